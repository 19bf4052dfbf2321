"""Differences of runs of one script, sensor by sensor, at common instants: what each cause makes, measured."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from ..report.answers import Answer
from ..report.cures import OF_CAUSES
from ..report.data import UNITS
from ..report.verdicts import CAUSES, MEASURED, Row, judge, not_covered

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..report.answers import Tolerances
    from .child_run import Result

SAME_TIME = 1e-9  # of the end time: solvers add up their steps
ABOVE_NOISE = 3.0  # times what two equal runs differ by: below it nothing is measurable
LEAST_ORDER, MOST_ORDER = 0.5, 6.0  # between them halving fits an order; Exudyn's methods have 1 to 5
TURNS, MOVES = "Rotation", "Position"
NOT_RUN = "{} was not had: {}"
OTHER_SENSORS = "the script has other sensors or solves in it"
DO_NOT_SHRINK = "differences do not shrink with the step (chaotic, or contact at other instants)"
NO_STEPS = "a static solve has no time steps"
SHORTER = 1e-6  # of the end time: a run that ends so much earlier has not gone all the way
ENDED = "it ended at t = {:.6g} s, the unchanged run at {:.6g} s"
DISAGREE = (
    "{}: modes {:.1e} by our vectors, {:.1e} +- {:.0e} by the script's own call; the former are a few dozen a body, "
    "what these cannot show is not in it; the latter cannot see rigid interfaces and may not have converged"
)
NO_VECTORS = "no vectors for its bodies, and no number of modes in a call of the script's"


class Signal(NamedTuple):
    """One sensor of one solve in all runs: times (T,), values (T, r) at the instants of the unchanged run, by run.

    missing : why other runs have none. has_bodies : whether the script has reduced bodies. left : for each component
    what the run with most vectors says of itself that these leave out, too; 0 where it says nothing.
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


def signals(results: Mapping[str, Result]) -> list[Signal]:
    """Return what all sensors show in all runs; results : by name, "unchanged" among them."""
    found, base = [], results["unchanged"].solves
    for i, solve in enumerate(base):
        names = _unique(solve)
        for j, name in enumerate(names):
            found.append(_signal(results, i, j, name, solve))
    return found


def _signal(results: Mapping[str, Result], i: int, j: int, name: str, solve: dict[str, Any]) -> Signal:
    data = solve["data"][j]
    t, of, missing = data[:, 0], {"unchanged": data[:, 1:]}, {}
    late = t[-1] - SHORTER * abs(t[-1])
    for run, result in results.items():
        if run == "unchanged":
            continue
        if result.failure:
            missing[run] = result.failure
        elif len(result.solves) <= i or result.solves[i]["names"] != solve["names"]:
            missing[run] = OTHER_SENSORS
        elif (end := result.solves[i]["data"][j][-1, 0]) < late:
            missing[run] = ENDED.format(end, t[-1])
        else:
            of[run] = _at(t, result.solves[i]["data"][j])
    has_bodies = bool(results["unchanged"].told["bodies"])
    is_static, left = solve["kind"] == "static", _left(results, name, i, data.shape[1] - 1)
    return Signal(name, solve["shows"][j], i, is_static, t, of, missing, has_bodies, left)


def estimates(result: Result | None) -> list[dict[str, Any]]:
    """Return what a watched run says of itself, as --json has it."""
    return [] if result is None else result.told.get("rows", [])


def _left(results: Mapping[str, Result], name: str, solve: int, count: int) -> tuple[float, ...]:
    rows = estimates(results.get("free") or results.get("modes"))
    of = {row["component"]: row["modes"] for row in rows if (row["name"], row["solve"]) == (name, solve)}
    return tuple((of[c]["size"] or 0.0) if of.get(c) else 0.0 for c in range(count))


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


def two_ways(results: Mapping[str, Result]) -> list[str]:
    """Return a line for each sensor of which our vectors and modes by the script's own call tell different things."""
    lines = []
    for signal in signals(results):
        if {"modes", "twice", "four times"} <= {*signal.of}:
            components = [_Component(signal, c) for c in range(signal.of["unchanged"].shape[1])]
            both = [(one.by_vectors(), one.by_call()) for one in components]
            ours, theirs = max(both, key=lambda pair: _largest(pair[0][0]))
            sizes, halves = [_largest(one[0]) for one in (ours, theirs)], ours[1] + theirs[1]
            if abs(sizes[0] - sizes[1]) > halves:
                lines.append(DISAGREE.format(signal.name, sizes[0], sizes[1], theirs[1]))
    return lines


def rows_of_signal(signal: Signal, tolerances: Tolerances) -> list[Row]:
    """Return a row for every component of a sensor."""
    y = signal.of["unchanged"]
    extents = np.ptp(y, axis=0) if signal.shows == MOVES else np.abs(y).max(axis=0, initial=0.0)
    tolerance = tolerances.of(signal.name)
    limit = None if tolerance is None else tolerance.of(float(extents.max()))
    return [_row(signal, c, float(extents[c]), limit, tolerances.is_given) for c in range(y.shape[1])]


