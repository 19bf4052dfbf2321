"""What the reduced run and the estimated error leave of the full mechanism's equations, by body, in K^-1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from ..mechanism.rotations import times_transposed
from ..mechanism.tangents import Block
from ..mechanism.unknowns import Unknowns
from ..mechanism_errors.unbalanced import unbalanced
from .residual_norm import ResidualNorm


@dataclass
class Residual:
    """R at T rows. y (T, Y) : of all bodies, |y| = |R|_{K^-1}.

    fast, fast_change (T,) : bounds of turning terms of fast oscillators, which y lacks, and of their change from row
    to row. push (T,) : |force|_{M^-1} that no body balances.
    """

    y: np.ndarray
    fast: np.ndarray
    fast_change: np.ndarray
    push: np.ndarray


class Residuals:
    """Residuals of block after block.

    cuts : where y of each body begins, and where the last ends. on_shapes (Y,) : which of y are on modes and vectors.
    start : |a|_M and |a|_K of accelerations that the first row sets off beside the estimate's own.
    """

    def __init__(self, unknowns: Unknowns, norms: Sequence[ResidualNorm]):
        self._u, self._norms, self._before = unknowns, norms, None
        own = [np.arange(at.start, at.stop) for at in unknowns.blocks]
        self._others = np.setdiff1d(np.arange(unknowns.n_a), np.concatenate(own))
        self.start = 0.0, 0.0
        self.cuts = np.cumsum([0, *(norm.size for norm in norms)])
        self.on_shapes = np.zeros(self.cuts[-1], bool)
        for norm, end in zip(norms, self.cuts[1:], strict=True):
            self.on_shapes[end - norm.body.k : end] = True

    def take(self, block: Block, f: np.ndarray, e: np.ndarray, lam: np.ndarray) -> Residual:
        """Return R under errors e (T, 3, n), lam (T, c) that kicks f (T, n) make."""
        r, moved = unbalanced(block, self._u, f, e, lam)
        push, starts, kept, ys = self._of_others(block, r), [], [], []
        fast = fast_change = np.zeros(len(r))
        before = self._before or [None] * len(self._norms)
        frames = [motion.A for motion in block.motions]  # whose axes forces stay in, turned or not
        of_blocks = self._u.blocks, self._u.waves, block.couplings, frames
        for norm, at, wave, coupling, A, motion, last in zip(self._norms, *of_blocks, moved, before, strict=True):
            shift, on_shapes, work = _taken_by_frame(block, r, at, wave, coupling.M)
            push = push + work
            shift = np.concatenate([times_transposed(A, shift[:, part]) for part in (slice(3), slice(3, 6))], axis=1)
            parts = norm.turning_parts(motion, shift)
            last = [np.concatenate([x[:1] if last is None else last[i], x[:-1]]) for i, x in enumerate(parts)]
            fast, fast_change = fast + norm.turning(parts), fast_change + norm.turning_change(parts, last)
            ys.append(norm.coordinates(motion, shift, -on_shapes))
            kept.append([x[-1:] for x in parts])
            starts.append((norm, motion[:1], shift[:1]))
        if self._before is None:
            self._begin(block, starts, ys)
        self._before = kept
        push = np.sqrt(np.maximum(push, 0.0))
        return Residual(np.concatenate(ys, axis=1), fast, fast_change, push)

    def _of_others(self, block: Block, r: np.ndarray) -> np.ndarray:
        """|r|_{M^-1}^2 (T,) of all that is no body."""
        own = r[:, self._others]
        if not own.any():
            return np.zeros(len(r))
        M = block.M[:, self._others][:, :, self._others]
        size = np.sqrt(np.maximum(np.diagonal(M, axis1=1, axis2=2), np.finfo(float).tiny))
        x = own / size
        return np.einsum("ti,tij,tj->t", x, np.linalg.pinv(M / size[:, None] / size[:, :, None]), x)

    def _begin(self, block: Block, starts: list, ys: list[np.ndarray]) -> None:
        """What the first row accelerates, of bodies and springs."""
        if not any(y[0].any() for y in ys):
            return
        mass, stiff = np.array([norm.start(motion, shift) for norm, motion, shift in starts]).T
        K = block.rest[2][0]
        springs = la.eigh((K + K.T) / 2, block.M[0], eigvals_only=True)[-1] if K.any() else 0.0
        whole = np.sqrt(np.sum(stiff**2) + max(springs, 0.0) * np.sum(mass**2))
        self.start = float(np.linalg.norm(mass)), float(whole)


def _taken_by_frame(
    block: Block, r: np.ndarray, at: slice, wave: slice, of_oscillators: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Accelerations (T, 6) that forces r on a frame give the rigid body, r on shapes then, and the forces' work."""
    frame = slice(at.start, at.start + 6)
    M = block.M[:, at, frame] - block.rest[0][:, at, frame]
    shift = -np.linalg.solve(M[:, :6], r[:, frame, None])
    work = -(r[:, None, frame] @ shift)[:, 0, 0]
    on_modes, on_waves = ((x @ shift)[..., 0] for x in (M[:, 6:], of_oscillators[:, :6].swapaxes(1, 2)))
    on_shapes = np.concatenate([r[:, at.start + 6 : at.stop] + on_modes, r[:, wave] + on_waves], axis=1)
    return shift[..., 0], on_shapes, work
