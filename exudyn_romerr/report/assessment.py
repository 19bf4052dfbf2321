"""What is known of errors: a row of verdicts for every component of every output, and whether that is enough."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import Any

import numpy as np

from ..checks import check_choice
from ..errors import InputError
from .answers import ASSESSED, Answer, Limit, Tolerances
from .causes import FEEDBACK, FURTHER_INTERFACES, LINEAR_INTERFACES
from .data import OutputReport, ReportData, is_rate
from .scope import ATTACH_ALL, COMPLETE, FROZEN, UNATTACHED, Doubt, Reason, causes_of, cures_of
from .verdict_text import TITLES, size_in_words
from .verdicts import (
    ALWAYS,
    CAUSES,
    ESTIMATED,
    KNOWN,
    LOWEST_ORDER,
    NO_ESTIMATE,
    NONE,
    NONE_SUCH,
    SECOND_ORDER,
    TO_THE_END,
    Reservation,
    Row,
    Steps,
    Verdict,
    cure_of,
    cure_of_bound,
    judge,
    judged_together,
    not_covered,
    until,
    until_load,
)
from .wording import (
    MEASURE_IT,
    NOT_THE_MECHANISM,
    covers_time,
    digits,
    estimate_scope,
    instant,
    largest,
    listed,
    parts_of,
    rounded_down,
    rounded_up,
    widest_scope,
    with_unit,
)

OF_INTERFACES = (FURTHER_INTERFACES, LINEAR_INTERFACES)  # in place of a share of those of modes, where they are known
NO_STEPS = "the error of the time steps is in none of its numbers"
AXES = ("x", "y", "z")
SAME = 1e-6  # of a step: all are of one size where they differ by rounding of times
FIRST_INSTANT = "only the first instant of the run is known"
OF_BOUNDS_ALONE = {Reason.UNCHECKED.name}  # doubts that speak of no estimate
ANSWERS = ("disproven", "unlikely", "unknown", "likely", "proven")  # of several rows the worst counts, which is first
TOO_LARGE = ANSWERS[:2]
PRINTED = dict(zip(ANSWERS, (*[Answer.TOO_LARGE] * 2, Answer.NOT_KNOWN, *[Answer.ENOUGH] * 2), strict=True))
WHERE = {"likely": "within", "unlikely": "above", "unknown": "and does not tell whether that is within"}
NOTHING, OWN_UNIT = "nothing to do", "the unit of its values"


# --- rows of verdicts ---


def rows_of(report: ReportData, tolerances: Tolerances | None = None) -> list[Row]:
    """Return a row for every component of every output; tolerances : None: those that attach was given, or SHARE."""
    outputs = report.outputs.values()
    return [row for out in outputs for row in rows_of_output(report, out, limit_of(out, tolerances))]


def limit_of(out: OutputReport, tolerances: Tolerances | None = None) -> Limit:
    """Return what is small enough; a share is one of the largest component: small ones ask for no more."""
    if out.tolerance is not None and not (tolerances and tolerances.is_given):
        return Limit(out.tolerance, True)
    return (tolerances or Tolerances()).limit(out.name, float(np.max(out.extents, initial=0.0)))


def rows_of_output(report: ReportData, out: OutputReport, limit: Limit, solve: int = 0) -> list[Row]:
    """Return what is known of each component of an output beside a limit."""
    early, extents = until_of(report), out.extents
    shown = float(extents.max())
    is_still = report.time == "static" and is_rate(out.of) and not early
    covered = "modes" if report.time == "sampled" else ""  # what bounds are of, if that is less than the whole error
    if widest_scope(report.scope) != COMPLETE:
        covered = "modes, to first order"
    rows = []
    for i, (label, extent) in enumerate(zip(out.row_names, extents, strict=True)):
        found = _Component(report, out, i, limit.size)
        of = judged_together(found.verdicts(), None if is_still else shown, limit.size)
        beside = {"bound": found.certain_bound(), "scope": covered, "until": early}
        axis = out.labels[i] if out.labels and out.labels[i] in AXES else ""
        row = Row(out.name, i, solve, out.unit, float(extent), shown, of, limit, label, axis, **beside)
        rows.append(row)
    return rows


class _Component:
    """One component of an output: verdicts on its errors beside a limit."""

    def __init__(self, report: ReportData, out: OutputReport, i: int, limit: float | None):
        self._report, self._out, self._i, self._limit = report, out, i, limit
        self._bound = float(np.max(out.bound["best"][:, i] + out.round_off[:, i]))
        self._is_of_all = is_of_all(report)
        self._but = _reservation(report, out)

    def certain_bound(self) -> float | None:
        """What the error is at most; None: not finite, not certified, or of this run's forces alone."""
        is_certain = not self._out.uncertified and widest_scope(self._report.scope) != FROZEN
        return self._bound if is_certain and np.isfinite(self._bound) else None

    def verdicts(self) -> dict[str, Verdict]:
        """By cause, and of the sum."""
        report, out = self._report, self._out
        if out.estimate is None:
            return {"sum": self._by_bound()}
        if estimate_scope(out, report.scope) == FROZEN:
            why = report.scope_reason.partition(";")[0].removeprefix("no coupled bound: ") or NOT_THE_MECHANISM
            cure = ATTACH_ALL if UNATTACHED in report.scope_reason else MEASURE_IT
            frozen = not_covered(f"only the error under this run's forces is known: {why}", cure)
            return dict.fromkeys((*ALWAYS, "sum"), frozen)
        found = self._by_cause()
        if not covers_time(out, report.time):
            found["step"] = not_covered(NO_STEPS, MEASURE_IT)
        return found | {"sum": self._of_all(found)}

    def _by_bound(self) -> Verdict:
        """On the whole error where a bound is all there is."""
        out, but = self._out, self._but
        if not self._is_of_all:
            return not_covered(NO_ESTIMATE, MEASURE_IT)
        if self._limit is None:
            return Verdict(None, None, ESTIMATED, Answer.NO_TOLERANCE)
        if self._bound <= self._limit and not out.uncertified and not but.why:
            return Verdict(None, None, ESTIMATED, Answer.ENOUGH)
        cure = cures_of(out.uncertified) or but.cure or cure_of_bound(out.causes)
        why = causes_of(out.uncertified) or but.why or NO_ESTIMATE
        return Verdict(None, None, ESTIMATED, Answer.NOT_KNOWN, why, cure)

    def _by_cause(self) -> dict[str, Verdict]:
        """On causes of which there is something; vectors check modes and interfaces together."""
        out, i, time = self._out, self._i, self._report.time
        parts, steps, found, zero = parts_of(out), steps_of(self._report), {}, np.zeros(len(out.value))
        for name, cause in CAUSES.items():
            part = zero + sum(parts[of][:, i] for of in cause.parts if of in parts)
            own = name == "interfaces" and OF_INTERFACES[0] in out.uncertainty_parts
            checks = OF_INTERFACES if own else cause.checks
            halves = {x: out.uncertainty_parts[x][:, i] for x in checks if x in out.uncertainty_parts}
            size, half = largest(part), _half_width(part, zero + sum(halves.values()))
            if name == "interfaces" and not own:  # of what vectors say each part has its share
                half *= size / (size + (found["modes"].size or 0.0)) if size else 0.0
            if size > 0 or (name in ALWAYS and (name, time) != ("step", "static")):
                by_check = {check: largest(x) for check, x in halves.items()}
                cure = cure_of(name, size, half, by_check, self._limit, steps, out.beside_steps)
                found[name] = self._judged(part, size, half, cure)
        return found

    def _judged(self, error: np.ndarray, size: float, half: float, cure: str = "") -> Verdict:
        floor = largest(self._out.round_off[:, self._i])
        verdict = judge(size, half, self._limit, ESTIMATED, cure, floor, self._but)
        return replace(verdict, time=float(self._report.t[np.argmax(np.abs(error))]))

    def _of_all(self, found: dict[str, Verdict]) -> Verdict:
        """On the whole error: by its bound where that is one, else by the estimate."""
        error, half = self._out.estimate[:, self._i], self._out.uncertainty[:, self._i]
        verdict = self._judged(error, largest(error), _half_width(error, half))
        if found.get("step", verdict).how == NONE:
            return not_covered(found["step"].reason, MEASURE_IT)
        is_proved = self._is_of_all and not self._but.why
        if is_proved and self._limit is not None and self._bound <= self._limit:
            return replace(verdict, answer=Answer.ENOUGH, reason="", cure="")
        cause = max(found, key=lambda cause: found[cause].most, default="modes")
        cure = "" if verdict.answer is Answer.ENOUGH else found[cause].cure or CAUSES[cause].cure
        return replace(verdict, cure=cure)


