"""Bodies whose mass and forces come from user functions, seen as the built-in ones with the same equations.

AddObjectFFRFreducedOrderWithUserFunctions makes an object without inertia of its own: functions of the script return
all forces of it, and its weight. They are compared with the built-in object in states of our own, on copies that hold
this body and nothing else. What they do along a run is checked with all the rest, by the run's balance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import exudyn as exu
import numpy as np

from ...basis.shape_sums import ShapeSums
from ...errors import AssumptionError
from ..access.copied_mbs import bare, object_terms
from ..access.detached import Detached, functions_of
from ..access.equations import Equations, set_state
from ..access.mbs_items import QUATERNIONS, Items, dense, node_coordinates
from ..access.solvers import raised, threads
from .floating_body import object_of

if TYPE_CHECKING:
    from .floating_body import FloatingBody

FUNCTIONS = ("massMatrixUserFunction", "forceUserFunction")
TERMS = ("mPsiTildePsi", "mPsiTildePsiTilde", "mPhitTPsi", "mPhitTPsiTilde", "mXRefTildePsi", "mXRefTildePsiTilde")
# of the largest in states of a kind: Exudyn's functions and its object agree to 1e-15, matrices are rounded at 1e-13;
# 1 % of a term is more wherever the term is 1e-7 of all
SAME = 1e-9
ROUNDED = 1e2 * np.finfo(float).eps  # of the largest in all states: nothing
KINDS, COUNT = ((0, 0), (1, 0), (0, 1), (1, 1)), 3  # whether states are deformed, whether they move; states of a kind
BENT, TURNED = 0.1, 0.3  # of the body's size, rad: how far they are from the reference
NOT_CALLED = "user functions of body {} for its mass and forces cannot be called away from the run: {}"


def as_built_in(mbs: Any, flexes: Sequence[FloatingBody]) -> Any:
    """Return the mbs, to be read only: bodies that have user functions are seen as built-in ones with a weight.

    Raises
    ------
    AssumptionError
        Functions that return something else than the built-in object has, or that cannot be called.
    """
    found = {flex.number: built_in(mbs, flex) for flex in flexes if has_functions(object_of(mbs, flex))}
    return _seen(mbs, found) if found else mbs


def has_functions(item: dict[str, Any]) -> bool:
    """Return whether mass or forces of an object come from user functions."""
    return any(item.get(name) for name in FUNCTIONS)


def built_in(mbs: Any, flex: FloatingBody) -> tuple[dict[str, Any], np.ndarray]:
    """Return the object without user functions that has the same equations, and the gravity (3,) on its mass.

    Raises
    ------
    AssumptionError
        There is none, see as_built_in.
    """
    item = mbs.GetObject(flex.number)
    own, detached = _built_in(item, flex), Detached(mbs, functions_of(item))
    if detached.lost:
        raise AssumptionError(NOT_CALLED.format(flex.number, detached.lost))
    frame = mbs.GetNode(int(item["nodeNumbers"][0]))
    states, scales = _states(frame, own, flex, mbs.systemData.GetTime())
    with detached.in_use():
        try:
            given = _Alone(mbs, flex.number, item, detached).values(states, scales)
        except Exception as error:  # whatever a function of a script raises
            raise AssumptionError(NOT_CALLED.format(flex.number, raised(error))) from error
    gravity = given.force[0, :3] / scales[:3] / own["mass"]  # in the first state nothing else moves the frame
    known = _Alone(mbs, flex.number, own, detached, gravity).values(states, scales)
    for name, x, y in zip(("masses", "forces"), given, known, strict=True):
        off, size = (np.abs(z).reshape(len(KINDS), -1).max(axis=1) for z in (x - y, y))
        if not np.all(off <= SAME * size + ROUNDED * size.max()):
            largest = np.max(off / np.maximum(size, ROUNDED * size.max()))
            raise AssumptionError(
                f"user functions of body {flex.number} have other equations than ObjectFFRFreducedOrder, {name} "
                f"differ by {largest:.1e} of the largest: romerr verify measures it"
            )
    return own, np.where(
        np.abs(gravity) * own["mass"] * scales[0] > ROUNDED * np.abs(known.force).max(), gravity, 0.0
    )


def _built_in(item: dict[str, Any], flex: FloatingBody) -> dict[str, Any]:
    """What a built-in object has with the modes and reduced matrices of this one."""
    V, x, mass = np.asarray(item["modeBasis"], dtype=float), flex.positions, flex.mass[::3, ::3]
    made = object_terms(V, ShapeSums.of(flex.mass, flex.stiffness, x, V))
    total, second = float(mass.sum()), x.T @ (mass @ x)
    middle = np.asarray(mass.sum(axis=0)).ravel() @ x / total
    return {
        **item,
        **{name: made[name] for name in TERMS},
        **dict.fromkeys(FUNCTIONS, 0),
        "computeFFRFterms": True,
        "mass": total,
        "inertia": np.trace(second) * np.eye(3) - second,
        "centerOfMass": middle,
        "objectIsInitialized": False,  # what follows from these is computed when it is assembled
    }


def _states(frame: dict[str, Any], item: dict[str, Any], flex: FloatingBody, now: float) -> tuple[list, np.ndarray]:
    """States (t, q, v) of each kind in turn, and what is much of each coordinate, by which forces do alike work.

    They move as fast as the stiffest mode rings: inertia is as large as elasticity then.
    """
    n, rng = np.shape(item["modeBasis"])[1], np.random.default_rng(1)
    M, K = (np.diag(dense(item[f"{name}MatrixReduced"], n)) for name in ("mass", "stiffness"))
    size, squares = np.ptp(flex.positions, axis=0).max(), np.divide(K, M, out=np.zeros(n), where=M > 0)
    at = np.array(frame["referenceCoordinates"], float)[3:]
    bent = BENT * size / np.abs(item["modeBasis"]).max(axis=0)
    scales, states = np.concatenate([[size] * 3, TURNED * np.ones(len(at)), bent]), []
    modal = slice(3 + len(at), None)
    for is_bent, moves in np.repeat(KINDS, COUNT, axis=0):
        q, v = rng.uniform(-1.0, 1.0, (2, len(scales))) * scales
        if frame["nodeType"] == QUATERNIONS:
            p = (at + q[3:7]) / np.linalg.norm(at + q[3:7])
            q[3:7], v[3:7] = p - at, v[3:7] - p * (p @ v[3:7])
        q[modal] *= is_bent
        states.append((rng.uniform() * now, q, moves * np.sqrt(np.abs(squares).max()) * v))
    return states, scales


class _Values(NamedTuple):
    """Masses (S, k, k) and forces (S, k) in states, times what is much of coordinates."""

    mass: np.ndarray
    force: np.ndarray


class _Alone:
    """A body of an mbs, with the numbers that its nodes and its object have there, and nothing else."""

    def __init__(
        self, mbs: Any, number: int, item: dict[str, Any], detached: Detached, gravity: np.ndarray | None = None
    ):
        self._container = exu.SystemContainer()
        self.mbs = to = self._container.AddSystem()
        to.variables, to.sys = detached.spaces
        for node in Items(mbs).nodes:
            to.AddNode(bare(node, detached))
        for _ in range(number):
            to.AddObject({"objectType": "Ground"})
        to.AddObject(bare(item, detached))
        if gravity is not None:
            add_weight(to, number, gravity)
        to.Assemble()
        self._equations = Equations(to, threads(mbs))
        self._own = np.concatenate([node_coordinates(to, int(node)) for node in item["nodeNumbers"]])

    def values(self, states: Sequence[tuple], scales: np.ndarray) -> _Values:
        """Return masses and forces of the body in states (t, q, v) of its coordinates."""
        of, own, found = self.mbs.systemData, self._own, []
        for t, *state in states:
            wide = np.zeros((3, self._equations.size))
            wide[:2, own] = state
            set_state(of, t, (*wide, np.zeros(len(of.GetAECoordinates()))))
            mass = self._equations.mass(self.mbs)[np.ix_(own, own)]
            found.append((mass * scales * scales[:, None], self._equations.forces(self.mbs)[own] * scales))
        return _Values(*map(np.array, zip(*found, strict=True)))


def add_weight(mbs: Any, number: int, gravity: np.ndarray) -> None:
    """Let gravity (3,) act on the mass of a body."""
    mbs.AddLoad(_weight(number, int(mbs.AddMarker(_on_mass(number))), gravity))


def _on_mass(number: int) -> dict[str, Any]:
    return {"markerType": "BodyMass", "bodyNumber": number, "name": f"mass of object {number}"}


def _weight(number: int, marker: int, gravity: np.ndarray) -> dict[str, Any]:
    of = {"loadVector": [*map(float, gravity)], "loadVectorUserFunction": 0, "name": f"weight of object {number}"}
    return {"loadType": "MassProportional", "markerNumber": marker, **of}


def _seen(mbs: Any, found: dict[int, tuple[dict[str, Any], np.ndarray]]) -> Any:
    """An mbs of which some objects are others, by number, with a marker and a load more for the gravity of each."""
    system = mbs.systemData
    markers, loads = system.NumberOfMarkers(), system.NumberOfLoads()
    objects = {number: item for number, (item, _) in found.items()}
    on_mass = {markers + i: _on_mass(number) for i, number in enumerate(found)}
    weights = {
        loads + i: _weight(number, markers + i, gravity) for i, (number, (_, gravity)) in enumerate(found.items())
    }
    return _Seen(
        mbs,
        systemData=_Seen(
            system,
            NumberOfMarkers=lambda: markers + len(found),
            NumberOfLoads=lambda: loads + len(found),
        ),
        GetObject=_or(objects, mbs.GetObject),
        GetMarker=_or(on_mass, mbs.GetMarker),
        GetLoad=_or(weights, mbs.GetLoad),
    )


def _or(items: dict[int, dict[str, Any]], call: Callable) -> Callable:
    """A function of the number of an item; call : of those that are not among items."""
    return lambda number: dict(items[int(number)]) if int(number) in items else call(number)


class _Seen:
    """Something of Exudyn of which some functions are others."""

    def __init__(self, of: Any, **others: Any):
        vars(self).update(others, _of=of)

    def __getattr__(self, name: str) -> Any:
        """Return what it has."""
        return getattr(self._of, name)

    def __setattr__(self, name: str, value: Any) -> None:
        """Set it there: copies of variables, while functions are called."""
        setattr(self._of, name, value)
