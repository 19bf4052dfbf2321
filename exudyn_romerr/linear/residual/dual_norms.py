"""Norms of the residual and of output rows, dual to mass and stiffness; where |R|_{K^-1} is formed."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...linalg.blocked_products import by_columns
from .residual import StartNorms, make_norm

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...model.body import ElasticBody
    from .residual import ResidualMap


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
        """[L, K q0, M q0'] where |.|_{M^-1} is the 2-norm; M V as it is, so that no digits are lost in it."""
        factor, start = self.body.mass_factor, []
        if self.initial_state is not None:
            q0, q0_t = self.initial_state
            start = [(factor.half_solve, self.body.K @ q0[:, None], 1), (factor.half_multiply, q0_t[:, None], 1)]
        return _side_by_side(
            (factor.half_multiply, self.map.V, 1),
            *((factor.half_solve, block, 1) for block in self.map.of_motion[1:]),
            (factor.half_solve, self.map.B, -1),
            *start,
        )

    @cached_property
    def Y_K(self) -> np.ndarray:
        """[L, K q0, M q0'] where |.|_{K^-1} is the 2-norm; K V as it is, so that no digits are lost in it."""
        factor, start = self.body.stiffness_factor, []
        if self.initial_state is not None:
            q0, q0_t = self.initial_state
            start = [(factor.half_multiply, q0[:, None], 1), (factor.half_solve, self.body.M @ q0_t[:, None], 1)]
        return _side_by_side(
            *((factor.half_solve, block, 1) for block in self.map.of_motion[:-1]),
            (factor.half_multiply, self.map.V, 1),
            (factor.half_solve, self.map.B, -1),
            *start,
        )

    @cached_property
    def Y_static(self) -> np.ndarray:
        """K^-1 [L, K q0, M q0'] where |.|_M is the 2-norm."""
        solve = self.body.stiffness_factor.solve
        columns = [*map(solve, self.map.of_motion[:-1]), self.map.V, -solve(self.map.B)]
        if self.initial_state is not None:
            q0, q0_t = self.initial_state
            columns += [q0[:, None], solve(self.body.M @ q0_t[:, None])]
        return self.body.mass_factor.half_multiply(np.hstack(columns))

    @cached_property
    def norm_M(self) -> Callable:
        """Return z -> |R|_{M^-1}."""
        return make_norm(self.kind, self.Y_M)

    @cached_property
    def norm_K(self) -> Callable:
        """Return z -> |R|_{K^-1}."""
        return make_norm(self.kind, self.Y_K)

    @cached_property
    def norm_static(self) -> Callable:
        """Return z -> |K^-1 R|_M, the mass norm of the static reconstruction."""
        return make_norm(self.kind, self.Y_static)

    @cached_property
    def start_norms(self) -> StartNorms | None:
        """Norms of an initial error; None if there is none."""
        return StartNorms(self.norm_K, self.norm_static, self.norm_M) if self.has_initial_error else None


def _side_by_side(*parts: tuple[Callable[[np.ndarray], np.ndarray], np.ndarray, int]) -> np.ndarray:
    """Columns sign * function(columns) of every part (function, columns, sign), nothing of their size beside them."""
    count = sum(columns.shape[1] for _, columns, _ in parts)
    result, first = np.empty((parts[0][1].shape[0], count), order="F"), 0
    for function, columns, sign in parts:
        own = result[:, first : first + columns.shape[1]]
        by_columns(lambda part, function=function, sign=sign: sign * function(part), columns, out=own)
        first += columns.shape[1]
    return result


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
