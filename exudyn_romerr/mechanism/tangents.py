"""Tangents of the whole mechanism in a block of rows: bodies in closed form, the rest splined, all in global axes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..compiled.loops import loops
from .body import Coupling, Motion
from .rotations import times
from .rows import Rows, Samples
from .splined import Splined
from .unknowns import Unknowns

# rows that are worked at once: more make no faster, fewer are calls alone; numbers of one of their matrices: those
# of 30 modes leave the cache with 256 rows, those of an engine take gigabytes with 128
MOST_ROWS, LEAST_ROWS, AT_ONCE = 128, 16, 128**3


@dataclass
class Block(Samples):
    """T rows: M, D, K (T, n_a, n_a), G, C (T, c, n_a), in global axes; couplings and motions by body.

    rest : M, D, K of all but bodies, as they are in the sums. forces (T, n) : M a - f + G^T lam of the bodies alone.
    sampled : empty, or S by coordinates and by rates (T, n_a, n_a): forces by the errors at the begin of a step.
    """

    rows: Rows
    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    G: np.ndarray
    C: np.ndarray
    couplings: list[Coupling]
    motions: list[Motion]
    rest: list[np.ndarray]
    forces: np.ndarray
    sampled: list[np.ndarray] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.rows)

    def as_if_at_once(self) -> Block:
        """Return the tangents of a mechanism where what is sampled once a step acts at every instant."""
        if not self.sampled:
            return self
        S, S1 = self.sampled
        M, D, K = self.rest
        return replace(self, D=self.D + S1, K=self.K + S, rest=[M, D + S1, K + S], sampled=[])


def rows_at_once(unknowns: Unknowns) -> int:
    """Return how many rows of a run a block has."""
    return max(LEAST_ROWS, min(MOST_ROWS, AT_ONCE // max(unknowns.n_a, 1) ** 2))


def block_of(rows: Rows, unknowns: Unknowns, rest: Splined) -> Block:
    """Return the tangents of these rows."""
    own = [rest("M", rows), rest("D", rows), rest.stiffness(rows)]
    constraints, sampled = [rest("G", rows), rest("C", rows)], rest.sampled(rows)
    motions = [body.motion(rows) for body in unknowns.bodies]
    for node, motion in zip(unknowns.nodes, motions, strict=False):  # frames of bodies are the first nodes
        for X in (*own, *sampled):
            _turn(X, motion.A, node.at, node.at)
        for X in constraints:
            _turn(X, motion.A, None, node.at)
    whole, couplings = [x.copy() for x in own], []
    forces = np.zeros((len(rows), unknowns.n))
    of_bodies = unknowns.bodies, motions, unknowns.blocks, unknowns.waves
    for body, motion, at, wave in zip(*of_bodies, strict=True):
        blocks, coupling = body.tangent(motion)
        for sums, block in zip(whole, blocks, strict=True):
            _turn(block, motion.A, 0, 0)
            sums[:, at, at] += block
        for x in vars(coupling).values():
            _turn(x, motion.A, 0, None)
        couplings.append(coupling)
        F = body.residual(motion)
        for part in (slice(0, 3), slice(3, 6)):
            F[:, part] = times(motion.A, F[:, part])
        forces[:, at], forces[:, wave] = np.split(F, [6 + body.na], axis=1)
    return Block(rows, *whole, *constraints, couplings, motions, own, forces, sampled)


def _turn(X: np.ndarray, A: np.ndarray, row: int | None, column: int | None) -> None:
    """Turn a frame's six rows and columns of X (T, n, m) from its axes to global ones by A (T, 3, 3), in place."""
    if loops is not None:
        places = (-1 if place is None else place for place in (row, column))
        loops.turn_frames(*X.shape, *places, np.ascontiguousarray(A), X)
        return
    for i in (0, 3):
        if row is not None:
            X[:, row + i : row + i + 3] = A @ X[:, row + i : row + i + 3]
        if column is not None:
            X[:, :, column + i : column + i + 3] = X[:, :, column + i : column + i + 3] @ A.swapaxes(1, 2)
