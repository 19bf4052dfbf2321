"""One verdict for each sensor, component and cause: size of its error, half width, answer, reason and cure."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..estimates.estimate import RESOLVED
from ..estimates.kept_estimate import LINEAR, LINEAR_STEPS
from ..report.data import is_beside
from ..report.estimate_wording import covers_time, estimate_scope, parts_of
from ..report.scope import COMPLETE, FROZEN
from ..report.wording import NOT_THE_MECHANISM, widest_scope
from .answers import Answer, worst

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..report.data import OutputData, ReportData
    from .answers import Tolerance, Tolerances
    from .solve import Solve

CAUSES = ("modes", "interfaces", "step", "start")
PARTS = {"modes": ("basis",), "interfaces": ("interfaces",), "step": ("time step",), "start": ("initial", "jumps")}
OF_MODES, OF_STEPS = ("vectors", LINEAR, "proved"), ("steps", LINEAR_STEPS, "loads", "proved")
CHECKS = {"modes": OF_MODES, "interfaces": OF_MODES, "step": OF_STEPS, "start": OF_MODES}
ALWAYS = ("modes", "step")  # the two that every user asks; the others only where there is something of them
ESTIMATED, MEASURED, NONE = "estimated", "measured", "not covered"
CURES = {
    "modes": "more modes",
    "interfaces": "RBE3 modes; nothing, if the part is as rigid there in reality",
    "step": "shorter steps",
    "start": "let loads begin smoothly, or start from equilibrium",
}
NO_STEPS = "the error of the time steps is in none of its numbers"
NO_SENSOR = "all bodies"  # stands for outputs of a scene without sensors
NO_NUMBER = "nothing is known of its error"
NO_ESTIMATE = "there is no estimate of its error at every instant"


@dataclass(frozen=True)
class Verdict:
    """What is known of one error of one component over the whole run.

    size, half_width : largest absolute value over time and how far that may be off, in the output's unit; None where
    they are not known. how : "estimated", "measured" or "not covered". reason : why there is no number. cure : what
    makes the error smaller.
    """

    size: float | None
    half_width: float | None
    how: str
    answer: Answer
    reason: str = ""
    cure: str = ""

    @property
    def most(self) -> float:
        """Size and half width; inf where they are not known."""
        return math.inf if self.size is None or self.half_width is None else self.size + self.half_width

    @property
    def is_resolved(self) -> bool:
        """Whether the size is a number to rely on."""
        return self.size is not None and self.half_width is not None and self.half_width <= RESOLVED * self.size

    def as_json(self) -> dict[str, Any]:
        """Return the fields that --json writes."""
        found = {"size": self.size, "half_width": self.half_width, "how": self.how, "answer": self.answer.value}
        return found | ({"reason": self.reason} if self.reason else {})


@dataclass(frozen=True)
class Row:
    """What is known of one component of one sensor in one solve.

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


def rows_of(solve: Solve, tolerances: Tolerances) -> list[Row]:
    """Return the rows of a solve: of every component that its report has, and of each sensor that it has not."""
    rows: list[Row] = []
    report = solve.report
    for out in report.outputs.values() if report is not None else ():
        still = solve.chosen and not out.value.any()  # the interface that holds the frame: nobody asked for it
        if not is_beside(report, out.name) and not still:
            rows += [_row(solve, report, out, i, tolerances) for i in range(out.value.shape[1])]
    seen = {row.name for row in rows}
    missing = [name for name in solve.sensors if name not in seen]
    if not rows and not missing:
        missing = [NO_SENSOR]
    return rows + [_without(solve, name, reason_of(solve, name)) for name in missing]


def reason_of(solve: Solve, name: str) -> str:
    """Return why there is no number of a sensor."""
    if solve.failure is not None:
        return str(solve.failure)
    said = solve.report.plan.left_out if solve.report is not None else ()
    own = (why for what, why in said if name in (what, what.removeprefix("sensor ").strip("'")) or f"({name})" in why)
    return next(own, "") or "; ".join(f"{which}: {why}" for which, why in solve.refused) or NO_NUMBER


def judge(size: float, half: float, limit: float | None, how: str, cure: str = "") -> Verdict:
    """Return the verdict on an error of that size, half width and tolerance (None: none asked)."""
    if not np.isfinite(size + half):
        return Verdict(None, None, how, Answer.NOT_KNOWN, NO_ESTIMATE, cure)
    if limit is None:
        return Verdict(size, half, how, Answer.ENOUGH)
    if size + half <= limit:
        answer = Answer.ENOUGH
    elif size - half > limit and half <= RESOLVED * size:
        answer = Answer.TOO_LARGE
    else:
        answer = Answer.NOT_KNOWN
    return Verdict(size, half, how, answer, cure="" if answer is Answer.ENOUGH else cure)


