"""Segments of a trajectory between samples, as estimators take them: the start of a run, and blocks of steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...linalg.blocked_products import largest_sizes
from ...model.floating_frame import Turn


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
