"""From samples to segments: the trajectory between samples as Bezier control points of z (theory.md 1, 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


@dataclass(frozen=True)
class Jump:
    """A load jump at time t: inputs u_left before and u_right after it (p,), and z_right - z_left = dz (k,)."""

    t: float
    u_left: np.ndarray
    u_right: np.ndarray
    dz: np.ndarray

    def is_before(self, t: float, u: np.ndarray) -> bool:
        """Whether a sample at t with input u was taken before the jump."""
        at_left = np.linalg.norm(u - self.u_left) < np.linalg.norm(u - self.u_right)
        return t < self.t or (t == self.t and bool(at_left))


def make_jumps(times: Sequence[float], f: Callable, acceleration: Callable) -> list[Jump]:
    """Read the one-sided inputs at jump times from f; acceleration(du) is the jump of z in its part of qr''."""
    jumps = []
    for t in sorted(times):
        left, right = f(np.nextafter(t, -np.inf)), f(np.nextafter(t, np.inf))
        jumps.append(Jump(float(t), left, right, acceleration(right - left)))
    return jumps


@dataclass(frozen=True)
class Segments:
    """Polynomial segments covering a block of steps.

    t (S,) ends, h (S,) lengths, c (S, d+1, k) control points, step_end (steps,) index of the segment that ends each
    step. Where c jumps between segments, the load does.
    """

    t: np.ndarray
    h: np.ndarray
    c: np.ndarray
    step_end: np.ndarray


def linear_segments(t: np.ndarray, z: np.ndarray, u: np.ndarray, jumps: Sequence[Jump]) -> Segments:
    """Take z piecewise linear between samples t (S+1,), z (S+1, k), apart from the given jumps."""
    c = np.stack([z[:-1], z[1:]], axis=1)
    lengths, steps = np.diff(t), len(t) - 1
    inside = [jump for jump in jumps if jump.is_before(t[0], u[0]) and not jump.is_before(t[-1], u[-1])]
    if not inside:
        return Segments(t[1:], lengths, c, np.arange(steps))
    pieces = [_split_at_jumps(t[s : s + 2], z[s : s + 2], u[s : s + 2], inside) for s in range(steps)]
    flat = [piece for parts in pieces for piece in parts]
    ends = np.cumsum([len(parts) for parts in pieces]) - 1
    knots, controls = (np.array(part) for part in zip(*flat, strict=True))
    return Segments(knots[:, 1], knots[:, 1] - knots[:, 0], controls, ends)


def _split_at_jumps(t, z, u, jumps) -> list[tuple]:
    """Segments (ends, control points) of one step that may hold jumps."""
    here = [jump for jump in jumps if jump.is_before(t[0], u[0]) and not jump.is_before(t[1], u[1])]
    smooth_end = z[1] - sum((jump.dz for jump in here), np.zeros_like(z[1]))
    pieces, start, offset = [], t[0], np.zeros_like(z[0])

    def at(time):
        share = (time - t[0]) / (t[1] - t[0])
        return (1 - share) * z[0] + share * smooth_end + offset

    for jump in here:
        time = min(max(jump.t, start), t[1])
        pieces.append(((start, time), (at(start), at(time))))
        start, offset = time, offset + jump.dz
    pieces.append(((start, t[1]), (at(start), z[1])))
    return pieces
