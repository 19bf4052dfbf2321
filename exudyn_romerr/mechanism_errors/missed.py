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
from .factors import factors_of
from .half_widths import Largest
from .linearity import PART, in_motion, nonlinear_forces
from .march import March

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


class MissedFeedback:
    """What comes of forces of a sampled feedback that are not linear in the error, where it saturates: marched.

    Their errors are of first order in the step, and no few rows tell where a controller that saturates begins to.
    largest : over time, "feedback" of what sensors show.
    """

    def __init__(self, of: Mechanism):
        self._of, self._march, self._before, self.largest = of, March(of.unknowns, of.scheme), 0.0, Largest()

    def take(self, block: Block, first: int, e: np.ndarray, lam: np.ndarray) -> None:
        """Go on through a block that begins with row `first`, under errors e (T, 3, n_a), lam (T, c)."""
        of, block, kicks = self._of, block.as_if_at_once(), np.zeros((len(block), self._of.unknowns.n, 1))
        for i in range(first == 0, len(block)):
            kicks[i, : of.unknowns.n_a, 0] = -nonlinear_forces(of, block, i, e[i], lam[i])[0]
        h = np.diff(block.rows.t, prepend=self._before if first else block.rows.t[0] - 1.0)
        self._before = block.rows.t[-1]
        d, forces = self._march.through(block, factors_of(block, h, of.unknowns, of.scheme), kicks)
        self.largest.add(feedback=of.outputs(first, d, of.all_multipliers(forces))[..., 0])
