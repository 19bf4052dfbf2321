"""Differences of runs of one script, sensor by sensor: what each cause makes, measured."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..report.answers import Answer
from ..report.cures import AGAIN, CAUSES, SECOND_ORDER, Steps, shorter_steps, times_as_short
from ..report.data import UNITS, extents, is_rate, units_of_length
from ..report.verdicts import (
    MEASURED,
    NONE,
    Row,
    Verdict,
    judge,
    judged_together,
    not_covered,
    of_a_run_cut_short,
)
from ..report.wording import largest
from .signals import Signal, signals

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from ..report.answers import Tolerances
    from .child_run import Result

STEPS = {"half": "the run with half the step", "quarter": "the run with a quarter of the step"}
ABOVE_NOISE = 3.0  # times what two equal runs differ by: below it nothing is measurable
LEAST_ORDER = 0.5  # from it on halving leads somewhere
FIRST_ORDER = 1.0  # of what is sampled at steps
# times what half the step does not divide as its order says: what jumps inside steps may leave
OTHER_ORDER = 2.0
TURNS, MOVES = "Rotation", "Position"
NOT_RUN = "{} was not had: {}"
DO_NOT_SHRINK = "differences do not shrink with the step (chaotic, or contact at other instants)"
SHRINK_LITTLE = "differences shrink too little with the step to tell where they lead"
UNSETTLED = "twice the modes once more change as much as before: nothing tells how many more are missing"
OTHER_INSTANTS = "find what happens at other instants with other steps: contact, friction, a controller that switches"
ONE_DIFFERENCE = "ask again, with the runs that are missing"
BY_RBE3 = "compare with modes of RBE3 (computationMode=HCBstaticModeSelection.RBE3)"
NO_STEPS = "a static solve has no time steps"
DISAGREE = (
    "{}: modes {:.1e} by our vectors, {:.1e} +- {:.0e} by the script's own call; the former are a few dozen a body, "
    "what these cannot show is not in it; the latter cannot see rigid interfaces and may not have converged"
)
NO_VECTORS = "no vectors for its bodies, and no number of modes in a call of the script's"


def disagreements(results: Mapping[str, Result]) -> list[str]:
    """Return a line for each sensor of which our vectors and modes by the script's own call tell different things."""
    lines = []
    for signal in signals(results):
        if {"modes", "twice", "four times"} <= {*signal.of}:
            components = [_Component(signal, c) for c in range(signal.of["unchanged"].shape[1])]
            both = [(one.by_vectors(), one.by_call()) for one in components]
            ours, theirs = max(both, key=lambda pair: largest(pair[0][0]))
            sizes, halves = [largest(one[0]) for one in (ours, theirs)], ours[1] + theirs[1]
            if abs(sizes[0] - sizes[1]) > halves:
                lines.append(DISAGREE.format(signal.name, sizes[0], sizes[1], theirs[1]))
    return lines


def rows_of_signal(signal: Signal, tolerances: Tolerances, length: str = "") -> list[Row]:
    """Return a row for every component of a sensor; length : the model's unit of it, if the user gave one."""
    extent = extents(signal.of["unchanged"], signal.shows == MOVES)
    shown = float(extent.max())
    limit, shows = tolerances.limit(signal.name, shown), signal.shows.removesuffix("Local")
    unit = UNITS.get(shows) or units_of_length(length).get(shows.lower(), "")
    is_still = signal.is_static and is_rate(signal.shows) and not signal.until
    rows = []
    for c, axis in enumerate("xyz" if len(extent) == 3 else [""] * len(extent)):
        one = _Component(signal, c)
        of = {cause: verdict for cause in CAUSES if (verdict := one.verdict(cause, limit.size)) is not None}
        of["sum"] = one.whole(limit.size, of)
        if signal.until and not signal.on_purpose:
            of = of_a_run_cut_short(of, signal.until)
        of = judged_together(of, None if is_still else shown, limit.size)
        label, beside = f"{signal.name} {axis}".rstrip(), {"order": one.order, "noise": one.noise}
        own = (signal.name, c, signal.solve, unit, float(extent[c]), shown, of, limit, label, axis)
        rows.append(Row(*own, until=signal.until, **beside))
    return rows