def not_covered(reason: str) -> Verdict:
    """Return the verdict on an error of which nothing is known."""
    return Verdict(None, None, NONE, Answer.NOT_COVERED, reason)


def _without(solve: Solve, name: str, reason: str) -> Row:
    return Row(name, 0, solve.number, "", None, dict.fromkeys((*ALWAYS, "sum"), not_covered(reason)))


def _row(solve: Solve, report: ReportData, out: OutputData, i: int, tolerances: Tolerances) -> Row:
    largest = _extent(out, i)
    tolerance = tolerances.of(out.name)
    limit = None if tolerance is None else _limit(out, tolerance)
    is_bounded = not out.uncertified and widest_scope(report.scope) != FROZEN  # else it is of this run's forces alone
    bound = float(np.max(out.bound["best"][:, i] + out.round_off[:, i]))
    return Row(
        out.name,
        i,
        solve.number,
        out.unit,
        largest,
        _verdicts(report, out, i, limit, bound),
        bound if is_bounded and np.isfinite(bound) else None,
        _covered(report),
        limit,
        label=out.row_names[i],
        is_asked=tolerances.is_given,
    )


def _covered(report: ReportData) -> str:
    """What bounds are of, where that is less than the whole error."""
    if widest_scope(report.scope) != COMPLETE:
        return "modes, to first order"
    return "modes" if report.time == "sampled" else ""


def _extent(out: OutputData, i: int) -> float:
    """The largest value; of a position how far it moves: where a body is says nothing about its error."""
    value = out.value[:, i]
    return float(np.ptp(value) if out.of == "position" else np.max(np.abs(value), initial=0.0))


def _limit(out: OutputData, tolerance: Tolerance) -> float:
    """The tolerance in the output's unit; a share is one of the largest component: small ones ask for no more."""
    return tolerance.of(max(_extent(out, i) for i in range(out.value.shape[1])))


def _verdicts(report: ReportData, out: OutputData, i: int, limit: float | None, bound: float) -> dict[str, Verdict]:
    if out.estimate is None:
        return dict.fromkeys((*ALWAYS, "sum"), not_covered(NO_ESTIMATE))
    if estimate_scope(out, report.scope) == FROZEN:
        why = report.scope_reason.partition(";")[0].removeprefix("no coupled bound: ") or NOT_THE_MECHANISM
        return dict.fromkeys((*ALWAYS, "sum"), not_covered(f"only the error under this run's forces is known: {why}"))
    parts, found = parts_of(out), {}
    for cause in CAUSES:
        size = _largest(sum(parts.get(name, np.zeros_like(out.estimate)) for name in PARTS[cause])[:, i])
        half = sum(_largest(out.uncertainty_parts[x][:, i]) for x in CHECKS[cause] if x in out.uncertainty_parts)
        if cause == "interfaces":  # vectors are checked together: of what these say each part has its share
            half *= size / (size + (found["modes"].size or 0.0)) if size else 0.0
        if cause in ALWAYS or size > 0:
            found[cause] = judge(size, half, limit, ESTIMATED, CURES[cause])
    if not covers_time(out, report.time) and report.time != "static":
        found["step"] = not_covered(NO_STEPS)
    found["sum"] = _of_all(report, out, i, limit, bound, found)
    return found


def _of_all(report: ReportData, out: OutputData, i: int, limit: float | None, bound: float, found) -> Verdict:
    """The verdict on the whole error: by its bound where that is one, else by the estimate."""
    total = np.max(np.abs(out.estimate[:, i]) + out.uncertainty[:, i]) if len(out.estimate) else 0.0
    size = _largest(out.estimate[:, i])
    verdict = judge(size, float(total) - size, limit, ESTIMATED)
    if found["step"].how == NONE:
        return not_covered(found["step"].reason)
    is_whole = widest_scope(report.scope) == COMPLETE and report.time != "sampled" and not out.uncertified
    if is_whole and limit is not None and bound <= limit:
        return Verdict(verdict.size, verdict.half_width, ESTIMATED, Answer.ENOUGH)
    return verdict


def _largest(x: np.ndarray) -> float:
    return float(np.max(np.abs(x), initial=0.0))


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

    def causes(self) -> list[str]:
        """Return the causes of which some row has a verdict."""
        return [cause for cause in CAUSES if any(cause in row.of for row in self.rows)]
