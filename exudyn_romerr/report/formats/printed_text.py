"""What print(report) shows: enough or not, by cause, on a screen; and all there is to say, component by component."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..component_verdicts import asked_for, rows_of
from ..cures import FAR, SHARPER
from ..scope import COUPLED, FROZEN, NOT_CERTIFIED
from ..verdict_text import ASSESS, aligned, by_sensor, first_sentences, has_numbers, reasons, table
from ..verdict_text import summary as first_sentence
from ..wording import (
    AS_IN_THIS_RUN,
    NOT_THE_MECHANISM,
    SAMPLED,
    corrected_within,
    covers_time,
    digits,
    error_kind,
    estimator_lines,
    is_known,
    largest,
    off_by,
    outside,
    rounded_up,
    said_first,
    shared_lines,
    under,
    widest_scope,
    with_unit,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..answers import Tolerances
    from ..data import OutputReport, ReportData
    from ..verdicts import Row

MORE = "every component, bounds by all estimators, corrected outputs: print(report.details)"
OUTPUT = "output"  # what a line of its tables is of


def summary(report: ReportData, tolerances: Tolerances | None = None) -> str:
    """Return the text of a report, a line for each output; tolerances : in place of those that attach was given."""
    rows, answers, why = judged(report, tolerances)
    tables = ["", *aligned(table(by_sensor(rows), OUTPUT)), ""] if has_numbers(rows) else []
    truths = [line for out in report.outputs.values() for line in _compared(out, report.time)]
    lines = [*_first(report), *answers, *tables, *why, *truths, *(f"! {text}" for text in messages(report))]
    return "\n".join([*lines, *shared_lines(report), *([MORE] if rows else [])])


def details(report: ReportData) -> str:
    """Return a line for every component, what bounds say of each output, and of the whole body."""
    rows = rows_of(report)
    lines = [*_first(report), *(f"! {text}" for text in messages(report))]
    return "\n".join(
        [*lines, *(aligned(table(rows, OUTPUT)) if rows else []), *of_bounds(report), *estimator_lines(report)]
    )


def judged(report: ReportData, tolerances: Tolerances | None) -> tuple[list[Row], list[str], list[str]]:
    """Return rows, with what stands beside outputs; sentences on what was asked for; why something is not known."""
    rows = rows_of(report, tolerances)
    if not rows:
        return [], [], []
    asked = asked_for(report, rows, tolerances)
    first = first_sentence(asked, OUTPUT if len(asked) == len(rows) else f"{OUTPUT} asked for", ASSESS)
    return rows, [first, *(first_sentences(asked) if has_numbers(rows) else [])], reasons(asked)


def of_bounds(report: ReportData) -> Iterator[str]:
    """Yield what bounds say of each output, a condition in full in the first line alone, and truths compared."""
    condition = f" ({NOT_THE_MECHANISM})"
    for out in report.outputs.values():
        yield from (f"{out.name}: {said}" for said in _of_output(report, out, condition))
        yield from _compared(out, report.time)
        condition = ""


def _of_output(report: ReportData, out: OutputReport, condition: str) -> Iterator[str]:
    known, most = _by_all(report, out), "bounded by" if out.uncertified else "at most"
    if not known:
        yield "no finite bound: report.reason(...) says why"
    elif widest_scope(report.scope) == FROZEN:
        yield f"{AS_IN_THIS_RUN} its error is {most} {known}{condition}"
    else:
        yield f"its {error_kind(report.time)} is {most} {known}"
    if (times := _times_the_estimate(report, out)) > FAR:
        yield SHARPER.format(digits(times, 2))
    if out.corrected is not None and not _tells_nothing(out):
        yield corrected_within(out, report.scope)


def _times_the_estimate(report: ReportData, out: OutputReport) -> float:
    """How far a bound of the modes is above the estimate of what it bounds; 0 where vectors lower none."""
    if not is_known(out) or widest_scope(report.scope) != COUPLED:
        return 0.0
    bound, error = np.max(out.bound["best"]), largest(out.estimate - out.estimate_parts.get("time step", 0.0))
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
    return np.isfinite(left) and bool(left >= largest(out.value) > 0)


def _first(report: ReportData) -> list[str]:
    """What stands first: what is not covered at all, then the instants."""
    first = said_first(report)
    return [*([f"! {first}"] if first else []), extent(report)]


def extent(report: ReportData) -> str:
    """Return how many instants there are, from when to when."""
    axis = "load factor" if report.time == "static" else "t / s"
    return f"{len(report.t)} instants, {axis} = {report.t[0]:g} .. {report.t[-1]:g}"


def messages(report: ReportData) -> Iterator[str]:
    """Yield what the reader must know first."""
    yield from report.messages
    if report.time == "sampled":
        outputs = report.outputs.values()
        only_bounds = any(out.estimate is not None and covers_time(out, report.time) for out in outputs)
        yield f"{'bounds: ' if only_bounds else ''}{SAMPLED}"


def _compared(out: OutputReport, time: str) -> Iterator[str]:
    """What a truth says that was compared."""
    if not out.effectivity:
        return
    ratios = ", ".join(f"{e} {digits(np.max(x))}" for e, x in out.effectivity.items() if e != "best")
    off = "" if out.estimate is None else f"; {off_by(out)}"
    bound = f"bound ({NOT_CERTIFIED})" if out.uncertified else "bound"
    size = with_unit(digits(largest(out.error)), out.unit)
    yield f"{out.name}: true error up to {size}; {bound} / error: {ratios}{off}"
    yield from (f"! {words}" for row in range(out.value.shape[1]) if (words := outside(out, row, time)))
