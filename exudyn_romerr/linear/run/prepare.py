"""prepare: all that is done once before a run, ending in an Offline of small arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...basis.basis import Basis
from ...checks import check_array, check_choice, check_finite
from ...errors import AssumptionError, InputError
from ...linalg.blocked_products import row_norms
from ...model.body import ElasticBody
from ...model.matrix_checks import DOUBLE
from ...model.outputs import View
from ...progress import progress
from ...report.scope import COMPLETE, Scene
from ..estimators import ESTIMATORS
from ..estimators.bounds import Worst
from ..estimators.energy import StaticError
from ..estimators.round_off import RoundOff, of_input
from ..estimators.turning_frame import Turning
from ..residual.input_signal import InputSignal
from ..residual.interface_stiffening import static_errors
from ..residual.problem import BoundOptions, Problem
from ..residual.samples import Start
from .planning import make_plan

UNMOVED = 1e-9  # of the entries of an output: what rounding leaves of rows that reference conditions hold at zero
IN_A_TURNING_FRAME = ("fast", "convolution", "energy", "auxiliary")  # what Turning can add the turning to

CHUNK = 600  # rows solved for at once: their solutions are of full size

ALONE = Scene()  # of a body without a frame
TIMES = ("reconstructed", "sampled")


def prepare(
    body: ElasticBody,
    basis: Basis,
    options: BoundOptions,
    *,
    sampled_inputs: bool = False,
    samples_precision: float = DOUBLE,
    scene: Scene = ALONE,
) -> Offline:
    """Do the offline work of evaluate and attach.

    sampled_inputs: the inputs come as samples with the trajectory, input_function may be missing. samples_precision:
    relative spacing of the trajectory's numbers.

    Raises
    ------
    InputError, AssumptionError
    """
    check_choice("time", options.time, TIMES)
    names = _checked_estimators(options.estimators, body)
    problem = Problem(body, basis, options)
    _check_frame(problem, names, options.jumps, scene)
    if "auxiliary" in names:
        _ = problem.split  # first, for it takes most modes: none made twice
    signal = _made_signal(options.input_function, problem.B.shape[1], sampled_inputs)
    return Offline(problem, names, options, signal, samples_precision, scene)


class AtNodes(NamedTuple):
    """Of the error u - u_reduced at nodes: bound (nodes,) of its length; estimate (nodes, 3), None if not known."""

    bound: np.ndarray
    estimate: np.ndarray | None


class Offline:
    """What a run needs of the full model: small arrays; of full size only what is asked for on demand.

    estimators : name -> estimator that starts copies of itself. shown : of every output itself, its rows, and how it
    is seen from outside a moving frame. value_rows (R, n): C V. balance_rows (n, k): those of W^T R = rows z, for
    checks, and for wrenches that follow from it. jump_response (n, p): jump of qr'' per jump of u. mass_root (n, n):
    |V qr|_M = |mass_root qr|. static_errors: see linear/residual/interface_stiffening.py. rounding: of the
    computation; input_rounding: of the input, None if all of it has 16 digits; single: names of what has fewer.
    modes: number of auxiliary ones. initial: None, "equilibrium" or "state". notes: what the reader must know.
    """

    def __init__(
        self,
        problem: Problem,
        names: tuple[str, ...],
        options: BoundOptions,
        signal: InputSignal | None,
        samples_precision: float,
        scene: Scene,
    ):
        body, V, W, rows, initial = problem.body, problem.V, problem.W, problem.rows, options.initial
        self._problem, self.signal, self.samples_precision, self.scene = problem, signal, samples_precision, scene
        self.coordinates, self.outputs, self._options = problem.map.coordinates, problem.outputs, options
        self.views, blind = _without_sight(problem, scene)
        self.shown = [*zip(problem.outputs, problem.slices, self.views, strict=True)]
        self.estimators = {name: self._estimator(name, problem) for name in names}
        self.velocity_rows, self.value_rows = rows.velocity_rows, rows.C @ V
        self.balance_rows = problem.map.seen_by(W.T)
        self.jump_response = np.linalg.solve(W.T @ (body.M @ V), W.T @ problem.B)
        self.mass_root = np.linalg.qr(body.mass_factor.half_multiply(V), mode="r")
        self.static_errors = None if scene.stiff is None else static_errors(problem, scene.stiff)
        eps, self.single = of_input(problem, samples_precision)
        self.rounding = RoundOff(problem, dict.fromkeys(eps, DOUBLE) | {"outputs": np.full(len(rows.C), DOUBLE)})
        self.input_rounding = RoundOff(problem, eps) if self.single else None
        self.omega_1, self.jumps = float(body.modes(1).omega[0]), _checked_jumps(options.jumps, signal)
        self.initial = None if initial is None else "equilibrium" if isinstance(initial, str) else "state"
        self.time, self.total_mass, self.positions = options.time, body.total_mass, body.positions
        modes = problem.split.modes if "auxiliary" in names else None
        self.modes = 0 if modes is None else modes.omega.size
        self.notes = tuple(filter(None, [scene.note, modes and modes.ringing_note, blind]))
        self.plan = make_plan(problem, names, options, scene)

    @cached_property
    def from_static(self) -> Offline:
        """What a run from the end of a static solve needs."""
        options, sampled, problem = replace(self._options, initial="equilibrium"), self.signal is None, self._problem
        return prepare(problem.body, problem.basis, options, sampled_inputs=sampled, scene=self.scene)

    def _estimator(self, name: str, problem: Problem) -> Any:
        if name == "static":
            return StaticError(problem)
        estimator = ESTIMATORS[name](problem)
        return Turning(estimator, problem) if self.scene.turns else estimator

    @property
    def width(self) -> int:
        """Numbers at the control points of a step: coordinates of the residual, and auxiliary modes."""
        return (6 if self.time == "reconstructed" else 2) * (self.coordinates.k + self.modes)

    def measure(self, z: np.ndarray) -> np.ndarray:
        """Return the norm of R(z) that the sharpest estimator accumulates, by which knots are chosen."""
        if self.modes:
            return self._problem.split.norm_K(z)
        dual = self._problem.dual
        return (dual.norm_K if "energy" in self.estimators else dual.norm_M)(z)

    def static(self) -> StaticError:
        """Return the errors of a static solve, made when one begins."""
        return StaticError(self._problem)

    def nodes(self, worst: dict[str, Worst]) -> dict[str, AtNodes]:
        """Return what is known of the error at every node, at the worst instant of every estimator."""
        return node_bounds(self._problem, self._estimator, worst)

    def moved(self, q: np.ndarray) -> np.ndarray:
        """Return the displacements (nodes, 3) of the reduced body at q (n,)."""
        problem = self._problem
        return problem.body.expand(problem.V @ q)[_shown(problem)].reshape(-1, 3)

    def outputs_of(self, q: np.ndarray, q_t: np.ndarray) -> np.ndarray:
        """Return the output rows (S, R) of the reduced body at q, q_t (S, n)."""
        rows = self.value_rows.T
        return np.where(self.velocity_rows, q_t @ rows, q @ rows)

    def distance_of(self, skipped: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return |V dq|_M, |V dq'|_M (S,), and |outputs| (S, R) of dq, dq' (S, 2, n)."""
        dq, dq_t = skipped[:, 0], skipped[:, 1]
        position, velocity = (row_norms(x @ self.mass_root.T) for x in (dq, dq_t))
        return position, velocity, np.abs(self.outputs_of(dq, dq_t))

    def checked_inputs(self, t: np.ndarray, u: Any) -> np.ndarray:
        """Return inputs (S, p) at t (S,): those given, or of the input function; InputError if they do not fit."""
        if self.signal is not None and u is None:
            return self.signal(t)
        p = self.coordinates.p
        u = np.zeros((len(t), 0)) if u is None else np.asarray(u, dtype=float).reshape(len(t), -1)
        if u.shape != (len(t), p):
            raise InputError(f"u has shape {u.shape}; needed: ({len(t)}, {p})")
        check_finite("u", u)
        return u

    def own_motion(self, start: Start) -> float:
        """Size of what the full body starts with, and may ring in all along, see RoundOff."""
        if self.initial != "equilibrium":
            return self.rounding.of_start
        u = start.y0[None, self.coordinates.input_slot]  # of the loads before, which may be others
        return float(self.rounding.of_equilibrium(u)[0])