def is_of_all(report: ReportData) -> bool:
    """Return whether bounds are of the whole error, time steps included."""
    return widest_scope(report.scope) == COMPLETE and report.time != "sampled"


def steps_of(report: ReportData) -> Steps:
    """Return how many steps a run was to take, where they are of one size."""
    h = np.diff(report.t)
    if report.time == "static" or len(h) == 0 or np.ptp(h) > SAME * np.max(h):
        return Steps(None)
    end = report.t[-1] if report.planned_end is None else report.planned_end
    is_sampled = any(FEEDBACK in out.uncertainty_parts for out in report.outputs.values())
    return Steps(round(float((end - report.t[0]) / np.mean(h))), LOWEST_ORDER if is_sampled else SECOND_ORDER)


def _reservation(report: ReportData, out: OutputReport) -> Reservation:
    if doubts := of_estimates(out.uncertified):
        return Reservation(causes_of(doubts), cures_of(doubts))
    if out.stopped is not None:
        why = f"the run was stopped at {instant(report.time, out.stopped)} by tolerance="
        return Reservation(why, "run on without it", True)
    if (early := until_of(report)) and not report.on_purpose:
        return Reservation(KNOWN.format(early), TO_THE_END, True)
    if report.time != "static" and len(report.t) < 2:
        return Reservation(FIRST_INSTANT, "see the messages")
    return NONE_SUCH


