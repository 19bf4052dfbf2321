"""Sums over the nodes of a body: what inertia and stiffness make of its shapes, in a frame that moves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp


class ShapeSums(NamedTuple):
    """Sums over the nodes a of a body with the same mass M in all directions, of shapes U (N, k) and places x.

    of_U (3, 3, k, k) : sum U_aim (M U)_ajn. of_x (3, 3, k) : sum x_ai (M U)_ajn. pull (3, k) : sum (M U)_ajn. M, K
    (k, k) : U^T M U, U^T K U.
    """

    of_U: np.ndarray
    of_x: np.ndarray
    pull: np.ndarray
    M: np.ndarray
    K: np.ndarray

    @classmethod
    def of(cls, mass: sp.spmatrix, stiffness: sp.spmatrix, positions: np.ndarray, U: np.ndarray) -> ShapeSums:
        """Make them of mass, stiffness (N, N), positions (nodes, 3) and U (N, k)."""
        U = np.ascontiguousarray(U)
        K = U.T @ (stiffness @ U)
        MU = mass @ U
        by_axis = [MU[j::3] for j in range(3)]
        of_U = np.array([[U[i::3].T @ of_j for of_j in by_axis] for i in range(3)])
        of_x = np.array([positions.T @ of_j for of_j in by_axis]).swapaxes(0, 1)
        pull, M = np.array([of_j.sum(axis=0) for of_j in by_axis]), np.einsum("iikl->kl", of_U)
        return cls(of_U, of_x, pull, M, K)