def _checked_estimators(estimators: Any, body: ElasticBody) -> tuple[str, ...]:
    """Names of the estimators; "auto": the sharp one if damping allows it, else two that neither is always best."""
    if isinstance(estimators, str) and estimators == "auto":
        return ("energy", "auxiliary") if body.proportional is not None else ("fast", "energy")
    return checked_names(estimators)


def checked_names(estimators: Any) -> tuple[str, ...]:
    """Return the names of estimators that were asked for one by one; InputError if one is unknown."""
    names = (estimators,) if isinstance(estimators, str) else estimators
    if not isinstance(names, tuple | list | set) or not names:
        raise InputError(f"estimators={estimators!r}; allowed: 'auto' or some of {tuple(ESTIMATORS)}")
    for name in names:
        check_choice("estimators", name, ESTIMATORS)
    return tuple(dict.fromkeys(names))


def _made_signal(f: Callable | InputSignal | None, p: int, sampled: bool) -> InputSignal | None:
    if isinstance(f, InputSignal):
        return f
    if f is not None and not p:
        raise InputError("input_function was given without inputs=B, the matrix it multiplies; pass both or neither")
    return None if sampled and f is None else InputSignal(f, p)


def _check_frame(problem: Problem, names: tuple[str, ...], jumps: Sequence[float], scene: Scene) -> None:
    for out in problem.outputs:
        if scene.pose is None and out.frame == "global":
            raise InputError(f"output {out.name!r} is in global axes; this body has no frame, leave frame='body'")
    if not scene.turns:
        return
    for name in names:
        if name not in IN_A_TURNING_FRAME:
            raise AssumptionError(f"estimator {name!r} needs a frame at rest; allowed here: {IN_A_TURNING_FRAME}")
    if len(jumps):
        raise AssumptionError("jumps= need a frame at rest; let the load grow over a few steps instead")


