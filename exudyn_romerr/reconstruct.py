"""From samples to segments: the trajectory between samples as Bezier control points of z (theory.md 1, 5).

Sampled: z piecewise linear. Reconstructed: the quintic Hermite interpolant through (q, q', q'') at both ends of a step, a
twice differentiable trajectory whose residual holds the error of the time integration too.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import TYPE_CHECKING

import numpy as np

from .estimators.base import Block

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from .inputs import InputSignal
    from .residual import Coordinates

DEGREE = 5
NODES = np.arange(DEGREE + 1) / DEGREE  # where the input is interpolated
CHECKS = (NODES[:-1] + NODES[1:]) / 2  # where what the polynomial misses is looked at
SNAP = 1e-9  # of a step: a jump this close to a sample is at the sample; solvers add up their steps
SAFETY = 2.0  # what lies between the checks may be larger than at them


def _bernstein(x: np.ndarray) -> np.ndarray:
    j = np.arange(DEGREE + 1)
    binomials = np.array([comb(DEGREE, i) for i in j])
    return binomials * x[:, None] ** j * (1 - x[:, None]) ** (DEGREE - j)


FROM_NODES = np.linalg.inv(_bernstein(NODES))
AT_CHECKS = _bernstein(CHECKS)


@dataclass(frozen=True)
class Samples:
    """Consecutive samples: t (S,), q, q_t, q_tt (S, n), u (S, p)."""

    t: np.ndarray
    q: np.ndarray
    q_t: np.ndarray
    q_tt: np.ndarray
    u: np.ndarray

    def after(self, last: Samples) -> Samples:
        """Return these samples with the last one of `last` before them."""
        pairs = zip(vars(last).values(), vars(self).values(), strict=True)
        return Samples(*(np.concatenate([before[-1:], new]) for before, new in pairs))

    def part(self, which: slice) -> Samples:
        """Return some of the samples."""
        return Samples(*(x[which] for x in vars(self).values()))


@dataclass(frozen=True)
class Jump:
    """A load jump at time t: inputs u_left before and u_right after it (p,), dq_tt = q''_right - q''_left (n,)."""

    t: float
    u_left: np.ndarray
    u_right: np.ndarray
    dq_tt: np.ndarray

    def is_before(self, t: float, u: np.ndarray) -> bool:
        """Whether a sample at t with input u was taken before the jump."""
        at_left = np.linalg.norm(u - self.u_left) < np.linalg.norm(u - self.u_right)
        return t < self.t or (t == self.t and bool(at_left))


def make_jumps(times: Sequence[float], signal: InputSignal, response: np.ndarray) -> list[Jump]:
    """Read the one-sided inputs at jump times; response (n, p) is the jump of qr'' per jump of u."""
    jumps = []
    for t in sorted(times):
        left, right = signal.at(np.nextafter(t, -np.inf)), signal.at(np.nextafter(t, np.inf))
        jumps.append(Jump(float(t), left, right, response @ (right - left)))
    return jumps


class Linear:
    """Samples to segments of degree 1."""

    def __init__(self, layout: Coordinates, jumps: Sequence[Jump]):
        self.layout, self.jumps = layout, jumps

    def __call__(self, samples: Samples) -> tuple[Block, np.ndarray]:
        """Return the segments of all steps, and the index of the segment that ends each step."""
        return _by_steps(samples, self.jumps, self._smooth, self._with_jumps)

    def _smooth(self, s: Samples) -> Block:
        z = self.layout(s.q, s.q_t, s.q_tt, s.u)
        return _block(s.t[1:], np.diff(s.t), np.stack([z[:-1], z[1:]], axis=1), self.layout.p)

    def _with_jumps(self, s: Samples, here: list[Jump]) -> Block:
        # every jump moves z by dz; without the jumps z is a straight line
        z0, z1 = self.layout(s.q, s.q_t, s.q_tt, s.u)
        zero = np.zeros_like(s.q[0])
        offsets = np.cumsum([self.layout(zero, zero, j.dq_tt, j.u_right - j.u_left) for j in here], axis=0)
        offsets = np.vstack([np.zeros_like(z0), offsets])
        edges = _edges(s.t, here)
        share = ((edges - s.t[0]) / (s.t[1] - s.t[0]))[:, None]
        line = z0 + share * (z1 - offsets[-1] - z0)
        controls = np.stack([line[:-1] + offsets, line[1:] + offsets], axis=1)
        controls[-1, -1] = z1
        return _without_empty(edges, controls, self.layout.p)


class Quintic:
    """Samples to segments of degree 5; inputs between samples from the signal (None: linear between samples).

    largest_miss: largest part of the inputs that the polynomials miss, over the largest input seen.
    """

    def __init__(self, layout: Coordinates, jumps: Sequence[Jump], signal: InputSignal | None):
        self.layout, self.jumps, self.signal = layout, jumps, signal
        self._miss = self._size = 0.0

    @property
    def largest_miss(self) -> float:
        """Largest |u - u_I| at the check points over the largest |u|."""
        return self._miss / self._size if self._size else 0.0

    def __call__(self, samples: Samples) -> tuple[Block, np.ndarray]:
        """Return the segments of all steps, and the index of the segment that ends each step."""
        return _by_steps(samples, self.jumps, self._smooth, self._with_jumps)

    def _smooth(self, s: Samples) -> Block:
        h = np.diff(s.t)
        controls = hermite_controls(h, s.q, s.q_t, s.q_tt)
        u, missed, variation = self._inputs(s.t[:-1], h, s.u[:-1], s.u[1:])
        c = self.layout(*controls, u)
        return Block(s.t[1:], h, c, missed, variation)

    def _with_jumps(self, s: Samples, here: list[Jump]) -> Block:
        # a sample that coincides with a jump has the acceleration of one side: each step takes that of its own side
        q_tt = s.q_tt.copy()
        edges = _edges(s.t, here)
        q_tt[0] += sum(j.dq_tt for j, t in zip(here, edges[1:-1], strict=True) if t == s.t[0])
        q_tt[1] -= sum(j.dq_tt for j, t in zip(here, edges[1:-1], strict=True) if t == s.t[1])
        shares = (edges - s.t[0]) / (s.t[1] - s.t[0])
        whole = hermite_controls(np.diff(s.t), s.q, s.q_t, q_tt)
        pieces = [np.vstack([subdivided(x[0], a, b)[None] for a, b in _pairs(shares)]) for x in whole]
        starts = np.vstack([s.u[:1], *(j.u_right[None] for j in here)])
        ends = np.vstack([*(j.u_left[None] for j in here), s.u[1:]])
        u, missed, variation = self._inputs(edges[:-1], np.diff(edges), starts, ends)
        return _without_empty(edges, self.layout(*pieces, u), self.layout.p, missed, variation)

    def _inputs(self, start, h, first, last) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Control points (S, 6, p) of the inputs' interpolant with given ends; bounds of what it misses."""
        if self.signal is None or not self.layout.p:
            shares = NODES[:, None]
            return first[:, None] * (1 - shares) + last[:, None] * shares, *np.zeros((2, *first.shape))
        inner = np.sort(np.concatenate([NODES[1:-1], CHECKS]))
        times = start[:, None] + h[:, None] * inner
        values = self.signal(times.ravel()).reshape(*times.shape, -1)
        at_nodes = np.concatenate([first[:, None], values[:, 1::2], last[:, None]], axis=1)
        controls = np.einsum("ij,sjp->sip", FROM_NODES, at_nodes)
        controls[:, 0], controls[:, -1] = first, last
        miss = np.abs(values[:, 0::2] - np.einsum("ij,sjp->sip", AT_CHECKS, controls))
        self._miss, self._size = max(self._miss, miss.max()), max(self._size, np.abs(at_nodes).max())
        return controls, SAFETY * miss.max(axis=1), SAFETY * 2 * miss.sum(axis=1)


