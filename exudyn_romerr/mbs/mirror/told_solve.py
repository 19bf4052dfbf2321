"""What is told of a solve that has ended: rows of the run in, a report of all its sensors out."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import AssumptionError, RunError
from ...mechanism.mechanism import Mechanism, unbalanced_share
from ...mechanism.readings import Readings
from ...mechanism.samples import Rows
from ...mechanism_bounds.bounds import Bounds
from ...mechanism_bounds.proved_widths import with_proved
from ...mechanism_errors.end_state import EndState
from ...mechanism_errors.estimates import estimates
from ...mechanism_errors.modes import OF_MODES, PARTS
from ...report.data import Plan, extents
from ...report.formats.provenance import made_here
from ...report.mechanism_report import MechanismReport, OfBodies
from ...report.report import OutputReport
from ...report.scope import COUPLED, Doubt, Reason
from ..access.load_functions import user_functions
from ..access.state_guard import state_set
from ..memory.user_memory import memory_kept
from .hollow_copy import HollowCopy
from .layout import require_covered, unknowns_of
from .sensors import Sensors, ShownSensor
from .vectors import Enriched, enriched, in_shapes_of

if TYPE_CHECKING:
    from ...mechanism.unknowns import Unknowns
    from ...mechanism_errors.half_widths import CauseEstimate
    from ...trajectory.scheme import Scheme
    from ..floating.floating_body import FloatingBody

VECTORS = 26  # static ones of a body, beside those that deform rigid interfaces
TURNS = 100.0  # vectors slower than so many times the frame's angular velocity are kept beside the modes
SAME = 1e-4  # of the largest force: what may be left of the equations of motion at stored rows
PART_OF = {"modes": "basis", "interfaces": "interfaces", "step": "time step"}
UNKNOWN_ACTS = (
    "at stored instants the equations are off by {:.0e} of the largest force: something acts that is not a function "
    "of time and state (a controller in PreStep, parameters that the script changes)"
)
REMEMBERS = "a user function keeps something from call to call"
HOLDS = "a user function can reach what no call away from the run could put back: {}"
BOUNDS = "bounds of what sensors show in frames of bodies"
GOES_ON = "a static solve, or a run that goes on from another"
NOT_RESOLVED = "modes and vectors leave as much of the equations as the error itself is worth"
BY_RATIOS = "damping by ratios of modes"
ESTIMATOR = "auxiliary"  # of the report: vectors beside the modes that react with the mechanism
OF_ESTIMATE = "linearised mechanism: all bodies, joints, springs and loads of this run, to first order"


class Asked(NamedTuple):
    """What a solve is told of.

    flexes : all reduced bodies of the mbs. chosen : of each (name, nodes, weights) that are shown beside sensors.
    scheme : of the solver. is_static : whether rows are load steps, of which the last counts.
    """

    flexes: Sequence[FloatingBody]
    chosen: Sequence[Sequence[tuple[str, Sequence[int], Sequence[float] | None]]]
    scheme: Scheme
    is_static: bool


class Ended(NamedTuple):
    """A run that has ended: its last q and q_t; bodies and errors there, None where these are not known."""

    q: np.ndarray
    v: np.ndarray
    bodies: Sequence[Enriched] = ()
    errors: EndState | None = None


def told_solve(
    mbs: Any, asked: Asked, rows: Rows, before: Ended | None = None, planned_end: float | None = None
) -> tuple[MechanismReport, Ended]:
    """Return what is known of the error of all sensors of an mbs in a run that has ended, and with what it has ended.

    Parameters
    ----------
    rows : of the run
    before : the run before; what it has left wrong is in this one if this goes on from there
    planned_end : s, where it was to go to, if it ended before; None: it did not

    Raises
    ------
    AssumptionError
        Something that the linearised mechanism does not cover.
    """
    require_covered(mbs)
    if len(rows) < 2 and not asked.is_static:
        raise RunError("no step was made: only the first instant of the run is known")
    flexes = asked.flexes
    shown = rows[-1:] if asked.is_static else rows
    rows = _as_equations_have_it(shown, asked.is_static)
    functions = user_functions(mbs)
    with memory_kept(mbs, functions) as memory, _in_last_state(mbs, shown):
        if memory.lost:
            raise AssumptionError(HOLDS.format(memory.lost))
        bodies = [
            enriched(mbs, flex, VECTORS, TURNS * w)
            for flex, w in zip(flexes, _speeds(mbs, flexes, rows), strict=True)
        ]
        unknowns = unknowns_of(mbs, [one.body for one in bodies])
        sensors = Sensors(mbs, bodies, unknowns)
        for b, of_body in enumerate(asked.chosen):
            for name, nodes, weights in of_body:
                sensors.add_nodes(name, b, "DisplacementLocal", nodes, weights)
        copy = HollowCopy(mbs, bodies, unknowns)
        readings = Readings(copy, rows)
        share = unbalanced_share(unknowns, rows, copy, readings)
        if not share < SAME:
            raise AssumptionError(REMEMBERS if memory.changed else UNKNOWN_ACTS.format(share))
        of = Mechanism(
            *(unknowns, rows, asked.scheme, copy, readings, sensors.outputs(shown)),
            projectors=[one.projectors for one in bodies],
            is_rigid=is_rigid(bodies),
            has_user_functions=bool(functions),
            sign=-1.0 if asked.is_static else 1.0,
            sensors=[one.rows for one in sensors.shown],
        )
        errors, doubts = _begun_with(None if asked.is_static else before, rows, bodies, unknowns)
        bounds, why_not = _bounds(of, sensors, bodies, asked.is_static or errors is not None or bool(doubts))
        by_cause, end = estimates(of, asked.is_static, errors, bounds and bounds.take)
        bound = None
        if bounds:
            bound, why_not = _bounded(bounds, by_cause)
        report = _report(sensors, shown, by_cause, bound, why_not, doubts)
        report.planned_end = planned_end
        if asked.is_static:
            report.time = "static"
        return report, Ended(rows.q[-1], rows.v[-1], bodies, end)


def _bounds(of: Mechanism, sensors: Sensors, bodies: Sequence[Enriched], goes_on: bool) -> tuple[Bounds | None, str]:
    """Bounds of what sensors show in frames, or why there are none; empty where no sensor shows such a thing."""
    if not sensors.in_frames:
        return None, ""
    if goes_on:
        return None, GOES_ON
    if any(one.known.flex.modal_damping is not None for one in bodies):
        return None, BY_RATIOS
    bounds = Bounds(of, (one.residual_norm() for one in bodies), sensors.in_frames)
    return (None, bounds.why_not) if bounds.why_not else (bounds, "")


def _bounded(bounds: Bounds, by_cause: dict[str, CauseEstimate]) -> tuple[np.ndarray | None, str]:
    """Bounds (T, R) of errors by modes and interfaces, which are made what is proved of them; or None, and why."""
    proved = bounds.proved()
    if proved is None:
        return None, bounds.why_not
    bound = with_proved(by_cause, proved)
    return bound, NOT_RESOLVED if bound is None else ""


def _as_equations_have_it(rows: Rows, is_static: bool) -> Rows:
    """Rows with M a - f + G^T lam = 0: Exudyn's static solver has f + G^T lam = 0."""
    return Rows(rows.t, rows.q, rows.v, rows.a, -rows.multipliers) if is_static else rows


