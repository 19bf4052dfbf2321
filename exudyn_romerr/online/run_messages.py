"""Messages at the head of a report: uncertified balance, early end, inputs that are not followed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..trajectory.reconstruction import ROUNDING_SHARE

if TYPE_CHECKING:
    from collections.abc import Iterable

    from .run_record import RunRecord, SolverFacts

GALERKIN_DEFECT = 1e-6  # of the largest term: above it, and above the solver's tolerance, a load was missed
TOLERANCES = 10  # of Newton's relative tolerance may be left in W^T R
ROUGH_RADIUS = 0.2  # with 0 an error was 2.9 times its bound at the first instant, with 0.3 none was above
RESOLVED = 1e-6  # of the largest input: below it what lies between the nodes does not matter
BEGUN_ANEW = (
    "the solver begins anew with the accelerations that it finds: what it does in its first steps then, with modes "
    "that ring and that they do not resolve, is not in the bound, which is not certified; a spectral radius of 1 "
    "leaves them as they are"
)
CHANGED = (
    "the mbs was changed meanwhile (by a PostStep function, or after the solve), so that coupled bounds are not "
    "certified"
)
STARTS_DAMPED = (
    "the run starts suddenly, by an integrator with a spectral radius below 1, and there are dampers beside those of "
    "the bodies: what its first steps make of both, where they do not resolve modes, is in the bound as far as "
    "examples tell, and the bound is not certified; a spectral radius of 1, or loads that begin smoothly, leave "
    "nothing of it"
)
STARTS_ROUGHLY = (
    f"the run starts suddenly, by an integrator with a spectral radius below {ROUGH_RADIUS}: velocities of modes "
    "that its first step does not resolve may be too large for linear equations, and the bound is not certified; a "
    "spectral radius of 1, or loads that begin smoothly, leave nothing of it"
)
FROM_SAMPLES = "motion of the frame, loads and wrenches are those at the samples, and linear between them"
MOTION_JUMPS = (
    "loads or accelerations of the prescribed motion change within single steps: up to {:.1e} of the largest is not "
    "followed by the reconstruction (estimated, and added to the bounds): let the motion change more smoothly, or "
    "take smaller steps"
)
UNCHECKED = (
    "the wrenches of joints use up the balance V^T R = 0 of all modes: a load that is not known here would not be "
    "noticed. No bound of this run is certified; add eigenmodes"
)
NO_OUTPUTS = (
    "no outputs: only the body's position as a whole is bounded, and not at a point. Pass "
    "outputs=[romerr.node_displacement('tip', node=..., component='z')], or add sensors of displacement, position or "
    "velocity on mesh nodes to a body in a floating frame"
)

IN_GLOBAL_AXES = (
    "no bound of {} (inf): the motion of the frame is in it, whose error has {}; see the estimate. An output "
    "in the body's frame is bounded ('NAME in the frame' of a sensor, or frame='body'); scope='inputs frozen' gives "
    "a bound under the motion of the frame in this run"
)


def run_messages(run: RunRecord) -> list[str]:
    """Return the messages of a run, the gravest first."""
    return [
        *_first_only(run),
        *_defect(run),
        *_no_outputs(run),
        *dict.fromkeys(run.messages),
        *_in_global_axes(run),
        *(run.offline.notes if run.time != "static" else ()),
        *_end(run),
        *_between_samples(run),
        *_single(run),
    ]


def is_balanced(run: RunRecord) -> bool:
    """Whether the Galerkin defect could be measured, and is what the solver's tolerance leaves."""
    return run.offline.scene.checked and run.defect <= _limit(run)


def is_certified(run: RunRecord) -> bool:
    """Whether the run is balanced and its bounds hold from the start of the solve on."""
    was_changed = run.offline.scene.coupled and bool(told_of_changes(run.messages))
    return is_balanced(run) and not run.begins_late and not starts_uncertainly(run) and not was_changed


def starts_uncertainly(run: RunRecord) -> bool:
    """Whether what the integrator makes of the start may not be in the bounds."""
    known = BEGUN_ANEW, STARTS_DAMPED, STARTS_ROUGHLY
    return any(message in known for message in run.messages)


