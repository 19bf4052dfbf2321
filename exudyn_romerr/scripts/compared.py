"""What all sensors show in the runs of one script, at common instants, and what each cause makes: measured."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from ..report.answers import Answer, Tolerances
from ..report.data import UNITS, extents, is_rate, units_of_length
from ..report.verdicts import (
    AGAIN,
    CAUSES,
    LOWEST_ORDER,
    MEASURED,
    NONE,
    SECOND_ORDER,
    Row,
    Steps,
    Verdict,
    judge,
    judged_together,
    not_covered,
    of_a_run_cut_short,
    shorter_steps,
    times_as_short,
)
from ..report.wording import largest
from .child_run import Result, estimates

FINER = ("half", "quarter", "all")  # runs that take shorter steps
SAME_TIME = 1e-9  # of the end time: solvers add up their steps
OTHER_SENSORS = "the script has other sensors or solves in it"
SAME_STEPS = "it took no shorter steps: the script sets its steps by itself, at each call of the solver"
OF_CALL = "rigid interfaces are in no run: modes are more by the script's own call, which cannot see them"
OF_STRESS = "stress is measured by modes of the script's own call, which cannot see rigid interfaces"
STRESS = ("Stress", "Strain")  # begin what sensors show of stress modes, which our vectors have none of
SHORTER = 1e-6  # of the end time: a run that ends so much earlier has not gone all the way
ENDED = "it ended at t = {:.6g} s, the unchanged run at {:.6g} s"
STEPS = {"half": "the run with half the step", "quarter": "the run with a quarter of the step"}
ABOVE_NOISE = 3.0  # times what two equal runs differ by: below it nothing is measurable
LEAST_ORDER = 0.5  # from it on halving leads somewhere
OTHER_ORDER = 2.0  # times what half the step does not divide as its order says: what jumps inside steps may leave
TURNS, MOVES = "Rotation", "Position"
NOT_RUN = "{} was not had: {}"
DO_NOT_SHRINK = "differences do not shrink with the step (chaotic, or contact at other instants)"
SHRINK_LITTLE = "differences shrink too little with the step to tell where they lead"
UNSETTLED = "twice the modes once more change as much as before: nothing tells how many more are missing"
OTHER_INSTANTS = "find what happens at other instants with other steps: contact, friction, a controller that switches"
ONE_DIFFERENCE = "ask again, with the runs that are missing"
BY_RBE3 = "compare with modes of RBE3 (computationMode=HCBstaticModeSelection.RBE3)"
DISAGREE = (
    "{}: modes {:.1e} by our vectors, {:.1e} +- {:.0e} by the script's own call; the former are a few dozen a body, "
    "what these cannot show is not in it; the latter cannot see rigid interfaces and may not have converged"
)
NO_VECTORS = "no vectors for its bodies, and no number of modes in a call of the script's"


class Signal(NamedTuple):
    """One sensor of one solve in all runs: times (T,), values (T, r) at the instants of the unchanged run, by run.

    missing : why other runs have none. has_bodies : whether the script has reduced bodies. left : for each component
    what the run with most vectors says of itself that these leave out, too; 0 where it says nothing. by_call :
    whether modes are to be measured by those of the script's own call; unseen : why rigid interfaces are in no run,
    empty: they are, or there are none. steps : of the unchanged run, None: not of one size. until, on_purpose : where
    it ended early, see Recorded. is_sampled : whether PreStep functions act at steps, which is of first order.
    """

    name: str
    shows: str
    solve: int
    is_static: bool
    t: np.ndarray
    of: dict[str, np.ndarray]
    missing: dict[str, str]
    has_bodies: bool = True
    left: tuple[float, ...] = ()
    by_call: bool = False
    unseen: str = ""
    steps: int | None = None
    until: str = ""
    on_purpose: bool = False
    is_sampled: bool = False


def signals(results: Mapping[str, Result]) -> list[Signal]:
    """Return what all sensors show in all runs; results : by name, "unchanged" among them."""
    solves = enumerate(results["unchanged"].solves)
    return [_signal(results, i, j, name, solve) for i, solve in solves for j, name in enumerate(_unique(solve))]


def _signal(results: Mapping[str, Result], i: int, j: int, name: str, solve: dict[str, Any]) -> Signal:
    data, base = _shown(solve, j), results["unchanged"]
    t, of, missing = data[:, 0], {"unchanged": data[:, 1:]}, {}
    for run, result in (one for one in results.items() if one[0] not in of):
        if why := _why_missing(run, result, i, j, solve):
            missing[run] = why
        else:
            of[run] = _at(t, _shown(result.solves[i], j))
    is_stress = solve["shows"][j].startswith(STRESS)
    return Signal(
        name,
        solve["shows"][j],
        i,
        solve["kind"] == "static",
        t,
        of,
        missing,
        bool(base.facts["bodies"]),
        _left(results, name, i, data.shape[1] - 1),
        is_stress or bool(base.facts.get("without_vectors")),
        _unseen(base, is_stress),
        _steps(solve, t),
        solve.get("until", ""),
        solve.get("on_purpose", False),
        base.facts.get("has_controllers", False),
    )


def _shown(solve: dict[str, Any], j: int) -> np.ndarray:
    """What a sensor showed; where a solve failed, without the last row, which may be of the step that did."""
    data = solve["data"][j]
    return data[: max(len(data) - 1, 1)] if solve.get("until") and not solve["on_purpose"] else data


def _steps(solve: dict[str, Any], t: np.ndarray) -> int | None:
    """How many steps a solve was to take; None: not of one size, or not known."""
    if not solve.get("fixed", True) or len(t) < 2:
        return None
    return int(solve["count"]) if solve.get("until") else len(np.unique(t)) - 1


def _why_missing(run: str, result: Result, i: int, j: int, solve: dict[str, Any]) -> str:
    """Why a run says nothing of a sensor; empty: it does."""
    if result.failure:
        return result.failure
    if len(result.solves) <= i or result.solves[i]["names"] != solve["names"]:
        return OTHER_SENSORS
    data, t = result.solves[i]["data"][j], _shown(solve, j)[:, 0]
    if data[-1, 0] < t[-1] - SHORTER * abs(t[-1]):
        return ENDED.format(data[-1, 0], t[-1])
    if run in FINER and solve["kind"] != "static" and len(data) <= len(t):
        return SAME_STEPS
    return ""


def _unseen(base: Result, is_stress: bool) -> str:
    """Why rigid interfaces, if there may be some, are in no run."""
    if base.vectors and not base.facts.get("without_vectors"):
        is_rigid = any(not keeps.all() for _, keeps in base.vectors.values())
        return OF_STRESS if is_stress and is_rigid else ""
    return OF_CALL if base.facts["bodies"] and base.facts.get("may_be_rigid", True) else ""


def _left(results: Mapping[str, Result], name: str, solve: int, count: int) -> tuple[float, ...]:
    """What vectors leave out of each component; 0 where nothing is said of it."""
    if results["unchanged"].solves[solve].get("until"):  # an estimate of a failed step is one of nothing
        return (0.0,) * count
    of = estimates(results, "free", "modes")
    found = [of.get((name, c, solve), {}).get("modes") for c in range(count)]
    return tuple(0.0 if one is None or one.how == NONE else one.most for one in found)


def _at(t: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Values at times t: those stored where these are stored, else on a cubic spline."""
    own = data[:, 0]
    index = np.clip(np.searchsorted(own, t - SAME_TIME * max(abs(t[-1]), 1e-300)), 0, len(own) - 1)
    if np.all(np.abs(own[index] - t) <= 10 * SAME_TIME * max(abs(t[-1]), 1e-300)) or len(own) < 4:
        return data[index, 1:]
    keep = np.append(True, np.diff(own) > 0)
    return CubicSpline(own[keep], data[keep, 1:])(t)


