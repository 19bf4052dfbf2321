"""Assessment: whether an output is as exact as asked, by what is proved of it and by what is estimated."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import check_choice
from ..errors import InputError
from .answers import ASSESSED, Answer, Limit
from .cures import CAUSES
from .report_rows import rows_of_output
from .scope import COMPLETE
from .table import TITLES, size_in_words
from .verdicts import ESTIMATED, NO_ESTIMATE, NONE, Verdict, not_covered
from .wording import digits, listed, rounded_down, rounded_up, widest_scope, with_unit

if TYPE_CHECKING:
    from .data import OutputReport, ReportData
    from .verdicts import Row

ANSWERS = ("disproven", "unlikely", "unknown", "likely", "proven")  # of several rows the worst counts, which is first
TOO_LARGE = ANSWERS[:2]
PRINTED = dict(zip(ANSWERS, (*[Answer.TOO_LARGE] * 2, Answer.NOT_KNOWN, *[Answer.ENOUGH] * 2), strict=True))
WHERE = {"likely": "within", "unlikely": "above", "unknown": "and does not tell whether that is within"}
NOTHING = "nothing to do"


@dataclass(frozen=True)
class Assessment:
    """Whether the error of an output is within a tolerance; see BoundReport.assess.

    answer : "proven", "likely", "unknown", "unlikely" or "disproven", that of the worst row. name : of that row.
    said, todo : why, and what to do next. rows : the answer of every row, by its name.
    """

    answer: str
    name: str
    said: str
    todo: str
    rows: dict[str, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """A sentence of all: the worst row, what to do, the answers of other rows."""
        others: dict[str, list[str]] = {}
        for name, answer in self.rows.items():
            if name != self.name:
                others.setdefault(PRINTED[answer].value, []).append(name)
        told = ", ".join(f"{listed(names)} {word}" for word, names in others.items())
        beside = told and f" (other rows: {told})"
        return f"{self.name}: {PRINTED[self.answer].value}, {self.said}: {self.todo}{beside}."

    def __str__(self) -> str:
        return self.text


def assess(
    report: ReportData, name: str, tolerance: float, relative: bool = False, cause: str | None = None
) -> Assessment:
    """Return what is known of an output's error beside a tolerance; see BoundReport.assess."""
    out = report.output(name)
    if cause is not None:
        check_choice("cause", cause, CAUSES)
    rows = rows_of_output(report, out, Limit(_limit(out, tolerance, relative), True))
    found = [_of_row(report, out, row, cause) for row in rows]
    # the worst answer; of rows with it that which moves most, of these that with the largest bound
    ranks = [ANSWERS.index(assessment.answer) for assessment in found]
    worst = np.lexsort((-np.max(out.bound["best"], axis=0), -out.extents, ranks))[0]
    return replace(found[worst], rows={row.label: one.answer for row, one in zip(rows, found, strict=True)})


def _limit(out: OutputReport, tolerance: Any, relative: bool) -> float:
    """The tolerance of all rows in their unit."""
    if isinstance(tolerance, bool) or not isinstance(tolerance, Real) or not 0 < tolerance < np.inf:
        needed = (
            "as a share of the largest value, such as 0.01"
            if relative
            else f"in {out.unit or 'the unit of its values'}"
        )
        raise InputError(f"tolerance={tolerance!r} of {out.name!r}; pass a positive finite number, {needed}")
    return float(tolerance) * (float(out.extents.max()) if relative else 1.0)


def _of_row(report: ReportData, out: OutputReport, row: Row, cause: str | None) -> Assessment:
    """What is known of one row: what is proved of the whole error first, then what is estimated."""
    if cause is None:
        verdict, proof = row.of["sum"], _proof(report, out, row)
        if proof is not None and not (proof.answer == "proven" and verdict.reason):
            return proof
        return _estimated(row, verdict, "its error")
    return _estimated(row, row.of.get(cause) or _without(row), f"its error by {TITLES[cause]}")


def _without(row: Row) -> Verdict:
    """The verdict on a cause that has none: there is nothing of it, where others have an estimate."""
    modes = row.of.get("modes")
    if modes is None:
        return not_covered(NO_ESTIMATE)
    return modes if modes.how == NONE else Verdict(0.0, 0.0, ESTIMATED, Answer.ENOUGH)


def _proof(report: ReportData, out: OutputReport, row: Row) -> Assessment | None:
    """What bounds of the whole error, time steps included, prove; None: nothing."""
    if widest_scope(report.scope) != COMPLETE or report.time == "sampled" or out.uncertified:
        return None
    i = row.component
    bound, floor = out.bound["best"][:, i], out.round_off[:, i]
    most, least = float(np.max(bound + floor)), 0.0
    if out.corrected is not None:
        known = np.abs(out.corrected - out.value)[:, i]
        least = max(float(np.max(known - (out.corrected_bound[:, i] + floor))), 0.0)
    if most <= row.tolerance:
        told = f"its error is at most {with_unit(rounded_up(most), row.unit)}, within {_tolerance(row)}"
        return Assessment("proven", row.label, told, NOTHING)
    if least > row.tolerance:
        told = f"its error is at least {with_unit(rounded_down(least), row.unit)}, above {_tolerance(row)}"
        return Assessment("disproven", row.label, told, _cure(row))
    return None


def _estimated(row: Row, verdict: Verdict, what: str) -> Assessment:
    answer = ASSESSED[verdict.answer]
    if verdict.size is None:
        told = f"{what} is not known, and so not whether it is within {_tolerance(row)}"
    else:
        told = f"{what} is about {size_in_words(verdict, row.unit, row.extent)}, {WHERE[answer]} {_tolerance(row)}"
    if verdict.reason and answer != "likely":
        told = f"{told} ({verdict.reason})"
    return Assessment(answer, row.label, told, NOTHING if answer == "likely" else verdict.cure or _cure(row))


def _tolerance(row: Row) -> str:
    return f"the tolerance of {with_unit(digits(row.tolerance), row.unit)}"


def _cure(row: Row) -> str:
    """What lowers the largest part of an error."""
    parts = [verdict for cause, verdict in row.of.items() if cause != "sum" and verdict.cure]
    return max(parts, key=lambda verdict: verdict.most, default=row.of["sum"]).cure or NOTHING
