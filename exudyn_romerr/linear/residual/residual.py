"""The residual R = M V qr'' + D V qr' + K V qr - B u as a linear map R = L z, its norms and those of output rows.

Sign and equations: paper (2), (15), (33)-(35); the orthonormal factor: theory.md 6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from ...basis.basis import Basis
from ...checks import check_array, check_choice
from ...linalg.blocked_products import by_columns, norms_times, polygon_lengths, row_norms, rows_times
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


class DualNorms:
    """Norms of R = L z: |R|_{M^-1}, |R|_{K^-1}, |K^-1 R|_M, each made when first needed.

    Columns of L are followed by extra columns K q0 and M q0' if an initial state is given, so that the initial error
    is a combination y of columns as well: K e0 = L y0, M e0' = L y0'.

    Parameters
    ----------
    initial_state : (q0, q0'), each (n_free,), or None
    kind : how a norm is taken, one of residual.RESIDUALS.
    has_initial_error : False if the initial error is zero by assumption.
    """

    def __init__(self, residual_map: ResidualMap, initial_state: tuple | None, kind: str, has_initial_error: bool):
        self.map, self.body, self.k = residual_map, residual_map.body, residual_map.coordinates.k
        self.initial_state, self.kind, self.has_initial_error = initial_state, kind, has_initial_error

    @cached_property
    def Y_M(self) -> np.ndarray:
        """[L, K q0, M q0'] where |.|_{M^-1} is the 2-norm."""
        factor = self.body.mass_factor
        return self._columns("M", factor.half_multiply, factor.half_solve)

    @cached_property
    def Y_K(self) -> np.ndarray:
        """[L, K q0, M q0'] where |.|_{K^-1} is the 2-norm."""
        factor = self.body.stiffness_factor
        return self._columns("K", factor.half_multiply, factor.half_solve)

    @cached_property
    def Y_static(self) -> np.ndarray:
        """K^-1 [L, K q0, M q0'] where |.|_M is the 2-norm."""
        solve, multiply = self.body.stiffness_factor.solve, self.body.mass_factor.half_multiply
        return self._columns("K", multiply, lambda columns: multiply(solve(columns)))

    def _columns(self, exact: str, multiply: Callable, apply: Callable) -> np.ndarray:
        """Columns apply([L, K q0, M q0']); those of the matrix `exact` by multiply(vectors): no digits get lost."""
        first, *damping, last = self.map.of_motion
        V, B = self.map.V, self.map.B
        parts = [("M", V, first), *(("D", V, x) for x in damping), ("K", V, last), ("-B", B, B)]
        if self.initial_state is not None:
            q0, q0_t = (x[:, None] for x in self.initial_state)
            parts += [("K", q0, self.body.K @ q0), ("M", q0_t, self.body.M @ q0_t)]
        result, at = np.empty((len(V), sum(x.shape[1] for _, x, _ in parts)), order="F"), 0
        for name, vectors, forces in parts:
            own = result[:, at : at + vectors.shape[1]]
            by_columns(multiply if name == exact else apply, vectors if name == exact else forces, out=own)
            if name == "-B":
                np.negative(own, out=own)
            at += vectors.shape[1]
        return result

    # z -> |R|_{M^-1}, |R|_{K^-1}, and |K^-1 R|_M, the mass norm of the static reconstruction
    norm_M = cached_property(lambda self: make_norm(self.kind, self.Y_M))
    norm_K = cached_property(lambda self: make_norm(self.kind, self.Y_K))
    norm_static = cached_property(lambda self: make_norm(self.kind, self.Y_static))

    @property
    def start_norms(self) -> tuple[Callable, Callable, Callable] | None:
        """norm_K, norm_static and norm_M, for an initial error; None if there is none."""
        return (self.norm_K, self.norm_static, self.norm_M) if self.has_initial_error else None


class OutputNorms:
    """Norms of output rows C (R, n_free) and their static response; other rows need a new object.

    velocity_rows : (R,) bool, rows of outputs C q'. dual : norms of the residual whose columns are L.
    """

    def __init__(self, body: ElasticBody, C: np.ndarray, velocity_rows: np.ndarray, dual: DualNorms):
        self.C, self.velocity_rows = C, velocity_rows
        self.body, self.dual = body, dual

    @cached_property
    def Y_C_M(self) -> np.ndarray:
        """C^T where |.|_{M^-1} is the 2-norm, (n_free, R)."""
        return self.body.mass_factor.half_solve(self.C.T)

    @cached_property
    def Y_C_K(self) -> np.ndarray:
        """C^T where |.|_{K^-1} is the 2-norm, (n_free, R)."""
        return self.body.stiffness_factor.half_solve(self.C.T)

    @cached_property
    def C_M(self) -> np.ndarray:
        """|c_i|_{M^-1} of every output row (R,), paper (29)."""
        return np.linalg.norm(self.Y_C_M, axis=0)

    @cached_property
    def C_K(self) -> np.ndarray:
        """|c_i|_{K^-1} of every output row (R,)."""
        return np.linalg.norm(self.Y_C_K, axis=0)

    @cached_property
    def static_rows(self) -> np.ndarray:
        """C K^-1 L (R, k): outputs of the static reconstruction K^-1 R, which has no velocity."""
        return self.of_displacements(self.Y_C_K.T @ self.dual.Y_K[:, : self.dual.k])

    def of_displacements(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (R, k) with those of velocity outputs zero."""
        return np.where(self.velocity_rows[:, None], 0.0, rows)

    def share(self, d_K: np.ndarray, v_M: np.ndarray) -> np.ndarray:
        """Return |C|_{K^-1} |d|_K, or |C|_{M^-1} |e'|_M for velocity rows, (S, R)."""
        share, velocity = times(d_K, self.C_K), self.velocity_rows
        return np.where(velocity, times(v_M, self.C_M), share) if velocity.any() else share


def times(bound: np.ndarray, constants: np.ndarray) -> np.ndarray:
    """Return bound (S,) times constants (R,) as (S, R); an output that sees nothing has bound 0, also of inf."""
    seen = constants > 0
    product = np.zeros((len(bound), len(constants)))
    product[:, seen] = np.outer(bound, constants[seen])
    return product


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