class _Component:
    """One component of one sensor: differences of its runs."""

    def __init__(self, signal: Signal, c: int):
        self._signal, self._turns = signal, signal.shows.startswith(TURNS)
        self._y = {run: values[:, c] for run, values in signal.of.items()}
        self._left = signal.left[c] if signal.left else 0.0
        self.noise = largest(self._change("unchanged", "again")) if "again" in self._y else 0.0
        self.order: float | None = None
        self.differ = 0.0  # largest difference of two runs of which one has half the step of the other
        self.unshrunk = ""  # why no limit is known that these tend to
        self._steps = self._by_steps()

    def _change(self, one: str, other: str) -> np.ndarray:
        """The second run less the first; angles without full turns."""
        change = self._y[other] - self._y[one]
        return change - 2 * np.pi * np.round(change / (2 * np.pi)) * self._turns

    def _floor(self) -> float:
        return ABOVE_NOISE * self.noise

    def _by_steps(self) -> tuple[np.ndarray, float] | str:
        """What shorter steps change (T,), as far as runs tell, and its half width; or why that is not known."""
        if self._signal.is_static:
            return NO_STEPS
        missing = [run for run in STEPS if run not in self._y]
        if missing and "half" in self._y:  # one difference is had, and no order
            self.differ, self.unshrunk = largest(self._change("unchanged", "half")), self._not_run(missing[0])
            return self._change("unchanged", "half"), math.inf
        if missing:
            return self._not_run(missing[0])
        first, second = self._change("unchanged", "half"), self._change("half", "quarter")
        d1, d2 = largest(first), largest(second)
        if not np.isfinite(d1 + d2):
            return DO_NOT_SHRINK
        self.differ = max(d1, d2)
        if d2 <= max(self._floor(), np.finfo(float).tiny):
            return first + second, self._floor() + d2
        self.order = math.log2(d1 / d2) if d1 > 0 else 0.0
        if not LEAST_ORDER <= self.order:
            self.unshrunk = DO_NOT_SHRINK if d2 >= d1 else SHRINK_LITTLE
            return first + second, max(d1, d2) + self._floor()
        least = FIRST_ORDER if self._signal.is_sampled else SECOND_ORDER
        left = second / (2 ** min(max(self.order, least), SECOND_ORDER) - 1)  # what steps shorter still would change
        ends = first / 2**least, first / 2**SECOND_ORDER
        otherwise = largest(second - np.clip(second, np.minimum(*ends), np.maximum(*ends)))
        return first + second + left, largest(left) + min(OTHER_ORDER * otherwise, d2) + self._floor()

    def _not_run(self, run: str) -> str:
        return NOT_RUN.format(STEPS[run], self._signal.missing.get(run, "it was not made"))

    def by_vectors(self) -> tuple[np.ndarray, float] | None:
        """What our vectors that keep interfaces change; half width: what is measurable, and what they leave out."""
        found = self._by_modes("modes", "unchanged")
        return found and (found[0], found[1] + self._left)

    def by_call(self) -> tuple[np.ndarray, float] | None:
        """What four times the modes by the script's own call change; half width: what from two to four times does."""
        if "four times" in self._y:
            last = largest(self._change("twice", "four times")) if "twice" in self._y else 0.0
            return self._change("unchanged", "four times"), last + self._floor()
        if "twice" in self._y:
            change = self._change("unchanged", "twice")
            return change, largest(change)  # nothing tells how much more is missing
        return None

    def _unsettled(self) -> float:
        """How far runs with more modes are apart where doubling them again changes as much; 0: they settle."""
        if not (self._is_by_call and {"twice", "four times"} <= {*self._y}):
            return 0.0
        first, last = (largest(self._change(*pair)) for pair in (("unchanged", "twice"), ("twice", "four times")))
        return max(first, last) if last > max(self._floor(), first / 2**LEAST_ORDER) else 0.0

    def _by_modes(self, run: str, before: str) -> tuple[np.ndarray, float] | None:
        """What a run with more modes changes, and its half width: what is measurable at all."""
        return (self._change(before, run), self._floor()) if run in self._y and before in self._y else None

    def modes(self) -> tuple[np.ndarray, float] | None:
        """What more modes change: our vectors beside those of the script, or more by the script's own call."""
        return self.by_call() if self._is_by_call else self.by_vectors()

    @property
    def _is_by_call(self) -> bool:
        return self._signal.by_call or self.by_vectors() is None

    def interfaces(self) -> tuple[np.ndarray, float] | None:
        """What vectors that free rigid interfaces change."""
        return None if self._signal.unseen else self._by_modes("free", "modes")

    @cached_property
    def _apart(self) -> np.ndarray:
        """How else vectors change the run with half the step: what they and shorter steps do not add up to (T,).

        With shorter steps any of the causes may change by as much.
        """
        finest = "free" if "free" in self._y else "modes"
        if not {"all", "half", finest} <= {*self._y}:
            return np.zeros(len(self._signal.t))
        both = self._change("unchanged", "all") - self._change("unchanged", "half")
        return both - self._change("unchanged", finest)

    def verdict(self, cause: str, limit: float | None) -> Verdict | None:
        """The verdict on one cause; None: there is nothing of it."""
        if cause == "step":
            return self._of_steps(limit)
        if cause == "start" or not self._signal.has_bodies:
            return None
        found = {"modes": self.modes, "interfaces": self.interfaces}[cause]()
        if found is None:
            return self._unmeasured(cause)
        otherwise = 0.0 if cause == "modes" and self._is_by_call else largest(self._apart)
        verdict = self._judged((found[0], found[1] + otherwise), limit, CAUSES[cause].cure)
        differ = self._unsettled() if cause == "modes" else 0.0
        return _at_least_apart(verdict, differ, limit, UNSETTLED, CAUSES[cause].cure) if differ else verdict

    def _judged(self, found: tuple[np.ndarray, float], limit: float | None, cure: str = "") -> Verdict:
        time = float(self._signal.t[np.argmax(np.abs(found[0]))])
        return replace(judge(largest(found[0]), found[1], limit, MEASURED, cure), time=time)

    def _unmeasured(self, cause: str) -> Verdict | None:
        """Why nothing was measured of a cause; None: there is nothing of it."""
        missing = self._signal.missing
        if cause == "interfaces":
            if self._signal.unseen:
                return not_covered(self._signal.unseen, BY_RBE3)
            why = missing.get("free")
            return None if why is None else not_covered(NOT_RUN.format("the run with free interfaces", why))
        why = missing.get("four times" if self._signal.by_call else "modes") or missing.get("twice")
        return not_covered(NOT_RUN.format("the run with more modes", why) if why else NO_VECTORS)

    def _of_steps(self, limit: float | None) -> Verdict | None:
        """The verdict on the step; where a run and one with half its step differ by twice the limit, one is wrong."""
        if isinstance(self._steps, str):
            return None if self._steps == NO_STEPS else not_covered(self._steps)
        steps = Steps(self._signal.steps, self.order or SECOND_ORDER)
        if not np.isfinite(self._steps[1]):
            verdict = Verdict(largest(self._steps[0]), None, MEASURED, Answer.NOT_KNOWN)
            told = _at_least_apart(verdict, self.differ, limit, self.unshrunk, ONE_DIFFERENCE)
            cure = shorter_steps(2 * self.differ, limit, steps, False)
            return replace(told, cure=cure) if told.answer is Answer.TOO_LARGE else told
        most = largest(self._steps[0]) + self._steps[1]
        verdict = self._judged(self._steps, limit, shorter_steps(most, limit, steps))
        again = f"{times_as_short(4, steps)}, {AGAIN}"
        cure = OTHER_INSTANTS if self.unshrunk == DO_NOT_SHRINK else again
        if self.unshrunk:
            return _at_least_apart(verdict, self.differ, limit, self.unshrunk, cure)
        is_off = limit is not None and verdict.answer is Answer.NOT_KNOWN and self.differ > 2 * limit
        return replace(verdict, answer=Answer.TOO_LARGE) if is_off else verdict

    def whole(self, limit: float | None, of: Mapping[str, Verdict]) -> Verdict:
        """The verdict on all together, with what both do not add up to; half width: of each, and as much again."""
        unknown = [verdict for verdict in of.values() if verdict.half_width is None]
        if unknown:
            return self._at_least(of.values(), unknown[0])
        parts = [self.modes(), self.interfaces()] if self._signal.has_bodies else []
        parts += [] if self._signal.is_static else [self._steps]
        total = sum(part[0] for part in parts if part is not None) + np.zeros(len(self._signal.t))
        half = sum(part[1] for part in parts if part is not None)
        apart = self._apart
        total, half = total + apart, half + largest(apart)  # that is at half the step; shorter ones may add as much
        cause = max(of, key=lambda cause: of[cause].most, default="modes")
        return self._judged((total, half), limit, of[cause].cure or CAUSES[cause].cure if of else "")

    def _at_least(self, causes: Iterable[Verdict], unknown: Verdict) -> Verdict:
        """The whole where one cause is not known: at least as large as the largest that is known."""
        known = [verdict for verdict in causes if verdict.size is not None]
        sizes = [verdict.size for verdict in known]
        is_wrong = any(verdict.answer is Answer.TOO_LARGE for verdict in known)
        answer = Answer.TOO_LARGE if is_wrong else unknown.answer
        how = MEASURED if known else NONE
        return Verdict(max(sizes, default=None), None, how, answer, unknown.reason, unknown.cure)


def _at_least_apart(verdict: Verdict, differ: float, limit: float | None, reason: str, cure: str) -> Verdict:
    """The verdict where no limit is known that runs tend to: too large if two of them differ by twice the tolerance.

    One of these is off by more than it then, most likely the coarser one. differ : by how much they do.
    """
    if verdict.answer in (Answer.ENOUGH, Answer.NO_TOLERANCE):
        return verdict
    answer = Answer.TOO_LARGE if limit is not None and differ > 2 * limit else Answer.NOT_KNOWN
    return replace(verdict, size=max(differ, verdict.size), half_width=None, answer=answer, reason=reason, cure=cure)
