"""Estimators that bound |e|_M by the integral of |R|_{M^-1}: what those of the paper share, initial errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..trajectory.segments import Block, Start
from .bounds import Bounds, times

if TYPE_CHECKING:
    from ..residual.problem import Problem
    from ..residual.residual import StartNorms


@dataclass(frozen=True)
class InitialError:
    """Norms of the initial error: |e0|_M, |e0|_K, |e0'|_M."""

    e_M: float = 0.0
    e_K: float = 0.0
    v_M: float = 0.0

    @property
    def energy(self) -> float:
        """sqrt(|e0'|_M^2 + |e0|_K^2): bounds |e'|_M of the free motion under any dissipative damping."""
        return float(np.hypot(self.e_K, self.v_M))

    @classmethod
    def of(cls, start: Start, norms: StartNorms | None) -> InitialError:
        """Evaluate the norms at the start; zero if the run starts in the span of V."""
        if start.y0 is None:
            return cls()
        return cls(float(norms.static(start.y0)), float(norms.K(start.y0)), float(norms.M(start.y0_t)))


class MassNormEstimator:
    """Shared part of the estimators that bound |e|_M by the integral of |R|_{M^-1} (paper, section 4)."""

    name: str
    inside = None

    def __init__(self, problem: Problem):
        self.norm = problem.dual.norm_M
        self.C2 = problem.rows.C_M
        self.velocity_rows = problem.rows.velocity_rows
        self._start_norms = problem.dual.start_norms
        self.integral = 0.0
        self.t0 = 0.0
        self.initial = InitialError()

    def start(self, start: Start) -> Bounds:
        """Begin a run; return the bounds at its first instant."""
        self.t0, self.integral = start.t, 0.0
        self.initial = InitialError.of(start, self._start_norms)
        return self._bounds(np.array([start.t]), np.zeros(1), None)

    def advance(self, block: Block) -> Bounds:
        """Go on by one block; return the bounds at the ends of its segments."""
        total = self.integral + np.cumsum(block.integral(self.norm))
        self.integral = float(total[-1])
        return self._bounds(block.t, total, block)

    def _bounds(self, t: np.ndarray, integral: np.ndarray, block: Block | None) -> Bounds:
        position, velocity = self._state_bounds(t - self.t0, integral, block)
        self._position = position
        outputs = np.where(self.velocity_rows, times(velocity, self.C2), times(position, self.C2))
        return Bounds(position, velocity, outputs)

    def instant(self, i: int) -> tuple:
        """Return what bounds displacements at entry i of the bounds returned last."""
        return (self._position[i],)

    def bounds_at(self, instant: tuple) -> Bounds:
        """Return the bounds (1, R) of displacement outputs at an instant of an estimator with other outputs."""
        return Bounds(None, None, times(np.array(instant), self.C2))

    def _state_bounds(self, t, integral, block) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of |e|_M and |e'|_M after times t (S,) from the start, with int |R| up to there."""
        raise NotImplementedError