def _without_sight(problem: Problem, scene: Scene) -> tuple[list[View | None], str | None]:
    """Return the views, blind where no motion of the body in its frame moves an output, and a note about these.

    What such an output, on the interface that holds the frame, shows in global axes is the motion of the frame: exact
    where the scope is complete, else unknown.
    """
    views, names = list(problem.views), []
    for i, (out, part) in enumerate(zip(problem.outputs, problem.slices, strict=True)):
        if views[i] is None or scene.scope == COMPLETE:
            continue
        if np.max(np.abs(problem.rows.C[part])) <= UNMOVED * np.max(np.abs(out.resolve(problem.body))):
            views[i] = replace(views[i], blind=True)
            names += [repr(out.name)] if out.is_requested else []
    if not names:
        return views, None
    return views, (
        f"nothing is known of the error of {', '.join(names)}: the reference conditions hold the body there, so that "
        "the output shows the motion of the frame alone, which is taken as it is in this run (bound inf). Take an "
        "output in the body's frame, or one elsewhere on the body"
    )


def _checked_jumps(jumps: Sequence[float], signal: InputSignal | None) -> tuple[float, ...]:
    times = check_array("jumps", jumps, (None,))
    if times.size and (signal is None or not signal.p):
        raise InputError("jumps need input_function, which gives the input on both sides; pass it beside inputs")
    return tuple(sorted(times.tolist()))


def node_bounds(problem: Problem, make: Any, worst: dict[str, Worst]) -> dict[str, AtNodes]:
    """Return what every estimator knows of the error at every node.

    Parameters
    ----------
    make : callable
        (name, problem) -> estimator.
    worst : dict
        Estimator -> its worst instant.
    """
    shown = _shown(problem)
    parts: dict[str, list] = {name: [] for name in worst}
    for first in progress(range(0, shown.size, CHUNK), "bounds at nodes"):
        coordinates = shown[first : first + CHUNK]
        rows = np.zeros((len(coordinates), problem.body.N))
        rows[np.arange(len(coordinates)), coordinates] = 1.0
        seen = problem.with_displacements(problem.body.space.rows(rows))
        for name, at in worst.items():
            found = make(name, seen).bounds_at(at.instant)
            parts[name].append((found.outputs[0] + at.widened * seen.rows.C_M, found.correction))
    return {name: _joined(chunks) for name, chunks in parts.items()}


def _shown(problem: Problem) -> np.ndarray:
    """Numbers (3 nodes,) of the coordinates that are displacements of nodes."""
    body = problem.body
    return (body.dofs_per_node * np.arange(len(body.positions))[:, None] + np.arange(3)).ravel()


def _joined(chunks: list) -> AtNodes:
    bounds, known = zip(*chunks, strict=True)
    estimate = None if known[0] is None else np.hstack(known).reshape(-1, 3)
    return AtNodes(np.linalg.norm(np.concatenate(bounds).reshape(-1, 3), axis=1), estimate)
