"""Looks: residuals along some steps, known where they were looked at and linear between; where that is due."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

DENSE = 32  # samples from a jump on, in which all sets in
# a change of accelerations that is so many times the largest of so many steps before it is a jump
JUMP, QUIET = 3.0, 8
CONFIRMED = 0.01  # of the largest so far: what a sample in the middle may be off a line, which is not refined then
Loads = tuple[np.ndarray, np.ndarray]
Residuals = Callable[[Sequence[np.ndarray], np.ndarray], Loads | None]  # of rows and what moves them
Sizes = Callable[[np.ndarray], np.ndarray]


class Looks:
    """Residuals and values of constraints at S samples, from the last known before them on.

    rows : t (S,), q, q_t, q_tt (S, k). e (3, S, k) : what is predicted there. own : loads (S, k) and values of
    constraints (S, c) that belong to the prediction, or None. before : t, residual (k,), values (c,) that are known.
    sizes : of loads and values, (S, quantities), by which they are compared; largest : of these so far.

    Attributes
    ----------
    known : (S,) where they are. ended : whether there are none any more. largest : of sizes so far, (quantities,).
    """

    def __init__(
        self,
        rows: Sequence[np.ndarray],
        e: np.ndarray,
        own: Loads | None,
        before: tuple[float, np.ndarray, np.ndarray],
        residuals: Residuals,
        sizes: Callable[[np.ndarray, np.ndarray], np.ndarray],
        largest: np.ndarray,
    ):
        self._rows, self._e, self._own, self._residuals, self._sizes = rows, e, own, residuals, sizes
        t, *values = before
        self._t = np.append(t, rows[0])
        self._values = [np.zeros((len(self._t), len(value))) for value in values]
        for all_of, value in zip(self._values, values, strict=True):
            all_of[0] = value
        self.known, self.ended, self.largest = np.zeros(len(rows[0]), dtype=bool), False, largest

    def at(self, where: np.ndarray) -> None:
        """Look at samples (S,), but for those that are known."""
        look_together([(self, where)])

    def _take(self, where: np.ndarray, found: Loads | None) -> None:
        """Take what was found at samples (S,) that were not known."""
        if found is None:
            self.ended = True
            return
        for i, (all_of, of) in enumerate(zip(self._values, found, strict=True)):
            all_of[1:][where] = of if self._own is None else of - self._own[i][where]
        self.known = self.known | where
        self.largest = np.maximum(self.largest, self._sizes(*(x[1:][where] for x in self._values)).max(axis=0))

    def confirm(self, where: np.ndarray, least: np.ndarray | float = 0.0) -> None:
        """Look near the middle between samples that are known, among some (S,), until it confirms the line.

        least : size, (quantities,), below which it does so anyway.
        """
        places = np.flatnonzero(np.append(True, self.known))
        gaps = [(a, b) for a, b in pairwise(places) if where[a:b].any()]
        while gaps := [(a, b) for a, b in gaps if b - a > 1]:
            ends = np.array(gaps)
            # an odd number of steps from the first: what alternates from step to step is the same at even ones
            middle = ends[:, 0] + (np.diff(ends)[:, 0] // 2 | 1)
            line = [_linear(self._t[middle], self._t[places], x[places]) for x in self._values]
            self.at(np.isin(np.arange(len(where)), middle - 1))
            if self.ended:
                return
            off = self._sizes(*(x[middle] - y for x, y in zip(self._values, line, strict=True)))
            bent = np.any(off > np.maximum(CONFIRMED * self.largest, least), axis=1)
            halves = zip(ends[bent, 0], middle[bent], ends[bent, 1], strict=True)
            gaps = [gap for a, m, b in halves for gap in ((a, m), (m, b))]
            places = np.flatnonzero(np.append(True, self.known))

    @property
    def last(self) -> tuple[float, np.ndarray, np.ndarray]:
        """What is known last: t, residual (k,), values (c,)."""
        place = np.flatnonzero(np.append(True, self.known))[-1]
        return self._t[place], *(x[place] for x in self._values)

    @property
    def end(self) -> float:
        """Time of the last sample."""
        return float(self._t[-1])

    def known_at(self, t: float) -> list[np.ndarray]:
        """Residual (k,) and values (c,) at a time before the samples, by the line to the first look."""
        places = np.flatnonzero(np.append(True, self.known))
        return [_linear(np.array([t]), self._t[places], x[places])[0] for x in self._values]

    @property
    def all(self) -> list[np.ndarray]:
        """Residuals (S, k) and values of constraints (S, c) at all samples; held after the last that are known."""
        places = np.flatnonzero(np.append(True, self.known))
        return [_linear(self._t[1:], self._t[places], x[places]) for x in self._values]


def look_together(wanted: Sequence[tuple[Looks, np.ndarray]]) -> None:
    """Look at samples (S,) of each, but for those that are known; at all at once, for many cost little more than one.

    All have the same residuals.
    """
    wanted = [(one, where & ~one.known) for one, where in wanted if not one.ended]
    wanted = [(one, where) for one, where in wanted if where.any()]
    if not wanted:
        return
    rows = [np.concatenate(x) for x in zip(*([x[at] for x in one._rows] for one, at in wanted), strict=True)]
    found = wanted[0][0]._residuals(rows, np.concatenate([one._e[:, where] for one, where in wanted], axis=1))
    first = 0
    for one, where in wanted:
        own = slice(first, first := first + np.count_nonzero(where))
        one._take(where, None if found is None else tuple(x[own] for x in found))


class Jumps:
    """Where accelerations jump along a run, as under loads that begin suddenly. sizes : as of Remainder."""

    def __init__(self, size: int, sizes: Sizes):
        self._sizes, self._quiet = sizes, DENSE  # samples since the last jump
        self._last = np.zeros((0, size))

    def go_on(self, before: Jumps) -> None:
        """Go on from another run's."""
        self._last, self._quiet = before._last, before._quiet

    def follow(self, q_tt: np.ndarray) -> np.ndarray:
        """Return whether the next samples, of accelerations (S, k), are among DENSE from a jump on, (S,)."""
        accelerations = np.vstack([self._last, q_tt])
        self._last = accelerations[-QUIET - 2 :]
        if len(accelerations) < QUIET + 2:
            return np.ones(len(q_tt), dtype=bool)
        change = np.diff(accelerations, axis=0)
        changes = self._sizes(np.broadcast_to(change, (3, *change.shape)))
        before = sliding_window_view(changes[:-1], QUIET, axis=0).max(axis=-1)
        jumps = np.any(changes[QUIET:] > JUMP * before, axis=1)[-len(q_tt) :]
        jumps = np.append(np.zeros(len(q_tt) - len(jumps), dtype=bool), jumps)
        since = np.arange(len(q_tt)) - np.maximum.accumulate(np.where(jumps, np.arange(len(q_tt)), -self._quiet))
        self._quiet = int(since[-1]) + 1
        return since < DENSE


def middles(t: np.ndarray, read: np.ndarray) -> np.ndarray:
    """Return whether samples (S,) are nearest to the middle between two times of tangents, not at one of these."""
    if len(read) < 2:
        return np.zeros(len(t), dtype=bool)
    nearest = np.abs(t[:, None] - (read[:-1] + read[1:]) / 2).argmin(axis=0)
    return np.isin(np.arange(len(t)), nearest) & ~np.isin(t, read)


def _linear(t: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (S, ...) at t (S,), linear between times (T,), held after the last."""
    after = np.minimum(np.searchsorted(times, t), len(times) - 1)
    before = np.maximum(after - 1, 0)
    dt = np.where(after > before, times[after] - times[before], np.inf)
    share = np.clip((t - times[before]) / dt, 0.0, 1.0)
    return values[before] + share[:, None] * (values[after] - values[before])
