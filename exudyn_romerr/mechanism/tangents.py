"""Tangents of the whole mechanism in a block of rows: bodies in closed form, the rest splined, all in global axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .body import Coupling, Motion
from .readings import Splined
from .rotations import rotation_matrix, times
from .samples import Rows, Samples
from .unknowns import Unknowns


@dataclass
class Block(Samples):
    """T rows: M, D, K (T, n_a, n_a), G, C (T, c, n_a), in global axes; couplings and motions by body.

    rest : M, D, K of all but bodies, as they are in the sums. forces (T, n) : M a - f + G^T lam of the bodies alone.
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

    def __len__(self) -> int:
        return len(self.rows)


def block_of(rows: Rows, unknowns: Unknowns, rest: Splined) -> Block:
    """Return the tangents of these rows."""
    own = [rest("M", rows.t), rest("D", rows.t), rest.stiffness(rows.t, rows.multipliers)]
    constraints = [rest("G", rows.t), rest("C", rows.t)]
    for X in own:
        _turn_rows(X, unknowns, rows)
    for X in (*own, *constraints):
        _turn_columns(X, unknowns, rows)
    whole, couplings, motions = [x.copy() for x in own], [], []
    forces = np.zeros((len(rows), unknowns.n))
    for body, at, wave in zip(unknowns.bodies, unknowns.blocks, unknowns.waves, strict=True):
        motion = body.motion(rows)
        blocks, coupling = body.tangent(motion)
        for sums, block in zip(whole, blocks, strict=True):
            sums[:, at, at] += _with_turned_frame(block, motion.A)
        couplings.append(Coupling(*(_turned_rows(x, motion.A) for x in vars(coupling).values())))
        F = body.residual(motion)
        for part in (slice(0, 3), slice(3, 6)):
            F[:, part] = times(motion.A, F[:, part])
        forces[:, at], forces[:, wave] = np.split(F, [6 + body.na], axis=1)
        motions.append(motion)
    return Block(rows, *whole, *constraints, couplings, motions, own, forces)


def _turn_rows(X: np.ndarray, unknowns: Unknowns, rows: Rows) -> None:
    """Turn rows of matrices (T, n_a, n_a) from axes of bodies to global ones, in place."""
    for node in unknowns.nodes:
        if node.is_frame:
            A = rotation_matrix(node.parameters(rows.q))
            for part in node.shifts_and_turns:
                X[:, part] = A @ X[:, part]


def _turn_columns(X: np.ndarray, unknowns: Unknowns, rows: Rows) -> None:
    for node in unknowns.nodes:
        if node.is_frame:
            A_t = rotation_matrix(node.parameters(rows.q)).swapaxes(1, 2)
            for part in node.shifts_and_turns:
                X[:, :, part] = X[:, :, part] @ A_t


def _turned_rows(x: np.ndarray, A: np.ndarray) -> np.ndarray:
    """Rows of the frame, dr and dphi, turned into global axes; a copy that lies in one piece."""
    x = np.ascontiguousarray(x)
    x[:, :3], x[:, 3:6] = A @ x[:, :3], A @ x[:, 3:6]
    return x


def _with_turned_frame(x: np.ndarray, A: np.ndarray) -> np.ndarray:
    x = _turned_rows(x.copy(), A)
    A_t = A.swapaxes(1, 2)
    x[:, :, :3], x[:, :, 3:6] = x[:, :, :3] @ A_t, x[:, :, 3:6] @ A_t
    return x
