"""Late readings: tangents at stored steps, wherever those read in passing are too far apart.

What is interpolated between two readings is compared, at every stored step between them, with what follows from the
forces and positions there; at one step of each interval with forces that Exudyn differentiates. Where the two differ,
the tangent is read in the stored state, until they do not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from .tangent import Reading, Tangents, scaled, state_set

OFF = 0.03  # of K + M/dt^2, and of G: what an interpolated tangent may miss
LONG = 4  # steps between readings, from which on one of them is tried
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
    def count(self) -> int:
        return self.rows.stop - self.rows.start


class LateReadings:
    """Of stored rows t (S,) and states q, q_t, q_tt, multipliers (S, ...).

    Attributes
    ----------
    failure : why a tangent could not be read; readings end before. note : why tangents were left as they are.
    """

    def __init__(self, tangents: Tangents, mbs: Any, t: np.ndarray, states: Sequence[np.ndarray]):
        self._tangents, self._mbs, self._t, self._states = tangents, mbs, t, states
        self._tried: set[float] = set()
        self._can_read: bool | None = None
        self.failure: Exception | None = None
        self.note = ""

    def read(self) -> None:
        """Read what is missing: at the last row, then where tangents change or what is interpolated is off."""
        if self._tangents.readings[-1].t < self._t[-1]:
            self._read([len(self._t) - 1])
        while any(self._read(list(find())) for find in (self._changing, self._missed, self._untrue)):
            pass

    def _read(self, rows: Sequence[int]) -> bool:
        """Whether there was something to read."""
        if not rows or not self._is_unchanged():
            return False
        for row in rows:
            try:
                self._tangents.read_stored(self._mbs, self._t[row], [x[row] for x in self._states])
            except Exception as error:
                self.failure = error
                self._tangents.end_before(self._t[row])
                break
        return True

    def _is_unchanged(self) -> bool:
        """Whether the mbs gives in the states of readings what it gave when they were read."""
        if self._can_read is None:
            within = [r for r in self._tangents.readings if r.t <= self._t[-1]]
            ends = (within[max(0, np.searchsorted([r.t for r in within], self._t[0], side="right") - 1)], within[-1])
            try:
                self._can_read = self._mbs is not None and all(
                    self._tangents.reads_the_same(self._mbs, reading) for reading in ends
                )
            except Exception:  # another mbs than it was
                self._can_read = False
            if not self._can_read:
                self.note = NOTE.format(self._t[0], self._t[-1])
        return self._can_read

    def _intervals(self) -> Iterator[_Interval]:
        """Those with rows between their readings."""
        for j, (first, last) in enumerate(pairwise(self._tangents.readings)):
            start, stop = np.searchsorted(self._t, first.t, side="right"), np.searchsorted(self._t, last.t)
            if start < stop:
                yield _Interval(j, first, last, slice(int(start), int(stop)))

    def _changing(self) -> Iterator[int]:
        return (interval.middle for interval in self._intervals() if interval.last.change > 1)

    def _missed(self) -> Iterator[int]:
        """Rows whose forces or positions are not those that the tangents around them belong to."""
        q, _, q_tt, multipliers = self._states
        readings = self._tangents.readings
        if len(readings) == 1:
            return
        times = np.array([r.t for r in readings])
        at = [np.array([r.state[k] for r in readings]) for k in range(4)]
        moving = np.hstack([q_tt, multipliers]) - CubicSpline(times, np.hstack(at[2:]))(self._t)
        turned = q - CubicHermiteSpline(times, *at[:2])(self._t)
        for interval in self._intervals():
            carried = self._tangents.carried_near(self._t[interval.middle])
            x, scale = moving[interval.rows], self._scale(interval)
            off = np.abs(turned[interval.rows]) @ carried.turning
            both = scale[carried.i] * scale[carried.j]
            matters = both * (np.abs(carried.by) @ np.abs(x).max(axis=0)) > OFF
            if matters.any():
                changes = np.abs(x @ carried.by[matters].T) * both[matters]
                off = np.maximum(off, changes.max(axis=1))
            if off.max() > OFF:
                yield interval.rows.start + int(off.argmax())

    def _untrue(self) -> Iterator[int]:
        """Rows in whose state forces change otherwise, in a direction that all coordinates take part in."""
        readings = self._tangents.readings
        times = np.array([r.t for r in readings])
        signs = np.random.default_rng(SEED).choice([-1.0, 1.0], self._tangents.size) * self._tangents.differentiable
        for interval in [i for i in self._intervals() if i.count >= LONG]:
            row = interval.middle
            t, scale = self._t[row], self._scale(interval)
            if t in self._tried or not self._is_unchanged():
                continue
            self._tried.add(t)
            with state_set(self._mbs.systemData, t, [x[row] for x in self._states]):
                Kdq = self._tangents.differences(self._mbs, scale * signs)
            for weight, reading in zip(CubicSpline(times, np.eye(len(times)))(t), readings, strict=True):
                Kdq -= weight * (reading.K @ (scale * signs))
            if np.abs(scale * Kdq).max() > OFF:
                yield row

    def _scale(self, interval: _Interval) -> np.ndarray:
        first, last = interval.first, interval.last
        return scaled(last, last.t - first.t, self._tangents.rotations)


NOTE = (
    "between t = {:g} and {:g} s the mechanism's tangents are those read in passing: the mbs was changed meanwhile (by "
    "a PostStep function, or after the solve), and they cannot be read in stored states"
)
