"""The residual R = M V qr'' + D V qr' + K V qr - B u as a linear map R = L z, and three ways to its norm.

Sign and equations: paper (2), (15), (33)-(35); the orthonormal factor: theory.md 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import check_array, check_choice

if TYPE_CHECKING:
    import scipy.sparse as sp

    from .basis import Basis
    from .body import ElasticBody

RESIDUALS = ("orthonormal", "direct", "expanded")
# A column that keeps less than this after orthogonalisation against the others carries rounding only; leaving it out
# changes the norm by less than its share in rounding of the direct evaluation.
DROP = 1e-14


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

    @property
    def mass_slot(self) -> slice:
        """Entries that multiply M V."""
        return slice(0, self.n)

    @property
    def stiffness_slot(self) -> slice:
        """Entries that multiply K V."""
        return slice(self.n * (1 + self.has_damping), self.n * (2 + self.has_damping))

    @property
    def input_slot(self) -> slice:
        """Entries that multiply -B."""
        return slice(self.k - self.p, self.k)

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
    B : ndarray, (n_free, p)
    """

    def __init__(self, body: ElasticBody, V: np.ndarray, B: np.ndarray, merged: bool = True):
        rayleigh = body.rayleigh if merged else None
        has_damping = rayleigh is None and body.D is not None
        self.body, self.V, self.B = body, V, B
        self.coordinates = Coordinates(V.shape[1], B.shape[1], rayleigh, has_damping)
        self.blocks = [body.M @ V, *([body.D @ V] if has_damping else []), body.K @ V, -B]
        self.L = np.hstack(self.blocks)

    def mass_inverse_columns(self) -> np.ndarray:
        """M^-1 L; V itself for M V, so that no digits are lost in it."""
        return np.hstack([self.V, *(self.body.mass_factor.solve(block) for block in self.blocks[1:] if block.size)])

    def stiffness_inverse_columns(self) -> np.ndarray:
        """K^-1 L; V itself for K V, so that no digits are lost in it."""
        solve = self.body.stiffness_factor.solve
        before = [solve(block) for block in self.blocks[:-2]]
        return np.hstack([*before, self.V, *([solve(-self.B)] if self.B.size else [])])


class OrthonormalNorm:
    """|X z|_G = |T z|_2 by an orthonormal basis of X's range in the G inner product; nothing cancels.

    Parameters
    ----------
    X : ndarray, (n_free, k)
    G : sparse matrix, (n_free, n_free)
        Symmetric positive definite.
    """

    def __init__(self, X: np.ndarray, G: sp.csc_matrix):
        self.T = triangular_factor(X, G)

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Norms (...) of z (..., k); trailing entries that are left out count as zero."""
        image = z.reshape(-1, z.shape[-1]) @ self.T[:, : z.shape[-1]].T
        return np.sqrt(np.einsum("ij,ij->i", image, image)).reshape(z.shape[:-1])


class DirectNorm:
    """Method 1 (33): X z is formed in full and its norm taken. Of size N online: kept for study."""

    def __init__(self, X: np.ndarray, G: sp.csc_matrix):
        self.X, self.G = X, G

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Norms (...) of z (..., k)."""
        image = self.X[:, : z.shape[-1]] @ z.reshape(-1, z.shape[-1]).T
        return np.sqrt(np.einsum("ij,ij->j", image, self.G @ image)).reshape(z.shape[:-1])


class ExpandedNorm:
    """Method 2 (34)-(35): quadratic form with the small matrices of all pairs of blocks; cancels (Fig. 6).

    Where rounding makes the square negative the norm is inf: never clipped.
    """

    def __init__(self, X: np.ndarray, G: sp.csc_matrix):
        self.H = X.T @ (G @ X)

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Norms (...) of z (..., k); inf where the form is negative."""
        flat = z.reshape(-1, z.shape[-1])
        square = np.einsum("ij,ij->i", flat @ self.H[: flat.shape[1], : flat.shape[1]], flat)
        return np.where(square < 0, np.inf, np.sqrt(np.abs(square))).reshape(z.shape[:-1])


def make_norm(name: str, X: np.ndarray, G: sp.csc_matrix) -> OrthonormalNorm | DirectNorm | ExpandedNorm:
    """Return z -> |X z|_G by the named way; InputError for unknown names."""
    check_choice("residual", name, RESIDUALS)
    return {"orthonormal": OrthonormalNorm, "direct": DirectNorm, "expanded": ExpandedNorm}[name](X, G)


def triangular_factor(X: np.ndarray, G: sp.csc_matrix) -> np.ndarray:
    """Return T (rank, k) with |X z|_G = |T z|_2: Gram-Schmidt twice in the G inner product, columns scaled first."""
    length = np.sqrt(np.einsum("ij,ij->j", X, G @ X))
    Q = np.empty_like(X, order="F")
    T = np.zeros((X.shape[1], X.shape[1]))
    rank = 0
    for j in np.flatnonzero(length > 0):
        vector = X[:, j] / length[j]
        for _ in range(2):
            share = Q[:, :rank].T @ (G @ vector)
            vector -= Q[:, :rank] @ share
            T[:rank, j] += share
        left = np.sqrt(vector @ (G @ vector))
        if left > DROP:
            Q[:, rank] = vector / left
            T[rank, j] = left
            rank += 1
    return T[:rank] * length


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
    q0, q0_t = (check_array(name, x, (body.N,))[body.free] for name, x in (("q0", q0), ("q0_t", q0_t)))
    return np.linalg.solve(W.T @ V, W.T @ q0), np.linalg.solve(W.T @ (body.M @ V), W.T @ (body.M @ q0_t))


def initial_error(body: ElasticBody, basis: Basis, q0: Any, q0_t: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return e0 = q0 - V qr0 and e0' = q0' - V qr0' of the projected initial state (31)-(32), each (N,)."""
    qr0, qr0_t = initial_coordinates(body, basis, q0, q0_t)
    return np.asarray(q0, dtype=float) - basis.V @ qr0, np.asarray(q0_t, dtype=float) - basis.V @ qr0_t
