"""Assessment: whether an output is as exact as asked, by what is proved of it and by what is estimated."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from .advice import RUN_TO_END, advice, cure_of_stop, largest_part, stop
from .estimate_wording import about, estimate_scope, estimated_kind, is_enough, known
from .scope import ATTACH_ALL, COMPLETE, FROZEN, UNATTACHED, causes_of, cures_of
from .wording import (
    AS_IN_THIS_RUN,
    MEASURE_IT,
    NOT_THE_MECHANISM,
    advises,
    digits,
    instant,
    listed,
    rounded_down,
    rounded_up,
    widest_scope,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .data import OutputData, ReportData
    from .estimate_wording import Known

ANSWERS = ("disproven", "unlikely", "unknown", "likely", "proven")  # of several rows the worst counts, which is first
SMALL = 0.01  # of the largest row: one below it that decides alone is told of
TOO_LARGE = ANSWERS[:2]
NO_ESTIMATE = "there is no estimate of its error, and no proof that it is within"
UNCERTIFIED = "what is computed of this run is not certified ({})"


@dataclass(frozen=True)
class Assessment:
    """Whether the error of an output is within a tolerance; see BoundReport.assess.

    answer : "proven", "likely", "unknown", "unlikely" or "disproven", that of the worst row. said, todo : why, and
    what to do next. rows : the answer of every row, by its name.
    """

    answer: str
    said: str
    todo: str
    rows: dict[str, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """A sentence of all: the worst row, what to do, the answers of other rows."""
        others: dict[str, list[str]] = {}
        for name, answer in self.rows.items():
            if not self.said.startswith(f"{name}: "):
                others.setdefault(answer, []).append(name)
        told = ", ".join(f"{listed(others[answer])} {answer}" for answer in ANSWERS if answer in others)
        return f"{self.said}: {self.todo}{told and f' (other rows: {told})'}."

    def __str__(self) -> str:
        return self.text


def assess(report: ReportData, name: str, tolerance: float, relative: bool = False) -> Assessment:
    """Return what is known of an output's error beside a tolerance; see BoundReport.assess."""
    out = report.output(name)
    limits = _limits(out, tolerance, relative)
    found = [_of_row(report, replace(out, tolerance=limit), row) for row, limit in enumerate(limits)]
    worst = _worst(out, found, limits)
    told = _with_small_row(out, tolerance, found, found.index(worst)) if relative else worst
    return replace(told, rows={name: row.answer for name, row in zip(out.row_names, found, strict=True)})


def _worst(out: OutputData, found: Sequence[Assessment], limits: Sequence[float]) -> Assessment:
    """The worst answer; of rows with it that of the largest tolerance (of shares, it moves most), of these bound."""
    ranks = [ANSWERS.index(assessment.answer) for assessment in found]
    return found[np.lexsort((-np.max(out.bound["best"], axis=0), -np.array(limits), ranks))[0]]


def _with_small_row(out: OutputData, tolerance: float, found: list[Assessment], row: int) -> Assessment:
    """The answer of the worst row, which, where rows that hardly move make it, says what to ask of all instead.

    A share of what is next to nothing asks for more than anybody needs, and often for more than rounding leaves.
    """
    sizes = np.max(np.abs(out.value), axis=0)
    largest = int(np.argmax(sizes))
    if sizes[row] >= SMALL * sizes[largest]:
        return found[row]
    small, large = (f"up to {digits(sizes[i])}" for i in (row, largest))
    why = f"this row is {small} {out.unit}, {out.row_names[largest]} {large}"
    absolute = rounded_down(tolerance * sizes[largest])
    return replace(found[row], todo=f"{why}; assess({out.name!r}, {absolute}) asks for the same of all rows")


def _limits(out: OutputData, tolerance: Any, relative: bool) -> list[float]:
    """The tolerance of each row in its unit."""
    if isinstance(tolerance, bool) or not isinstance(tolerance, Real) or not 0 < tolerance < np.inf:
        needed = "as a share of the largest value, such as 0.01" if relative else f"in {out.unit or 'its unit'}"
        raise InputError(f"tolerance={tolerance!r} of {out.name!r}; pass a positive finite number, {needed}")
    sizes = np.max(np.abs(out.value), axis=0) if relative else np.ones(out.value.shape[1])
    return [float(tolerance * size) for size in sizes]