def until_of(report: ReportData) -> str:
    """Return until when a run went that was to go farther, and what ended it; empty: it went to its end."""
    if report.time == "static" and report.ended_by:
        return until_load(report.t[-1], report.ended_by)
    return "" if report.planned_end is None else until(report.t[-1], report.planned_end, report.ended_by)


def of_estimates(doubts: Iterable[Doubt]) -> list[Doubt]:
    """Return those of the doubts about bounds that concern estimates, too."""
    return [doubt for doubt in doubts if doubt.reason not in OF_BOUNDS_ALONE]


def _half_width(x: np.ndarray, half: np.ndarray) -> float:
    """How far the largest |error| over time may be from the largest |x|, each instant's within its half width."""
    size, most = largest(x), float(np.max(np.abs(x) + half, initial=0.0))
    if not np.isfinite(most):
        return np.inf
    return max(most - size, size - float(np.max(np.abs(x) - half, initial=0.0)))


# --- within a tolerance or not ---


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
    within = f"the tolerance of {with_unit(digits(row.tolerance), row.unit)}"
    if cause is None:
        proof = _proof(report, out, row, within)
        if proof is not None and not (proof.answer == "proven" and verdict.reason):
            return proof
    elif verdict is None:  # there is nothing of it, where others have an estimate
        verdict = row.of.get("modes", not_covered(NO_ESTIMATE))
        verdict = verdict if verdict.how == NONE else Verdict(0.0, 0.0, ESTIMATED, Answer.ENOUGH)
    answer = ASSESSED[verdict.answer]
    if verdict.size is None:
        told = f"{what} is not known, and so not whether it is within {within}"
    else:
        told = f"{what} is about {size_in_words(verdict, row.unit, row.extent)}, {WHERE[answer]} {within}"
    if verdict.reason and answer != "likely":
        told = f"{told} ({verdict.reason})"
    return Assessment(answer, row.label, told, NOTHING if answer == "likely" else verdict.cure or _cure(row))


def _proof(report: ReportData, out: OutputReport, row: Row, within: str) -> Assessment | None:
    """What bounds of the whole error, time steps included, prove; None: nothing."""
    if not is_of_all(report) or out.uncertified:
        return None
    i = row.component
    floor, least = out.round_off[:, i], 0.0
    most = float(np.max(out.bound["best"][:, i] + floor))
    if out.corrected is not None:
        known = np.abs(out.corrected - out.value)[:, i]
        least = float(np.max(known - (out.corrected_bound[:, i] + floor)))
    if most <= row.tolerance:
        told = f"its error is at most {with_unit(rounded_up(most), row.unit)}, within {within}"
        return Assessment("proven", row.label, told, NOTHING)
    if least > row.tolerance:
        told = f"its error is at least {with_unit(rounded_down(least), row.unit)}, above {within}"
        return Assessment("disproven", row.label, told, _cure(row))
    return None


def _cure(row: Row) -> str:
    """What lowers the largest part of an error."""
    parts = [verdict for cause, verdict in row.of.items() if cause != "sum" and verdict.cure]
    return max(parts, key=lambda verdict: verdict.most, default=row.of["sum"]).cure or NOTHING
