"""NetInertia: what the inertia of a body does to the coordinates of its frame, and how that is of second order.

The body's residual does not show it: there the wrench of one interface balances the body, whatever it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...linalg.blocked_products import row_norms
from ...model.admissible_space import rigid_modes
from ...model.floating_frame import skew

if TYPE_CHECKING:
    from collections.abc import Sequence

    import scipy.sparse as sp

    from ..floating.frame_node import FrameNode

EULER_PARAMETERS = 4  # other rotations are increments: sums of states are no states there


class NetInertia:
    """Forces of a body's inertia and weight on the coordinates of its frame.

    Parameters
    ----------
    mass : sparse matrix, (N, N)
    positions : ndarray, (nodes, 3)
    shapes : ndarray, (N, k)
        Modes and vectors.
    """

    def __init__(self, frame: FrameNode, mass: sp.csc_matrix, positions: np.ndarray, shapes: np.ndarray):
        self._frame, (nodes, _) = frame, positions.shape
        u, of_u = (X.reshape(nodes, 3, -1) for X in (shapes, mass @ shapes))
        of_x, rigid = (mass @ positions.ravel()).reshape(nodes, 3), rigid_modes(positions)
        whole = rigid.T @ (mass @ rigid)
        self._total, self._first, self._pull = whole[0, 0], of_x.sum(axis=0), of_u.sum(axis=0)
        self._root = np.linalg.inv(np.linalg.cholesky(whole))
        self._xx = positions.T @ of_x  # sums of x_i M x_j, x_i M u_j, u_i M u_j
        self._xu = np.einsum("ai,ajm->ijm", positions, of_u)
        self._uu = np.einsum("ain,ajm->nijm", u, of_u, optimize=True)

    @property
    def is_known(self) -> bool:
        """Whether the frame's coordinates are such that forces of second order can be told."""
        return self._frame.size == 3 + EULER_PARAMETERS

    def second_order(
        self, gravity: np.ndarray, here: Sequence[np.ndarray], moved: Sequence[np.ndarray]
    ) -> np.ndarray:
        """Return what forces (S, size) are of second order in moved states less those here; gravity (S, 3).

        States q, q_t, q_tt (S, size + k) are those of frame, modes and vectors. What is of even order, in fact.
        """
        if not self.is_known:
            return np.zeros((len(gravity), self._frame.size))
        back = [2 * x - y for x, y in zip(here, moved, strict=True)]
        there, back, here = (self._forces(gravity, states) for states in (moved, back, here))
        return (there + back) / 2 - here

    def size(self, q: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return |.|_{M^-1} (S,) of the rigid body's inertia forces that are such forces (S, size) at q; nan: unknown."""
        if not self.is_known:
            return np.full(len(q), np.nan)
        still = np.zeros_like(q)
        local = np.einsum("sji,sj->si", self._frame.motion(q, still, still).A, force[:, :3])
        moment = np.einsum("sij,sj->si", self._frame.rates(q), force[:, 3:]) / EULER_PARAMETERS
        return row_norms(np.hstack([local, moment]) @ self._root.T)

    def _forces(self, gravity: np.ndarray, states: Sequence[np.ndarray]) -> np.ndarray:
        size = self._frame.size
        (q, q_t, q_tt), (c, c_t, c_tt) = ([x[:, part] for x in states] for part in (slice(size), slice(size, None)))
        q = self._of_unit_length(q)
        motion, rates = self._frame.motion(q, q_t, q_tt), self._frame.rates(q)
        b, weight, S, w = motion.local(motion.r_tt), motion.local(-gravity), motion.S, 2 * skew(motion.w)
        first, by_c = self._first + c @ self._pull.T, self._xu + np.tensordot(c, self._uu, axes=1)
        of_c, of_rates, of_accelerations = (np.einsum("sijm,sm->sij", by_c, x) for x in (c, c_t, c_tt))
        second = self._xx + of_c + np.einsum("ijm,sm->sji", self._xu, c)
        turned = lambda turning, x: np.einsum("sjk,sk->sj", turning, x)  # noqa: E731
        force = self._total * (b + weight) + turned(S, first) + turned(w, c_t @ self._pull.T) + c_tt @ self._pull.T
        arms = first[:, :, None] * b[:, None] + self._first[:, None] * weight[:, None]
        arms += second @ S.swapaxes(1, 2) + of_rates @ w.swapaxes(1, 2)
        arms += of_accelerations
        moment = np.stack([arms[:, j, k] - arms[:, k, j] for j, k in ((1, 2), (2, 0), (0, 1))], axis=1)
        return np.hstack([turned(motion.A, force), np.einsum("sij,si->sj", rates, moment)])

    def _of_unit_length(self, q: np.ndarray) -> np.ndarray:
        """Euler parameters that are off to first order leave unit length to second order."""
        p = self._frame.reference[3:] + q[:, 3:]
        return np.hstack([q[:, :3], p / np.linalg.norm(p, axis=1)[:, None] - self._frame.reference[3:]])
