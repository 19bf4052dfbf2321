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
STEADIER = 0.1  # times what rows vary in other axes: those in which they vary less are taken
PARTS = ("M", "D", "K", "G", "C")
OF_CONSTRAINTS = ("G", "C")
SAMPLED = ("by coordinates", "by rates")  # parts of Reading.sampled


@dataclass(frozen=True)
class Reading:
    """Of all but floating bodies, in axes of bodies, at one row.

    M, D, K (n_a, n_a) : K without forces of constraints. G, C (c, n_a) of independent constraints: forces G^T lam,
    what is kept zero C z. H (n_a n_a, all), sparse : change of the forces of constraints, for each multiplier; dense
    it takes gigabytes of an engine. sampled : empty, or (n_a, n_a) twice, what coordinates and rates at the begin of
    the step make of forces at its end.
    """

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    G: np.ndarray
    C: np.ndarray
    H: sp.csr_matrix
    sampled: tuple[np.ndarray, ...] = ()

    def stiffness(self, multipliers: np.ndarray) -> np.ndarray:
        """K with what turning constraints add to it."""
        return self.K + (self.H @ multipliers).reshape(self.K.shape)


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
    both = np.array([np.stack([one.G, one.C]) for one in readings]) * scales
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
        self._fixed, self._varying, both, t = {}, {}, scales * scales[:, None], rows.t
        self._turning, forces, H = turning, forces.copy(), [one.H for one in readings]
        if turning:
            axes = np.tile(np.eye(len(forces)), (len(readings), 1, 1))
            for of in turning:
                axes[:, of.all, of.all] = of.axes(rows)
                forces[of.all] = forces[of.all].max()
            H = [one @ sp.csr_matrix(A) for one, A in zip(H, axes, strict=True)]
        parts = {name: [getattr(one, name) for one in readings] for name in PARTS}
        if any(np.any(one.sampled) for one in readings):
            parts |= zip(SAMPLED, zip(*(one.sampled for one in readings), strict=True), strict=True)
        for name, of_readings in parts.items():
            values = np.array(of_readings)
            for of in turning if name in OF_CONSTRAINTS else ():
                values[:, of.own] = of.axes(rows).swapaxes(1, 2) @ values[:, of.own]
            alike, axes = (scales, (0, 2)) if name in OF_CONSTRAINTS else (both, None)
            least = CONSTANT * np.abs(values * alike).max(axis=axes, initial=0.0, keepdims=True)
            moves = np.flatnonzero(np.ptp(values * alike, axis=0) > least[0])
            self._fixed[name] = values[0]
            self._varying[name] = (
                moves,
                _over_time(t, values.reshape(len(values), -1)[:, moves]) if len(moves) else None,
            )
        self._by_multiplier = _by_multiplier(H, t, both.ravel(), forces)

    def __call__(self, name: str, rows: Rows) -> np.ndarray:
        """Return a part of PARTS, or of SAMPLED, at rows of the run, (T, ...)."""
        fixed, (moves, spline) = self._fixed[name], self._varying[name]
        found = np.tile(fixed.ravel(), (len(rows), 1))
        if spline is not None:
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
    most = abs(H[0])
    for one in H[1:]:
        most = most.maximum(abs(one))
    most = sp.coo_matrix(most)
    size = most.data * both[most.row] * forces[most.col]
    used = size > CONSTANT * size.max(initial=0.0)
    place, number = most.row[used], most.col[used]
    gathers = sp.csr_matrix((np.ones(len(place)), (np.arange(len(place)), place)), shape=(len(place), len(both)))
    values = np.array([np.asarray(one[place, number]).ravel() for one in H])
    return number, _over_time(t, values), gathers


def _over_time(t: np.ndarray, values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Values (R, k) of readings as a function of times (T,): cubic, linear where there are few."""
    if len(t) > 3 and values.size:
        from scipy.interpolate import CubicSpline  # here, for it takes a tenth of a second: more than many a solve

        return CubicSpline(t, values)
    return lambda at: np.array([np.interp(at, t, column) for column in values.T]).T.reshape(len(at), -1)
