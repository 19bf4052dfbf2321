"""Late readings: tangents at stored steps, wherever those read in passing are too far apart.

What is interpolated between two readings is compared, at every stored step between them, with what follows from the
forces and positions there; at one step of each interval with forces that Exudyn differentiates. Where the two differ,
the tangent is read in the stored state, until they do not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ...online.run_messages import CHANGED, changed
from ..derivatives.linearisation import Reading, Tangents
from ..memory.user_memory import memory_kept
from .stored_residuals import GONE, user_functions

OFF = 0.003  # of K + M/dt^2 in motions that constraints admit, and of G: what an interpolated tangent may miss
LONG = 4  # steps between readings, from which on one of them is tried
APART = 32  # steps between those that are tried, at most
SOME = 16  # of the rows between two readings, or every 16th if there are more
LIGHT = 0.5  # of the smallest mass at two readings: less between them, and the march through the spline may explode
SEED = 15


class _Interval(NamedTuple):
    """Two readings, numbers of the first and of the rows between them, a slice."""

    j: int
    first: Reading
    last: Reading
    rows: slice

    @property
    def middle(self) -> int:
        return (self.rows.start + self.rows.stop) // 2

    @property
    def scale(self) -> np.ndarray:
        return self.last.scale(self.last.t - self.first.t)

    @property
    def count(self) -> int:
        return self.rows.stop - self.rows.start


class LateReadings:
    """Of stored rows t (S,) and states q, q_t, q_tt, multipliers (S, ...).

    enriched : has `extended`, tangents with the auxiliary vectors of bodies; None: there are no vectors.

    Attributes
    ----------
    failure : why a tangent could not be read; readings end before. note : why tangents were left as they are.
    """

    def __init__(
        self,
        tangents: Tangents,
        mbs: Any,
        t: np.ndarray,
        states: Sequence[np.ndarray],
        enriched: Any = None,
    ):
        self._tangents, self._mbs, self._t, self._states = tangents, mbs, t, states
        self._enriched, self._tried, self._true = enriched, set[float](), set[tuple]()
        self._rates = np.hstack(states[2:])  # and multipliers
        self._can_read: bool | None = None
        self.failure: Exception | None = None
        self.note = ""

    def read(self) -> None:
        """Read what is missing; what user functions keep, which are called at stored times, is put back."""
        functions = [] if self._mbs is None else user_functions(self._mbs)
        with memory_kept(self._mbs, functions) if functions else nullcontext():
            self._read_missing()

    def _read_missing(self) -> None:
        """At the last row, then where tangents change or what is interpolated is off."""
        if self._tangents.readings[-1].t < self._t[-1]:
            self._read([len(self._t) - 1])
        while self._interpolate() and any(
            self._read(list(find())) for find in (self._changing, self._missed, self._untrue, self._light)
        ):
            pass

    def _interpolate(self) -> bool:
        """Compare q'' and multipliers of the rows with a spline through those of readings; K has one such."""
        from scipy.interpolate import CubicSpline  # here, for it takes long to import

        readings = self._tangents.readings
        times, at = (
            [*values] for values in zip(*((r.t, np.concatenate(r.state[2:])) for r in readings), strict=True)
        )
        self._spline = CubicSpline(times, np.eye(len(times))) if len(times) > 1 else None
        if self._spline is not None:
            self._moving = self._rates - self._spline(self._t) @ np.array(at)
        return self._spline is not None

    def _read(self, rows: Sequence[int]) -> bool:
        """Whether there was something to read."""
        if not rows or not self._is_unchanged():
            return False
        for row in rows:
            self._read_row(row)
        return True

    def _read_row(self, row: int) -> None:
        t, end = self._t[row], self._tangents.readings[-1].t
        if self.failure is not None and t > end:
            return
        try:
            self._tangents.read_stored(self._mbs, t, [x[row] for x in self._states])
        except Exception as error:
            self.failure = error
            self._tangents.end_before(t)

    def _is_unchanged(self) -> bool:
        """Whether the mbs gives in the states of readings what it gave when they were read."""
        if self._can_read is None:
            within = [r for r in self._tangents.readings if r.t <= self._t[-1]]
            ends = [within[max(0, np.searchsorted([r.t for r in within], self._t[0], side="right") - 1)], within[-1]]
            if ends[0] is ends[1] or ends[1].t == self._t[-1]:  # read just now, or if not, the first one tells
                del ends[1]
            try:
                self._can_read = self._mbs is not None and all(
                    self._tangents.reads_the_same(self._mbs, reading) for reading in ends
                )
            except Exception:  # another mbs than it was
                self._can_read = False
            if not self._can_read:
                note = NOTE.format(self._t[0], self._t[-1], GONE if self._mbs is None else CHANGED)
                self.note = note if self._mbs is None else changed(note)
        return self._can_read

    def _intervals(self) -> Iterator[_Interval]:
        """Those with rows between their readings."""
        readings = self._tangents.readings
        times = [reading.t for reading in readings]
        after, before = (np.searchsorted(self._t, times, side).tolist() for side in ("right", "left"))
        for j, ends in enumerate(pairwise(readings)):
            if after[j] < before[j + 1]:
                yield _Interval(j, *ends, slice(after[j], before[j + 1]))

    def _changing(self) -> Iterator[int]:
        return (interval.middle for interval in self._intervals() if interval.last.change > 1)

    def _missed(self) -> Iterator[int]:
        """Rows whose forces or positions are not those that the tangents around them belong to."""
        for interval in self._intervals():
            around = tuple(r.t for r in self._tangents.readings[max(interval.j - 1, 0) : interval.j + 3])
            if around in self._true:  # of readings farther away a spline knows little
                continue
            off = np.abs(self._turned(interval)) @ self._tangents.carried_near(self._t[interval.middle]).turning
            by_forces = self._off(interval)
            if by_forces.max() > OFF:
                off = np.maximum(off, self._off_in_motions(interval, by_forces))
            if off.max() > OFF:
                yield interval.rows.start + int(off.argmax())
            else:
                self._true.add(around)

    def _turned(self, interval: _Interval) -> np.ndarray:
        """How far q (S, n) of the rows of an interval is from what its readings let expect."""
        first, last, rows = interval.first, interval.last, interval.rows
        dt, change = last.t - first.t, last.state[0] - first.state[0]
        share = ((self._t[rows] - first.t) / dt)[:, None]
        bend = (1 - share) * (dt * first.state[1] - change) - share * (dt * last.state[1] - change)
        return self._states[0][rows] - first.state[0] - share * (change + (1 - share) * bend)

    def _off(self, interval: _Interval) -> np.ndarray:
        """How far K is off at the rows (S,) of an interval, by q'' and multipliers there, coordinate by coordinate.

        What comes and goes within the interval accelerates masses no longer than that: its integral counts, over time
        twice, if that is less.
        """
        carried, scale = self._tangents.carried_near(self._t[interval.middle]), interval.scale
        x = self._moving[interval.rows]
        both = scale[carried.i] * scale[carried.j]
        matters = both * (np.abs(carried.by) @ np.abs(x).max(axis=0)) > OFF
        changes = np.vstack([x[:1] * 0, x, x[:1] * 0]) @ carried.by[matters].T
        h = np.diff(np.concatenate([[interval.first.t], self._t[interval.rows], [interval.last.t]]))[:, None]
        moved = _integral(_integral(changes, h), h)
        light = 1 / np.sqrt(interval.last.masses)
        moved = np.abs(moved).max(axis=0, initial=0.0) * light[carried.i[matters]] * light[carried.j[matters]]
        found = np.abs(changes[1:-1]) * both[matters]
        return found[:, moved > OFF].max(axis=1, initial=0.0)

    def _off_in_motions(self, interval: _Interval, off: np.ndarray) -> np.ndarray:
        """The same in motions that constraints admit, which may feel little of it; 0 at rows that are not tried.

        off : by single coordinates; the row where that is largest is tried, and some of all.
        """
        carried, motions = self._tangents.carried_near(self._t[interval.middle]), interval.last.motions
        rows = np.unique([off.argmax(), *np.linspace(0, len(off) - 1, max(SOME, len(off) // SOME)).astype(int)])
        K = np.zeros((len(rows), len(motions), len(motions)))
        K[:, carried.i, carried.j] = self._moving[interval.rows][rows] @ carried.by.T
        found = np.zeros(len(off))
        found[rows] = np.abs(motions.T @ K @ motions).max(axis=(1, 2), initial=0.0)
        return found

    def _untrue(self) -> Iterator[int]:
        """Rows in whose state K differs for other reasons, in a direction that all motions take part in."""
        rng = np.random.default_rng(SEED)
        for interval in [i for i in self._intervals() if i.count >= LONG]:
            motions = interval.last.motions * self._tangents.differentiable[:, None]
            direction = motions @ rng.choice([-1.0, 1.0], motions.shape[1])
            if not (rows := self._to_try(interval)):
                continue
            off = self._missing(rows, motions, direction)
            self._tried.update(self._t[row] for row, x in zip(rows, off, strict=True) if x <= OFF)
            if off.max() > OFF:
                yield rows[off.argmax()]

    def _light(self) -> Iterator[int]:
        """Middles of long intervals where the spline's mass is none: that of stiff motions is in no scale."""
        long = [i for i in self._intervals() if i.count > APART and self._enriched is not None]
        if not long:
            return
        tangents = self._enriched.extended.now()
        yield from (i.middle for i in long if tangents.is_lighter(i.j, LIGHT))

    def _to_try(self, interval: _Interval) -> list[int]:
        """Rows of an interval that were not tried, and may be."""
        parts = max((interval.count + 1) // APART, 2)
        rows = [interval.rows.start + interval.count * part // parts for part in range(1, parts)]
        rows = [row for row in rows if self._t[row] not in self._tried]
        return rows if rows and self._is_unchanged() else []

    def _missing(self, rows: list[int], motions: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """What K is off by in the states of rows (S,), of K + M/dt^2, by a direction, but for what q'' and l are."""
        t, readings = self._t[rows], self._tangents.readings
        off = self._tangents.differences(self._mbs, t, [x[rows] for x in self._states], dq)
        off -= self._spline(t) @ np.array([reading.K @ dq for reading in readings])
        near = [self._tangents.carried_near(at) for at in t]
        for carried in {id(one): one for one in near}.values():
            own = np.array([one is carried for one in near])
            changes = (carried.by @ self._moving[rows][own].T).T * dq[carried.j]
            off[own] -= [np.bincount(carried.i, change, len(dq)) for change in changes]
        return np.abs(off @ motions).max(axis=1, initial=0.0)


def _integral(x: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Integral of rows x from 0 on, over steps h in time, by trapezoids."""
    return np.concatenate([0 * x[:1], np.cumsum(h * (x[1:] + x[:-1]) / 2, axis=0)])


NOTE = (
    "between t = {:g} and {:g} s the mechanism's tangents are those read in passing, and cannot be read in stored "
    "states: {}"
)
