"""Reconstruction of the trajectory between samples: Bezier control points of z (theory.md 1, 5).

Sampled: z piecewise linear. Reconstructed: the quintic Hermite interpolant through (q, q', q'') at both ends of a
step, a twice differentiable trajectory whose residual holds the error of the time integration too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...linalg.bezier import (
    CHECKS,
    NODES,
    hermite_bends,
    hermite_controls,
    hermite_rows,
    interpolated,
    straight,
    subdivided,
)
from ...linalg.blocked_products import norms_times
from .input_signal import InputSignal
from .residual import Coordinates
from .samples import Block, Jump, Samples, piece_ends, without_empty

SAFETY = 6.0  # what lies between the checks may be larger: a single kink at its worst place 2.6 times
SHORT = 0.02  # rad of the first mode per step: below, rounding of q'' from differences of q is looked at
LONG = 0.2  # rad of the first mode per knot interval: longer ones are not tried
ROUNDING_SHARE = 0.1  # of the variation of R: above, fewer samples are taken as knots, and the report speaks of it


class Segmenter:
    """Samples to segments: by _smooth of many steps at once, by _with_jumps of a step that holds jumps."""

    def __init__(self, layout: Coordinates, jumps: Sequence[Jump]):
        self.layout, self.jumps = layout, jumps

    def __call__(self, s: Samples) -> tuple[Block, np.ndarray | slice]:
        """Return the segments of all steps, and the index of the segment that ends each step."""
        if not self.jumps:
            return self._smooth(s), slice(None)
        before = np.array([[jump.is_before(t, u) for t, u in zip(s.t, s.u, strict=True)] for jump in self.jumps])
        crossed = before[:, :-1] & ~before[:, 1:]
        special = np.flatnonzero(crossed.any(axis=0))
        if not special.size:
            return self._smooth(s), slice(None)
        blocks, ends, first = [], [], 0
        for step in [*special.tolist(), len(s.t) - 1]:
            if step > first:
                blocks.append(self._smooth(s.part(slice(first, step + 1))))
                ends.extend([1] * (step - first))
            if step < len(s.t) - 1:
                here = [jump for jump, hit in zip(self.jumps, crossed[:, step], strict=True) if hit]
                blocks.append(self._with_jumps(s.part(slice(step, step + 2)), here))
                ends.append(len(blocks[-1].h))
            first = step + 1
        return Block.joined(blocks), np.cumsum(ends) - 1


class Linear(Segmenter):
    """Samples to segments of degree 1."""

    def _smooth(self, s: Samples) -> Block:
        z = self.layout(s.q, s.q_t, s.q_tt, s.u)
        missed = np.zeros((2, len(z) - 1, self.layout.p))
        return Block(s.t[1:], np.diff(s.t), np.stack([z[:-1], z[1:]], axis=1), *missed)

    def _with_jumps(self, s: Samples, here: list[Jump]) -> Block:
        # every jump moves z by dz; without the jumps z is a straight line
        z0, z1 = self.layout(s.q, s.q_t, s.q_tt, s.u)
        zero = np.zeros_like(s.q[0])
        offsets = np.cumsum([self.layout(zero, zero, j.dq_tt, j.u_right - j.u_left) for j in here], axis=0)
        offsets = np.vstack([np.zeros_like(z0), offsets])
        edges = piece_ends(s.t, here)
        share = ((edges - s.t[0]) / (s.t[1] - s.t[0]))[:, None]
        line = z0 + share * (z1 - offsets[-1] - z0)
        controls = np.stack([line[:-1] + offsets, line[1:] + offsets], axis=1)
        controls[-1, -1] = z1
        return without_empty(edges, controls, self.layout.p)


@dataclass(frozen=True)
class _Choice:
    """Segments through some samples as knots, the size of what they add to the bounds, rounding's part of it."""

    block: Block
    size: float
    rounding: float

    @property
    def rounds(self) -> bool:
        """Whether rounding matters."""
        return self.rounding > ROUNDING_SHARE * self.size


