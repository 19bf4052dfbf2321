"""Assessment: whether an output is as exact as asked, by what is proved of it and by what is estimated."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import check_choice
from ..errors import InputError
from .answers import ASSESSED, Answer
from .report_rows import row_of
from .scope import COMPLETE
from .table import TITLES, size_in_words
from .verdicts import CAUSES, ESTIMATED, NO_ESTIMATE, NONE, Limit, Verdict, not_covered
from .wording import digits, listed, rounded_down, rounded_up, widest_scope, with_unit

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    limits = _limits(out, tolerance, relative)
    found = [_of_row(report, out, i, limit, cause) for i, limit in enumerate(limits)]
    return replace(
        _worst(out, found), rows={name: row.answer for name, row in zip(out.row_names, found, strict=True)}
    )


def _worst(out: OutputReport, found: Sequence[Assessment]) -> Assessment:
    """The worst answer; of rows with it that which moves most, of these that with the largest bound."""
    ranks = [ANSWERS.index(assessment.answer) for assessment in found]
    return found[np.lexsort((-np.max(out.bound["best"], axis=0), -out.extents, ranks))[0]]


def _limits(out: OutputReport, tolerance: Any, relative: bool) -> list[float]:
    """The tolerance of each row in its unit."""
    if isinstance(tolerance, bool) or not isinstance(tolerance, Real) or not 0 < tolerance < np.inf:
        needed = (
            "as a share of the largest value, such as 0.01"
            if relative
            else f"in {out.unit or 'the unit of its values'}"
        )
        raise InputError(f"tolerance={tolerance!r} of {out.name!r}; pass a positive finite number, {needed}")
    shown = float(out.extents.max()) if relative else 1.0
    return [float(tolerance) * shown] * out.value.shape[1]


def _of_row(report: ReportData, out: OutputReport, i: int, limit: float, cause: str | None) -> Assessment:
    """What is known of one row: what is proved of the whole error first, then what is estimated."""
    row = row_of(report, out, i, Limit(limit, True))
    if cause is None:
        verdict, proof = row.of["sum"], _proof(report, out, i, limit, row)
        if proof is not None and not (proof.answer == "proven" and verdict.reason):
            return proof
        return _estimated(row, verdict, "its error", limit)
    return _estimated(row, row.of.get(cause) or _without(row), f"its error by {TITLES[cause]}", limit)


def _without(row: Row) -> Verdict:
    """The verdict on a cause that has none: there is nothing of it, where others have an estimate."""
    modes = row.of.get("modes")
    if modes is None:
        return not_covered(NO_ESTIMATE)
    return modes if modes.how == NONE else Verdict(0.0, 0.0, ESTIMATED, Answer.ENOUGH)


def _proof(report: ReportData, out: OutputReport, i: int, limit: float, row: Row) -> Assessment | None:
    """What bounds of the whole error, time steps included, prove; None: nothing."""
    if widest_scope(report.scope) != COMPLETE or report.time == "sampled" or out.uncertified:
        return None
    most, least = _proved(out, i)
    if most <= limit:
        told = f"its error is at most {with_unit(rounded_up(most), row.unit)}, within {_tolerance(row, limit)}"
        return _made(row, "proven", told, NOTHING)
    if least > limit:
        told = f"its error is at least {with_unit(rounded_down(least), row.unit)}, above {_tolerance(row, limit)}"
        return _made(row, "disproven", told, _cure(row))
    return None


def _proved(out: OutputReport, i: int) -> tuple[float, float]:
    """What the largest error is at most, and at least; nothing, 0, without the corrected output."""
    most = float(np.max(out.bound["best"][:, i] + out.round_off[:, i]))
    if out.corrected is None:
        return most, 0.0
    doubt = out.corrected_bound[:, i] + out.round_off[:, i]
    return most, max(float(np.max(np.abs(out.corrected - out.value)[:, i] - doubt)), 0.0)


def _estimated(row: Row, verdict: Verdict, what: str, limit: float) -> Assessment:
    answer = ASSESSED[verdict.answer]
    if verdict.size is None:
        told = f"{what} is not known, and so not whether it is within {_tolerance(row, limit)}"
    else:
        size = size_in_words(verdict, row.unit, row.extent)
        told = f"{what} is about {size}, {WHERE[answer]} {_tolerance(row, limit)}"
    if verdict.reason and answer != "likely":
        told = f"{told} ({verdict.reason})"
    return _made(row, answer, told, NOTHING if answer == "likely" else verdict.cure or _cure(row))


def _tolerance(row: Row, limit: float) -> str:
    return f"the tolerance of {with_unit(digits(limit), row.unit)}"


def _cure(row: Row) -> str:
    """What lowers the largest part of an error."""
    parts = [verdict for cause, verdict in row.of.items() if cause != "sum" and verdict.cure]
    worst = max(parts, key=lambda verdict: verdict.most, default=row.of["sum"])
    return worst.cure or NOTHING


def _made(row: Row, answer: str, told: str, todo: str) -> Assessment:
    return Assessment(answer, row.label, told, todo)
