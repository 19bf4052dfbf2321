"""Readings: tangents of all but the floating bodies at some rows, splined over time; where to read them.

What has to be asked for hardly changes in axes of bodies; what forces of constraints carry is linear in multipliers.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np

from .rows import Rows
from .splined import Reading, Splined, turning_rows
from .unknowns import TurningNode

FIRST = 9  # readings at first
WITHIN = 5e-3  # of the largest entry: a spline that is farther off is read more often
MOST = 0.25  # of rows
JUMP = 0.1  # of the largest entry: tangents of two rows beside one another that are farther apart do not join
ASIDE = 0.382  # of a span, where it is tried: halves of a turn look like the whole


class Readable(Protocol):
    """What can be read at a row.

    scales (n_a,) : finite motions that are alike. inertia : kg m^2, of the lightest body moved so. frames : nodes in
    whose axes readings are. independent (c,) : numbers of the constraints of a reading among all.
    """

    scales: np.ndarray
    inertia: float
    frames: Sequence[TurningNode]
    independent: np.ndarray

    def read(self, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray, multipliers: np.ndarray) -> Reading:
        """Return what is there."""

    def note_dependence(self, readings: Sequence[Reading]) -> None:
        """Note which unknowns matter at all: all others are left out of later readings."""


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
        self._turning = turning_rows(
            source.frames, source.independent, rows[self.at], self._in_order(), source.scales
        )
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
        return Splined(self._rows[self.at], self._in_order(), self._source.scales, forces, self._turning)

    def _in_order(self) -> list[Reading]:
        return [self._read[i] for i in self.at]

    def _differs(self, i: int) -> bool:
        """Whether the tangents of the next row are others."""
        one, two, both = self._read[i], self._read[i + 1], self._source.scales * self._source.scales[:, None]
        pairs = [(one.D, two.D), (one.K, two.K), *zip(one.sampled[::-1], two.sampled[::-1], strict=True)]
        pairs = [(a.toarray(), b.toarray()) for a, b in pairs]
        return any(
            _relative((b - a) * both, np.maximum(np.abs(a), np.abs(b)) * both, least) > JUMP
            for (a, b), least in zip(pairs, 2 * self._least[1:], strict=False)
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
        K = now.stiffness(part.multipliers[0]), splined.stiffness(part)[0]
        pairs = [(getattr(now, name).toarray(), splined(name, part)[0]) for name in ("M", "D")] + [K]
        sampled = [x.toarray() for x in now.sampled]
        fed_back = splined.sampled(part) or [0.0 * x[None] for x in sampled]
        pairs += [(sampled[k], fed_back[k][0]) for k in range(len(sampled))][::-1]
        off = (
            _relative((there - here) * both, here * both, least)
            for (here, there), least in zip(pairs, self._least + self._least[1:], strict=False)
        )
        C = now.C.toarray()
        return max(*off, _relative((splined("C", part)[0] - C) * scale, C * scale))


def _relative(off: np.ndarray, of: np.ndarray, least: float = 0.0) -> float:
    """Largest |off| over the largest |of|, which is at least `least`; 0 of nothing."""
    size = max(float(np.abs(of).max(initial=0.0)), least)
    return float(np.abs(off).max() / size) if size else 0.0
