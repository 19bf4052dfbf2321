"""Samples of a trajectory, arrays that grow with them, segments between them as estimators take them, load jumps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ...checks import check_finite
from ...errors import InputError
from ...linalg.blocked_products import largest_sizes
from ...model.floating_frame import Turn
from .input_signal import InputSignal

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


@dataclass(frozen=True)
class Start:
    """First instant of a run.

    z : (k,) residual coordinates; y0, y0_t : columns' combinations with K e0 = L y0, M e0' = L y0' (theory.md 3),
    None if the initial error is zero.
    """

    t: float
    z: np.ndarray
    y0: np.ndarray | None = None
    y0_t: np.ndarray | None = None


@dataclass
class Block:
    """S consecutive segments of a trajectory, polynomial in time.

    t : (S,) ends of the segments; h : (S,) lengths; c : (S, d + 1, k) Bezier control points of z.
    unresolved : (S, p) bounds of |u - u_I| in each segment, u_I the polynomial that c contains.
    unresolved_variation : (S, p) bounds of the total variation of u - u_I.
    skipped : (S, 2, n), samples of qr and qr' less the trajectory at the ends of the segments; None: no difference.
    turn : how the frame turns in each segment; None: not at all.
    bent, moved : (S, 2), see Turn.of_curve.
    """

    t: np.ndarray
    h: np.ndarray
    c: np.ndarray
    unresolved: np.ndarray
    unresolved_variation: np.ndarray
    skipped: np.ndarray | None = None
    turn: Turn | None = None
    bent: np.ndarray | None = None
    moved: np.ndarray | None = None
    _norms: dict[Callable, np.ndarray] = field(default_factory=dict, init=False)

    @classmethod
    def joined(cls, blocks: Sequence[Block]) -> Block:
        """Return blocks one after another: t, h, c, unresolved and skipped, as frames at rest have them alone."""
        fields = ("t", "h", "c", "unresolved", "unresolved_variation")
        joined = cls(*(np.concatenate([getattr(block, name) for block in blocks]) for name in fields))
        shapes = {block.skipped.shape[1:] for block in blocks if block.skipped is not None}
        if shapes:
            none = np.zeros((1, *shapes.pop()))
            parts = [np.repeat(none, len(b.h), axis=0) if b.skipped is None else b.skipped for b in blocks]
            joined.skipped = np.concatenate(parts)
        return joined

    def without_residual(self) -> Block:
        """Return the same segments with R = 0."""
        return replace(self, c=0 * self.c)

    def largest(self) -> np.ndarray:
        """Largest size (k,) of every entry of the control points."""
        k = self.c.shape[2]
        return largest_sizes(self.c.reshape(len(self.h), -1)).reshape(-1, k).max(axis=0)  # long rows are faster

    def integral(self, norm: Callable) -> np.ndarray:
        """Upper bounds (S,) of int |R| over each segment: |R| <= sum_j B_j |c_j| and int B_j = h/(d + 1)."""
        if norm not in self._norms:  # once for all estimators that share it
            self._norms[norm] = norm(self.c).mean(axis=1)
        return self.h * (self._norms[norm] + self.of_inputs(norm, self.unresolved))

    def variation(self, norm: Callable, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Upper bounds (S,) of the total variation of R inside each segment, and of the jump at its beginning.

        Inside: the length of the control polygon. before (k,): z at the end of the segment before this block.
        """
        gaps = self.c[:, 0] - np.vstack([before, self.c[:-1, -1]])
        jumps = norm(gaps) if gaps.any() else np.zeros(len(gaps))
        return self.length(norm) + self.of_inputs(norm, self.unresolved_variation), jumps

    def length(self, norm: Callable) -> np.ndarray:
        """Lengths (S,) of the control polygon."""
        return norm.lengths(self.c) if hasattr(norm, "lengths") else norm(np.diff(self.c, axis=1)).sum(axis=1)

    def of_inputs(self, norm: Callable, u: np.ndarray) -> np.ndarray:
        """Norms (S,) of B u, at most, for sizes u (S, p)."""
        k = self.c.shape[2]
        return u @ norm(np.eye(k)[k - u.shape[1] :]) if u.any() else np.zeros(len(u))


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
