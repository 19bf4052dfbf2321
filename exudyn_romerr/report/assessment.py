"""Assessment: whether an output is as exact as asked, by what is proved of it and by what is estimated."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import check_choice
from ..errors import InputError
from .answers import ASSESSED, Answer, Limit
from .component_verdicts import rows_of_output
from .cures import CAUSES
from .scope import COMPLETE
from .verdict_text import TITLES, size_in_words
from .verdicts import ESTIMATED, NO_ESTIMATE, NONE, Verdict, not_covered
from .wording import digits, listed, rounded_down, rounded_up, widest_scope, with_unit

if TYPE_CHECKING:
    from .data import OutputReport, ReportData
    from .verdicts import Row

ANSWERS = ("disproven", "unlikely", "unknown", "likely", "proven")  # of several rows the worst counts, which is first
TOO_LARGE = ANSWERS[:2]
PRINTED = dict(zip(ANSWERS, (*[Answer.TOO_LARGE] * 2, Answer.NOT_KNOWN, *[Answer.ENOUGH] * 2), strict=True))
WHERE = {"likely": "within", "unlikely": "above", "unknown": "and does not tell whether that is within"}
NOTHING, OWN_UNIT = "nothing to do", "the unit of its values"


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
    report: ReportData, name: str, tolerance: Any, relative: bool = False, cause: str | None = None
) -> Assessment:
    """Return what is known of an output's error beside a tolerance; see BoundReport.assess."""
    out = report.output(name)
    if cause is not None:
        check_choice("cause", cause, CAUSES)
    if isinstance(tolerance, bool) or not isinstance(tolerance, Real) or not 0 < tolerance < np.inf:
        unit = "as a share of the largest value, such as 0.01" if relative else f"in {out.unit or OWN_UNIT}"
        raise InputError(f"tolerance={tolerance!r} of {name!r}; pass a positive finite number, {unit}")
    limit = float(tolerance) * (float(out.extents.max()) if relative else 1.0)
    rows = rows_of_output(report, out, Limit(limit, True))
    found = [_of_row(report, out, row, cause) for row in rows]
    # the worst answer; of rows with it that which moves most, of these that with the largest bound
    ranks = [ANSWERS.index(assessment.answer) for assessment in found]
    worst = np.lexsort((-np.max(out.bound["best"], axis=0), -out.extents, ranks))[0]
    return replace(found[worst], rows={row.label: one.answer for row, one in zip(rows, found, strict=True)})


def _of_row(report: ReportData, out: OutputReport, row: Row, cause: str | None) -> Assessment:
    """What is known of one row: what is proved of the whole error first, then what is estimated."""
    verdict, what = row.of.get(cause or "sum"), f"its error{f' by {TITLES[cause]}' if cause else ''}"
    if cause is None:
        proof = _proof(report, out, row)
        if proof is not None and not (proof.answer == "proven" and verdict.reason):
            return proof
    elif verdict is None:  # there is nothing of it, where others have an estimate
        verdict = row.of.get("modes", not_covered(NO_ESTIMATE))
        verdict = verdict if verdict.how == NONE else Verdict(0.0, 0.0, ESTIMATED, Answer.ENOUGH)
    answer = ASSESSED[verdict.answer]
    if verdict.size is None:
        told = f"{what} is not known, and so not whether it is within {_tolerance(row)}"
    else:
        told = f"{what} is about {size_in_words(verdict, row.unit, row.extent)}, {WHERE[answer]} {_tolerance(row)}"
    if verdict.reason and answer != "likely":
        told = f"{told} ({verdict.reason})"
    return Assessment(answer, row.label, told, NOTHING if answer == "likely" else verdict.cure or _cure(row))


def _proof(report: ReportData, out: OutputReport, row: Row) -> Assessment | None:
    """What bounds of the whole error, time steps included, prove; None: nothing."""
    if widest_scope(report.scope) != COMPLETE or report.time == "sampled" or out.uncertified:
        return None
    i = row.component
    floor, least = out.round_off[:, i], 0.0
    most = float(np.max(out.bound["best"][:, i] + floor))
    if out.corrected is not None:
        known = np.abs(out.corrected - out.value)[:, i]
        least = float(np.max(known - (out.corrected_bound[:, i] + floor)))
    if most <= row.tolerance:
        told = f"its error is at most {with_unit(rounded_up(most), row.unit)}, within {_tolerance(row)}"
        return Assessment("proven", row.label, told, NOTHING)
    if least > row.tolerance:
        told = f"its error is at least {with_unit(rounded_down(least), row.unit)}, above {_tolerance(row)}"
        return Assessment("disproven", row.label, told, _cure(row))
    return None


def _tolerance(row: Row) -> str:
    return f"the tolerance of {with_unit(digits(row.tolerance), row.unit)}"


def _cure(row: Row) -> str:
    """What lowers the largest part of an error."""
    parts = [verdict for cause, verdict in row.of.items() if cause != "sum" and verdict.cure]
    return max(parts, key=lambda verdict: verdict.most, default=row.of["sum"]).cure or NOTHING