def _begun_with(
    before: Ended | None, rows: Rows, bodies: Sequence[Enriched], unknowns: Unknowns
) -> tuple[EndState | None, tuple[Doubt, ...]]:
    """What a run begins with that goes on from another, and what speaks against it; None: it goes on from none."""
    if before is None or not (np.array_equal(before.q, rows.q[0]) and np.array_equal(before.v, rows.v[0])):
        return None, ()
    turns = [in_shapes_of(one, was) for one, was in zip(bodies, before.bodies, strict=False)]
    parts = len(PARTS) if is_rigid(bodies) else OF_MODES
    is_known = before.errors is not None and before.errors.parts.x.shape[2] == parts
    if not is_known or len(turns) < len(bodies) or any(turn is None for turn in turns):
        return None, (Reason.GOES_ON.doubt(),)
    return before.errors.of(unknowns, turns), ()


def is_rigid(bodies: Sequence[Enriched]) -> bool:
    """Whether modes make interfaces of a body rigid."""
    return any(one.known.stiff is not None for one in bodies)


def _in_last_state(mbs: Any, rows: Rows) -> AbstractContextManager:
    """The mbs in the state of its last accepted step: a step that failed may have left another one."""
    t, *state = rows.row(-1)
    return state_set(mbs.systemData, t, state)


