"""What q + e leaves of the equations of motion: of bodies nonlinear, of all else to first order."""

from __future__ import annotations

import numpy as np

from ..mechanism.body import Motion
from ..mechanism.rotations import times
from ..mechanism.tangents import Block
from ..mechanism.unknowns import Unknowns


def unbalanced(
    block: Block, u: Unknowns, f: np.ndarray, e: np.ndarray, lam: np.ndarray
) -> tuple[np.ndarray, list[Motion]]:
    """Return f less what e (T, 3, n) and lam (T, c) really take, (T, n), and the motions of bodies under q + e.

    Rows of forces turn with the perturbed body, as they do in tangents: what forces of joints turn by beyond first
    order is then forces of the same joints, and their multipliers answer it.
    """
    left, n_a, motions = f.copy(), u.n_a, []
    for X, order in zip(block.rest, (2, 1, 0), strict=True):
        left[:, :n_a] -= times(X, e[:, order, :n_a])
    left[:, :n_a] -= times(block.G.swapaxes(1, 2), lam)
    for body, at, wave, motion in zip(u.bodies, u.blocks, u.waves, block.motions, strict=True):
        own = np.concatenate([e[:, :, at], e[:, :, wave]], axis=2)
        moved = motion.moved(*own.swapaxes(0, 1))
        F, before = body.residual(moved), np.concatenate([block.forces[:, at], block.forces[:, wave]], axis=1)
        for part in (slice(0, 3), slice(3, 6)):
            F[:, part] = times(motion.A, F[:, part])
        F -= before
        left[:, at] -= F[:, : 6 + body.na]
        left[:, wave] -= F[:, 6 + body.na :]
        motions.append(moved)
    return left, motions