def _row(signal: Signal, c: int, largest: float, limit: float | None, is_asked: bool) -> Row:
    one = _Component(signal, c)
    of = {cause: verdict for cause in CAUSES if (verdict := one.verdict(cause, limit)) is not None}
    of["sum"] = one.whole(limit, of)
    return Row(
        signal.name,
        c,
        signal.solve,
        UNITS.get(signal.shows.removesuffix("Local"), ""),
        largest,
        of,
        tolerance=limit,
        order=one.order,
        noise=one.noise,
        label=f"{signal.name} {'xyz'[c]}" if signal.of["unchanged"].shape[1] == 3 else signal.name,
        is_asked=is_asked,
    )


class _Component:
    """One component of one sensor: differences of its runs."""

    def __init__(self, signal: Signal, c: int):
        self._signal, self._turns = signal, signal.shows.startswith(TURNS)
        self._y = {run: values[:, c] for run, values in signal.of.items()}
        self._left = signal.left[c] if signal.left else 0.0
        self.noise = _largest(self._change("unchanged", "again")) if "again" in self._y else 0.0
        self.order: float | None = None
        self.shrinks = True
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
        for run, name in (("half", "the run with half the step"), ("quarter", "the run with a quarter of the step")):
            if run not in self._y:
                return NOT_RUN.format(name, self._signal.missing.get(run, "it was not made"))
        first, second = self._change("unchanged", "half"), self._change("half", "quarter")
        d1, d2 = _largest(first), _largest(second)
        if not np.isfinite(d1 + d2):
            return DO_NOT_SHRINK
        if d2 <= max(self._floor(), np.finfo(float).tiny):
            return first + second, self._floor() + d2
        self.order = math.log2(d1 / d2) if d1 > 0 else 0.0
        if not LEAST_ORDER <= self.order:
            self.shrinks = False  # all that is known: what they differ by, and no limit that they tend to
            return first + second, max(d1, d2) + self._floor()
        left = second / (2 ** min(self.order, MOST_ORDER) - 1)  # Richardson: what steps shorter still would change
        return first + second + left, _largest(left) + self._floor()

    def by_vectors(self) -> tuple[np.ndarray, float] | None:
        """What our vectors that keep interfaces change; half width: what is measurable, and what they leave out."""
        found = self._by_modes("modes", "unchanged")
        return found and (found[0], found[1] + self._left)

    def by_call(self) -> tuple[np.ndarray, float] | None:
        """What four times the modes by the script's own call change; half width: what from two to four times does."""
        if "four times" in self._y:
            last = _largest(self._change("twice", "four times")) if "twice" in self._y else 0.0
            return self._change("unchanged", "four times"), last + self._floor()
        if "twice" in self._y:
            change = self._change("unchanged", "twice")
            return change, _largest(change)  # nothing tells how much more is missing
        return None

    def _by_modes(self, run: str, before: str) -> tuple[np.ndarray, float] | None:
        """What a run with more modes changes, and its half width: what is measurable at all."""
        return (self._change(before, run), self._floor()) if run in self._y and before in self._y else None

    def modes(self) -> tuple[np.ndarray, float] | None:
        """What more modes change: our vectors beside those of the script, or more by the script's own call."""
        return self.by_vectors() or self.by_call()

    def verdict(self, cause: str, limit: float | None) -> Any:
        """The verdict on one cause; None: there is nothing of it."""
        if cause == "modes":
            found = self.modes()
            if found is None and not self._signal.has_bodies:
                return None
            if found is None:
                missing = self._signal.missing.get("modes") or self._signal.missing.get("twice")
                return not_covered(NOT_RUN.format("the run with more modes", missing) if missing else NO_VECTORS)
        elif cause == "interfaces":
            found = self._by_modes("free", "modes")
        elif cause == "step":
            found = self._steps
        else:
            return None
        if found is None or isinstance(found, str):
            return None if found is None or found == NO_STEPS else not_covered(found)
        verdict = judge(_largest(found[0]), found[1], limit, MEASURED, OF_CAUSES[cause])
        if cause == "step" and not self.shrinks and verdict.answer is not Answer.ENOUGH:
            return replace(verdict, answer=Answer.NOT_KNOWN, reason=DO_NOT_SHRINK)
        return verdict

    def whole(self, limit: float | None, of: Mapping[str, Any]) -> Any:
        """The verdict on all together, with what both do not add up to; half width: of each, and as much again."""
        parts = [self.modes(), self._by_modes("free", "modes")] if self._signal.has_bodies else []
        if not self._signal.is_static:
            if isinstance(self._steps, str) or of["step"].reason:
                return of["step"]
            parts.append(self._steps)
        if parts[:1] == [None]:
            return of["modes"]
        total = sum(part[0] for part in parts if part is not None)
        half = sum(part[1] for part in parts if part is not None)
        finest = "free" if "free" in self._y else "modes"
        if {"all", "half", finest} <= {*self._y}:
            apart = self._change("unchanged", "all") - self._change("unchanged", "half")
            apart -= self._change("unchanged", finest)
            total = total + apart
            half += _largest(apart)  # that is at half the step; shorter ones may add as much again
        return judge(_largest(total), half, limit, MEASURED)


def _largest(x: np.ndarray) -> float:
    return float(np.max(np.abs(x), initial=0.0))
