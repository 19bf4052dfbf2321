"""Split: the error space cut into auxiliary modes and the rest (theory.md 4)."""

from __future__ import annotations

import copy
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import check_count
from .decay_rates import Forgetting, rayleigh_rates
from .residual import StartNorms, make_norm

if TYPE_CHECKING:
    from collections.abc import Callable

    from .problem import Problem

AUTO_SHARE = 0.05  # of |C|_{K^-1} that may be left above the auxiliary modes
AUTO_CAP = 60
AUTO_WITHOUT_OUTPUTS = 20


class Split:
    """m modes P of the full body and the rest R_rest = (I - M P P^T) R; full-size, offline.

    Attributes
    ----------
    omega (m,), cut : rad/s; every other mode has omega >= cut (inf if P is complete).
    CP : (R, m).
    capped : the note for the plan if "auto" stopped at its cap, else None.
    """

    def __init__(self, problem: Problem, asked: int | str):
        body = problem.body
        body.require_rayleigh("auxiliary modes")
        self._problem = problem
        self.capped: str | None = None
        if asked == "auto":
            asked = self._auto_count()
        modes = body.modes(check_count("auxiliary_modes", asked, body.free.size, "free coordinates; or 'auto'"))
        self.omega, self.P, self.cut = modes.omega, modes.shapes, modes.cut
        self.CP = problem.C @ self.P

    def with_problem(self, problem: Problem, C: np.ndarray) -> Split:
        """Return the same modes with the rows C of another problem; norms of R are shared."""
        other = copy.copy(self)
        for name in ("C_K", "C_M", "static_rows", "_rest_C_K"):
            other.__dict__.pop(name, None)
        other._problem, other.CP = problem, C @ self.P
        return other

    @cached_property
    def C_K(self) -> np.ndarray:
        """|C| in the K^-1 norm on the rest (R,)."""
        return np.linalg.norm(self._rest_C_K, axis=0)

    @cached_property
    def C_M(self) -> np.ndarray:
        """|C| in the M^-1 norm on the rest (R,)."""
        return np.linalg.norm(without(self._modes_M, self._problem.Y_C_M), axis=0)

    @cached_property
    def rates(self) -> list[Forgetting]:
        """Rates at which the rest may be forgotten; none if nothing is left."""
        return rayleigh_rates(self.cut, *self._problem.body.rayleigh) if np.isfinite(self.cut) else []

    @cached_property
    def start_norms(self) -> StartNorms | None:
        """Norms of the rest of an initial error; None if there is none."""
        return StartNorms(self.norm_K, self.norm_static, self.norm_M) if self._problem.may_start_off else None

    @cached_property
    def norm_K(self) -> Callable:
        """Return z -> |R_rest|_{K^-1}."""
        return make_norm(self._problem.residual, without(self.modes_K, self._problem.Y_K))

    @cached_property
    def norm_static(self) -> Callable:
        """Return z -> |K^-1 R_rest|_M."""
        return make_norm(self._problem.residual, without(self._modes_M, self._problem.Y_static))

    @cached_property
    def norm_M(self) -> Callable:
        """Return z -> |R_rest|_{M^-1}."""
        return make_norm(self._problem.residual, without(self._modes_M, self._problem.Y_M))

    @cached_property
    def static_rows(self) -> np.ndarray:
        """C K^-1 L_rest (R, k), zero for velocity outputs."""
        problem = self._problem
        return problem.of_displacements(self._rest_C_K.T @ problem.Y_K[:, : problem.map.coordinates.k])

    @cached_property
    def mode_residual(self) -> np.ndarray:
        """|K phi - omega^2 M phi|_{K^-1} / |phi|_K of every mode (m,): how exact the computed modes are."""
        body = self._problem.body
        return np.linalg.norm(self.modes_K - body.stiffness_factor.half_solve(body.M @ (self.P * self.omega)), axis=0)

    @cached_property
    def modes_K(self) -> np.ndarray:
        """K P Omega^-1 where |.|_{K^-1} is the 2-norm: orthonormal columns."""
        return self._problem.body.stiffness_factor.half_multiply(self.P / self.omega)

    @cached_property
    def _modes_M(self) -> np.ndarray:
        """M P where |.|_{M^-1} is the 2-norm, P where |.|_M is: orthonormal columns."""
        return self._problem.body.mass_factor.half_multiply(self.P)

    @cached_property
    def _rest_C_K(self) -> np.ndarray:
        return without(self.modes_K, self._problem.Y_C_K)

    @cached_property
    def PL(self) -> np.ndarray:
        """P^T [L, K q0, M q0'], with Omega^2 P^T M in place of P^T K, which cancels."""
        problem, layout, MP = self._problem, self._problem.map.coordinates, self._problem.body.M @ self.P
        PL = self.P.T @ problem.map.L
        PL[:, layout.stiffness_slot] = self.omega[:, None] ** 2 * (MP.T @ problem.V)
        if problem.initial_state is None:
            return PL
        q0, q0_t = problem.initial_state
        return np.column_stack([PL, self.omega**2 * (MP.T @ q0), MP.T @ q0_t])

    def _auto_count(self) -> int:
        """Smallest m with |C|_rest <= 5 % of |C|_{K^-1} for every output, at most 60."""
        problem, body = self._problem, self._problem.body
        cap = min(AUTO_CAP, body.free.size)
        if not problem.decides.any():
            return min(AUTO_WITHOUT_OUTPUTS, cap)
        modes = body.modes(cap)
        seen = problem.decides & (problem.C_K > 0)  # rows that see free coordinates
        share = np.cumsum((problem.C[seen] @ modes.shapes / modes.omega) ** 2, axis=1) / problem.C_K[seen, None] ** 2
        enough = np.all(1 - share <= AUTO_SHARE**2, axis=0)
        if not enough.any():
            left = np.sqrt(np.max(1 - share[:, -1]))
            self.capped = f"'auto' stopped at {cap} modes with {100 * left:.2g} % of |C| above them"
            return cap
        return int(np.argmax(enough)) + 1


def without(modes: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Return Y less its part in the span of the orthonormal modes."""
    for _ in range(2):  # twice: what rounding leaves of the first pass is taken out by the second
        Y = Y - modes @ (modes.T @ Y)
    return Y
