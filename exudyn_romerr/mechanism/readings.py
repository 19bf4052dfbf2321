"""Readings: tangents of all but the floating bodies at some rows, splined over time; where to read them.

What has to be asked for hardly changes in axes of bodies; what forces of constraints carry is linear in multipliers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from scipy.interpolate import CubicSpline

from .samples import Rows

FIRST = 9  # readings at first
WITHIN = 5e-3  # of the largest entry: a spline that is farther off is read more often
MOST = 0.25  # of rows
JUMP = 0.1  # of the largest entry: tangents of two rows beside one another that are farther apart do not join
ASIDE = 0.382  # of a span, where it is tried: halves of a turn look like the whole
CONSTANT = 1e-11  # of the largest of alike entries: one that varies by less does not
PARTS = ("M", "D", "K", "G", "C")
OF_CONSTRAINTS = ("G", "C")


@dataclass(frozen=True)
class Reading:
    """Of all but floating bodies, in axes of bodies, at one row.

    M, D, K (n_a, n_a) : K without forces of constraints. G, C (c, n_a) of independent constraints: forces G^T lam,
    what is kept zero C z. H (n_a, n_a, all) : change of the forces of constraints, for each multiplier.
    """

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    G: np.ndarray
    C: np.ndarray
    H: np.ndarray

    def stiffness(self, multipliers: np.ndarray) -> np.ndarray:
        """K with what turning constraints add to it."""
        return self.K + self.H @ multipliers if multipliers.size else self.K


class Readable(Protocol):
    """What can be read at a row.

    scales (n_a,) : finite motions that are alike. inertia : kg m^2, of the lightest body moved so.
    """

    scales: np.ndarray
    inertia: float

    def read(self, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray, multipliers: np.ndarray) -> Reading:
        """Return what is there."""

    def note_dependence(self, readings: Sequence[Reading]) -> None:
        """Note which unknowns matter at all: all others are left out of later readings."""


class Splined:
    """Readings over time: entries that are always the same once, others by a cubic spline.

    scales (n_a,) : finite motions that are alike. forces (all,) : the largest of each multiplier. Forces and moments,
    lengths and angles are told from rounding only beside their like.
    """

    def __init__(self, t: np.ndarray, readings: Sequence[Reading], scales: np.ndarray, forces: np.ndarray):
        self._fixed, self._varying, both = {}, {}, scales * scales[:, None]
        for name in PARTS:
            values = np.array([getattr(one, name) for one in readings])
            alike, axes = (scales, (0, 2)) if name in OF_CONSTRAINTS else (both, None)
            least = CONSTANT * np.abs(values * alike).max(axis=axes, initial=0.0, keepdims=True)
            moves = np.flatnonzero(np.ptp(values * alike, axis=0) > least[0])
            self._fixed[name] = values[0]
            self._varying[name] = (
                moves,
                _over_time(t, values.reshape(len(values), -1)[:, moves]) if len(moves) else None,
            )
        self._by_multiplier = _sparse(np.array([one.H for one in readings]), t, both[..., None] * forces)

    def __call__(self, name: str, t: np.ndarray) -> np.ndarray:
        """Return a part of PARTS at times t, (T, ...)."""
        fixed, (moves, spline) = self._fixed[name], self._varying[name]
        found = np.tile(fixed.ravel(), (len(t), 1))
        if spline is not None:
            found[:, moves] = spline(t)
        return found.reshape(len(t), *fixed.shape)

    def stiffness(self, t: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """Return K (T, n_a, n_a) with what multipliers (T, all) make of turning constraints."""
        K, (number, values, gathers) = self("K", t), self._by_multiplier
        if len(number):
            K += ((values(t) * multipliers[:, number]) @ gathers).reshape(K.shape)
        return K


def _sparse(H: np.ndarray, t: np.ndarray, alike: np.ndarray) -> tuple[np.ndarray, Callable, sp.csr_matrix]:
    """Entries of H (readings, n_a, n_a, all) that are not zero: multipliers, values over time, where they go.

    alike (n_a, n_a, all) : times these entries are works.
    """
    R, n, _, count = H.shape
    flat = H.reshape(R, -1)
    size = (np.abs(H).max(axis=0, initial=0.0) * alike).ravel()
    used = np.flatnonzero(size > CONSTANT * size.max(initial=0.0))
    place, number = np.divmod(used, max(count, 1))
    gathers = sp.csr_matrix((np.ones(len(used)), (np.arange(len(used)), place)), shape=(len(used), n * n))
    return number, _over_time(t, flat[:, used]), gathers


def _over_time(t: np.ndarray, values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Values (R, k) of readings as a function of times (T,): cubic, linear where there are few."""
    if len(t) > 3:
        return CubicSpline(t, values)
    return lambda at: np.array([np.interp(at, t, column) for column in values.T]).T.reshape(len(at), -1)


