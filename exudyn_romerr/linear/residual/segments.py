"""Segments of a trajectory between samples, as estimators take them: the start of a run, and blocks of steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...linalg.blocked_products import largest_sizes
from ...model.floating_frame import FrameMotion, Turn


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
    chain : (S + 1, k), z where straight lines lead from one to the next; None: c are other curves.
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
    chain: np.ndarray | None = None
    _made: dict = field(default_factory=dict, init=False)
    _of_ends: dict = field(default_factory=dict, init=False)

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
        return replace(self, c=0 * self.c, chain=None)

    def norms(self, norm: Callable) -> np.ndarray:
        """Norms of the control points (S, d + 1), computed once for all estimators that share `norm`."""

        def make() -> np.ndarray:
            size = norm(self.c if self.chain is None else self.chain)
            return size if self.chain is None else np.stack([size[:-1], size[1:]], axis=1)

        return self._once((norm, "norms"), make)

    def norms_at_ends(self, norm: Callable) -> np.ndarray:
        """Norms (S,) of z at the ends of segments, computed once for all estimators and blocks that share them."""
        if norm not in self._of_ends:
            self._of_ends[norm] = norm(self.c[:, -1] if self.chain is None else self.chain[1:])
        return self._of_ends[norm]

    def share_ends(self, other: Block) -> None:
        """Share norms at ends with a block, of other curves through the same samples, say, if z is the same there."""
        if self is not other and np.array_equal(self.c[:, -1], other.c[:, -1]):
            self._of_ends = other._of_ends

    def largest(self) -> np.ndarray:
        """Largest size (k,) of every entry of the control points."""
        k, rows = self.c.shape[2], self.c.reshape(len(self.h), -1) if self.chain is None else self.chain
        return largest_sizes(rows).reshape(-1, k).max(axis=0)  # long rows are faster

    def integral(self, norm: Callable) -> np.ndarray:
        """Upper bounds (S,) of int |R| over each segment: |R| <= sum_j B_j |c_j| and int B_j = h/(d + 1)."""
        make = lambda: self.h * (self.norms(norm).mean(axis=1) + self.of_inputs(norm, self.unresolved))  # noqa: E731
        return self._once((norm, "integral"), make)

    def variation(self, norm: Callable, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Upper bounds (S,) of the total variation of R inside each segment, and of the jump at its beginning.

        Inside: the length of the control polygon. before (k,): z at the end of the segment before this block.
        """
        inside, jumps = self.length(norm), np.zeros(len(self.h))
        if not self._is_continuous:
            jumps = norm(self.c[:, 0] - np.vstack([before, self.c[:-1, -1]]))
        elif not np.array_equal(self.c[0, 0], before):  # most often by rounding: products depend on the row's place
            jumps[0] = norm(self.c[0, 0] - before)
        return inside + self.of_inputs(norm, self.unresolved_variation), jumps

    @cached_property
    def _is_continuous(self) -> bool:
        return self.chain is not None or np.array_equal(self.c[1:, 0], self.c[:-1, -1])

    def length(self, norm: Callable) -> np.ndarray:
        """Lengths (S,) of the control polygon."""
        return norm.lengths(self.c) if hasattr(norm, "lengths") else norm(np.diff(self.c, axis=1)).sum(axis=1)

    def of_inputs(self, norm: Callable, u: np.ndarray) -> np.ndarray:
        """Norms (S,) of B u, at most, for sizes u (S, p)."""
        if not u.any():
            return np.zeros(len(u))
        columns = np.eye(self.c.shape[2])[self.c.shape[2] - u.shape[1] :]
        return u @ self._once((norm, "inputs"), lambda: norm(columns))

    def _once(self, key: tuple, make: Callable) -> np.ndarray:
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]


def turn_of(block: Block, frame: np.ndarray) -> Turn | None:
    """Return how the frame turns in every segment of a block; frame: its rows (S + 1, 21) at the samples."""
    rows = FrameMotion.of(frame)
    turn = Turn.between(rows.w, rows.al)
    return turn if turn is None or block.bent is None else turn.of_curve(block.bent, block.moved, rows)
