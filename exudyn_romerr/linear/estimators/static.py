"""The error of a static solve: no estimate, K e = -R is solved offline for every column of R."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .bounds import Bounds

if TYPE_CHECKING:
    from ..residual.problem import Problem


class StaticError:
    """|C e| = |C K^-1 R| and |e|_M = |K^-1 R|_M, exact; velocities are zero."""

    assumes = "static equilibrium at every load step (exact, no estimate)"

    def __init__(self, problem: Problem):
        self.norm = problem.dual.norm_static
        self.rows = problem.rows.static_rows

    def __call__(self, z: np.ndarray) -> Bounds:
        """Return the errors at load steps z (S, k)."""
        self._z, known = z, -(z @ self.rows.T)
        return Bounds(self.norm(z), np.zeros(len(z)), np.abs(known), None, known, np.zeros_like(known))

    def instant(self, i: int) -> tuple:
        """Return z at entry i of the errors returned last."""
        return (self._z[i : i + 1].copy(),)

    def bounds_at(self, instant: tuple) -> Bounds:
        """Return the errors (1, R) at an instant of an object with other outputs."""
        return self(*instant)
