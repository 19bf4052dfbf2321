"""add_reduced_body: a reduced body as an object of an Exudyn mbs; LinearSubject: how a monitor sees it."""

from __future__ import annotations

import weakref
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from exudyn.itemInterface import NodeGenericODE2, ObjectGenericODE2

from ...basis.basis import Basis
from ...checks import check_array, check_type
from ...errors import AssumptionError, InputError
from ...linalg.blocked_products import consecutive
from ...linear.residual.input_signal import InputSignal
from ...linear.residual.residual import initial_coordinates
from ...linear.run.prepare import prepare
from ...model.body import ElasticBody
from ...model.matrix_checks import checked_inputs
from .detached import Detached
from .mbs_items import Items, node_coordinates, nodes_of, numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from ...linear.run.prepare import BoundOptions, Offline
    from ...model.outputs import Output


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """W^T M V q'' + W^T D V q' + W^T K V q = W^T B f(t): all that the simulation knows of the body.

    M, D, K : (n, n); G = W^T B : (n, p), or None without inputs.
    """

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    G: np.ndarray | None
    input_function: Callable | None

    def force(self, t: float) -> np.ndarray:
        """Return W^T B f(t), (n,); InputError if f(t) is not (p,), or a float where p = 1."""
        if self.G is None:
            return np.zeros(len(self.M))
        p = self.G.shape[1]
        try:
            u = self.input_function(t)
        except Exception as error:
            raise InputError(f"input_function({t:g}) raised {type(error).__name__}: {error}") from error
        u = check_array(f"input_function({t:g})", np.atleast_1d(u) if p == 1 else u, (p,))
        return self.G @ u

    def acceleration(self, t: float, q: np.ndarray, q_t: np.ndarray) -> np.ndarray:
        """Return the q'' that meets the equations of motion at (t, q, q')."""
        return np.linalg.solve(self.M, self.force(t) - self.D @ q_t - self.K @ q)

    def force_user_function(self) -> Callable | int:
        """Return the load as Exudyn calls it, several times a step: without checks (0: no load)."""
        G, f = self.G, self.input_function
        if G is None:
            return 0
        if G.shape[1] == 1:
            g = G[:, 0]
            return lambda mbs, t, itemNumber, q, q_t: g * f(t)
        return lambda mbs, t, itemNumber, q, q_t: G @ f(t)


@dataclass(frozen=True, eq=False)
class ReducedBody:
    """A linear reduced body in an mbs, as made by add_reduced_body.

    items holds the Exudyn numbers: 'nGenericODE2' (node) and 'oGenericODE2' (object).
    """

    mbs: Any = field(repr=False)
    body: ElasticBody = field(repr=False)
    basis: Basis = field(repr=False)
    inputs: np.ndarray | None = field(repr=False)
    input_function: Callable | None
    items: dict[str, Any]
    initial: tuple[np.ndarray, np.ndarray] | None = field(repr=False)
    model: ReducedModel = field(repr=False)


def add_reduced_body(
    mbs: Any,
    body: ElasticBody,
    basis: Basis,
    *,
    inputs: Any = None,
    input_function: Callable | None = None,
    initial: tuple[Any, Any] | None = None,
) -> ReducedBody:
    """Add NodeGenericODE2 and ObjectGenericODE2 with the reduced matrices W^T M V, W^T D V, W^T K V.

    Parameters
    ----------
    mbs : exudyn MainSystem
    body : ElasticBody
    basis : Basis
        W != V gives unsymmetric matrices, which every solver of Exudyn takes.
    inputs : ndarray, (N, p), optional
        Input matrix B.
    input_function : callable, optional
        f(t) -> (p,), or a float if p = 1. Exudyn calls it in every evaluation of the equations of motion.
        It must depend on t only: the bounds call it again, in blocks, after the steps were made.
    initial : ((N,), (N,)), optional
        Full-order initial displacement and velocity; their projections (31)-(32) start the reduced body.

    Returns
    -------
    ReducedBody
        To be passed to attach.

    Raises
    ------
    InputError
        Shapes; a basis that does not fit the body; only one of inputs and input_function.

    Notes
    -----
    Does not cover: loads and connectors added to the node by markers; attach refuses them.
    """
    if not hasattr(mbs, "AddObject"):
        raise InputError(f"mbs is a {type(mbs).__name__}; needed: the MainSystem that SC.AddSystem() returns")
    check_type("body", body, ElasticBody)
    check_type("basis", basis, Basis)
    B = _checked_inputs(body, inputs, input_function)
    model = _reduce(body, basis, B, input_function)
    model.force(0.0)  # a function that fails would stop Exudyn's solver without a word of what is wrong
    items = _add_items(mbs, model, _initial_state(body, basis, initial))
    return ReducedBody(mbs, body, basis, B, input_function, items, initial, model)


def _reduce(body: ElasticBody, basis: Basis, B: np.ndarray | None, input_function: Callable | None) -> ReducedModel:
    V, W = basis.restricted_to(body)
    return ReducedModel(
        M=W.T @ (body.M @ V),
        D=np.zeros((basis.n, basis.n)) if body.D is None else W.T @ (body.D @ V),
        K=W.T @ (body.K @ V),
        G=None if B is None else W.T @ body.space.loads(B),
        input_function=input_function,
    )


