"""What linear equations miss of joints, springs and other bodies, as forces to be marched beside the error itself.

Tangents are splined between rows in which they were read: half way between these they are farthest off. There
Exudyn's own forces under q + e tell by how much, and a march what comes of it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..mechanism.mechanism import Mechanism
from ..mechanism.rotations import times
from ..mechanism.tangents import Block
from .linearity import PART, in_motion, nonlinear_forces

MOST = 32  # rows of a block that are looked at


class MissedForces:
    """Looks half way between readings, and where the error of each part of a block is largest.

    of_constraints : what is missed of constraints, as a share of the error's motion, at most.
    """

    def __init__(self, of: Mechanism):
        self._of, self.of_constraints = of, 0.0

    def take(self, block: Block, first: int, e: np.ndarray, lam: np.ndarray) -> np.ndarray:
        """Return kicks (T, n) in a block that begins with row `first`, under errors e (T, 3, n), lam (T, c)."""
        u, x = self._of.unknowns, e[:, :, : self._of.unknowns.n_a]
        squares, kicks = np.einsum("ti,ti->t", times(block.M, x[:, 0]), x[:, 0]), np.zeros((len(block), u.n))
        rows = [i for i in self._rows(first, squares) if e[i, 0].any()]
        if not rows:
            return kicks
        found = []
        for i in rows:
            left, g = nonlinear_forces(self._of, block, i, x[i], lam[i])
            found.append(-left)
            masses = np.maximum(np.diag(block.M[i]), np.finfo(float).tiny)
            motion = np.sqrt(max(squares[i], np.finfo(float).tiny))
            self.of_constraints = max(self.of_constraints, in_motion(block.C[i], masses, g) / motion)
        every = np.arange(len(block))
        kicks[:, : u.n_a] = np.transpose([np.interp(every, rows, y) for y in np.transpose(found)])
        if first == 0:
            kicks[0] = 0.0  # whether a run begins in an equilibrium is not theirs to say
        return kicks

    def _rows(self, first: int, squares: np.ndarray) -> list[int]:
        T, between = len(squares), [(a + b) // 2 - first for a, b in pairwise(self._of.readings.at) if b > a + 1]
        between = [i for i in between if 0 <= i < T]
        largest = {a + int(np.argmax(squares[a : a + PART])) for a in range(0, T, PART)}
        return sorted({*between[:: 1 + len(between) // MOST], *largest})
