"""What print(report) shows: each thing once, on a screen; and all there is to say, row by row."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..advice import advice, until_its_end
from ..estimate_wording import covers_time, off_by, said_first
from ..overview import aligned, next_steps, short_table
from ..scope import NOT_CERTIFIED
from ..verdict import row_verdict
from ..wording import (
    SAMPLED,
    advises,
    corrected_within,
    digits,
    outside,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from ..data import OutputData, ReportData

MORE = "every row, with parts and corrected output: print(report.details)"


def summary(report: ReportData, scope_lines: Sequence[str]) -> str:
    """Return the text of a report of several outputs, all rows of one together.

    scope_lines : what the bounds cover.
    """
    told = [line for out in report.outputs.values() for line in _compared(out, report.time, f"{out.name}: ")]
    steps = [*next_steps(report), *told, MORE]
    return "\n".join([*_first(report), *aligned(short_table(report)), *steps, *_messages(report), *scope_lines])


def details(report: ReportData, estimator_lines: Sequence[str]) -> str:
    """Return a line for every row of every output, advice, corrected outputs; estimator_lines : of the whole body."""
    lines = [*_first(report), *_messages(report)]
    for place, out in enumerate(report.outputs.values()):
        rows = range(out.value.shape[1])
        lines += [row_verdict(out, row, report.time, report.scope, place + row == 0) for row in rows]
        if advises(report):
            lines.append(f"  {until_its_end(report.planned_end, advice(out, report.time, report.scope))}")
        if out.corrected is not None and not _tells_nothing(out):
            lines.append(f"  {corrected_within(out, out.corrected_bound, report.scope, in_full=False)}")
        lines += _compared(out, report.time, "  ")
    return "\n".join([*lines, *estimator_lines])


def _tells_nothing(out: OutputData) -> bool:
    """Whether the corrected output may be as far off as the output is large, for all that is known."""
    left = np.max(out.corrected_bound)
    return np.isfinite(left) and bool(left >= np.max(np.abs(out.value)) > 0)


def _first(report: ReportData) -> list[str]:
    """Return what stands first: what is not covered at all, then the instants."""
    first = said_first(report)
    return [*([f"! {first}"] if first else []), _extent(report)]


def _extent(report: ReportData) -> str:
    axis = "load factor" if report.time == "static" else "t / s"
    return f"bounds at {len(report.t)} instants, {axis} = {report.t[0]:g} .. {report.t[-1]:g}"


def _messages(report: ReportData) -> Iterator[str]:
    yield from (f"! {message}" for message in report.messages)
    if report.time == "sampled":
        outputs = report.outputs.values()
        only_bounds = any(out.estimate is not None and covers_time(out, report.time) for out in outputs)
        yield f"! {'bounds: ' if only_bounds else ''}{SAMPLED}"


def _compared(out: OutputData, time: str, begin: str) -> Iterator[str]:
    """What a truth says that was compared."""
    if not out.effectivity:
        return
    ratios = ", ".join(f"{e} {digits(np.max(x))}" for e, x in out.effectivity.items() if e != "best")
    off = "" if out.estimate is None else f"; {off_by(out)}"
    bound = f"bound ({NOT_CERTIFIED})" if out.uncertified else "bound"
    yield f"{begin}true error up to {digits(np.max(np.abs(out.error)))} {out.unit}; {bound} / error: {ratios}{off}"
    yield from (f"! {words}" for row in range(out.value.shape[1]) if (words := outside(out, row, time)))