def told_of_changes(messages: Iterable[str]) -> list[str]:
    """Return those messages that say that the mbs was changed along the run."""
    return [message for message in messages if CHANGED in message]


def planned_end(run: RunRecord) -> float | None:
    """Return where the solver was to go to, if the run ends before; None: it does not, or that is not known."""
    return run.solver.end_time if _ends_early(run.t[-1], run.solver) else None


def stopped_at(run: RunRecord) -> float | None:
    """Return where a tolerance stopped the solver before its end; None: none did."""
    return float(run.t[-1]) if run.solver.is_stopped and _ends_early(run.t[-1], run.solver) is not False else None


def stopped_or_ended(t: float, solver: SolverFacts) -> str:
    """Return in words whether what ends a run at t stopped it, or was found when it had come to its end."""
    return "the run ended" if _ends_early(t, solver) is False else "stopped"


def _limit(run: RunRecord) -> float:
    return GALERKIN_DEFECT + TOLERANCES * (run.solver.newton_tolerance + run.offline.samples_precision)


def _first_only(run: RunRecord) -> list[str]:
    return [] if run.time == "static" or len(run.t) > 1 else ["only the first instant was bounded"]


def _defect(run: RunRecord) -> list[str]:
    if not run.offline.scene.checked:
        return [UNCHECKED]
    if is_balanced(run):
        return []
    return [
        f"Galerkin defect {run.defect:.1e} of the largest term, in mode {run.worst_mode} (expected below "
        f"{_limit(run):.1e}): a load on the body is not known here, or depends on more than time, or damping "
        "differs, or a step was too long to be solved well. No bound of this run is certified: it holds for the "
        "loads known"
    ]


def _no_outputs(run: RunRecord) -> list[str]:
    return [] if any(out.is_requested for out in run.offline.outputs) else [NO_OUTPUTS]


def _in_global_axes(run: RunRecord) -> list[str]:
    """In a mechanism: positions are bounded where vectors react with it, velocities are not."""
    if not run.offline.scene.coupled:
        return []
    is_known = run.left.size > 0
    names = [
        repr(out.name)
        for out in run.offline.outputs
        if out.is_requested and out.frame == "global" and (out.of == "velocity" or not is_known)
    ]
    rates = "no bound of its rate" if is_known else "no bound"
    return [IN_GLOBAL_AXES.format(", ".join(names), rates)] if names else []


def _single(run: RunRecord) -> list[str]:
    names = run.offline.single
    if not names:
        return []
    return [
        f"{', '.join(names)} came in fewer than 16 digits: bounds are those of the numbers as they are; what their "
        "rounding alone may move is report.output(name).round_off"
    ]


def _end(run: RunRecord) -> list[str]:
    end = planned_end(run)
    return [] if end is None else [f"the run ends at t = {run.t[-1]:g} s; the solver was to go to {end:g} s"]


def _ends_early(t: float, solver: SolverFacts) -> bool | None:
    """Whether a run that is at t ends before its solver was to; None: not known."""
    return None if solver.end_time is None else bool(t < solver.end_time * (1 - 1e-9))


def _between_samples(run: RunRecord) -> list[str]:
    offline = run.offline
    if run.time == "static":
        return []
    if offline.scene.pose is not None and offline.signal is None and offline.driven is None:
        return [FROM_SAMPLES]
    if run.rounding_share is None:
        return []
    if run.rounding_share > ROUNDING_SHARE:
        share = f"{min(100 * run.rounding_share, 100):.0f} %"
        return [f"steps so short that rounding makes about {share} of the bound: longer steps are better"]
    if offline.signal is None and offline.coordinates.p and offline.driven is None:
        return ["inputs taken as linear between samples: pass input_function to cover what lies between"]
    if run.largest_miss > RESOLVED and offline.driven is not None:
        return [MOTION_JUMPS.format(run.largest_miss)]
    if run.largest_miss > RESOLVED:
        return [
            f"the inputs change within single steps: up to {run.largest_miss:.1e} of their largest value is "
            "not followed by the reconstruction (estimated, and added to the bounds): give jump times as jumps=, "
            "or take smaller steps"
        ]
    return []