def _speeds(mbs: Any, flexes: Sequence[FloatingBody], rows: Rows) -> list[float]:
    """Largest angular velocity of each frame, rad/s."""
    nodes = (int(mbs.GetObject(flex.number)["nodeNumbers"][0]) for flex in flexes)
    own = [np.array(mbs.systemData.GetNodeLTGODE2(node), int) for node in nodes]
    return [float(2 * np.linalg.norm(rows.v[:, x[3:]], axis=1).max()) for x in own]


def _report(
    sensors: Sensors,
    rows: Rows,
    by_cause: dict[str, CauseEstimate],
    bound: np.ndarray | None,
    why_not: str,
    doubts: tuple[Doubt, ...],
) -> MechanismReport:
    values = sensors.values(rows)
    bound = np.full(values.shape, np.inf) if bound is None else bound
    outputs = [_output(one, values[:, one.rows], by_cause, bound[:, one.rows], doubts) for one in sensors.shown]
    computed = tuple(f"output {x.name!r}: {x.of}{x.unit and f' in {x.unit}'}, estimated" for x in sensors.shown)
    return MechanismReport(
        t=rows.t,
        position_bound=OfBodies(),
        velocity_bound=OfBodies(),
        outputs={out.name: out for out in outputs},
        scope={ESTIMATOR: COUPLED},
        scope_reason="",
        reasons={ESTIMATOR: OF_ESTIMATE},
        plan=Plan(computed, (*sensors.left_out, *([(BOUNDS, why_not)] if why_not else []))),
        messages=[],
        time="reconstructed",
        total_mass=None,
        made=made_here(),
        uncertified=doubts,
    )


def _output(
    sensor: ShownSensor,
    value: np.ndarray,
    by_cause: dict[str, CauseEstimate],
    bound: np.ndarray,
    doubts: tuple[Doubt, ...],
) -> OutputReport:
    parts = {PART_OF[cause]: x.over_time[:, sensor.rows] for cause, x in by_cause.items()}
    checks: dict[str, np.ndarray] = {}
    shown = extents(value, sensor.of == "position").max(initial=0.0)
    for cause, x in by_cause.items():
        # no linear equation tells an error as large as what is shown
        is_lost = not np.abs(parts[PART_OF[cause]]).max(initial=0.0) <= shown
        for check, half in x.half_widths.items():
            width = np.full(value.shape, np.inf) if is_lost else np.broadcast_to(half[sensor.rows], value.shape)
            checks[check] = checks.get(check, 0.0) + width
    return OutputReport(
        name=sensor.name,
        unit=sensor.unit,
        quantity=sensor.of,
        of=sensor.of,
        value=value,
        round_off=np.finfo(float).eps * np.abs(value),
        bound={ESTIMATOR: bound, "best": bound},
        reduction_bound={},
        corrected=None,
        corrected_bound=None,
        causes={},
        estimate=sum(parts.values()),
        estimate_parts=parts,
        uncertainty=sum(checks.values()),
        uncertainty_parts=checks,
        estimate_scope=COUPLED,
        labels=sensor.labels,
        uncertified=doubts,
    )
