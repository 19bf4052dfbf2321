"""MoreVectors: "auto" takes more vectors where the first steps of a run show that its bounds ask for them.

What more vectors bring cannot be told from fewer: forecasts from thirds of them were wrong by 50 to 400 times. So it
is tried. The run so far, whose rows are still there, is gone through once more with more vectors, from its first row.
A bound with any vectors is one, so that each trial may be taken or left for what it shows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...estimates.kept_estimate import KeptEstimate
from ...report.wording import digits
from .tried_vectors import TINY, Result, WaitingSensors, times_the_estimate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..derivatives.linearisation import Reading, Tangents
    from .tried_vectors import Reaction, Rows, Sensors, Subject, Watch

# vectors a body to begin with: 20 static responses (those to the inertia of 14 modes and of the frame are 26)
# and a round of responses to their own inertia; 14 more where a third deform rigid interfaces or damping is not
# Rayleigh's; 34 more of a LARGE body (coordinates) that nothing damps: its vectors are not made twice
FIRST, STIFF, UNDAMPED, LARGE = 26, 40, 60, 20_000
MORE = 60, 130  # that are tried in turn
# times the estimate, both with what time steps make beside: above it a bound asks for more, in a run of LONG steps or
# more; vectors and another go take as long as some hundred steps. Without steps, mechanisms with smooth loads are at
# 1.0 to 1.5 with 26 vectors. With them: NGsolveCraigBampton, 1 s, 75 and in the frame 3.4, CMSexampleCourse, 0.3 s,
# 4.4 and in the frame 1.6, objectFFRFreducedOrderTest, 100 steps, 55. A falling arm's velocity in the frame, which
# nobody asked for, is at 100 without steps, at 1.6 to 2.0 with them
FAR, FAR_IN_SHORT_RUNS, LONG = 3.0, 10.0, 256
SHORT = 50  # steps: nothing is tried in runs of fewer
PAYS = 1.3  # times smaller, of one of the bounds that asked for it; or fewer vectors are kept
WORSE = 1.1  # times larger, of any bound: they are kept as well
KEPT = 1024  # rows of a run, the most that are gone through once more
OF_TANGENTS, WITH_VECTORS = 1_000_000, 20_000_000  # numbers of M in all their tangents, of six such arrays: 1 GB
SAME_TIME = 1e-9  # of a time: solvers add up their steps


def first_count(most: int, is_damped: bool, is_easy: bool) -> int:
    """Return how many vectors "auto" begins with, of so many that there can be."""
    undamped = UNDAMPED if most > LARGE else FIRST
    return min((FIRST if is_easy else STIFF) if is_damped else undamped, most)


class MoreVectors:
    """Chooses the reaction of a run, once: when it ends, or when so many rows were taken that no more are kept.

    watches : of the bodies whose bounds are coupled. make : mbs, sensors -> a reaction of these, with the vectors
    that they have then.
    """

    def __init__(
        self,
        watches: Sequence[Watch],
        tangents: Tangents,
        make: Callable[[Any, Sequence], Reaction],
        sensors: Sequence[Sensors],
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
        for sensors in kept.sensors:
            sensors.tell()
        return kept.reaction

    def _tell(self, begin: Result, kept: Result, told: Sequence[str]) -> None:
        few, now = (" and ".join(dict.fromkeys(str(of[0].asked) for of in x.left)) for x in (begin, kept))
        (_, name), times = max(begin.far.items(), key=lambda item: item[1])
        far = f"with {few} the bound of {name!r} is {digits(times, 2)} times the estimate after {self._taken} steps"
        for watch in self._watches:
            spared = f"; attach(..., auxiliary_modes={now}) spares the next run the trying" if now.isdigit() else ""
            watch.run.messages.append(f"auxiliary vectors: {far}; {', '.join(told)}{spared}")

    def _again(self, kept: Result, factor: float, mbs: Any, wider: Sequence[Subject], count: int) -> Result:
        """Go through the run so far once more, some bodies with so many vectors."""
        sensors = [WaitingSensors(of) for of in self._sensors]
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
            reaction = self._make(mbs, sensors)
            reaction.open(self._first, None, mbs)
            reaction.advance(_joined(self._rows), mbs)
        finally:
            self._tangents.readings = readings
            for watch, (opening, rows) in zip(self._watches, now, strict=True):
                watch.opening, watch.rows = opening, rows
        return self._result(reaction, factor)._replace(sensors=sensors)

    def _put_back(self, kept: Result) -> None:
        for watch, (enriched, companion, estimate, messages) in zip(self._watches, kept.left, strict=True):
            watch.subject.enriched, watch.run.companion, watch.run.estimate = enriched, companion, estimate
            watch.run.messages[:] = messages

    def _result(self, reaction: Reaction, factor: float) -> Result:
        left, bounds, times, named = [], {}, {}, set()
        for i, watch in enumerate(self._watches):
            run = watch.run
            left.append((watch.subject.enriched, run.companion, run.estimate, list(run.messages)))
            run.settle()
            for name, out in run.report().outputs.items():
                bounds[i, name] = float(np.max(out.bound["best"], initial=0.0))
                times[i, name] = times_the_estimate(out)
                if name not in watch.subject.sensors.unnamed and bounds[i, name] < np.inf:
                    named.add((i, name))
        # what nobody named asks for nothing, but where nothing else is bounded
        far = {key: times[key][0] for key in named or times if factor < times[key][1] < np.inf}
        return Result(reaction, left, bounds, far)


def _joined(parts: Sequence[tuple]) -> tuple:
    return tuple(None if of[0] is None else np.concatenate(of) for of in zip(*parts, strict=True))
