"""Tangents of all but the floating bodies over time, splined through readings.

Rows of constraints that turn with a body, as those of a joint to the ground do in the body's axes, are splined in
axes in which they do not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from .rotations import rotation_matrix, times_transposed
from .rows import Rows
from .unknowns import TurningNode

CONSTANT = 1e-11  # of the largest of alike entries: one that varies by less does not
KNOTS = 16  # of a spline that are worked at once, with as many beside: those farther off count by 0.27^16 = 1e-9
STEADIER = 0.1  # times what rows vary in other axes: those in which they vary less are taken
PARTS = ("M", "D", "K", "G", "C")
OF_CONSTRAINTS = ("G", "C")
SAMPLED = ("by coordinates", "by rates")  # parts of Reading.sampled


@dataclass(frozen=True)
class Reading:
    """Of all but floating bodies, in axes of bodies, at one row; sparse, for an engine is read a thousand times.

    M, D, K (n_a, n_a) : K without forces of constraints. G, C (c, n_a) of independent constraints: forces G^T lam,
    what is kept zero C z. H (n_a n_a, all) : change of the forces of constraints, for each multiplier. sampled :
    empty, or (n_a, n_a) twice, what coordinates and rates at the begin of the step make of forces at its end.
    """

    M: sp.csr_matrix
    D: sp.csr_matrix
    K: sp.csr_matrix
    G: sp.csr_matrix
    C: sp.csr_matrix
    H: sp.csr_matrix
    sampled: tuple[sp.csr_matrix, ...] = ()

    @classmethod
    def of(cls, *parts: np.ndarray | sp.csr_matrix, sampled: Sequence[np.ndarray] = ()) -> Reading:
        """Return one of M, D, K, G, C, H and what is sampled, which may be dense."""
        return cls(*map(sp.csr_matrix, parts), tuple(map(sp.csr_matrix, sampled)))

    def stiffness(self, multipliers: np.ndarray) -> np.ndarray:
        """K (n_a, n_a) with what turning constraints add to it."""
        return self.K.toarray() + (self.H @ multipliers).reshape(self.K.shape)


@dataclass(frozen=True)
class TurningRows:
    """Three rows of constraints that are those of a vector: A^T of them varies less, A of a frame's node.

    own : slice of the independent ones. all : of all.
    """

    own: slice
    all: slice
    node: TurningNode

    def axes(self, rows: Rows) -> np.ndarray:
        """Return A (T, 3, 3)."""
        return rotation_matrix(self.node.parameters(rows.q))


def turning_rows(
    frames: Sequence[TurningNode],
    independent: np.ndarray,
    rows: Rows,
    readings: Sequence[Reading],
    scales: np.ndarray,
) -> list[TurningRows]:
    """Return the rows of constraints that vary less in axes that turn back with a frame.

    rows : of the readings. scales (n_a,) : finite motions that are alike.
    """
    found, i = [], 0
    both = np.array([[x.toarray() for x in (one.G, one.C)] for one in readings]) * scales
    while i + 2 < len(independent):
        three, first, best = both[:, :, i : i + 3], independent[i], None
        if independent[i + 2] == first + 2:
            for of in (TurningRows(slice(i, i + 3), slice(first, first + 3), node) for node in frames):
                left = _varies(of.axes(rows).swapaxes(1, 2)[:, None] @ three)
                if left < (STEADIER * _varies(three) if best is None else best[0]):
                    best = left, of
        found += [] if best is None else [best[1]]
        i += 1 if best is None else 3
    return found


def _varies(x: np.ndarray) -> float:
    return float(np.ptp(x, axis=0).max())


class Splined:
    """Readings over time: entries that are always the same once, others by a cubic spline.

    rows : of the readings. scales (n_a,) : finite motions that are alike. forces (all,) : the largest of each
    multiplier. Forces and moments, lengths and angles are told from rounding only beside their like. turning : rows
    that are splined in axes of a body.
    """

    def __init__(
        self,
        rows: Rows,
        readings: Sequence[Reading],
        scales: np.ndarray,
        forces: np.ndarray,
        turning: Sequence[TurningRows] = (),
    ):
        self._fixed, self._varying, t = {}, {}, rows.t
        both, n, forces = np.outer(scales, scales).ravel(), len(scales), forces.copy()
        self._turning, H = turning, [one.H for one in readings]
        parts = {name: [getattr(one, name) for one in readings] for name in PARTS}
        if turning:
            sizes = len(forces), parts["G"][0].shape[0]
            of_all, of_own = (np.tile(np.eye(size), (len(readings), 1, 1)) for size in sizes)
            for of in turning:
                of_all[:, of.all, of.all] = of_own[:, of.own, of.own] = of.axes(rows)
                forces[of.all] = forces[of.all].max()
            H = [x @ sp.csr_matrix(A) for x, A in zip(H, of_all, strict=True)]
            for name in OF_CONSTRAINTS:
                parts[name] = [sp.csr_matrix(A.T) @ x for x, A in zip(parts[name], of_own, strict=True)]
        if any(x.nnz for one in readings for x in one.sampled):
            parts |= zip(SAMPLED, zip(*(one.sampled for one in readings), strict=True), strict=True)
        for name, of_readings in parts.items():
            place, values = _stacked(of_readings)
            row, column = np.divmod(place, n)
            # rows of constraints have units of their own, and of each other part all entries are works
            row, alike = (row, scales[column]) if name in OF_CONSTRAINTS else (0 * row, both[place])
            most = np.zeros(of_readings[0].shape[0])
            np.maximum.at(most, row, np.abs(values).max(axis=0, initial=0.0) * alike)
            moves = np.ptp(values, axis=0) * alike > CONSTANT * most[row]
            self._fixed[name] = of_readings[0].toarray()
            self._varying[name] = place[moves], _over_time(t, values[:, moves])
        self._by_multiplier = _by_multiplier(H, t, both, forces)

    def __call__(self, name: str, rows: Rows) -> np.ndarray:
        """Return a part of PARTS, or of SAMPLED, at rows of the run, (T, ...)."""
        fixed, (moves, spline) = self._fixed[name], self._varying[name]
        found = np.tile(fixed.ravel(), (len(rows), 1))
        if len(moves):
            found[:, moves] = spline(rows.t)
        found = found.reshape(len(rows), *fixed.shape)
        for of in self._turning if name in OF_CONSTRAINTS else ():
            found[:, of.own] = of.axes(rows) @ found[:, of.own]
        return found

    @property
    def is_sampled(self) -> bool:
        """Whether forces at the ends of steps follow what is at their begins."""
        return SAMPLED[0] in self._fixed

    def sampled(self, rows: Rows) -> list[np.ndarray]:
        """Return what Reading.sampled is at rows, (T, n_a, n_a) twice; empty: nothing is fed back so."""
        return [self(name, rows) for name in SAMPLED] if self.is_sampled else []

    def stiffness(self, rows: Rows) -> np.ndarray:
        """Return K (T, n_a, n_a) with what multipliers make of turning constraints."""
        K, (number, values, gathers) = self("K", rows), self._by_multiplier
        if len(number):
            multipliers = rows.multipliers.copy()
            for of in self._turning:
                multipliers[:, of.all] = times_transposed(of.axes(rows), multipliers[:, of.all])
            K += ((values(rows.t) * multipliers[:, number]) @ gathers).reshape(K.shape)
        return K


def _by_multiplier(
    H: Sequence[sp.csr_matrix], t: np.ndarray, both: np.ndarray, forces: np.ndarray
) -> tuple[np.ndarray, Callable, sp.csr_matrix]:
    """Entries of readings of H that are not zero: multipliers, values over time, where they go.

    both (n_a n_a,), forces (all,) : times these entries are works.
    """
    place, values = _stacked(H)
    place, number = np.divmod(place, max(len(forces), 1))
    size = np.abs(values).max(axis=0, initial=0.0) * both[place] * forces[number]
    used = size > CONSTANT * size.max(initial=0.0)
    place, number, count = place[used], number[used], int(used.sum())
    gathers = sp.csr_matrix((np.ones(count), (np.arange(count), place)), shape=(count, len(both)))
    return number, _over_time(t, values[:, used]), gathers


def _stacked(of: Sequence[sp.csr_matrix]) -> tuple[np.ndarray, np.ndarray]:
    """Flat numbers (k,) of entries that are not zero in one of R matrices, and what they are in each, (R, k)."""
    entries = [(x.row.astype(np.int64) * x.shape[1] + x.col, x.data) for x in (one.tocoo() for one in of)]
    is_used = np.zeros(np.prod(of[0].shape), bool)
    for numbers, _ in entries:
        is_used[numbers] = True
    place = np.flatnonzero(is_used)
    values = np.zeros((len(of), len(place)))
    for row, (numbers, data) in zip(values, entries, strict=True):
        row[np.searchsorted(place, numbers)] = data
    return place, values


def _over_time(t: np.ndarray, values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Values (R, k) of readings as a function of times (T,): cubic, linear where there are few."""
    if len(t) <= 3 or not values.size:
        return lambda at: np.array([np.interp(at, t, column) for column in values.T]).T.reshape(len(at), -1)
    from scipy.interpolate import CubicSpline  # here, for it takes a tenth of a second: more than many a solve

    return CubicSpline(t, values) if len(t) <= 4 * KNOTS else _Windows(t, values, CubicSpline)


class _Windows:
    """A cubic spline through values (R, k) at times t (R,), made where it is asked for: whole it takes gigabytes."""

    def __init__(self, t: np.ndarray, values: np.ndarray, spline: Callable):
        self._t, self._values, self._spline, self._last = t, values, spline, (-1, None)

    def __call__(self, at: np.ndarray) -> np.ndarray:
        """Return the values (T, k) at times (T,)."""
        windows = np.maximum(np.searchsorted(self._t, at, "right") - 1, 0) // KNOTS
        found = np.empty((len(at), self._values.shape[1]))
        for window in np.unique(windows):
            here = windows == window
            found[here] = self._of(window)(at[here])
        return found

    def _of(self, window: int) -> Callable:
        if self._last[0] != window:
            part = slice(max((window - 1) * KNOTS, 0), (window + 2) * KNOTS)
            self._last = window, self._spline(self._t[part], self._values[part])
        return self._last[1]
