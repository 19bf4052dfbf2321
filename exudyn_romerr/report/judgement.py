"""Verdicts on the solves of a script: what was found of each Solve, all rows, and the text that commands print."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from .answers import Answer, Limit, worst
from .component_verdicts import limit_of, rows_of_output
from .cures import ALWAYS, CAUSES
from .data import is_beside
from .verdict_text import (
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
    summary,
    table,
)
from .verdicts import Row, not_covered

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from .answers import Tolerances
    from .report import BoundReport

FEW_SOLVES = 3  # of these each has its own table; of more a line each
NO_SENSOR = "all bodies"  # stands for outputs of a scene without sensors
NO_NUMBER = "nothing is known of its error"
AT_REST = "nothing moves: outputs chosen for the scene stay at zero"


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
    report: BoundReport | None = None
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
    return rows + [_without(solve, name, reason_of(solve, name), tolerances) for name in missing]


def reason_of(solve: Solve, name: str) -> str:
    """Return why there is no number of a sensor."""
    if solve.failure is not None:
        return str(solve.failure)
    left_out = solve.report.plan.left_out if solve.report is not None else ()
    own = (
        why for what, why in left_out if name in (what, what.removeprefix("sensor ").strip("'")) or f"({name})" in why
    )
    refused = "; ".join(f"{which}: {why}" for which, why in solve.refused)
    is_still = name == NO_SENSOR and solve.report is not None and bool(solve.report.outputs)
    return next(own, "") or refused or (AT_REST if is_still else NO_NUMBER)


def _without(solve: Solve, name: str, reason: str, tolerances: Tolerances) -> Row:
    found, limit = not_covered(reason), tolerances.limit(name, 0.0)
    if limit.size is None:
        found = replace(found, answer=Answer.NO_TOLERANCE)
    of = dict.fromkeys((*ALWAYS, "sum"), found)
    return Row(name, 0, solve.number, "", None, None, of, Limit(None, limit.is_asked), until=solve.until)


def text(judgement: Judgement, script: str, what_next: str = "") -> str:
    """Return all that `romerr run` and `verify` print: the answer, the tables, why, notes.

    script : as the user typed it, for what to type next. what_next : what is told where something is not known, {}
    stands for the script; empty: nothing.
    """
    rows, lines = judgement.rows, []
    if rows:
        lines.append(summary(rows))
    if has_numbers(rows):
        lines += [*first_sentences(rows), "", *_tables(rows, judgement)]
    lines += [*reasons(rows, script), *judgement.notes]
    is_unsure = any(row.answer in UNSURE for row in rows)
    is_said = any(YOURS in verdict.cure for row in rows for verdict in row.of.values())
    return "\n".join([*lines, *([what_next.format(script)] if what_next and is_unsure and not is_said else [])])


def _tables(rows: Sequence[Row], judgement: Judgement) -> list[str]:
    numbers = sorted({row.solve for row in rows})
    if len(numbers) > FEW_SOLVES:
        return aligned(table_of_solves(rows, numbers))
    lines: list[str] = []
    for number in numbers:
        lines += [f"solve {number} ({judgement.solves[number].kind}):"] if len(numbers) > 1 else []
        lines += aligned(table(by_sensor([row for row in rows if row.solve == number])))
    return lines


def table_of_solves(rows: Sequence[Row], numbers: Iterable[int]) -> list[tuple[str, ...]]:
    """Return head and a line for each solve: the sensor with the largest share of each cause."""
    causes = [cause for cause in (*CAUSES, "sum") if any(cause in row.of for row in rows)]
    lines = [("solve", "answer", *(f"{TITLES[cause]} {how(rows)}" for cause in causes))]
    for number in numbers:
        own = [row for row in rows if row.solve == number]
        lines.append((str(number), worst(row.answer for row in own).value, *(_worst_cell(own, x) for x in causes)))
    return lines


def _worst_cell(rows: Sequence[Row], cause: str) -> str:
    known = [row for row in rows if cause in row.of and row.of[cause].size is not None]
    if not known:
        return Answer.NOT_COVERED.value
    row = max(known, key=lambda row: row.share(cause))
    return f"{size_in_words(row.of[cause], row.unit, row.extent)}, {row.label or row.name}"
