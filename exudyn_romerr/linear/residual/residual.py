"""The residual R = M V qr'' + D V qr' + K V qr - B u as a linear map R = L z, and three ways to its norm.

Sign and equations: paper (2), (15), (33)-(35); the orthonormal factor: theory.md 6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from ...basis.basis import Basis
from ...checks import check_array, check_choice
from ...linalg.blocked_products import norms_times, polygon_lengths, row_norms, rows_times
from ...model.body import ElasticBody


@dataclass(frozen=True)
class Coordinates:
    """How z is laid out: the small part of ResidualMap that a run needs.

    Rayleigh (or no) damping, merged: z = (qr'' + alpha qr', qr + beta qr', u) of 2 n + p entries; otherwise
    z = (qr'', qr', qr, u), without qr' if undamped.
    """

    n: int
    p: int
    rayleigh: tuple[float, float] | None
    has_damping: bool

    @property
    def k(self) -> int:
        """Number of entries of z."""
        return self.n * (2 + self.has_damping) + self.p

    # entries that multiply M V; D V, if there are such; K V; -B
    mass_slot = property(lambda self: slice(0, self.n))
    damping_slot = property(lambda self: slice(self.n, 2 * self.n))
    stiffness_slot = property(lambda self: slice(self.n * (1 + self.has_damping), self.n * (2 + self.has_damping)))
    input_slot = property(lambda self: slice(self.k - self.p, self.k))

    def __call__(self, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return z (..., k) of reduced coordinates (..., n) and inputs (..., p)."""
        if self.rayleigh is None:
            return np.concatenate([q_tt, *([q_t] if self.has_damping else []), q, u], axis=-1)
        alpha, beta = self.rayleigh
        return np.concatenate([q_tt + alpha * q_t, q + beta * q_t, u], axis=-1)


class ResidualMap:
    """R = L z on the free coordinates: L = [M V, K V, -B] (Rayleigh, merged) or [M V, D V, K V, -B].

    Parameters
    ----------
    V : ndarray, (n_free, n)
    B : ndarray or sparse matrix, (n_free, p)

    Attributes
    ----------
    of_motion : M V, D V where it counts, K V.
    """

    def __init__(self, body: ElasticBody, V: np.ndarray, B: np.ndarray | sp.spmatrix, merged: bool = True):
        rayleigh = body.rayleigh if merged else None
        has_damping = rayleigh is None and body.D is not None
        self.body, self.V, self.B = body, V, B
        self.coordinates = Coordinates(V.shape[1], B.shape[1], rayleigh, has_damping)
        self.of_motion = [body.M @ V, *([body.D @ V] if has_damping else []), body.K @ V]

    @property
    def L(self) -> np.ndarray:
        """All columns (n_free, k); of a large body and many inputs they fill the memory: see `seen_by`."""
        return np.hstack([*self.of_motion, -(self.B.toarray() if sp.issparse(self.B) else self.B)])

    def seen_by(self, rows: np.ndarray) -> np.ndarray:
        """Return rows L (r, k) of rows (r, n_free)."""
        return np.hstack([*(rows @ block for block in self.of_motion), -(rows @ self.B)])


class OrthonormalNorm:
    """|Y z|_2 = |T z|_2 by an orthonormal basis of Y's range (Householder, columns scaled first); nothing cancels.

    Parameters
    ----------
    Y : ndarray, (n_free, k)
    """

    def __init__(self, Y: np.ndarray):
        length = np.linalg.norm(Y, axis=0)
        self.T = np.linalg.qr(Y / np.where(length > 0, length, 1.0), mode="r") * length

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Norms (...) of z (..., k); trailing entries that are left out count as zero."""
        k = z.shape[-1]
        return norms_times(z, self.T[:k, :k].T)

    def lengths(self, c: np.ndarray) -> np.ndarray:
        """Lengths (S,) of polygons with corners z, c (S, d + 1, k)."""
        k = c.shape[-1]
        return polygon_lengths(c, self.T[:k, :k].T)


def direct_norm(Y: np.ndarray) -> Callable:
    """Return method 1 (33): Y z is formed in full and its norm taken. Of size N online: kept for study."""
    return lambda z: row_norms(rows_times(z, Y[:, : z.shape[-1]].T))


def expanded_norm(Y: np.ndarray) -> Callable:
    """Return method 2 (34)-(35): quadratic form with the small matrices of all pairs of blocks; cancels (Fig. 6).

    Where rounding makes the square negative the norm is inf: never clipped.
    """
    H = Y.T @ Y

    def norm(z: np.ndarray) -> np.ndarray:
        k = z.shape[-1]
        square = np.einsum("...j,...j->...", z @ H[:k, :k], z)
        return np.where(square < 0, np.inf, np.sqrt(np.abs(square)))

    return norm


RESIDUALS = {"orthonormal": OrthonormalNorm, "direct": direct_norm, "expanded": expanded_norm}


def make_norm(name: str, Y: np.ndarray) -> Callable:
    """Return z (..., k) -> |Y z|_2 (...) by the named way; trailing entries of z that are left out count as zero."""
    check_choice("residual", name, RESIDUALS)
    return RESIDUALS[name](Y)


def initial_coordinates(body: ElasticBody, basis: Basis, q0: Any, q0_t: Any) -> tuple[np.ndarray, np.ndarray]:
    """Project a full initial state: qr0 = (W^T V)^-1 W^T q0, qr0' = (W^T M V)^-1 W^T M q0' (paper, 31-32).

    Parameters
    ----------
    q0, q0_t : ndarray, (N,)

    Returns
    -------
    qr0, qr0_t : ndarray, (n,)
    """
    V, W = basis.restricted_to(body)
    pairs = (("q0", q0), ("q0_t", q0_t))
    q0, q0_t = (body.space.coordinates(name, check_array(name, x, (body.N,))) for name, x in pairs)
    # W^T V has the square of the condition of V: nearly dependent columns go through the triangle of V alone
    (Q, triangle), test = np.linalg.qr(V), np.linalg.qr(W)[0]
    projected = (np.linalg.solve(test.T @ x, test.T @ y) for x, y in ((Q, q0), (body.M @ Q, body.M @ q0_t)))
    return tuple(la.solve_triangular(triangle, x) for x in projected)


def initial_error(body: ElasticBody, basis: Basis, q0: Any, q0_t: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return e0 = q0 - V qr0 and e0' = q0' - V qr0' of the projected initial state (31)-(32), each (N,)."""
    qr0, qr0_t = initial_coordinates(body, basis, q0, q0_t)
    return np.asarray(q0, dtype=float) - basis.V @ qr0, np.asarray(q0_t, dtype=float) - basis.V @ qr0_t
