"""Rows of verdicts of a report: what estimates and bounds say of every component of every output."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..linear.estimators.causes import FEEDBACK, FURTHER_INTERFACES, LINEAR_INTERFACES
from .answers import Answer, Limit, Tolerances
from .cures import ALWAYS, CAUSES, LOWEST_ORDER, SECOND_ORDER, Steps, cure_of, cure_of_bound
from .data import is_beside, is_rate
from .scope import ATTACH_ALL, COMPLETE, FROZEN, UNATTACHED, Reason, causes_of, cures_of
from .verdicts import (
    ESTIMATED,
    KNOWN,
    NO_ESTIMATE,
    NONE,
    NONE_SUCH,
    TO_THE_END,
    Reservation,
    Row,
    Verdict,
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
    estimate_scope,
    instant,
    largest,
    parts_of,
    widest_scope,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from .data import OutputReport, ReportData
    from .scope import Doubt

OF_INTERFACES = (FURTHER_INTERFACES, LINEAR_INTERFACES)  # in place of a share of those of modes, where they are known
NO_STEPS = "the error of the time steps is in none of its numbers"
AXES = ("x", "y", "z")
SAME = 1e-6  # of a step: all are of one size where they differ by rounding of times
FIRST_INSTANT = "only the first instant of the run is known"
OF_BOUNDS_ALONE = {Reason.UNCHECKED.name}  # doubts that speak of no estimate


def rows_of(report: ReportData, tolerances: Tolerances | None = None) -> list[Row]:
    """Return a row for every component of every output; tolerances : None: those that attach was given, or SHARE."""
    outputs = report.outputs.values()
    return [row for out in outputs for row in rows_of_output(report, out, limit_of(out, tolerances))]


def asked_for(report: ReportData, rows: Iterable[Row], tolerances: Tolerances | None = None) -> list[Row]:
    """Return rows without those of outputs nobody asked for, but where a tolerance names them."""
    named = set() if tolerances is None else tolerances.names
    return [row for row in rows if not is_beside(report, row.name) or row.name in named]


def limit_of(out: OutputReport, tolerances: Tolerances | None = None) -> Limit:
    """Return what is small enough; a share is one of the largest component: small ones ask for no more."""
    shown = float(np.max(out.extents, initial=0.0))
    if out.tolerance is not None and not (tolerances and tolerances.is_given):
        return Limit(out.tolerance, True)
    return (tolerances or Tolerances()).limit(out.name, shown)


def rows_of_output(report: ReportData, out: OutputReport, limit: Limit, solve: int = 0) -> list[Row]:
    """Return what is known of each component of an output beside a limit."""
    early, extents = until_of(report), out.extents
    shown = float(extents.max())
    is_still = report.time == "static" and is_rate(out.of) and not early
    rows = []
    for i in range(len(extents)):
        found = _Component(report, out, i, limit.size)
        of = judged_together(found.verdicts(), None if is_still else shown, limit.size)
        beside = {"bound": found.certain_bound(), "scope": _covered(report), "until": early}
        axis = out.labels[i] if out.labels and out.labels[i] in AXES else ""
        row = Row(out.name, i, solve, out.unit, float(extents[i]), shown, of, limit, out.row_names[i], axis, **beside)
        rows.append(row)
    return rows


def _covered(report: ReportData) -> str:
    """What bounds are of, where that is less than the whole error."""
    if widest_scope(report.scope) != COMPLETE:
        return "modes, to first order"
    return "modes" if report.time == "sampled" else ""


class _Component:
    """One component of an output: verdicts on its errors beside a limit."""

    def __init__(self, report: ReportData, out: OutputReport, i: int, limit: float | None):
        self._report, self._out, self._i, self._limit = report, out, i, limit
        self._bound = float(np.max(out.bound["best"][:, i] + out.round_off[:, i]))
        self._is_of_all = widest_scope(report.scope) == COMPLETE and report.time != "sampled"
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


def steps_of(report: ReportData) -> Steps:
    """Return how many steps a run was to take, where they are of one size."""
    h = np.diff(report.t)
    if report.time == "static" or len(h) == 0 or np.ptp(h) > SAME * np.max(h):
        return Steps(None)
    end = report.t[-1] if report.planned_end is None else report.planned_end
    is_sampled = any(FEEDBACK in out.uncertainty_parts for out in report.outputs.values())
    return Steps(round(float((end - report.t[0]) / np.mean(h))), LOWEST_ORDER if is_sampled else SECOND_ORDER)


def _reservation(report: ReportData, out: OutputReport) -> Reservation:
    doubts = of_estimates(out.uncertified)
    if doubts:
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
    if report.planned_end is None:
        return ""
    return until(report.t[-1], report.planned_end, report.ended_by)


def of_estimates(doubts: Iterable[Doubt]) -> list[Doubt]:
    """Return those of the doubts about bounds that concern estimates, too."""
    return [doubt for doubt in doubts if doubt.reason not in OF_BOUNDS_ALONE]


def _half_width(x: np.ndarray, half: np.ndarray) -> float:
    """How far the largest |error| over time may be from the largest |x|, each instant's within its half width."""
    size, most = largest(x), float(np.max(np.abs(x) + half, initial=0.0))
    if not np.isfinite(most):
        return np.inf
    least = max(float(np.max(np.abs(x) - half, initial=0.0)), 0.0)
    return max(most - size, size - least)
