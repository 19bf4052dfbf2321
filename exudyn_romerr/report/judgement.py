"""What is printed: of a report, is it enough, by cause, and all there is to say; the same of a script's solves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .answers import Answer, Limit, Tolerances, worst
from .assessment import limit_of, rows_of, rows_of_output
from .data import OutputReport, ReportData, is_beside
from .scope import COUPLED, FROZEN, NOT_CERTIFIED
from .verdict_text import (
    ASSESS,
    TITLES,
    UNSURE,
    YOURS,
    aligned,
    by_sensor,
    first_sentences,
    has_numbers,
    how,
    reasons,
    size_in_words,
    table,
)
from .verdict_text import summary as first_sentence
from .verdicts import ALWAYS, CAUSES, FAR, SHARPER, Row, not_covered
from .wording import (
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

MORE = "every component, bounds by all estimators, corrected outputs: print(report.details)"
OUTPUT = "output"  # what a line of a report's tables is of
FEW_SOLVES = 3  # of these each has its own table; of more a line each
NO_SENSOR = "all bodies"  # stands for outputs of a scene without sensors
NO_NUMBER = "nothing is known of its error"
AT_REST = "nothing moves: outputs chosen for the scene stay at zero"


# --- of a report ---


def summary(report: ReportData, tolerances: Tolerances | None = None) -> str:
    """Return the text of a report, a line for each output; tolerances : in place of those that attach was given."""
    rows, answers, why = judged(report, tolerances)
    tables = ["", *aligned(table(by_sensor(rows), OUTPUT)), ""] if has_numbers(rows) else []
    lines = [*_first(report), *answers, *tables, *why, *truths(report), *(f"! {text}" for text in messages(report))]
    return "\n".join([*lines, *shared_lines(report), *([MORE] if rows else [])])


def details(report: ReportData) -> str:
    """Return a line for every component, what bounds say of each output, and of the whole body."""
    rows, heard = rows_of(report), (f"! {text}" for text in messages(report))
    lines = [*_first(report), *heard, *(aligned(table(rows, OUTPUT)) if rows else [])]
    return "\n".join([*lines, *of_bounds(report), *estimator_lines(report)])


def judged(report: ReportData, tolerances: Tolerances | None) -> tuple[list[Row], list[str], list[str]]:
    """Return rows, with what stands beside outputs; sentences on what was asked for; why something is not known."""
    rows = rows_of(report, tolerances)
    named = set() if tolerances is None else tolerances.names
    asked = [row for row in rows if not is_beside(report, row.name) or row.name in named]
    what = OUTPUT if len(asked) == len(rows) else f"{OUTPUT} asked for"
    return rows, [first_sentence(asked, what, ASSESS), *first_sentences(asked)] if rows else [], reasons(asked)


def of_bounds(report: ReportData) -> Iterator[str]:
    """Yield what bounds say of each output, a condition in full in the first line alone, and truths compared."""
    condition = f" ({NOT_THE_MECHANISM})"
    for out in report.outputs.values():
        yield from (f"{out.name}: {said}" for said in _of_output(report, out, condition))
        yield from _compared(out, report.time)
        condition = ""


def _of_output(report: ReportData, out: OutputReport, condition: str) -> Iterator[str]:
    most = "bounded by" if out.uncertified else "at most"
    known = ", ".join(  # the largest bound of each estimator, and what it holds under
        f"{with_unit(rounded_up(np.max(out.bound[e])), out.unit)} by {e!r}{under(report.scope, e, out.uncertified)}"
        for e in report.scope
        if np.isfinite(np.max(out.bound[e]))
    )
    if not known:
        yield "no finite bound: report.reason(...) says why"
    elif widest_scope(report.scope) == FROZEN:
        yield f"{AS_IN_THIS_RUN} its error is {most} {known}{condition}"
    else:
        yield f"its {error_kind(report.time)} is {most} {known}"
    if (times := _times_the_estimate(report, out)) > FAR:
        yield SHARPER.format(digits(times, 2))
    left = np.inf if out.corrected is None else np.max(out.corrected_bound)
    # it may be as far off as it is large, for all that is known: that tells nothing
    if out.corrected is not None and not (np.isfinite(left) and left >= largest(out.value) > 0):
        yield corrected_within(out, report.scope)


def _times_the_estimate(report: ReportData, out: OutputReport) -> float:
    """How far a bound of the modes is above the estimate of what it bounds; 0 where vectors lower none."""
    if not is_known(out) or widest_scope(report.scope) != COUPLED:
        return 0.0
    bound, error = np.max(out.bound["best"]), largest(out.estimate - out.estimate_parts.get("time step", 0.0))
    return float(bound / error) if error > 0 and np.isfinite(bound) else 0.0


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


def truths(report: ReportData) -> Iterator[str]:
    """Yield what truths say that were compared."""
    for out in report.outputs.values():
        yield from _compared(out, report.time)


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


# --- of the solves of a script ---


@dataclass
class Solve:
    """A solve that moved reduced flexible bodies, as found from outside.

    number : from 0. kind : "dynamic" or "static". bodies : how many. report : None where there is none; failure says
    why then. refused : (body, why) of bodies that are not watched. sensors : names of all sensors of the mbs.
    chosen : whether outputs were chosen for a scene without sensors. notes : what else is to be said.
    until : of a solve without report that ended early, when and by what.
    content : of each sensor, what further modes would take from its error, where that was asked.
    seconds, our_seconds : CPU time of the solve with us, and of what we do before and after it.
    flexes : the bodies that were read.
    """

    number: int
    kind: str
    bodies: int
    report: Any = None  # a BoundReport, whose module imports this one
    failure: Exception | None = None
    refused: list[tuple[str, str]] = field(default_factory=list)
    sensors: list[str] = field(default_factory=list)
    chosen: bool = False
    notes: list[str] = field(default_factory=list)
    until: str = ""
    seconds: float = 0.0
    our_seconds: float = 0.0
    flexes: list[Any] = field(default_factory=list)
    content: dict[str, Any] = field(default_factory=dict)


@dataclass
class Judgement:
    """All rows of a script, and how it went.

    Attributes
    ----------
    rows : of all solves. solves : what was found of them. notes : what else is to be said.
    """

    rows: list[Row]
    solves: Sequence[Solve] = ()
    notes: list[str] = field(default_factory=list)

    @property
    def answer(self) -> Answer:
        """The answer that counts for all rows."""
        return worst(row.answer for row in self.rows)


def rows_of_solve(solve: Solve, tolerances: Tolerances) -> list[Row]:
    """Return the rows of a solve: of every component that its report has, and of each sensor that it has not."""
    rows: list[Row] = []
    report = solve.report
    for out in report.outputs.values() if report is not None else ():
        still = solve.chosen and not out.value.any()  # the interface that holds the frame: nobody asked for it
        if not is_beside(report, out.name) and not still:
            rows += rows_of_output(report, out, limit_of(out, tolerances), solve.number)
    seen = {row.name for row in rows}
    missing = [name for name in solve.sensors if name not in seen]
    if not rows and not missing:
        missing = [NO_SENSOR]
    return rows + [_without(solve, name, tolerances) for name in missing]


def _without(solve: Solve, name: str, tolerances: Tolerances) -> Row:
    """A row of a sensor of which there is no number, with the reason."""
    found, limit = not_covered(_reason(solve, name)), tolerances.limit(name, 0.0)
    if limit.size is None:
        found = replace(found, answer=Answer.NO_TOLERANCE)
    of = dict.fromkeys((*ALWAYS, "sum"), found)
    return Row(name, 0, solve.number, "", None, None, of, Limit(None, limit.is_asked), until=solve.until)


def _reason(solve: Solve, name: str) -> str:
    if solve.failure is not None:
        return str(solve.failure)
    left_out = solve.report.plan.left_out if solve.report is not None else ()
    own = (
        why for what, why in left_out if name in (what, what.removeprefix("sensor ").strip("'")) or f"({name})" in why
    )
    refused = "; ".join(f"{which}: {why}" for which, why in solve.refused)
    is_still = name == NO_SENSOR and solve.report is not None and bool(solve.report.outputs)
    return next(own, "") or refused or (AT_REST if is_still else NO_NUMBER)


def text(judgement: Judgement, script: str, what_next: str = "") -> str:
    """Return all that `romerr run` and `verify` print: the answer, the tables, why, notes.

    script : as the user typed it, for what to type next. what_next : what is told where something is not known, {}
    stands for the script; empty: nothing.
    """
    rows = judgement.rows
    tables = ["", *_tables(rows, judgement)] if has_numbers(rows) else []
    first = [first_sentence(rows), *first_sentences(rows), *tables] if rows else []
    is_unsure = any(row.answer in UNSURE for row in rows)
    is_said = any(YOURS in verdict.cure for row in rows for verdict in row.of.values())
    last = [what_next.format(script)] if what_next and is_unsure and not is_said else []
    return "\n".join([*first, *reasons(rows, script), *judgement.notes, *last])


def _tables(rows: Sequence[Row], judgement: Judgement) -> Iterator[str]:
    numbers = sorted({row.solve for row in rows})
    if len(numbers) > FEW_SOLVES:
        yield from aligned(_table_of_solves(rows, numbers))
        return
    for number in numbers:
        if len(numbers) > 1:
            yield f"solve {number} ({judgement.solves[number].kind}):"
        yield from aligned(table(by_sensor([row for row in rows if row.solve == number])))


def _table_of_solves(rows: Sequence[Row], numbers: Iterable[int]) -> list[tuple[str, ...]]:
    """Head and a line for each solve: the sensor with the largest share of each cause."""
    causes = [cause for cause in (*CAUSES, "sum") if any(cause in row.of for row in rows)]
    lines = [("solve", "answer", *(f"{TITLES[cause]} {how(rows)}" for cause in causes))]
    for number in numbers:
        own, cells = [row for row in rows if row.solve == number], []
        for cause in causes:
            known = [row for row in own if cause in row.of and row.of[cause].size is not None]
            row = max(known, key=lambda row, cause=cause: row.share(cause), default=None)
            size = row and f"{size_in_words(row.of[cause], row.unit, row.extent)}, {row.label or row.name}"
            cells.append(size or Answer.NOT_COVERED.value)
        lines.append((str(number), worst(row.answer for row in own).value, *cells))
    return lines
