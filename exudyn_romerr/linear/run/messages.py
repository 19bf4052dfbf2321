"""Messages at the head of a report: why it is not certified, early end, inputs that are not followed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...report.scope import Doubt
from ...report.wording import NO_OUTPUTS
from ..trajectory.reconstruction import ROUNDING_SHARE

if TYPE_CHECKING:
    from collections.abc import Iterable

    from .record import RunRecord, SolverFacts

RESOLVED = 1e-6  # of the largest input: below it what lies between the nodes does not matter
FROM_SAMPLES = "motion of the frame, loads and wrenches are those at the samples, and linear between them"


def run_messages(run: RunRecord) -> list[str]:
    """Return the messages of a run, the gravest first."""
    return [
        *_first_only(run),
        *[doubt for doubt in run.doubts if doubt not in run.messages],
        *_no_outputs(run),
        *_noted(run),
        *(run.offline.notes if run.time != "static" else ()),
        *_end(run),
        *_between_samples(run),
        *_single(run),
    ]


def doubts_in(messages: Iterable[str]) -> list[Doubt]:
    """Return those messages that say why no bound of a run, or of one that goes on from it, is certified."""
    return [message for message in messages if isinstance(message, Doubt)]


def planned_end(run: RunRecord) -> float | None:
    """Return where the solver was to go to, if the run ends before; None: it does not, or that is not known."""
    return run.solver.end_time if _ends_early(run.t[-1], run.solver) else None


def stopped_at(run: RunRecord) -> float | None:
    """Return where a tolerance stopped the solver before its end; None: none did."""
    return float(run.t[-1]) if run.solver.is_stopped and _ends_early(run.t[-1], run.solver) is not False else None


def stopped_or_ended(t: float, solver: SolverFacts) -> str:
    """Return in words whether what ends a run at t stopped it, or was found when it had come to its end."""
    return "the run ended" if _ends_early(t, solver) is False else "stopped"


def _first_only(run: RunRecord) -> list[str]:
    return [] if run.time == "static" or len(run.t) > 1 else ["only the first instant was bounded"]


def _noted(run: RunRecord) -> list[str]:
    """What was noted along the run; of doubts that are none of its bounds, what is said but that."""
    is_other = lambda note: isinstance(note, Doubt) and note not in run.doubts  # noqa: E731
    return [note.said if is_other(note) else note for note in dict.fromkeys(run.messages)]


def _no_outputs(run: RunRecord) -> list[str]:
    return [] if any(out.is_requested for out in run.offline.outputs) else [NO_OUTPUTS]


def _single(run: RunRecord) -> list[str]:
    if not (names := run.offline.single):
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
    if offline.scene.pose is not None and offline.signal is None:
        return [FROM_SAMPLES]
    if run.rounding_share is None:
        return []
    if run.rounding_share > ROUNDING_SHARE:
        share = f"{min(100 * run.rounding_share, 100):.0f} %"
        return [f"steps so short that rounding makes about {share} of the bound: longer steps are better"]
    if offline.signal is None and offline.coordinates.p:
        return ["inputs taken as linear between samples: pass input_function to cover what lies between"]
    if run.largest_miss > RESOLVED:
        return [
            f"the inputs change within single steps: up to {run.largest_miss:.1e} of their largest value is "
            "not followed by the reconstruction (estimated, and added to the bounds): give jump times as jumps=, "
            "or take smaller steps"
        ]
    return []