def _unique(solve: dict[str, Any]) -> list[str]:
    names, numbers = solve["names"], solve["numbers"]
    return [f"{name} (sensor {i})" if names.count(name) > 1 else name for name, i in zip(names, numbers, strict=True)]


def disagreements(results: Mapping[str, Result]) -> list[str]:
    """Return a line for each sensor of which our vectors and modes by the script's own call tell different things."""
    lines = []
    for signal in signals(results):
        if {"modes", "twice", "four times"} <= {*signal.of}:
            components = [_Component(signal, c) for c in range(signal.of["unchanged"].shape[1])]
            both = [(one.by_vectors, one.by_call) for one in components]
            ours, theirs = max(both, key=lambda pair: pair[0].size)
            if abs(ours.size - theirs.size) > ours.half + theirs.half:
                lines.append(DISAGREE.format(signal.name, ours.size, theirs.size, theirs.half))
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
        one = _Component(signal, c, limit.size)
        of = one.verdicts()
        if signal.until and not signal.on_purpose:
            of = of_a_run_cut_short(of, signal.until)
        of = judged_together(of, None if is_still else shown, limit.size)
        label, beside = f"{signal.name} {axis}".rstrip(), {"order": one.order, "noise": one.noise}
        own = (signal.name, c, signal.solve, unit, float(extent[c]), shown, of, limit, label, axis)
        rows.append(Row(*own, until=signal.until, **beside))
    return rows


