"""What is told of a solve that has ended: rows of the run in, errors of what sensors and outputs show out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.linalg as la

from ...errors import AssumptionError, RunError
from ...mechanism.mechanism import Mechanism, rests, unbalanced_share
from ...mechanism.readings import Readings
from ...mechanism.rows import Rows
from ...mechanism.scheme import strays_of_first_order
from ...mechanism_bounds.bounded_estimates import with_bounds
from ...mechanism_bounds.bounds import Bounds
from ...mechanism_errors.end_state import EndState
from ...mechanism_errors.estimates import estimates
from ...mechanism_errors.march import is_at_rest
from ...mechanism_errors.modes import GROUPS, THIRDS
from ...mode_selection.modal_content import Content, FurtherModes, ModalContent, Shares
from ...mode_selection.without_modes import Shown, WithoutModes
from ...report.causes import ESTIMATE_PARTS, REDUCTION
from ...report.data import extents
from ...report.report import OutputReport
from ...report.scope import COUPLED, Doubt, Reason, beside_steps
from ..access.detached import user_functions
from ..access.equations import state_set
from ..access.mbs_items import node_coordinates
from ..floating.built_in import as_built_in
from ..floating.reference_search import VECTORS
from .covered import require_covered, unknowns_of
from .hollow_copy import HollowCopy
from .pre_step import Parameters, detached_with
from .sensors import Sensors, ShownSensor
from .told import ESTIMATOR, Told
from .vectors import Enriched, enriched, in_shapes_of

if TYPE_CHECKING:
    from ...mechanism.scheme import Scheme
    from ...mechanism.unknowns import Unknowns
    from ...mechanism_errors.half_widths import CauseEstimate
    from ...model.outputs import Output
    from ..floating.floating_body import FloatingBody

# vectors slower than so many times the angular velocity of the frame are kept: 100 changed 0.5 % at most
TURNS = 20.0
SAME = 1e-4  # of the largest force: what may be left of the equations of motion at stored rows
PART_OF = {"modes": "basis", "interfaces": "interfaces", "step": "time step"}
UNKNOWN_ACTS = (
    "at stored instants the equations are off by {:.0e} of the largest force: something acts that is not a function "
    "of time and state (a controller in PreStep, parameters that the script changes)"
)
BEGUN_ANEW = (
    "in {} steps, first at t = {:.6g} s, coordinates of first order (ODE1) go on from other rates than those before, "
    "as Exudyn does where Newton fails and a step is begun anew: newton.useModifiedNewton = False cures that"
)
# errors of modes are then as large as what they show, and with one eigenmode bounds were up to 14 % below them
MOVED_INTERFACES = "modes that cannot move each interface by itself: errors are too large for bounds to first order"
RESTS = "nothing moves: what coordinates show is rounding"
REMEMBERS = "a user function keeps something from call to call"
PRE_STEP_REMEMBERS = (
    "the PreStep function keeps something from call to call (an integrator, a filter, a sampling of its own, noise): "
    "called again in the same states it acts otherwise"
)
TRIED, CONSECUTIVE = 64, 8  # rows in which it is called twice, and how many of them are the first of the run
HOLDS = "a user function keeps what cannot be copied, so it is not called away from the run: {}"
BOUNDS = "bounds of what sensors show in frames of bodies"
NOT_RESOLVED = "modes and vectors leave so much of the equations that bounds are many times as large as the error"


class Asked(NamedTuple):
    """What a solve is told of.

    flexes : all reduced bodies of the mbs. outputs : of each, beside sensors. scheme : of the solver. is_static :
    whether rows are load steps, of which the last counts. sensors : their numbers; None: all. vectors : number of
    static ones of a body, beside those that deform rigid interfaces. holds_rates : whether the solver holds rates of
    constraints in place of what they keep (index 2). begun : what a PreStep function may set, before the first step.
    further : of each body, modes that it might have; (): not asked.
    """

    flexes: Sequence[FloatingBody]
    outputs: Sequence[Sequence[Output]]
    scheme: Scheme
    is_static: bool
    sensors: Sequence[int] | None = None
    vectors: int = VECTORS
    holds_rates: bool = False
    begun: Parameters | None = None
    further: Sequence[FurtherModes | None] = ()


class Ended(NamedTuple):
    """A run that has ended: its last q and q_t; bodies and errors there, None where these are not known."""

    q: np.ndarray
    v: np.ndarray
    bodies: Sequence[Enriched] = ()
    errors: EndState | None = None
    is_static: bool = False


def told_solve(
    mbs: Any, asked: Asked, rows: Rows, before: Ended | None = None, planned_end: float | None = None
) -> tuple[Told, Ended]:
    """Return what is known of the errors in a run that has ended, and with what it has ended.

    Parameters
    ----------
    rows : of the run
    before : the run before; what it has left wrong is in this one if this goes on from there
    planned_end : s, where it was to go to, if it ended before; None: it did not

    Raises
    ------
    AssumptionError
        Something that the linearised mechanism does not cover.
    RunError
        No step was made.
    """
    require_covered(mbs, asked.is_static)
    if len(rows) < 2 and not asked.is_static:
        raise RunError("no step was made: only the first instant of the run is known")
    n = mbs.systemData.ODE2Size()  # behind them are coordinates of first order
    anew = [] if asked.is_static else strays_of_first_order(rows.t, rows.v[:, n:], rows.a[:, n:])
    if len(anew):
        raise AssumptionError(BEGUN_ANEW.format(len(anew), rows.t[anew[0]]))
    flexes = asked.flexes
    mbs = as_built_in(mbs, flexes)
    if asked.is_static:  # which holds coordinates of first order
        held = rows.v[-1]
        rows = replace(rows, q=rows.q[:, :n], v=rows.v[:, :n], a=rows.a[:, :n])
    shown = rows[-1:] if asked.is_static else rows
    # with M a - f + G^T lam = 0: Exudyn's static solver has f + G^T lam = 0
    rows = replace(shown, multipliers=-shown.multipliers) if asked.is_static else shown
    of_loads, of_objects = user_functions(mbs)
    detached, pre_step = detached_with(mbs, [*of_loads, *of_objects], rows, asked.begun or {})
    if detached.lost:
        raise AssumptionError(HOLDS.format(detached.lost))
    t, *state = shown.row(-1)  # of the last accepted step: a step that failed may have left the mbs in another one
    # an error that grows beyond all numbers is told as not known; numpy says nothing of it in the user's run
    with detached.in_use(mbs), state_set(mbs.systemData, t, state), np.errstate(all="ignore"):
        bodies = [
            enriched(mbs, flex, asked.vectors, TURNS * w, detached)
            for flex, w in zip(flexes, _speeds(mbs, flexes, rows), strict=True)
        ]
        unknowns = unknowns_of(mbs, [one.body for one in bodies], rows)
        sensors = Sensors(mbs, bodies, unknowns, detached, asked.outputs, asked.sensors, pre_step)
        copy = HollowCopy(mbs, bodies, unknowns, detached, pre_step=pre_step)
        if pre_step is not None and _remembers(copy, rows):
            raise AssumptionError(PRE_STEP_REMEMBERS)
        rows = copy.with_first_rates(rows)
        readings = Readings(copy, rows)
        share = unbalanced_share(unknowns, rows, copy, readings)
        if not share < SAME:
            why = REMEMBERS if detached.has_changed() else UNKNOWN_ACTS.format(share)
            raise AssumptionError(RESTS if rests(unknowns, rows) else why)
        of = Mechanism(
            *(unknowns, rows, asked.scheme, copy, readings, sensors.outputs(shown)),
            projectors=[one.projectors for one in bodies],
            is_rigid=is_rigid(bodies),
            has_user_functions=bool(of_loads or of_objects) or pre_step is not None,
            has_forces_by_users=bool(of_objects),
            sign=-1.0 if asked.is_static else 1.0,
            sensors=[one.rows for one in sensors.shown],
        )
        errors, doubts = _begun_with(None if asked.is_static else before, rows, bodies, unknowns)
        why_not = _why_unbounded(asked, errors is not None or doubts, readings.splined.is_sampled, unknowns.n_1)
        bounds, why_not = _bounds(of, sensors, bodies, why_not)
        content = ModalContent(of, _shares(asked.further, bodies)) if any(asked.further) else None
        watches = bounds and bounds.take, content and content.take
        by_cause, end, of_each = estimates(of, asked.is_static, errors, *watches)
        bound = None
        if bounds:
            bound, why_not = _bounded(bounds, by_cause)
        at_once = () if asked.is_static else max((_beside_steps(one, rows) for one in bodies), key=len)
        outputs = [replace(out, beside_steps=at_once) for out in _outputs(sensors, shown, by_cause, bound, doubts)]
        vectors = [one.shapes[:, one.body.n :] for one in bodies]
        shown_of = [Shown(x.name, x.unit, x.own, out.extents) for x, out in zip(sensors.shown, outputs, strict=True)]
        modes = WithoutModes(of, shown_of, [(V, x.squares) for V, x in zip(vectors, of_each, strict=True)])
        owners = [one.body for one in sensors.shown]
        of_mbs, *of_bodies = (
            [out for out, b in zip(outputs, owners, strict=True) if b == which]
            for which in (None, *range(len(bodies)))
        )
        left_out = [*sensors.left_out, *([(BOUNDS, why_not)] if why_not else [])]
        of_modes = content.content(by_cause) if content else None
        nodes = [one.at_nodes(ESTIMATOR, x, rows) for one, x in zip(bodies, of_each, strict=True)]
        contents = {} if of_modes is None else {one.name: _shown_of(of_modes, one.own) for one in sensors.shown}
        told = Told(
            shown.t, of_mbs, of_bodies, left_out, doubts, asked.is_static, planned_end, modes, contents, nodes
        )
        return told, Ended(rows.q[-1], held if asked.is_static else rows.v[-1], bodies, end, asked.is_static)


def _shares(further: Sequence[FurtherModes | None], bodies: Sequence[Enriched]) -> list[Shares | None]:
    """What of the forces on each body modes that may vary answer."""
    return [
        None if more is None else Shares(more, one.shapes, one.body.n, one.known.flex.stiffness, one.projectors)
        for more, one in zip(further, bodies, strict=True)
    ]


def _shown_of(of: Content, own: np.ndarray) -> Content:
    """What a sensor with its own rows shows of it."""
    return Content(of.known[:, own], {c: x[..., own] for c, x in of.parts.items()}, of.step[:, own], of.rest[:, own])


def _remembers(copy: HollowCopy, rows: Rows) -> bool:
    """Whether a PreStep function does something else when it is called backwards through rows than forwards."""
    at = np.unique([*range(min(len(rows), CONSECUTIVE)), *np.linspace(0, len(rows) - 1, TRIED).astype(int)])
    back, forth = (copy.unbalanced(rows[order]) for order in (at[::-1], at))
    return not np.array_equal(forth, back[::-1])


def _why_unbounded(asked: Asked, goes_on: Any, is_sampled: bool, of_first_order: int) -> str:
    """Why a run as a whole has no bounds; empty: nothing speaks against them."""
    if is_sampled:
        return "a PreStep function, which acts by the begin of each step"
    if of_first_order:
        return "coordinates of first order (ODE1), whose equations need not lose energy"
    if asked.is_static or goes_on:
        return "a static solve, or a run that goes on from another that moves"
    if any(flex.modal_damping is not None for flex in asked.flexes):
        return "damping by ratios of modes"
    if asked.holds_rates:
        return "joints held by their rates (useIndex2Constraints): they drift, and otherwise with all modes"
    return ""


def _bounds(of: Mechanism, sensors: Sensors, bodies: Sequence[Enriched], why_not: str) -> tuple[Bounds | None, str]:
    """Bounds of what sensors show in frames, or why there are none; empty where no sensor shows such a thing."""
    if why_not or not sensors.in_frames:
        return None, why_not if sensors.in_frames else ""
    if not all(one.leaves_interfaces for one in bodies):
        return None, MOVED_INTERFACES
    bounds = Bounds(of, (one.residual_norm() for one in bodies), sensors.in_frames)
    return (None, bounds.why_not) if bounds.why_not else (bounds, "")


def _bounded(bounds: Bounds, by_cause: dict[str, CauseEstimate]) -> tuple[np.ndarray | None, str]:
    """Bounds (T, R) of errors by modes and interfaces, which are made what is proved of them; or None, and why."""
    proved = bounds.proved()
    if proved is None:
        return None, bounds.why_not
    bound = with_bounds(by_cause, proved)
    return bound, NOT_RESOLVED if bound is None else ""


def _beside_steps(one: Enriched, rows: Rows) -> tuple[str, ...]:
    """What helps beside shorter steps where a body rings from its start on."""
    body, n = one.body, one.body.n
    M, K = body.M[:n, :n], body.K[:n, :n]
    sizes = [
        np.sqrt(np.einsum("ti,ij,tj->t", x, M, x)) for x in (rows.q[:, body.place.modal], rows.a[:, body.place.modal])
    ]
    return beside_steps(np.stack(sizes, axis=1), float(np.sqrt(la.eigvalsh(K, M)[0])))


def _begun_with(
    before: Ended | None, rows: Rows, bodies: Sequence[Enriched], unknowns: Unknowns
) -> tuple[EndState | None, tuple[Doubt, ...]]:
    """What a run begins with that goes on from another, and what speaks against it; None: it goes on from none."""
    n = unknowns.n_q - unknowns.n_1
    goes_on = before and all(np.array_equal(x[:n], y[0, :n]) for x, y in ((before.q, rows.q), (before.v, rows.v)))
    if not goes_on:
        return None, ()
    turns = [in_shapes_of(one, was) for one, was in zip(bodies, before.bodies, strict=False)]
    parts = len(GROUPS) if is_rigid(bodies) else THIRDS
    is_known = before.errors is not None and before.errors.parts.x.shape[2] == parts
    if not is_known or len(turns) < len(bodies) or any(turn is None for turn in turns):
        return None, (Reason.GOES_ON.doubt(),)
    if before.is_static and is_at_rest(rows) and not unknowns.n_1:
        return None, ()  # the full model rests, too: its equilibrium is found anew, and nothing else is carried on
    if unknowns.n_1 and not before.is_static:
        return None, (Reason.GOES_ON.doubt(),)  # what it has left wrong of coordinates of first order has other units
    # pressures that a script has set to hold what a static solve has found: with all modes it sets others
    still = is_at_rest(replace(rows, v=rows.v[:, :n]))
    balancing = unknowns.first_order.start + np.flatnonzero(still & (before.v[n:] != rows.v[0, n:]))
    return before.errors.of(unknowns, turns, balancing), ()


def is_rigid(bodies: Sequence[Enriched]) -> bool:
    """Whether modes make interfaces of a body rigid."""
    return any(one.known.stiff is not None for one in bodies)


def _speeds(mbs: Any, flexes: Sequence[FloatingBody], rows: Rows) -> list[float]:
    """Largest angular velocity of each frame, rad/s."""
    nodes = (int(mbs.GetObject(flex.number)["nodeNumbers"][0]) for flex in flexes)
    turns = (rows.v[:, node_coordinates(mbs, node)[3:]] for node in nodes)
    return [float(2 * np.linalg.norm(x, axis=1).max()) for x in turns]


def _outputs(
    sensors: Sensors,
    rows: Rows,
    by_cause: dict[str, CauseEstimate],
    bound: np.ndarray | None,
    doubts: tuple[Doubt, ...],
) -> list[OutputReport]:
    values = sensors.values(rows)
    bound = np.full(values.shape, np.inf) if bound is None else bound
    return [_output(one, values, by_cause, bound, doubts) for one in sensors.shown]


def _output(
    sensor: ShownSensor,
    value: np.ndarray,
    by_cause: dict[str, CauseEstimate],
    bound: np.ndarray,
    doubts: tuple[Doubt, ...],
) -> OutputReport:
    own = sensor.own
    value, bound = value[:, own], bound[:, own]
    none = np.broadcast_to(0.0, value.shape)  # takes no memory
    parts = dict.fromkeys(ESTIMATE_PARTS, none) | {
        PART_OF[cause]: x.over_time[:, own] for cause, x in by_cause.items()
    }
    checks: dict[str, np.ndarray] = {}
    shown = extents(value, sensor.of == "position").max(initial=0.0)
    for cause, x in by_cause.items():
        # no linear equation tells an error as large as what is shown
        is_lost = not np.abs(parts[PART_OF[cause]]).max(initial=0.0) <= shown
        for check, half in x.half_widths.items():
            width = np.full(value.shape, np.inf) if is_lost else np.broadcast_to(half[own], value.shape)
            checks[check] = checks.get(check, 0.0) + width
    known, is_bounded = sum(parts[c] for c in REDUCTION), bool(np.isfinite(bound).all())
    return OutputReport(
        name=sensor.name,
        unit=sensor.unit,
        quantity=sensor.quantity,
        of=sensor.of,
        value=value,
        round_off=np.finfo(float).eps * np.abs(value),
        bound={ESTIMATOR: bound, "best": bound},
        reduction_bound={},
        corrected=value + known if is_bounded else None,
        corrected_bound=np.maximum(bound - np.abs(known), 0.0) if is_bounded else None,
        causes=_causes(bound, parts) if is_bounded else {},
        estimate=sum(parts.values()),
        estimate_parts=parts,
        uncertainty=sum(checks.values()),
        uncertainty_parts=checks,
        estimate_scope=COUPLED,
        labels=sensor.labels,
        uncertified=doubts,
    )


def _causes(bound: np.ndarray, parts: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Shares of a bound (T, r) of what modes and rigid interfaces make, as their estimates have them."""
    modes, stiff = (np.abs(parts[cause]).max(axis=0, initial=0.0) for cause in REDUCTION)
    share = np.divide(stiff, modes + stiff, out=np.zeros_like(stiff), where=stiff > 0)
    none = np.broadcast_to(0.0, bound.shape)
    return dict.fromkeys(ESTIMATE_PARTS, none) | {"basis": (1 - share) * bound, "interfaces": share * bound}
