"""What print(report) shows: enough or not, by cause, on a screen; and all there is to say, component by component."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..cures import FAR, SHARPER
from ..report_rows import asked_for, rows_of
from ..scope import COUPLED, FROZEN, NOT_CERTIFIED
from ..table import ASSESS, aligned, by_sensor, first_sentences, reasons, table
from ..table import summary as first_sentence
from ..verdicts import NONE
from ..wording import (
    AS_IN_THIS_RUN,
    NOT_THE_MECHANISM,
    SAMPLED,
    corrected_within,
    covers_time,
    digits,
    error_kind,
    is_known,
    off_by,
    outside,
    rounded_up,
    said_first,
    under,
    widest_scope,
    with_unit,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from ..answers import Tolerances
    from ..data import OutputReport, ReportData

MORE = "every component, bounds by all estimators, corrected outputs: print(report.details)"
OUTPUT = "output"  # what a line of its tables is of


def summary(report: ReportData, scope_lines: Sequence[str], tolerances: Tolerances | None = None) -> str:
    """Return the text of a report, a line for each output; scope_lines : what the bounds cover.

    tolerances : in place of those that attach was given.
    """
    compared = [line for out in report.outputs.values() for line in _compared(out, report.time, f"{out.name}: ")]
    lines = [*_first(report), *_answers(report, tolerances), *compared, *_messages(report)]
    return "\n".join([*lines, *scope_lines, *([MORE] if report.outputs else [])])


def details(report: ReportData, estimator_lines: Sequence[str]) -> str:
    """Return a line for every component, and what bounds say of each output; estimator_lines : of the whole body."""
    lines, rows = [*_first(report), *_messages(report)], rows_of(report)
    lines += aligned(table(rows, OUTPUT)) if rows else []
    for place, out in enumerate(report.outputs.values()):
        lines += [f"{out.name}: {said}" for said in _of_bounds(report, out, place == 0)]
        lines += _compared(out, report.time, f"{out.name}: ")
    return "\n".join([*lines, *estimator_lines])


def _answers(report: ReportData, tolerances: Tolerances | None) -> list[str]:
    """Sentences of what was asked for, and the table, with what stands beside it for the sake of its bounds."""
    rows = rows_of(report, tolerances)
    if not rows:
        return []
    asked = asked_for(report, rows, tolerances)
    known = any(row.bound is not None or verdict.how != NONE for row in rows for verdict in row.of.values())
    tables = [*first_sentences(asked), "", *aligned(table(by_sensor(rows), OUTPUT)), ""] if known else []
    what = OUTPUT if len(asked) == len(rows) else f"{OUTPUT} asked for"
    return [first_sentence(asked, what, ASSESS), *tables, *reasons(asked)]


def _of_bounds(report: ReportData, out: OutputReport, is_first: bool) -> Iterator[str]:
    """What bounds say of an output, each with its condition, in full in the first line, and its corrected value."""
    is_frozen, most = widest_scope(report.scope) == FROZEN, "bounded by" if out.uncertified else "at most"
    known = _by_all(report, out)
    if not known:
        yield "no finite bound: report.reason(...) says why"
    elif is_frozen:
        yield f"{AS_IN_THIS_RUN} its error is {most} {known}{f' ({NOT_THE_MECHANISM})' if is_first else ''}"
    else:
        yield f"its {error_kind(report.time)} is {most} {known}"
    if (times := _times_the_estimate(report, out)) > FAR:
        yield SHARPER.format(digits(times, 2))
    if out.corrected is not None and not _tells_nothing(out):
        yield corrected_within(out, out.corrected_bound, report.scope, in_full=False)


def _times_the_estimate(report: ReportData, out: OutputReport) -> float:
    """How far a bound of the modes is above the estimate of what it bounds; 0 where vectors lower none."""
    if not is_known(out) or widest_scope(report.scope) != COUPLED:
        return 0.0
    bound, error = np.max(out.bound["best"]), np.max(np.abs(out.estimate - out.estimate_parts.get("time step", 0.0)))
    return float(bound / error) if error > 0 and np.isfinite(bound) else 0.0


def _by_all(report: ReportData, out: OutputReport) -> str:
    """The largest bound of each estimator, and what it holds under."""
    return ", ".join(
        f"{with_unit(rounded_up(np.max(out.bound[e])), out.unit)} by {e!r}{under(report.scope, e, out.uncertified)}"
        for e in report.scope
        if np.isfinite(np.max(out.bound[e]))
    )


def _tells_nothing(out: OutputReport) -> bool:
    """Whether the corrected output may be as far off as the output is large, for all that is known."""
    left = np.max(out.corrected_bound)
    return np.isfinite(left) and bool(left >= np.max(np.abs(out.value)) > 0)


def _first(report: ReportData) -> list[str]:
    """Return what stands first: what is not covered at all, then the instants."""
    first = said_first(report)
    return [*([f"! {first}"] if first else []), _extent(report)]


def _extent(report: ReportData) -> str:
    axis = "load factor" if report.time == "static" else "t / s"
    return f"{len(report.t)} instants, {axis} = {report.t[0]:g} .. {report.t[-1]:g}"


def _messages(report: ReportData) -> Iterator[str]:
    yield from (f"! {message}" for message in report.messages)
    if report.time == "sampled":
        outputs = report.outputs.values()
        only_bounds = any(out.estimate is not None and covers_time(out, report.time) for out in outputs)
        yield f"! {'bounds: ' if only_bounds else ''}{SAMPLED}"


def _compared(out: OutputReport, time: str, begin: str) -> Iterator[str]:
    """What a truth says that was compared."""
    if not out.effectivity:
        return
    ratios = ", ".join(f"{e} {digits(np.max(x))}" for e, x in out.effectivity.items() if e != "best")
    off = "" if out.estimate is None else f"; {off_by(out)}"
    bound = f"bound ({NOT_CERTIFIED})" if out.uncertified else "bound"
    largest = with_unit(digits(np.max(np.abs(out.error))), out.unit)
    yield f"{begin}true error up to {largest}; {bound} / error: {ratios}{off}"
    yield from (f"! {words}" for row in range(out.value.shape[1]) if (words := outside(out, row, time)))
