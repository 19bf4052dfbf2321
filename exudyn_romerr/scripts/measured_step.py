"""What an estimate of the step leaves open, put right by runs with shorter steps: romerr run --measure-step."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from ..report.answers import Answer
from ..report.verdict_text import UNSURE
from ..report.verdicts import (
    CAUSES,
    ESTIMATED,
    NONE,
    NONE_SUCH,
    TOO_COARSE,
    Reservation,
    Row,
    Verdict,
    judge,
    judged_together,
)
from .compared import at_least

if TYPE_CHECKING:
    from .verify import Verification

SAME = 1e-6  # of what a sensor shows: runs of the same script differ by rounding
OTHERWISE = (
    "run again, the script shows something else ({}): its step was not measured. Does it use random numbers, the "
    "clock, or a file that it writes?"
)


def is_open(row: Row) -> bool:
    """Return whether a row's step is one of which no tolerance can be judged."""
    return "step" in row.of and row.of["step"].answer in UNSURE


def with_measured_steps(rows: Iterable[Row], steps: Verification) -> tuple[list[Row], list[str]]:
    """Return rows of a run, those whose step is open with the step that was measured, and why others have none.

    A cause that nothing could be said of beside such steps is judged anew; the whole is what causes add up to. A row
    that stands for a sensor of which nothing is known becomes one for each of its components.
    """
    numbers = {number: i for i, number in enumerate(steps.results["unchanged"].with_bodies)}
    measured: dict[tuple[str, int], list[Row]] = {}
    for row in steps.judgement.rows:
        if row.solve in numbers:
            measured.setdefault((row.name, numbers[row.solve]), []).append(row)
    pairs = [pair for row in rows for pair in _beside(row, measured.get((row.name, row.solve), []))]
    others = {row.solve: row.name for row, one in pairs if one is not None and _differ(row, one)}
    found = [row if one is None or row.solve in others else _with_measured_step(row, one) for row, one in pairs]
    return found, [OTHERWISE.format(name) for name in dict.fromkeys(others.values())]


def _beside(row: Row, measured: list[Row]) -> Iterator[tuple[Row, Row | None]]:
    """Yield the row, or one for each component, and what was measured of it."""
    if row.largest is None and measured:  # it stands for all components of its sensor
        for one in measured:
            yield replace(row, component=one.component, axis=one.axis, label=one.label, unit=one.unit), one
    else:
        yield row, next((one for one in measured if one.component == row.component), None)


def _differ(row: Row, measured: Row) -> bool:
    """Whether the run in a process of its own shows something else than the run itself, where that is known."""
    if row.largest is None or row.until:  # not known, or not all of it was compared
        return False
    return not abs(row.largest - measured.largest) <= SAME * row.extent


def _with_measured_step(row: Row, measured: Row) -> Row:
    if not is_open(row):
        return row
    step = measured.of["step"]
    if step.how == NONE or (step.half_width is None and step.answer in UNSURE and row.of["step"].how != NONE):
        return row  # runs that lead nowhere tell no more than the estimate
    of = {cause: _without_doubt(one, cause, row) for cause, one in row.of.items() if cause != "sum"} | {"step": step}
    extent = measured.extent if row.extent is None else row.extent
    limit = measured.limit if row.limit.size is None else row.limit
    of = judged_together(of | {"sum": _added(of, limit.size)}, extent, limit.size)
    return replace(row, of=of, extent=extent, limit=limit, largest=row.largest or measured.largest)


def _without_doubt(verdict: Verdict, cause: str, row: Row) -> Verdict:
    """The verdict as it is where steps are resolved."""
    if verdict.reason != TOO_COARSE:
        return verdict
    judged = judge(verdict.size, verdict.half_width, row.tolerance, ESTIMATED, CAUSES[cause].cure, verdict.floor)
    return replace(judged, time=verdict.time)


def _added(of: Mapping[str, Verdict], limit: float | None) -> Verdict:
    """The whole error, of which nothing but its causes is known: others may be with the largest, or against it.

    What speaks against a number of a cause (a run that ended early, what no estimate covers) does so here.
    """
    open_causes = [one for one in of.values() if one.half_width is None]
    if open_causes:
        return replace(at_least(of.values(), open_causes[0]), answer=Answer.NOT_KNOWN)
    largest = max(of.values(), key=lambda one: one.size)
    most = sum(one.most for one in of.values())
    least = max(0.0, *(one.least + one.most - most for one in of.values()))
    but = next((Reservation(x.reason, x.cure) for x in of.values() if x.reason and x.answer in UNSURE), NONE_SUCH)
    whole = judge((most + least) / 2, (most - least) / 2, limit, ESTIMATED, largest.cure, but=but)
    return replace(whole, time=largest.time)