class Quintic(Segmenter):
    """Samples to segments of degree 5; inputs between samples from the signal (None: linear between samples).

    Where steps are so short that rounding of q'' from differences of q would dominate, only every s-th sample is a
    knot of the interpolant; the known differences at the samples between come with the block. measure: z -> norm of R
    by which s is chosen. mass_root: given in a turning frame, whose terms z takes as linear between samples; blocks
    then tell how far the trajectory is from that.
    """

    def __init__(
        self,
        layout: Coordinates,
        jumps: Sequence[Jump],
        signal: InputSignal | None,
        measure: Callable,
        omega_1: float,
        mass_root: np.ndarray | None = None,
    ):
        super().__init__(layout, jumps)
        self.signal, self.measure, self.omega_1, self.mass_root = signal, measure, omega_1, mass_root
        self._miss = self._size = self._rounding = self._variation = 0.0

    @property
    def largest_miss(self) -> float:
        """Largest |u - u_I| at the check points over the largest |u|."""
        return self._miss / self._size if self._size else 0.0

    @property
    def rounding_share(self) -> float:
        """Estimated share of rounding in the variation of R, where steps are short."""
        return self._rounding / self._variation if self._variation else 0.0

    def _smooth(self, s: Samples) -> Block:
        every, inputs = np.arange(len(s.t)), self._inputs(s.t[:-1], np.diff(s.t), s.u[:-1], s.u[1:])
        if np.diff(s.t).max() * self.omega_1 >= SHORT or len(s.t) == 2:
            return self._through(s, every, inputs)
        best, stride = self._choice(s, every, inputs), 2
        while best.rounds and stride < len(every) and (s.t[stride] - s.t[0]) * self.omega_1 <= LONG:
            choice = self._choice(s, np.unique(np.append(every[::stride], every[-1])), inputs)
            if choice.size > best.size:
                break
            best, stride = choice, 2 * stride
        self._variation, self._rounding = self._variation + best.size, self._rounding + best.rounding
        return best.block

    def _choice(self, s: Samples, knots: np.ndarray, inputs: tuple) -> _Choice:
        block = self._through(s, knots, inputs)
        return _Choice(block, self._size_of(block), self._rounding_of(s.part(knots)))

    def _through(self, s: Samples, knots: np.ndarray, inputs: tuple) -> Block:
        """Segments between all samples, of the interpolant through those at the knots."""
        h, states, skipped = np.diff(s.t), (s.q, s.q_t, s.q_tt), None
        u, *missed = inputs
        if len(knots) == len(s.t):
            c = hermite_rows(self.layout, h, (*states, s.u), u)
        else:
            curves = [_cut(s.t, knots, c) for c in hermite_controls(np.diff(s.t[knots]), *(x[knots] for x in states))]
            skipped = np.stack([s.q[1:] - curves[0][:, -1], s.q_t[1:] - curves[1][:, -1]], axis=1)
            c = self.layout(*curves, straight(s.u[:-1], s.u[1:]) if u is None else u)
        block = Block(s.t[1:], h, c, *missed, skipped)
        if self.mass_root is not None:
            if skipped is None:
                bent = [self._sizes(bend).sum(axis=0) / len(NODES) for bend in hermite_bends(h, *states)]
            else:
                lines = (straight(x[:-1], x[1:]) for x in states[:2])
                bent = [self._sizes(x - line).mean(axis=1) for x, line in zip(curves, lines, strict=False)]
            block.bent = np.stack(bent, axis=1)
            block.moved = np.stack([self._sizes(np.diff(x, axis=0)) for x in states[:2]], axis=1)
        return block

    def _sizes(self, x: np.ndarray) -> np.ndarray:
        """|V x|_M (...) of x (..., n)."""
        return norms_times(x, self.mass_root.T)

    def _size_of(self, block: Block) -> float:
        """Variation of R over a block and the size of the differences at skipped samples, in the measure's norm."""
        size = float(self.measure(np.diff(block.c, axis=1)).sum())
        if block.skipped is None:
            return size
        dq = block.skipped[:, 0]
        return size + float(self.measure(self.layout(dq, 0 * dq, 0 * dq, np.zeros((len(dq), self.layout.p)))).max())

    def _rounding_of(self, s: Samples) -> float:
        """Estimated variation of R from rounding of 20 dq/H^2 in the control points of q''."""
        dq_tt = 40 * np.finfo(float).eps * np.abs(s.q[1:]) / np.diff(s.t)[:, None] ** 2
        z = self.layout(0 * dq_tt, 0 * dq_tt, dq_tt, np.zeros((len(dq_tt), self.layout.p)))
        return float(self.measure(z).sum())

    def _with_jumps(self, s: Samples, here: list[Jump]) -> Block:
        # a sample that coincides with a jump has the acceleration of one side: each step takes that of its own side
        q_tt = s.q_tt.copy()
        edges = piece_ends(s.t, here)
        q_tt[0] += sum(j.dq_tt for j, t in zip(here, edges[1:-1], strict=True) if t == s.t[0])
        q_tt[1] -= sum(j.dq_tt for j, t in zip(here, edges[1:-1], strict=True) if t == s.t[1])
        shares = (edges - s.t[0]) / (s.t[1] - s.t[0])
        curves = hermite_controls(np.diff(s.t), s.q, s.q_t, q_tt)
        pieces = [subdivided(np.repeat(c, len(shares) - 1, axis=0), shares[:-1], shares[1:]) for c in curves]
        starts = np.vstack([s.u[:1], *(j.u_right[None] for j in here)])
        ends = np.vstack([*(j.u_left[None] for j in here), s.u[1:]])
        u, missed, variation = self._inputs(edges[:-1], np.diff(edges), starts, ends)
        u = straight(starts, ends) if u is None else u
        return without_empty(edges, self.layout(*pieces, u), self.layout.p, missed, variation)

    def _inputs(self, start, h, first, last) -> tuple[np.ndarray | None, np.ndarray, np.ndarray]:
        """Control points (S, 6, p) of the inputs' interpolant with given ends; bounds of what it misses.

        None in place of control points: straight lines.
        """
        if self.signal is None or not self.layout.p:
            return None, *np.zeros((2, len(h), 0))
        inner = np.sort(np.concatenate([NODES[1:-1], CHECKS]))
        times = start[:, None] + h[:, None] * inner
        values = self.signal(times.ravel()).reshape(*times.shape, -1)
        controls, largest, summed, size = interpolated(first, last, values)
        self._miss, self._size = max(self._miss, largest.max()), max(self._size, size)
        return controls, SAFETY * largest, SAFETY * 2 * summed


def _cut(t: np.ndarray, knots: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Control points (S, 6, n) between all samples of curves given between knots."""
    interval = np.searchsorted(knots, np.arange(len(t) - 1), side="right") - 1
    start, length = t[knots[interval]], np.diff(t[knots])[interval]
    last = np.isin(np.arange(1, len(t)), knots)
    pieces = subdivided(c[interval], (t[:-1] - start) / length, np.where(last, 1.0, (t[1:] - start) / length))
    pieces[1:, 0] = pieces[:-1, -1]  # continuous to the last bit
    return pieces