class _Change(NamedTuple):
    """What differs over time (T,), as far as runs tell; half : how far that may be off."""

    y: np.ndarray
    half: float

    @property
    def size(self) -> float:
        return largest(self.y)


class _Component:
    """One component of one sensor: differences of its runs, and verdicts on them beside a limit."""

    def __init__(self, signal: Signal, c: int, limit: float | None = None):
        self._signal, self._limit = signal, limit
        self._y = {run: values[:, c] for run, values in signal.of.items()}
        self.noise = largest(self._change("unchanged", "again")) if "again" in self._y else 0.0
        self._floor = ABOVE_NOISE * self.noise
        self.order: float | None = None
        self._differ = 0.0  # largest difference of two runs of which one has half the step of the other
        self._unshrunk = ""  # why no limit is known that these tend to
        self._steps = None if signal.is_static else self._by_steps()
        # our vectors that keep interfaces, and what they leave out; or more modes by the script's own call
        left = signal.left[c] if signal.left else 0.0
        self.by_vectors, self.by_call = self._between("unchanged", "modes", left), self._by_call()
        self._is_by_call = signal.by_call or self.by_vectors is None
        self._modes = self.by_call if self._is_by_call else self.by_vectors
        self._interfaces = None if signal.unseen else self._between("modes", "free")

    def _change(self, one: str, other: str) -> np.ndarray:
        """The second run less the first; angles without full turns."""
        change, turns = self._y[other] - self._y[one], self._signal.shows.startswith(TURNS)
        return change - 2 * np.pi * np.round(change / (2 * np.pi)) * turns

    def _between(self, one: str, other: str, left: float = 0.0) -> _Change | None:
        """What a run with more modes changes, and what is measurable at all."""
        return _Change(self._change(one, other), self._floor + left) if {one, other} <= {*self._y} else None

    def _by_steps(self) -> _Change | str:
        """What shorter steps change; or why that is not known."""
        missing = [run for run in STEPS if run not in self._y]
        if missing:
            why = NOT_RUN.format(STEPS[missing[0]], self._signal.missing.get(missing[0], "it was not made"))
            if "half" not in self._y:
                return why
            found = _Change(self._change("unchanged", "half"), math.inf)  # one difference is had, and no order
            self._differ, self._unshrunk = found.size, why
            return found
        first, second = self._change("unchanged", "half"), self._change("half", "quarter")
        d1, d2 = largest(first), largest(second)
        if not np.isfinite(d1 + d2):
            return DO_NOT_SHRINK
        self._differ = max(d1, d2)
        if d2 <= max(self._floor, np.finfo(float).tiny):
            return _Change(first + second, self._floor + d2)
        self.order = math.log2(d1 / d2) if d1 > 0 else 0.0
        if not LEAST_ORDER <= self.order:
            self._unshrunk = DO_NOT_SHRINK if d2 >= d1 else SHRINK_LITTLE
            return _Change(first + second, max(d1, d2) + self._floor)
        least = LOWEST_ORDER if self._signal.is_sampled else SECOND_ORDER
        left = second / (2 ** min(max(self.order, least), SECOND_ORDER) - 1)  # what steps shorter still would change
        ends = first / 2**least, first / 2**SECOND_ORDER
        otherwise = largest(second - np.clip(second, np.minimum(*ends), np.maximum(*ends)))
        return _Change(first + second + left, largest(left) + min(OTHER_ORDER * otherwise, d2) + self._floor)

    def _by_call(self) -> _Change | None:
        """What four times the modes by the script's own call change; half width: what from two to four times does."""
        if "four times" in self._y:
            last = largest(self._change("twice", "four times")) if "twice" in self._y else 0.0
            return _Change(self._change("unchanged", "four times"), last + self._floor)
        if "twice" in self._y:
            change = self._change("unchanged", "twice")
            return _Change(change, largest(change))  # nothing tells how much more is missing
        return None

    def _unsettled(self) -> float:
        """How far runs with more modes are apart where doubling them again changes as much; 0: they settle."""
        if not (self._is_by_call and {"twice", "four times"} <= {*self._y}):
            return 0.0
        first, last = (largest(self._change(*pair)) for pair in (("unchanged", "twice"), ("twice", "four times")))
        return max(first, last) if last > max(self._floor, first / 2**LEAST_ORDER) else 0.0

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

    def verdicts(self) -> dict[str, Verdict]:
        """By cause, where there is something of it, and of the sum."""
        found = {"modes": self._of_modes(), "interfaces": self._of_interfaces(), "step": self._of_steps()}
        of = {cause: verdict for cause, verdict in found.items() if verdict is not None}
        return of | {"sum": self._of_all(of)}

    def _judged(self, found: _Change, cure: str = "") -> Verdict:
        time = float(self._signal.t[np.argmax(np.abs(found.y))])
        return replace(judge(found.size, found.half, self._limit, MEASURED, cure), time=time)

    def _of_modes(self) -> Verdict | None:
        found, missing = self._modes, self._signal.missing
        if not self._signal.has_bodies:
            return None
        if found is None:
            why = missing.get("four times" if self._signal.by_call else "modes") or missing.get("twice")
            return not_covered(NOT_RUN.format("the run with more modes", why) if why else NO_VECTORS)
        otherwise = 0.0 if self._is_by_call else largest(self._apart)
        verdict = self._judged(_Change(found.y, found.half + otherwise), CAUSES["modes"].cure)
        differ = self._unsettled()
        return self._at_least_apart(verdict, differ, UNSETTLED, CAUSES["modes"].cure) if differ else verdict

    def _of_interfaces(self) -> Verdict | None:
        found, why = self._interfaces, self._signal.missing.get("free")
        if not self._signal.has_bodies:
            return None
        if found is not None:
            return self._judged(_Change(found.y, found.half + largest(self._apart)), CAUSES["interfaces"].cure)
        if self._signal.unseen:
            return not_covered(self._signal.unseen, BY_RBE3)
        return None if why is None else not_covered(NOT_RUN.format("the run with free interfaces", why))

    def _of_steps(self) -> Verdict | None:
        """Where a run and one with half its step differ by twice the limit, one is wrong."""
        found, differ, limit = self._steps, self._differ, self._limit
        if not isinstance(found, _Change):
            return found and not_covered(found)
        steps = Steps(self._signal.steps, self.order or SECOND_ORDER)
        if not np.isfinite(found.half):
            verdict = Verdict(found.size, None, MEASURED, Answer.NOT_KNOWN)
            told = self._at_least_apart(verdict, differ, self._unshrunk, ONE_DIFFERENCE)
            cure = shorter_steps(2 * differ, limit, steps, False)
            return replace(told, cure=cure) if told.answer is Answer.TOO_LARGE else told
        verdict = self._judged(found, shorter_steps(found.size + found.half, limit, steps))
        if self._unshrunk:
            again = f"{times_as_short(4, steps)}, {AGAIN}"
            cure = OTHER_INSTANTS if self._unshrunk == DO_NOT_SHRINK else again
            return self._at_least_apart(verdict, differ, self._unshrunk, cure)
        is_off = limit is not None and verdict.answer is Answer.NOT_KNOWN and differ > 2 * limit
        return replace(verdict, answer=Answer.TOO_LARGE) if is_off else verdict

    def _at_least_apart(self, verdict: Verdict, differ: float, reason: str, cure: str) -> Verdict:
        """The verdict where no limit is known that runs tend to: too large if two differ by twice the tolerance.

        One of these is off by more than it then, most likely the coarser one. differ : by how much they do.
        """
        if verdict.answer in (Answer.ENOUGH, Answer.NO_TOLERANCE):
            return verdict
        is_off = self._limit is not None and differ > 2 * self._limit
        answer, size = Answer.TOO_LARGE if is_off else Answer.NOT_KNOWN, max(differ, verdict.size)
        return replace(verdict, size=size, half_width=None, answer=answer, reason=reason, cure=cure)

    def _of_all(self, of: Mapping[str, Verdict]) -> Verdict:
        """With what both do not add up to; half width: of each, and as much again."""
        unknown = [verdict for verdict in of.values() if verdict.half_width is None]
        if unknown:
            return at_least(of.values(), unknown[0])
        parts = [self._modes, self._interfaces] if self._signal.has_bodies else []
        parts = [part for part in (*parts, self._steps) if part is not None]
        # apart : at half the step; shorter ones may add as much
        total = sum((part.y for part in parts), self._apart)
        half = sum((part.half for part in parts), largest(self._apart))
        cause = max(of, key=lambda cause: of[cause].most, default="modes")
        return self._judged(_Change(total, half), of[cause].cure or CAUSES[cause].cure if of else "")


def at_least(causes: Iterable[Verdict], unknown: Verdict) -> Verdict:
    """Return the verdict on the whole where one cause is not known: it is as large as the largest that is known."""
    known = [verdict for verdict in causes if verdict.size is not None]
    largest = max(known, key=lambda verdict: verdict.size, default=not_covered(unknown.reason))
    is_wrong = any(verdict.answer is Answer.TOO_LARGE for verdict in known)
    answer = Answer.TOO_LARGE if is_wrong else unknown.answer
    return Verdict(largest.size, None, largest.how, answer, unknown.reason, unknown.cure)
