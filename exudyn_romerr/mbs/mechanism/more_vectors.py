"""MoreVectors: "auto" takes more vectors where the first steps of a run show that its bounds ask for them.

What more vectors bring cannot be told from fewer: forecasts from thirds of them were wrong by 50 to 400 times. So it
is tried. The run so far, whose rows are still there, is gone through once more with more vectors, from its first row.
A bound with any vectors is one, so that each trial may be taken or left for what it shows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from ...estimates.kept_estimate import KeptEstimate
from ...report.wording import at_round_off, digits, permitted

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...online.run import Opening, Run
    from ...report.data import OutputData
    from ..derivatives.linearisation import Reading, Tangents

    Rows = tuple[np.ndarray, ...]

# vectors a body to begin with: 20 static responses (those to the inertia of 14 modes and of the frame are 26)
# and a round of responses to their own inertia; 14 more where a third deform rigid interfaces or damping is not
# Rayleigh's; 34 more of a LARGE body (coordinates) that nothing damps: its vectors are not made twice
FIRST, STIFF, UNDAMPED, LARGE = 26, 40, 60, 20_000
MORE = 60, 130  # that are tried in turn
# times the estimate of what it bounds: above it a bound asks for more, in a run of LONG steps or more; vectors and
# another go take as long as some hundred steps. Mechanisms with smooth loads are at 1.0 to 1.5 with 26 vectors,
# NGsolveCraigBampton at 2.8 after 0.1 s, at 6.2 after 1 s; CMSexampleCourse at 7 and 5.7 after 0.1 and 0.3 s;
# objectFFRFreducedOrderTest, 100 steps, at 55
FAR, FAR_IN_SHORT_RUNS, LONG = 3.0, 10.0, 256
SHORT = 50  # steps: nothing is tried in runs of fewer
PAYS = 1.3  # times smaller, of one of the bounds that asked for it; or fewer vectors are kept
WORSE = 1.1  # times larger, of any bound: they are kept as well
KEPT = 1024  # rows of a run, the most that are gone through once more
OF_TANGENTS, WITH_VECTORS = 1_000_000, 20_000_000  # numbers of M in all their tangents, of six such arrays: 1 GB
SAME_TIME, TINY = 1e-9, np.finfo(float).tiny  # of a time: solvers add up their steps


def first_count(most: int, is_damped: bool, is_easy: bool) -> int:
    """Return how many vectors "auto" begins with, of so many that there can be."""
    undamped = UNDAMPED if most > LARGE else FIRST
    return min((FIRST if is_easy else STIFF) if is_damped else undamped, most)


class Vectors(Protocol):
    """A body with vectors. asked, most : how many were to be made, and how many there can be."""

    asked: int
    most: int


class Subject(Protocol):
    """A body. more : makes it with so many vectors; None: their number was asked for."""

    enriched: Vectors
    more: Callable[[int], Vectors] | None


class Watch(Protocol):
    """What is watched of it; see mbs/monitoring/body_monitor.py."""

    subject: Subject
    run: Run
    opening: Opening | None
    rows: tuple
    tolerance: dict[str, float]


class Reaction(Protocol):
    """What vectors react with. said : notes in the messages of runs."""

    said: list[str]

    def open(self, rows: Rows, before: Any, mbs: Any = None) -> None:
        """Begin with the first of the rows."""

    def advance(self, rows: Rows, mbs: Any) -> None:
        """Take rows that follow."""


class _Result(NamedTuple):
    """What a reaction has left: vectors, companion, estimate and messages of each watch; bounds by body and name.

    far : of the bounds that ask for more vectors, how many times the estimate they are.
    """

    reaction: Reaction
    left: list[tuple]
    bounds: dict[tuple[int, str], float]
    far: dict[tuple[int, str], float]


class MoreVectors:
    """Chooses the reaction of a run, once: when it ends, or when so many rows were taken that no more are kept.

    watches : of the bodies whose bounds are coupled. make : mbs, whether with sensors -> a reaction of these, with
    the vectors that they have then. sensors : whether there are any.
    """

    def __init__(
        self, watches: Sequence[Watch], tangents: Tangents, make: Callable[[Any, bool], Reaction], sensors: bool
    ):
        self._watches, self._tangents, self._make, self._sensors = watches, tangents, make, sensors
        self._first: Rows | None = None  # None: nothing can be chosen, or no more

    def open(self, rows: Rows) -> None:
        """The runs have opened with the first of the rows; those that go on from others have the vectors of these."""
        self._forget()
        goes_on = any(watch.opening.before is not None for watch in self._watches)
        large = any(watch.subject.enriched.most > LARGE for watch in self._watches)
        is_fixed = goes_on or large or not self._larger(MORE[-1])
        self._first = None if is_fixed else tuple(x[:1].copy() for x in rows)
        self._openings = [watch.opening for watch in self._watches]

    def _forget(self) -> None:
        self._readings: dict[float, Reading] = {}
        self._rows, self._taken, self._samples = [], 0, [[] for _ in self._watches]

    def _larger(self, count: int) -> list[Subject]:
        """Bodies that can have so many vectors, and have fewer; none if tangents with these would be too large."""
        size = self._tangents.size + 1.5 * count * len(self._watches)  # half as many more where interfaces are rigid
        if len(self._readings) * size**2 > WITH_VECTORS:
            return []
        subjects = [watch.subject for watch in self._watches if watch.subject.more is not None]
        return [subject for subject in subjects if subject.enriched.asked < min(count, subject.enriched.most)]

    def advance(self, reaction: Reaction, rows: Rows, mbs: Any) -> Reaction:
        """Take rows that follow; return the reaction that has taken them, maybe another one."""
        if self._first is None:
            reaction.advance(rows, mbs)
            return reaction
        self._readings |= {reading.t: reading for reading in self._tangents.readings}
        self._rows.append(rows)
        self._taken += len(rows[0])
        for kept, watch in zip(self._samples, self._watches, strict=True):
            kept.append(watch.rows)
        reaction.advance(rows, mbs)
        is_last = self._taken >= KEPT or len(self._readings) * self._tangents.size**2 > OF_TANGENTS
        stops = self._exceeds(len(rows[0]))
        if is_last or stops or SHORT <= self._planned <= self._taken:
            reaction = self._chosen(reaction, FAR if stops or self._planned >= LONG else FAR_IN_SHORT_RUNS, mbs)
        if is_last:
            self._first = None
            self._forget()
        return reaction

    @property
    def _planned(self) -> float:
        """Number of steps of the run, if the rest are as long as those so far."""
        end, first, last = self._watches[0].run.solver.end_time, self._first[0][0], self._rows[-1][0][-1]
        if end is None or last >= end - SAME_TIME * abs(end):
            return self._taken
        return self._taken * (end - first) / (last - first)

    def _exceeds(self, count: int) -> bool:
        """Whether a bound exceeds a tolerance, which stops the run, in the last steps."""
        best = ((w.tolerance, w.run.best_of_last(count)) for w in self._watches if w.tolerance)
        return any(np.any(found[name] > limit) for limits, found in best for name, limit in limits.items())

    def _chosen(self, reaction: Reaction, factor: float, mbs: Any) -> Reaction:
        begin = kept = self._result(reaction, factor)
        told = []
        for count in MORE:
            wider = self._larger(count) if kept.far else ()
            if not wider:
                continue
            try:
                tried = self._again(kept, factor, mbs, wider, count)
            except Exception as error:  # vectors cannot be made, or the motion is too sensitive with them
                self._put_back(kept)
                told.append(f"{count} could not be tried: {error}")
                break
            gain, name = max((kept.bounds[key] / max(tried.bounds[key], TINY), key[1]) for key in kept.far)
            pays = gain >= PAYS and all(tried.bounds[key] <= WORSE * x for key, x in kept.bounds.items())
            lower = f"{digits(gain, 2)} times smaller" if gain > 1 else "no smaller"
            told.append(f"{count} make that of {name!r} {lower}")
            if not pays:
                told[-1] += ": not taken"
                self._put_back(kept)
                break
            kept = tried
        if told:
            self._tell(begin, kept, told)
        if self._sensors and kept is not begin:
            kept = self._again(kept, factor, mbs)
        return kept.reaction

    def _tell(self, begin: _Result, kept: _Result, told: Sequence[str]) -> None:
        few, now = (" and ".join(dict.fromkeys(str(of[0].asked) for of in x.left)) for x in (begin, kept))
        (_, name), times = max(begin.far.items(), key=lambda item: item[1])
        far = f"with {few} the bound of {name!r} is {digits(times, 2)} times the estimate after {self._taken} steps"
        for watch in self._watches:
            spared = f"; attach(..., auxiliary_modes={now}) spares the next run the trying" if now.isdigit() else ""
            watch.run.messages.append(f"auxiliary vectors: {far}; {', '.join(told)}{spared}")

    def _again(self, kept: _Result, factor: float, mbs: Any, wider: Sequence = (), count: int = 0) -> _Result:
        """Go through the run so far once more: some bodies with so many vectors, or all as they are with sensors."""
        now = [(watch.opening, watch.rows) for watch in self._watches]
        readings = self._tangents.readings
        try:
            for subject in wider:
                subject.enriched = subject.more(count)
            for watch, opening, samples in zip(self._watches, self._openings, self._samples, strict=True):
                watch.run.companion, watch.run.estimate = None, KeptEstimate()
                watch.run.messages[:] = [text for text in watch.run.messages if text not in kept.reaction.said]
                watch.opening, watch.rows = opening, _joined(samples)
            self._tangents.readings = [self._readings[t] for t in sorted(self._readings)]
            reaction = self._make(mbs, not wider)
            reaction.open(self._first, None, mbs)
            reaction.advance(_joined(self._rows), mbs)
        finally:
            self._tangents.readings = readings
            for watch, (opening, rows) in zip(self._watches, now, strict=True):
                watch.opening, watch.rows = opening, rows
        return self._result(reaction, factor)

    def _put_back(self, kept: _Result) -> None:
        for watch, (enriched, companion, estimate, messages) in zip(self._watches, kept.left, strict=True):
            watch.subject.enriched, watch.run.companion, watch.run.estimate = enriched, companion, estimate
            watch.run.messages[:] = messages

    def _result(self, reaction: Reaction, factor: float) -> _Result:
        left, bounds, far = [], {}, {}
        for i, watch in enumerate(self._watches):
            run = watch.run
            left.append((watch.subject.enriched, run.companion, run.estimate, list(run.messages)))
            run.settle()
            for name, out in run.report().outputs.items():
                bounds[i, name] = float(np.max(out.bound["best"], initial=0.0))
                times = times_the_estimate(out)
                far |= {(i, name): times} if factor < times < np.inf else {}
        return _Result(reaction, left, bounds, far)


def times_the_estimate(out: OutputData) -> float:
    """How many times the estimate of what it bounds the largest bound of an output is; 0 if nobody needs to know."""
    bound = np.max(out.bound["best"], initial=0.0)
    if out.estimate is None or np.all(at_round_off(out)) or bound <= permitted(out)[0]:
        return 0.0
    bounded = np.max(np.abs(out.estimate - out.estimate_parts["time step"]), initial=0.0)
    return float(bound / max(bounded, TINY))


def _joined(parts: Sequence[tuple]) -> tuple:
    return tuple(None if of[0] is None else np.concatenate(of) for of in zip(*parts, strict=True))
