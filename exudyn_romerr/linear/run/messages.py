"""Messages at the head of a report: why it is not certified, early end, inputs that are not followed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...report.scope import Doubt
from ...report.wording import NO_OUTPUTS
from ..trajectory.reconstruction import ROUNDING_SHARE

if TYPE_CHECKING:
    from collections.abc import Iterable

    from .record import RunRecord

RESOLVED = 1e-6  # of the largest input: below it what lies between the nodes does not matter
FROM_SAMPLES = "motion of the frame, loads and wrenches are those at the samples, and linear between them"

FEW_DIGITS = (
    "came in fewer than 16 digits: bounds are those of the numbers as they are; what their rounding alone may move "
    "is report.output(name).round_off"
)


def run_messages(run: RunRecord) -> list[str]:
    """Return the messages of a run, the gravest first."""
    offline, is_dynamic, end, few_digits = run.offline, run.time != "static", run.planned_end, run.offline.single
    found = [
        is_dynamic and len(run.t) == 1 and "only the first instant was bounded",
        *(doubt for doubt in run.doubts if doubt not in run.messages),
        not any(out.is_requested for out in offline.outputs) and NO_OUTPUTS,
        *dict.fromkeys(run.messages),
        *(offline.notes if is_dynamic else ()),
        end is not None and f"the run ends at t = {run.t[-1]:g} s; the solver was to go to {end:g} s",
        is_dynamic and _between_samples(run),
        few_digits and f"{', '.join(few_digits)} {FEW_DIGITS}",
    ]
    return list(filter(None, found))


def doubts_in(messages: Iterable[str]) -> list[Doubt]:
    """Return those messages that say why no bound of a run, or of one that goes on from it, is certified."""
    return [message for message in messages if isinstance(message, Doubt)]


def _between_samples(run: RunRecord) -> str:
    offline = run.offline
    if offline.scene.pose is not None and offline.signal is None:
        return FROM_SAMPLES
    if run.rounding_share is None:
        return ""
    if run.rounding_share > ROUNDING_SHARE:
        share = f"{min(100 * run.rounding_share, 100):.0f} %"
        return f"steps so short that rounding makes about {share} of the bound: longer steps are better"
    if offline.signal is None and offline.coordinates.p:
        return "inputs taken as linear between samples: pass input_function to cover what lies between"
    if run.largest_miss > RESOLVED:
        return (
            f"the inputs change within single steps: up to {run.largest_miss:.1e} of their largest value is "
            "not followed by the reconstruction (estimated, and added to the bounds): give jump times as jumps=, "
            "or take smaller steps"
        )
    return ""