class Readings:
    """Readings at rows of a run: more of them where a spline of those before would not have told them.

    at : rows that were read. splined : all of them over time. doubtful : rows where the spline may still be off:
    between rows that were read, and where two of these are beside one another and apart.
    """

    def __init__(self, source: Readable, rows: Rows):
        self._source, self._rows, self._read = source, rows, {}
        S, T = len(rows), rows.t[-1] - rows.t[0] or 1.0
        # what is less moves no body along the run
        self._least = [2 * source.inertia / T**order for order in (0, 1, 2)]
        first = np.unique(np.clip([0, 1, 4, *np.linspace(0, S - 1, FIRST).astype(int)], 0, S - 1))
        for i in first:
            self._take(i)
        source.note_dependence([*self._read.values()])
        spans = [*pairwise(first)]
        while spans:
            spans = self._refined(spans)
            if len(self._read) + len(spans) > max(S * MOST, 2 * FIRST):
                break
        self.splined = self._spline()
        jumps = (i for i, j in pairwise(self.at) if j == i + 1 and self._differs(i))
        self.doubtful = {(a + b) // 2 for a, b in spans} | {i for first in jumps for i in (first, first + 1)}

    @property
    def at(self) -> np.ndarray:
        """Rows that were read, in their order."""
        return np.array(sorted(self._read))

    def _spline(self) -> Splined:
        forces = np.abs(self._rows.multipliers).max(axis=0, initial=0.0)
        return Splined(self._rows.t[self.at], [self._read[i] for i in self.at], self._source.scales, forces)

    def _differs(self, i: int) -> bool:
        """Whether the tangents of the next row are others."""
        one, two, both = self._read[i], self._read[i + 1], self._source.scales * self._source.scales[:, None]
        pairs = ((one.D, two.D), (one.K, two.K))
        return any(
            _relative((b - a) * both, np.maximum(np.abs(a), np.abs(b)) * both, least) > JUMP
            for (a, b), least in zip(pairs, self._least[1:], strict=True)
        )

    def _refined(self, spans: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Read within each span; return both parts of those where the spline was off."""
        splined, wrong = self._spline(), []
        for a, b in spans:
            if b - a > 1:
                self._take(c := a + max(1, round(ASIDE * (b - a))))
                if self._off(c, splined) > WITHIN:
                    wrong += [(a, c), (c, b)]
        return wrong

    def _take(self, i: int) -> None:
        self._read[i] = self._source.read(*self._rows.row(i))

    def _off(self, i: int, splined: Splined) -> float:
        """Largest difference of what was read from what a spline told, over the largest of its part."""
        now, part, scale = self._read[i], self._rows[i : i + 1], self._source.scales
        both = scale * scale[:, None]
        K = now.stiffness(part.multipliers[0]), splined.stiffness(part.t, part.multipliers)[0]
        pairs = zip((now.M, now.D, K[0]), (splined("M", part.t)[0], splined("D", part.t)[0], K[1]), strict=True)
        off = (
            _relative((there - here) * both, here * both, least)
            for (here, there), least in zip(pairs, self._least, strict=True)
        )
        return max(*off, _relative((splined("C", part.t)[0] - now.C) * scale, now.C * scale))


def _relative(off: np.ndarray, of: np.ndarray, least: float = 0.0) -> float:
    """Largest |off| over the largest |of|, which is at least `least`; 0 of nothing."""
    size = max(float(np.abs(of).max(initial=0.0)), least)
    return float(np.abs(off).max() / size) if size else 0.0