def _initial_state(body: ElasticBody, basis: Basis, initial: tuple | None) -> tuple[np.ndarray, np.ndarray]:
    if initial is None:
        return np.zeros(basis.n), np.zeros(basis.n)
    if not isinstance(initial, tuple | list) or len(initial) != 2:
        raise InputError(f"initial={initial!r}; needed: (q0, q0_t), each of shape ({body.N},)")
    return initial_coordinates(body, basis, *initial)


def _add_items(mbs: Any, model: ReducedModel, state: tuple) -> dict[str, Any]:
    n = len(model.M)
    node = mbs.AddNode(
        NodeGenericODE2(
            referenceCoordinates=[0.0] * n,
            initialCoordinates=list(state[0]),
            initialCoordinates_t=list(state[1]),
            numberOfODE2Coordinates=n,
        )
    )
    item = mbs.AddObject(
        ObjectGenericODE2(
            nodeNumbers=[node],
            massMatrix=model.M,
            dampingMatrix=model.D,
            stiffnessMatrix=model.K,
            forceUserFunction=model.force_user_function(),
        )
    )
    return {"nGenericODE2": node, "oGenericODE2": item}


def _checked_inputs(body: ElasticBody, inputs: Any, input_function: Callable | None) -> np.ndarray | None:
    if (inputs is None) != (input_function is None):
        missing = "inputs" if inputs is None else "input_function"
        raise InputError(f"{missing} is missing; pass both inputs=B and input_function=f, or neither")
    if inputs is None:
        return None
    if not callable(input_function):
        raise InputError(f"input_function={input_function!r}; needed: a function f(t) -> (p,) or a float if p = 1")
    return checked_inputs(inputs, body.N)


class KeptSignal(InputSignal):
    """An input function that a run goes on with: copies of it are called, which keep what they keep."""

    def __init__(self, flex: ReducedBody):
        super().__init__(flex.input_function, flex.model.G.shape[1])
        self._mbs, self._given = weakref.ref(flex.mbs), flex.input_function

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Let a copy be called."""
        detached = Detached(self._mbs(), [self._given])
        with detached.in_use(self._mbs()):
            self._f = detached.of(self._given)
            try:
                yield
            finally:
                self._f = self._given


class LinearSubject:
    """Its offline work is done when it is attached; the mbs is read for what it must not contain.

    body : the full body. is_live : whether bounds are needed while a solve goes on, where they are known.
    """

    def __init__(self, flex: ReducedBody, options: BoundOptions):
        self._node, self.item = (int(flex.items[key]) for key in ("nGenericODE2", "oGenericODE2"))
        self._model, self.body, self._basis = flex.model, flex.body, flex.basis  # not flex, which holds the mbs
        self._signal = None if flex.input_function is None else KeptSignal(flex)
        self._options = replace(options, inputs=flex.inputs, input_function=self._signal)
        self._offline = prepare(self.body, self._basis, self._options)
        self.columns, self.floor, self.is_live = slice(0, 0), 0.0, True

    @property
    def outputs(self) -> tuple[Output, ...]:
        """What is bounded."""
        return self._offline.outputs

    def modes(self, mbs: Any) -> tuple[np.ndarray, Any]:
        """Return V (N, n) and the full K (N, N)."""
        return self._basis.V, self.body.stiffness

    def add(self, outputs: Sequence[Output]) -> None:
        """Bound further outputs."""
        self._options = replace(self._options, outputs=[*self._options.outputs, *outputs])
        self._offline = prepare(self.body, self._basis, self._options)

    def read(self, mbs: Any, static: bool = False, why_not: str = "") -> Offline:
        """Find the body's coordinates in the mbs; AssumptionError if something beside its inputs acts on it."""
        _require_inputs_only(Items(mbs), self._node, self.item)
        self.columns = consecutive(node_coordinates(mbs, self._node))
        return self._offline

    def first(self, t: float, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray, **_: bool) -> tuple:
        """Return q, q_t, q_tt of a run's first sample, each (n,)."""
        # explicit solvers leave the initial accelerations unset until their first step is done
        model = self._model if self._signal is None else replace(self._model, input_function=self._signal.at)
        return q, q_t, model.acceleration(t, q, q_t)

    def sampled(self, t: np.ndarray, *states: np.ndarray) -> tuple:
        """Return q, q_t, q_tt of accepted steps, each (S, n)."""
        return states


def _require_inputs_only(items: Items, node: int, item: int) -> None:
    """Raise AssumptionError if a load, joint, connector or other object acts on the reduced body.

    The bound knows the load B f(t) and nothing else.
    """
    keys = ("bodyNumber", "objectNumber")
    on_it = {
        i
        for i, marker in enumerate(items.markers)
        if node in nodes_of(marker) or any(item in numbers(marker, key) for key in keys)
    }
    culprits = [f"load {i}" for i, load in enumerate(items.loads) if int(load["markerNumber"]) in on_it]
    culprits += [
        f"object {i}"
        for i, other in enumerate(items.objects)
        if i != item and (node in nodes_of(other) or on_it & numbers(other, "markerNumbers"))
    ]
    if culprits:
        raise AssumptionError(
            f"on the reduced body (object {item}) act beside its input_function: {', '.join(culprits)}; "
            "a bound covers prescribed loads only, so pass them as columns of inputs= to add_reduced_body"
        )