def _of_row(report: ReportData, out: OutputData, row: int) -> Assessment:
    """What is known of one row beside out.tolerance, of a run that ended early as far as it went."""
    if out.uncertified:
        return _made(out, row, "unknown", UNCERTIFIED.format(causes_of(out.uncertified)), cures_of(out.uncertified))
    found = _of_instants(report, out, row)
    if found.answer in TOO_LARGE:
        return found
    if out.stopped is not None:
        said = f"{stop(out, report.time)}; until then {_without_head(found, out, row)}"
        return _made(out, row, "unknown", said, cure_of_stop(out, row))
    if not advises(report):
        said = f"only the first instant was bounded; there {_without_head(found, out, row)}"
        return _made(out, row, "unknown", said, "see the messages")
    if report.planned_end is not None:
        said = f"the run ends at {instant(report.time, report.t[-1])} and was to go to {report.planned_end:.4g} s"
        return _made(out, row, "unknown", f"{said}; until then {_without_head(found, out, row)}", RUN_TO_END)
    return found


def _of_instants(report: ReportData, out: OutputData, row: int) -> Assessment:
    """What is known of one row at the instants of the run: what is proved first, then what is estimated."""
    if widest_scope(report.scope) == COMPLETE and report.time != "sampled":
        most, least = _proved(out, row)
        if most <= out.tolerance:
            said = f"its error is at most {rounded_up(most)} {out.unit}, within {_limit(out)}"
            return _made(out, row, "proven", said, "nothing to do")
        if least > out.tolerance:
            said = f"its error is at least {rounded_down(least)} {out.unit}, above {_limit(out)}"
            return _made(out, row, "disproven", said, _smaller(report, out, row))
    return _estimated(report, out, row)


def _proved(out: OutputData, row: int) -> tuple[float, float]:
    """What the largest error is at most, and at least; nothing, 0, without the corrected output."""
    most = float(np.max(out.bound["best"][:, row] + out.round_off[:, row]))
    if out.corrected is None:
        return most, 0.0
    doubt = out.corrected_bound[:, row] + out.round_off[:, row]
    return most, max(float(np.max(np.abs(out.corrected - out.value)[:, row] - doubt)), 0.0)


def _estimated(report: ReportData, out: OutputData, row: int) -> Assessment:
    found, is_frozen = known(out, row), estimate_scope(out, report.scope) == FROZEN
    others = ATTACH_ALL if UNATTACHED in report.scope_reason else MEASURE_IT
    if found is None:
        todo = others if is_frozen else _next(report, out, row)
        return _made(out, row, "unknown", f"{NO_ESTIMATE} {_limit(out)}", todo)
    kind, size = estimated_kind(out, report.time), about(out, found)
    if is_frozen:
        said = f"{AS_IN_THIS_RUN} its {kind} is {size}, but {NOT_THE_MECHANISM}"
        return _made(out, row, "unknown", said, others)
    steps = "" if kind == "error" else "; what the time steps do is not in it"
    answer = _answer(out, row, found)
    if answer == "unknown" and not found.is_resolved:
        if found.tells_nothing:
            said = f"its {kind} is not known, and so not whether it is within {_limit(out)}{steps}"
            return _made(out, row, answer, said, found.cure)
        half = f"up to {rounded_up(found.half, 2)} {out.unit}" if np.isfinite(found.half) else "not known"
        said = f"the estimate of its {kind}, {digits(found.size, 2)} {out.unit}, half width {half}, does not tell"
        return _made(out, row, answer, f"{said} whether it is within {_limit(out)}", found.cure)
    where = {"likely": "within", "unlikely": "above"}.get(answer, "too close to tell from")
    following = _smaller if answer == "unlikely" else _next
    todo = "nothing to do" if answer == "likely" else following(report, out, row)
    return _made(out, row, answer, f"its {kind} is {size}, {where} {_limit(out)}{steps}", todo)


def _answer(out: OutputData, row: int, found: Known) -> str:
    if is_enough(out, found):
        return "likely"
    least = np.max(np.abs(out.estimate)[:, row] - out.uncertainty[:, row] - out.round_off[:, row])
    return "unlikely" if found.is_resolved and least > out.tolerance else "unknown"


def _made(out: OutputData, row: int, answer: str, said: str, todo: str) -> Assessment:
    return Assessment(answer, f"{out.row_names[row]}: {answer}, {said}", todo)


def _without_head(found: Assessment, out: OutputData, row: int) -> str:
    return found.said.removeprefix(f"{out.row_names[row]}: {found.answer}, ")


def _limit(out: OutputData) -> str:
    return f"the tolerance of {digits(out.tolerance)} {out.unit}".rstrip()


def _smaller(report: ReportData, out: OutputData, row: int) -> str:
    """What lowers an error that is too large: what makes it, however well the estimate is resolved."""
    return largest_part(out, row) if advises(report) else "see the messages"


def _next(report: ReportData, out: OutputData, row: int) -> str:
    return advice(out, report.time, report.scope, row) if advises(report) else "see the messages"
