"""Samples of a trajectory and arrays that grow with them, load jumps, and the pieces of steps that hold jumps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...checks import check_finite
from ...errors import InputError
from .input_signal import InputSignal
from .segments import Block

SAME_TIMES = 1e-9  # of the span: instants this close are one; solvers add up their steps, to 1e-12 of it
SNAP = 1e-9  # of a step: a jump this close to a sample is at the sample; solvers add up their steps


@dataclass(frozen=True)
class Samples:
    """Consecutive samples: t (S,), q, q_t, q_tt (S, n), u (S, p); frame (S, 24), or (S, 0) of a body at rest."""

    t: np.ndarray
    q: np.ndarray
    q_t: np.ndarray
    q_tt: np.ndarray
    u: np.ndarray
    frame: np.ndarray

    def after(self, last: Samples) -> Samples:
        """Return these samples with the last one of `last` before them."""
        pairs = zip(vars(last).values(), vars(self).values(), strict=True)
        return Samples(*(np.concatenate([before[-1:], new]) for before, new in pairs))

    def part(self, which: slice) -> Samples:
        """Return some of the samples."""
        return Samples(*(x[which] for x in vars(self).values()))

    def copy(self) -> Samples:
        """Return the same in arrays of their own."""
        return Samples(*(x.copy() for x in vars(self).values()))


class GrowingArray:
    """An array that grows: rows are kept once, and read without a copy; its room doubles when it is full."""

    def __init__(self) -> None:
        self._held: np.ndarray | None = None
        self._count = 0

    def append(self, rows: np.ndarray) -> None:
        """Add rows (S, ...)."""
        before, self._count = self._count, self._count + len(rows)
        if self._held is None or self._count > len(self._held):
            held = np.empty((max(self._count, 2 * before), *rows.shape[1:]), dtype=rows.dtype)
            if before:
                held[:before] = self._held[:before]
            self._held = held
        self._held[before : self._count] = rows

    def cut(self, count: int) -> None:
        """Forget the rows from `count` on; what was read of them before changes with those that are added then."""
        self._count = min(count, self._count)

    def __len__(self) -> int:
        return self._count

    def read(self) -> np.ndarray:
        """Return all rows, (0,) if there are none, not to be written to; later ones do not show in it."""
        if self._held is None:
            return np.zeros(0)
        rows = self._held[: self._count]
        rows.flags.writeable = False  # a report changed in place would change the run that goes on
        return rows


class Extension(NamedTuple):
    """Further samples, and stream -> (their segments, index of the segment that ends each step)."""

    new: Samples
    segments: dict[str, tuple[Block, np.ndarray]]


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


def piece_ends(t: np.ndarray, here: list[Jump]) -> np.ndarray:
    """Ends of the pieces of a step."""
    near = SNAP * (t[1] - t[0])
    inner = [t[0] if jump.t <= t[0] + near else t[1] if jump.t >= t[1] - near else jump.t for jump in here]
    return np.array([t[0], *inner, t[1]])


def without_empty(edges: np.ndarray, c: np.ndarray, p: int, *missed: np.ndarray) -> Block:
    """Segments between edges; those of no length (a jump at a sample) are left out."""
    h = np.diff(edges)
    kept = h > 0
    missed = [x[kept] for x in missed] or np.zeros((2, int(kept.sum()), p))
    return Block(edges[1:][kept], h[kept], c[kept], *missed)


def checked_states(t: np.ndarray, states: Sequence, n: int, last: float) -> list[np.ndarray]:
    """Return q, q_t, q_tt (S, n) at t (S,) as arrays; InputError if they do not fit, or t is not after `last`."""
    states = [np.asarray(x, dtype=float) for x in states]
    if t.ndim != 1 or any(x.shape != (len(t), n) for x in states):
        raise InputError(f"trajectory arrays have shapes {[x.shape for x in states]}; needed: ({len(t)}, {n})")
    for name, x in zip(("t", "q", "q_t", "q_tt"), (t, *states), strict=True):
        check_finite(name, x)
    check_increasing(t, last)
    return states


def check_increasing(t: np.ndarray, last: float = -np.inf) -> None:
    """Raise InputError unless t (S,) increases, and is after `last`."""
    late = np.diff(t, prepend=last) <= 0
    if late.any():
        at = int(np.argmax(late))
        raise InputError(f"t does not increase at entry {at}: {t[at]:.9g} s after {([last, *t])[at]:.9g} s")


def instants_in(t: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return where in t (n,), ascending, the wanted instants are; InputError for the first that it lacks."""
    at = np.clip(np.searchsorted(t, wanted), 1, max(len(t) - 1, 1)) if len(t) > 1 else np.zeros(len(wanted), int)
    at = np.where(np.abs(t[at - 1] - wanted) < np.abs(t[at] - wanted), at - 1, at)
    gap = np.abs(t[at] - wanted)
    if gap.max() > SAME_TIMES * max(np.ptp(wanted), np.finfo(float).tiny):
        raise InputError(f"t lacks the report's instant {wanted[gap.argmax()]:.6g} s; give the truth at report.t")
    return at
