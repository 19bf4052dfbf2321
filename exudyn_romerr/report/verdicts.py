"""One verdict for each output, component and cause of an error: size, half width, answer, reason and cure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf
from typing import Any, NamedTuple

import numpy as np

from .answers import NO_LIMIT, Answer, Limit, worst
from .causes import FEEDBACK, FURTHER, LINEAR, LINEAR_MODES, LINEAR_STEPS, RESOLVED

ESTIMATED, MEASURED, NONE = "estimated", "measured", "not covered"
COARSE = RESOLVED  # of what a sensor shows: an error of steps above it leaves nothing that could be judged
TOO_COARSE = "steps resolve too little to tell it from their own error"
KNOWN, TO_THE_END = "known {}", "let it run to its end"  # {}: until when
CONTRADICTED = "what was measured and what is estimated are farther apart than both half widths"
SHOWS_NOTHING = "it shows 0 throughout: nothing tells whether it would without an error"
OTHER_SENSORS = "--tolerance NAME=... for the sensors that move"
NUMBERS = ("largest", "extent", "tolerance", "bound", "order", "noise")  # of a row, beside its verdicts
NO_ESTIMATE = "there is no estimate of its error at every instant"


@dataclass(frozen=True)
class Verdict:
    """What is known of one error of one component over the whole run.

    size, half_width : largest absolute value over time and how far that may be off, in the output's unit; None where
    they are not known; a size without a half width: it is that or more. how : "estimated", "measured" or "not
    covered". reason : why there is no number, or why the number does not tell. cure : what makes the error, or the
    half width where that is too large, smaller. floor : what rounding of the input may move, beside both. time : when
    it is largest.
    """

    size: float | None
    half_width: float | None
    how: str
    answer: Answer
    reason: str = ""
    cure: str = ""
    floor: float = 0.0
    time: float | None = None

    @property
    def most(self) -> float:
        """Size, half width and rounding; inf where they are not known."""
        return inf if self.size is None or self.half_width is None else self.size + self.half_width + self.floor

    @property
    def least(self) -> float:
        """Size less half width and rounding; 0 where the size is no number to rely on."""
        return self.size - self.half_width - self.floor if self.is_resolved else 0.0

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
        found = {name: getattr(self, name) for name in ("size", "half_width", "how", "time", "reason")}
        return found | {"answer": self.answer.value, "action": self.cure}


@dataclass(frozen=True)
class Row:
    """What is known of one component of one output in one solve.

    largest : its largest absolute value; None where it was not read. extent : that of all components together, of
    which shares are. of : verdicts by cause, CAUSES that there are, and "sum". limit : its tolerance. axis : "x", "y"
    or "z", "" where that is not known. bound : what its error is at most, None: no finite bound, or not certified.
    scope : what the bound is of, if not of the whole error. order, noise : of runs that measure; None elsewhere.
    estimated : of a measured row, the run's own estimate of the whole error. until : of a run that ended before its
    end, when and by what.
    """

    name: str
    component: int
    solve: int
    unit: str
    largest: float | None
    extent: float | None
    of: dict[str, Verdict]
    limit: Limit = NO_LIMIT
    label: str = ""
    axis: str = ""
    bound: float | None = None
    scope: str = ""
    order: float | None = None
    noise: float | None = None
    estimated: Verdict | None = None
    until: str = ""

    @property
    def tolerance(self) -> float | None:
        """In its unit; None: it has none."""
        return self.limit.size

    @property
    def answer(self) -> Answer:
        """The answer that counts: of the whole error."""
        return self.of["sum"].answer

    @property
    def shows_nothing(self) -> bool:
        """Whether all components of the sensor are 0 throughout."""
        return self.extent == 0

    @property
    def is_coarse(self) -> bool:
        """Whether steps resolve so little that nothing else can be judged."""
        return _is_coarse(self.of.get("step"), self.extent)

    @property
    def is_contradicted(self) -> bool:
        """Whether what was measured and what the run says of itself are farther apart than both half widths."""
        one, other = self.of["sum"], self.estimated
        if other is None or one.half_width is None or other.half_width is None:
            return False
        return max(one.least, other.least) > min(one.most, other.most)

    def share(self, cause: str) -> float:
        """Return size and half width of a cause as a share of the tolerance; where there is none, of the extent."""
        of, one = self.tolerance or self.extent or 1.0, self.of.get(cause)
        if one is None:
            return 0.0
        return (one.most if one.half_width is not None or one.size is None else one.size) / of

    @property
    def shortening(self) -> float:
        """How many times as short steps have to be, by the order that was measured, or the second."""
        return self.share("step") ** (1 / max(self.order or SECOND_ORDER, LOWEST_ORDER))

    def as_json(self) -> dict[str, Any]:
        """Return the row as --json writes it; docs/answer.schema.json has the fields."""
        names = ("name", "component", "solve", "unit", "until", *NUMBERS)
        verdicts = {cause: None if cause not in self.of else self.of[cause].as_json() for cause in (*CAUSES, "sum")}
        return {name: getattr(self, name) for name in names} | {"axis": self.axis or None} | verdicts


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
    own, cure = cure, but.cure or cure
    if not np.isfinite(size + half):
        return Verdict(None, None, how, Answer.NOT_KNOWN, NO_ESTIMATE, cure)
    if limit is None:
        return Verdict(size, half, how, Answer.NO_TOLERANCE, floor=floor)
    answer = Answer.NOT_KNOWN
    if size + half + floor <= limit and not but.why:
        answer, cure = Answer.ENOUGH, ""
    elif size - half - floor > limit and half <= RESOLVED * size and (but.until_then or not but.why):
        answer, cure = Answer.TOO_LARGE, own or cure
    return Verdict(size, half, how, answer, but.why, cure, floor)


def not_covered(reason: str, cure: str = "") -> Verdict:
    """Return the verdict on an error of which nothing is known."""
    return Verdict(None, None, NONE, Answer.NOT_COVERED, reason, cure)


def judged_together(of: dict[str, Verdict], shown: float | None, limit: float | None) -> dict[str, Verdict]:
    """Return verdicts on all causes and the sum beside one another: what one of them says may leave another nothing.

    shown : the extent of the sensor; None: it is 0 whatever the model. limit : what is allowed.
    """
    if limit is None:
        return {cause: replace(one, answer=Answer.NO_TOLERANCE) for cause, one in of.items()}
    if shown is None:
        return {cause: replace(one, answer=Answer.ENOUGH, reason="", cure="") for cause, one in of.items()}
    if shown == 0:  # a share of nothing is nothing; what is too large in the model's units is
        still = {cause for cause, one in of.items() if not limit or one.answer is not Answer.TOO_LARGE}
        return {c: _doubted(one, SHOWS_NOTHING, OTHER_SENSORS) if c in still else one for c, one in of.items()}
    step = of.get("step")
    if _is_coarse(step, shown):
        cure = step.cure if not step.cure or step.cure.endswith(AGAIN) else f"{step.cure}, {AGAIN}"
        told = {"step", "sum"}
        of = {c: replace(x, cure=cure) if c in told else _doubted(x, TOO_COARSE, cure) for c, x in of.items()}
    # the whole is too large where a cause is, unless it is known to be within: both would cancel by chance only
    is_wrong = any(one.answer is Answer.TOO_LARGE for one in of.values())
    if is_wrong and of["sum"].answer in (Answer.NOT_KNOWN, Answer.NOT_COVERED):
        of = of | {"sum": replace(of["sum"], answer=Answer.TOO_LARGE)}
    return of


def until(t: float, end: float, why: str) -> str:
    """Return until when a run went that was to go farther, and what ended it."""
    return f"until {t:.4g} of {end:.4g} s: {why or 'it went no farther'}"


def until_load(factor: float, why: str) -> str:
    """Return up to which load factor a static solve went that failed, and why it did."""
    return f"until load factor {factor:.4g}: {why}"


def until_begun(why: str) -> str:
    """Return that a solve has made no step, and why."""
    return f"until its first step: {why}"


def of_a_run_cut_short(of: dict[str, Verdict], early: str) -> dict[str, Verdict]:
    """Return verdicts on a run that ended early: of the rest nothing is enough, what is too large until then is."""
    return {
        c: _doubted(x, KNOWN.format(early), TO_THE_END) if x.answer is Answer.ENOUGH else x for c, x in of.items()
    }


def _is_coarse(step: Verdict | None, shown: float | None) -> bool:
    """Whether steps resolve so little that nothing else can be judged."""
    if step is None or step.size is None or step.answer is Answer.ENOUGH or not shown:
        return False
    if step.reason and step.how == ESTIMATED:  # what is doubted has a cure of its own
        return False
    return step.size + (step.half_width or 0.0) > COARSE * shown


def _doubted(verdict: Verdict, why: str, cure: str) -> Verdict:
    """The same number, which tells nothing; where nothing is known, or is doubted already, that stays."""
    if verdict.how == NONE or verdict.reason:
        return verdict
    return replace(verdict, answer=Answer.NOT_KNOWN, reason=why, cure=cure)


def beside_estimate(row: Row, estimated: Verdict | None) -> Row:
    """Return a measured row with what the run says of itself: where they contradict each other the worse answers."""
    row = replace(row, estimated=estimated)
    if not row.is_contradicted:
        return row
    whole = row.of["sum"]
    other = judge(estimated.size, estimated.half_width, row.tolerance, ESTIMATED, floor=estimated.floor)
    answer = worst([whole.answer, other.answer])
    why = whole.reason or (CONTRADICTED if answer is not whole.answer else "")
    return replace(row, of=row.of | {"sum": replace(whole, answer=answer, reason=why)})


# --- causes, and what to do about each ---


class Cause(NamedTuple):
    """What makes an error: in words; parts of estimates and of bounds that are of it, checks of these; its cure."""

    title: str
    parts: tuple[str, ...]
    checks: tuple[str, ...]
    cure: str


CHECKS_OF_MODES = ("vectors", LINEAR, FURTHER, LINEAR_MODES, "proved")
CHECKS_OF_STEPS = ("steps", LINEAR_STEPS, "loads", FEEDBACK, "proved")
CAUSES = {
    "modes": Cause("modes", ("basis",), CHECKS_OF_MODES, "more modes"),
    "interfaces": Cause(
        "rigid interfaces",
        ("interfaces",),
        CHECKS_OF_MODES,
        "RBE3 modes; nothing, if the part is as rigid there in reality",
    ),
    "step": Cause("step", ("time step",), CHECKS_OF_STEPS, "shorter steps"),
    "start": Cause(
        "start", ("initial", "jumps"), CHECKS_OF_MODES, "let loads begin smoothly, or start from equilibrium"
    ),
}
ALWAYS = ("modes", "step")  # the two that every user asks; the others only where there is something of them
MORE_VECTORS = "more vectors (auxiliary_modes=...)"
NOT_LINEAR = "for the error is too large to be linear"
AGAIN = "then ask again"  # where an error, or its half width, is too large to tell how far to go
MOST_TIMES = 20  # times shorter steps: what is told at once; farther away nothing says that it gets there
SECOND_ORDER = 2.0  # of Exudyn's implicit solvers, where none was measured
LOWEST_ORDER = 1.0  # in which errors of steps are taken to fall where a lower order was measured; of PreStep
FAR = 3.0  # times the estimate of what it bounds: from there on a bound says that it is far off, not the error
SHARPER = "the bound is {} times the estimate: auxiliary_modes=60, or 130, make it sharper"
OF_CHECKS = {"vectors": MORE_VECTORS, "loads": "smoother loads"}


class Steps(NamedTuple):
    """How many steps a run has taken, None: not known, or not of one size; in which order their error falls."""

    count: int | None
    order: float = SECOND_ORDER


def cure_of(
    cause: str,
    size: float,
    half: float,
    halves: Mapping[str, float],
    limit: float | None,
    steps: Steps,
    beside_steps: Sequence[str] = (),
) -> str:
    """Return what to do about one cause of an error, with a number where there is one.

    size, half : of the error, and its half width. halves : parts of that by check. limit : what is allowed.
    beside_steps : what helps beside shorter steps where these resolve nothing.
    """
    if half <= RESOLVED * size or cause == "interfaces":
        return shorter_steps(size + half, limit, steps) if cause == "step" else CAUSES[cause].cure
    # What starts at once rings in modes that neither steps nor vectors resolve: a smooth start makes half widths 50
    # to 7000 times smaller; shorter steps, damping, vectors 0.5 to 3 times (tests: test_output_estimates.py)
    if beside_steps:
        return beside_steps[0]
    check = max(halves, key=halves.get)
    if check in (LINEAR, LINEAR_MODES, LINEAR_STEPS, FEEDBACK):
        return f"{shorter_steps(size + half, limit, steps) if cause == 'step' else CAUSES[cause].cure}, {NOT_LINEAR}"
    if check == "steps":
        return shorter_steps(size + half, limit, steps, is_resolved=False)
    return OF_CHECKS.get(check, CAUSES[cause].cure)


def cure_of_bound(causes: Mapping[str, np.ndarray]) -> str:
    """Return what lowers the largest cause of a bound beside which there is no estimate."""
    largest = max(causes, key=lambda name: np.max(np.abs(causes[name]), initial=0.0))
    return next(cause.cure for cause in CAUSES.values() if largest in cause.parts)


def shorter_steps(most: float, limit: float | None, steps: Steps, is_resolved: bool = True) -> str:
    """Return how many steps to take: an error falls with a power of the step, its order.

    most : size and half width. limit : what is allowed; None: nothing was asked. is_resolved : whether most is a
    number to go by; else, or where it is far away, the answer is asked for again.
    """
    if limit is None or not 0 < limit < most:
        return CAUSES["step"].cure
    needed = (most / limit) ** (1 / max(steps.order, LOWEST_ORDER))
    is_far = not needed <= MOST_TIMES  # inf, too
    times = MOST_TIMES if is_far else max(ceil(needed), 2)
    said = times_as_short(times, steps)
    return said if is_resolved and not is_far else f"{said}, {AGAIN}"


def times_as_short(times: int, steps: Steps) -> str:
    """Return how many steps are so many times as short, where it is known how many there were."""
    told = f"{times} times as short"
    return f"take steps {told}" if steps.count is None else f"take {steps.count * times:,} steps, {told}"
