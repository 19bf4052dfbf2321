"""Norms of the residual and of output rows, dual to mass and stiffness; where |R|_{K^-1} is formed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from ...linalg.blocked_products import by_columns
from ...model.body import ElasticBody
from .residual import ResidualMap, make_norm


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