def hermite_controls(h: np.ndarray, q, q_t, q_tt) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return control points (S, 6, n) of the quintic Hermite interpolants, of their first and second derivatives.

    First and last control points are the samples themselves, bit for bit, so that R is continuous between steps.
    """
    q0, q1, v0, v1, a0, a1 = (x[part] for x in (q, q_t, q_tt) for part in (slice(None, -1), slice(1, None)))
    h = h[:, None]
    dq = q1 - q0
    position = [
        q0,
        q0 + h * v0 / 5,
        q0 + 2 * h * v0 / 5 + h**2 * a0 / 20,
        q1 - 2 * h * v1 / 5 + h**2 * a1 / 20,
        q1 - h * v1 / 5,
        q1,
    ]
    middle = 5 * dq / h - 2 * (v0 + v1) + h * (a1 - a0) / 4
    velocity = [v0, v0 + h * a0 / 4, middle, v1 - h * a1 / 4, v1]
    bend = 20 * dq / h**2
    acceleration = [a0, bend - (8 * v1 + 12 * v0) / h + a1 - 2 * a0, -bend + (12 * v1 + 8 * v0) / h + a0 - 2 * a1, a1]
    return np.stack(position, axis=1), _raised(np.stack(velocity, axis=1)), _raised(np.stack(acceleration, axis=1))


def _raised(c: np.ndarray) -> np.ndarray:
    """Control points (S, d + 1, n) of the same polynomials with degree 5."""
    for d in range(c.shape[1], DEGREE + 1):
        share = (np.arange(1, d) / d)[:, None]
        c = np.concatenate([c[:, :1], share * c[:, :-1] + (1 - share) * c[:, 1:], c[:, -1:]], axis=1)
    return c


def subdivided(c: np.ndarray, a: float, b: float) -> np.ndarray:
    """Return the control points (d + 1, n) of the part [a, b] of a curve with control points c (de Casteljau)."""
    right = c if a == 0 else _halves(c, a)[1]
    return right if b == 1 else _halves(right, (b - a) / (1 - a) if a < 1 else 1.0)[0]


def _halves(c: np.ndarray, x: float) -> tuple[np.ndarray, np.ndarray]:
    left, right, rest = [c[0]], [c[-1]], c
    while len(rest) > 1:
        rest = (1 - x) * rest[:-1] + x * rest[1:]
        left.append(rest[0])
        right.append(rest[-1])
    return np.array(left), np.array(right[::-1])


def _by_steps(s: Samples, jumps: Sequence[Jump], smooth: Callable, with_jumps: Callable) -> tuple[Block, np.ndarray]:
    """Segments of all steps: the smooth ones at once, those that hold jumps one by one."""
    before = np.array([[jump.is_before(t, u) for t, u in zip(s.t, s.u, strict=True)] for jump in jumps], dtype=bool)
    crossed = before[:, :-1] & ~before[:, 1:] if len(jumps) else np.zeros((0, len(s.t) - 1), dtype=bool)
    special = np.flatnonzero(crossed.any(axis=0))
    if not special.size:
        return smooth(s), np.arange(len(s.t) - 1)
    blocks, ends, first = [], [], 0
    for step in [*special.tolist(), len(s.t) - 1]:
        if step > first:
            blocks.append(smooth(s.part(slice(first, step + 1))))
            ends.extend([1] * (step - first))
        if step < len(s.t) - 1:
            here = [jump for jump, hit in zip(jumps, crossed[:, step], strict=True) if hit]
            blocks.append(with_jumps(s.part(slice(step, step + 2)), here))
            ends.append(len(blocks[-1].h))
        first = step + 1
    return Block.joined(blocks), np.cumsum(ends) - 1


def _edges(t: np.ndarray, here: list[Jump]) -> np.ndarray:
    """Ends of the pieces of a step."""
    near = SNAP * (t[1] - t[0])
    inner = [t[0] if jump.t <= t[0] + near else t[1] if jump.t >= t[1] - near else jump.t for jump in here]
    return np.array([t[0], *inner, t[1]])


def _pairs(x: np.ndarray) -> list[tuple[float, float]]:
    return list(zip(x[:-1].tolist(), x[1:].tolist(), strict=True))


def _block(t, h, c, p: int) -> Block:
    return Block(t, h, c, np.zeros((len(h), p)), np.zeros((len(h), p)))


def _without_empty(edges: np.ndarray, c: np.ndarray, p: int, *missed: np.ndarray) -> Block:
    """Segments between edges; those of no length (a jump at a sample) are left out."""
    h = np.diff(edges)
    kept = h > 0
    missed = [x[kept] for x in missed] or np.zeros((2, int(kept.sum()), p))
    return Block(edges[1:][kept], h[kept], c[kept], *missed)
