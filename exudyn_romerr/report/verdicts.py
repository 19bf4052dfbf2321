"""One verdict for each output, component and cause: size of its error, half width, answer, reason and cure."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..estimates.estimate import RESOLVED
from ..estimates.kept_estimate import LINEAR, LINEAR_STEPS
from .answers import SHARE, Answer, Tolerance
from .cures import cure_of
from .scope import ATTACH_ALL, COMPLETE, FROZEN, UNATTACHED, Reason, causes_of, cures_of
from .wording import MEASURE_IT, NOT_THE_MECHANISM, covers_time, estimate_scope, instant, parts_of, widest_scope

if TYPE_CHECKING:
    from collections.abc import Iterable

    from .answers import Tolerances
    from .data import OutputData, ReportData
    from .scope import Doubt

CAUSES = ("modes", "interfaces", "step", "start")
PARTS = {"modes": ("basis",), "interfaces": ("interfaces",), "step": ("time step",), "start": ("initial", "jumps")}
OF_MODES, OF_STEPS = ("vectors", LINEAR, "proved"), ("steps", LINEAR_STEPS, "loads", "proved")
CHECKS = {"modes": OF_MODES, "interfaces": OF_MODES, "step": OF_STEPS, "start": OF_MODES}
ALWAYS = ("modes", "step")  # the two that every user asks; the others only where there is something of them
ESTIMATED, MEASURED, NONE = "estimated", "measured", "not covered"
NO_STEPS = "the error of the time steps is in none of its numbers"
NO_ESTIMATE = "there is no estimate of its error at every instant"
FIRST_INSTANT = "only the first instant of the run is known"
# Doubts about bounds that the half width of an estimate tells: what first steps do, and what is not linear
OF_BOUNDS_ALONE = {
    reason.name
    for reason in (
        Reason.UNCHECKED,
        Reason.THIRD_ORDER,
        Reason.REPEATED,
        Reason.STARTS_DAMPED,
        Reason.BEGUN_ANEW,
        Reason.OTHER_INDEX,
        Reason.UNKNOWN_SCHEME,
    )
}


@dataclass(frozen=True)
class Verdict:
    """What is known of one error of one component over the whole run.

    size, half_width : largest absolute value over time and how far that may be off, in the output's unit; None where
    they are not known. how : "estimated", "measured" or "not covered". reason : why there is no number, or why the
    number does not tell. cure : what makes the error, or the half width where that is too large, smaller. floor :
    what rounding of the input may move, beside both.
    """

    size: float | None
    half_width: float | None
    how: str
    answer: Answer
    reason: str = ""
    cure: str = ""
    floor: float = 0.0

    @property
    def most(self) -> float:
        """Size, half width and rounding; inf where they are not known."""
        return math.inf if self.size is None or self.half_width is None else self.size + self.half_width + self.floor

    @property
    def is_resolved(self) -> bool:
        """Whether the size is a number to rely on."""
        return self.size is not None and self.half_width is not None and self.half_width <= RESOLVED * self.size

    @property
    def is_at_round_off(self) -> bool:
        """Whether rounding of the input moves the output as much."""
        return self.most < 3 * self.floor

    def as_json(self) -> dict[str, Any]:
        """Return the fields that --json writes."""
        found = {"size": self.size, "half_width": self.half_width, "how": self.how, "answer": self.answer.value}
        return found | ({"reason": self.reason} if self.reason else {})


@dataclass(frozen=True)
class Row:
    """What is known of one component of one output in one solve.

    largest : its largest absolute value; None where it was not read. of : verdicts by cause, CAUSES that there are,
    and "sum". bound : what its error is at most, None: no finite bound, or not certified. scope : what the bound is
    of, if not of the whole error.
    order, noise : of runs that measure; None elsewhere. tolerance : in its unit; is_asked : by the user.
    estimated : of a measured row, the run's own estimate of the whole error.
    """

    name: str
    component: int
    solve: int
    unit: str
    largest: float | None
    of: dict[str, Verdict]
    bound: float | None = None
    scope: str = ""
    tolerance: float | None = None
    order: float | None = None
    noise: float | None = None
    label: str = ""
    is_asked: bool = False
    estimated: Verdict | None = None

    @property
    def answer(self) -> Answer:
        """The answer that counts: of the whole error."""
        return self.of["sum"].answer

    def as_json(self) -> dict[str, Any]:
        """Return the row as --json writes it."""
        head = {name: getattr(self, name) for name in ("name", "component", "solve", "unit", "largest")}
        verdicts = {cause: None if cause not in self.of else self.of[cause].as_json() for cause in (*CAUSES, "sum")}
        return head | verdicts | {"bound": self.bound, "order": self.order, "noise": self.noise}


class Limit(NamedTuple):
    """A tolerance of one component in its unit, None: none; is_asked : by the user."""

    size: float | None
    is_asked: bool


def rows_of(report: ReportData, tolerances: Tolerances | None = None, solve: int = 0) -> list[Row]:
    """Return a row for every component of every output; tolerances : None: those that attach was given, or SHARE."""
    return [
        row_of(report, out, i, limit_of(out, tolerances), solve)
        for out in report.outputs.values()
        for i in range(out.value.shape[1])
    ]


def limit_of(out: OutputData, tolerances: Tolerances | None = None) -> Limit:
    """Return what is small enough; a share is one of the largest component: small ones ask for no more."""
    asked = None if tolerances is None else tolerances.of(out.name)
    if tolerances is not None and tolerances.is_given:
        return Limit(None if asked is None else asked.of(_largest_extent(out)), True)
    if out.tolerance is not None:
        return Limit(out.tolerance, True)
    return Limit(Tolerance(SHARE, True).of(_largest_extent(out)), False)


def row_of(report: ReportData, out: OutputData, i: int, limit: Limit, solve: int = 0) -> Row:
    """Return what is known of one component."""
    is_bounded = not out.uncertified and widest_scope(report.scope) != FROZEN  # else it is of this run's forces alone
    bound = float(np.max(out.bound["best"][:, i] + out.round_off[:, i]))
    return Row(
        out.name,
        i,
        solve,
        out.unit,
        _extent(out, i),
        _verdicts(report, out, i, limit.size, bound),
        bound if is_bounded and np.isfinite(bound) else None,
        _covered(report),
        limit.size,
        label=out.row_names[i],
        is_asked=limit.is_asked,
    )


class Reservation(NamedTuple):
    """Why numbers do not tell that an error is small enough, and what to do; empty: they do.

    until_then : they are right as far as the run went: what is too large until then is.
    """

    why: str = ""
    cure: str = ""
    until_then: bool = False


NONE_SUCH = Reservation()


def judge(
    size: float,
    half: float,
    limit: float | None,
    how: str,
    cure: str = "",
    floor: float = 0.0,
    but: Reservation = NONE_SUCH,
) -> Verdict:
    """Return the verdict on an error of that size, half width and tolerance (None: none asked)."""
    cure = but.cure or cure
    if not np.isfinite(size + half):
        return Verdict(None, None, how, Answer.NOT_KNOWN, NO_ESTIMATE, cure)
    if limit is None:
        return Verdict(size, half, how, Answer.ENOUGH, floor=floor)
    answer = Answer.NOT_KNOWN
    if size + half + floor <= limit and not but.why:
        answer, cure = Answer.ENOUGH, ""
    elif size - half - floor > limit and half <= RESOLVED * size and (but.until_then or not but.why):
        answer = Answer.TOO_LARGE
    return Verdict(size, half, how, answer, but.why, cure, floor)


def not_covered(reason: str, cure: str = "") -> Verdict:
    """Return the verdict on an error of which nothing is known."""
    return Verdict(None, None, NONE, Answer.NOT_COVERED, reason, cure)


def _covered(report: ReportData) -> str:
    """What bounds are of, where that is less than the whole error."""
    if widest_scope(report.scope) != COMPLETE:
        return "modes, to first order"
    return "modes" if report.time == "sampled" else ""


def _extent(out: OutputData, i: int) -> float:
    """The largest value; of a position how far it moves: where a body is says nothing about its error."""
    value = out.value[:, i]
    return float(np.ptp(value) if out.of == "position" else np.max(np.abs(value), initial=0.0))


def _largest_extent(out: OutputData) -> float:
    return max(_extent(out, i) for i in range(out.value.shape[1]))


def _verdicts(report: ReportData, out: OutputData, i: int, limit: float | None, bound: float) -> dict[str, Verdict]:
    if out.estimate is None:
        return {"sum": _by_bound(report, out, limit, bound)}
    if estimate_scope(out, report.scope) == FROZEN:
        why = report.scope_reason.partition(";")[0].removeprefix("no coupled bound: ") or NOT_THE_MECHANISM
        cure = ATTACH_ALL if UNATTACHED in report.scope_reason else MEASURE_IT
        frozen = not_covered(f"only the error under this run's forces is known: {why}", cure)
        return dict.fromkeys((*ALWAYS, "sum"), frozen)
    found = _by_cause(report, out, i, limit)
    if not covers_time(out, report.time):
        found["step"] = not_covered(NO_STEPS, MEASURE_IT)
    found["sum"] = _of_all(report, out, i, limit, bound, found)
    return found


def _by_cause(report: ReportData, out: OutputData, i: int, limit: float | None) -> dict[str, Verdict]:
    """Verdicts on CAUSES of which there is something; vectors check modes and interfaces together."""
    parts, found, but = parts_of(out), {}, _reservation(report, out)
    zero = np.zeros(len(out.value))
    for cause in CAUSES:
        part = zero + sum(parts[name][:, i] for name in PARTS[cause] if name in parts)
        halves = {x: out.uncertainty_parts[x][:, i] for x in CHECKS[cause] if x in out.uncertainty_parts}
        size, half = _largest(part), _half_width(part, zero + sum(halves.values()))
        if cause == "interfaces":  # of what vectors say each part has its share
            half *= size / (size + (found["modes"].size or 0.0)) if size else 0.0
        if size > 0 or (cause in ALWAYS and (cause, report.time) != ("step", "static")):
            cure = cure_of(out, cause, size, half, _by_check(halves), limit)
            found[cause] = judge(size, half, limit, ESTIMATED, cure, _largest(out.round_off[:, i]), but)
    return found


def _by_bound(report: ReportData, out: OutputData, limit: float | None, bound: float) -> Verdict:
    """The verdict on the whole error where a bound is all there is."""
    if widest_scope(report.scope) != COMPLETE or report.time == "sampled":
        return not_covered(NO_ESTIMATE, MEASURE_IT)
    but = _reservation(report, out)
    if limit is not None and bound <= limit and not out.uncertified and not but.why:
        return Verdict(None, None, ESTIMATED, Answer.ENOUGH)
    cure = cures_of(out.uncertified) or but.cure or cure_of(out, None, 0.0, 0.0, {}, limit)
    why = causes_of(out.uncertified) or but.why or NO_ESTIMATE
    return Verdict(None, None, ESTIMATED, Answer.NOT_KNOWN, why, cure)


def _of_all(
    report: ReportData,
    out: OutputData,
    i: int,
    limit: float | None,
    bound: float,
    found: dict[str, Verdict],
) -> Verdict:
    """The verdict on the whole error: by its bound where that is one, else by the estimate."""
    floor, but = _largest(out.round_off[:, i]), _reservation(report, out)
    size, half = _largest(out.estimate[:, i]), _half_width(out.estimate[:, i], out.uncertainty[:, i])
    verdict = judge(size, half, limit, ESTIMATED, floor=floor, but=but)
    if found.get("step", verdict).how == NONE:
        return not_covered(found["step"].reason, MEASURE_IT)
    is_whole = widest_scope(report.scope) == COMPLETE and report.time != "sampled" and not but.why
    if is_whole and limit is not None and bound <= limit:
        return Verdict(verdict.size, verdict.half_width, ESTIMATED, Answer.ENOUGH, floor=floor)
    worst = max(found.values(), key=lambda x: x.most, default=verdict)
    return verdict if verdict.answer is Answer.ENOUGH else replace(verdict, cure=worst.cure)


def _reservation(report: ReportData, out: OutputData) -> Reservation:
    doubts = of_estimates(out.uncertified)
    if doubts:
        return Reservation(causes_of(doubts), cures_of(doubts))
    if out.stopped is not None:
        why = f"the run was stopped at {instant(report.time, out.stopped)} by tolerance="
        return Reservation(why, "run on without it", True)
    if report.planned_end is not None:
        end = instant(report.time, report.t[-1])
        why = f"the run ends at {end} and was to go to {report.planned_end:.4g} s"
        return Reservation(why, "let it run to its end", True)
    if report.time != "static" and len(report.t) < 2:
        return Reservation(FIRST_INSTANT, "see the messages")
    return NONE_SUCH


def of_estimates(doubts: Iterable[Doubt]) -> list[Doubt]:
    """Return those of the doubts about bounds that concern estimates, too."""
    return [doubt for doubt in doubts if doubt.reason not in OF_BOUNDS_ALONE]


def _half_width(x: np.ndarray, half: np.ndarray) -> float:
    """How far the largest |error| over time may be from the largest |x|, each instant's within its half width."""
    size, most = _largest(x), float(np.max(np.abs(x) + half, initial=0.0))
    least = max(float(np.max(np.abs(x) - half, initial=0.0)), 0.0)
    return max(most - size, size - least)


def _by_check(halves: dict[str, np.ndarray]) -> dict[str, float]:
    return {check: _largest(half) for check, half in halves.items()}


def _largest(x: np.ndarray) -> float:
    return float(np.max(np.abs(x), initial=0.0))
