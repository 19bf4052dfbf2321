"""Equations: what Exudyn computes in the current state of an mbs, by a static solver of our own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .state_guard import current_state, own_solver, set_state, state_kept


class Equations:
    """M q'' + G^T l = f and g = 0 of an mbs in its current state; the solver writes into itself only.

    Attributes
    ----------
    size : number of coordinates. threads : of the running solver.
    """

    def __init__(self, mbs: Any, threads: int = 1):
        self._solver, self.threads = own_solver(mbs, threads), threads
        self.size = self._solver.GetODE2size()
        self._first_constraint = self.size + self._solver.GetODE1size()
        self._no_jacobian = np.zeros((self._first_constraint + self._solver.GetAEsize(),) * 2)

    def mass(self, mbs: Any) -> np.ndarray:
        """M (n, n)."""
        self._solver.ComputeMassMatrix(mbs)
        return self._solver.GetSystemMassMatrix()[: self.size, : self.size]

    def constraints(self, mbs: Any) -> np.ndarray:
        """G (all, n), rows of zeros where constraints are not active."""
        self._solver.SetSystemJacobian(self._no_jacobian)
        if self._solver.GetAEsize():
            self._solver.ComputeJacobianAE(mbs, 1.0, 0.0, 0.0, False)
        return self._solver.GetSystemJacobian()[self._first_constraint :, : self.size]

    def drift(self, mbs: Any) -> np.ndarray:
        """Return g (all,): 0, or what a solver that keeps its rate zero has let it come to."""
        self._solver.ComputeAlgebraicEquations(mbs, False)
        return self._solver.GetSystemResidual()[self._first_constraint :].copy()

    def jacobian(self, mbs: Any, positions: float, rates: float, with_loads: int) -> np.ndarray:
        """Derivative of f by coordinates or rates (n, n), times these factors."""
        self._solver.ComputeJacobianODE2RHS(mbs, positions, rates, 0.0, with_loads)
        return self._solver.GetSystemJacobian()[: self.size, : self.size]

    def residual(self, mbs: Any) -> np.ndarray:
        """M q'' + G^T l - f (n,)."""
        forces = self.forces(mbs)
        _, _, q_tt, multipliers = current_state(mbs.systemData)
        return self.mass(mbs) @ q_tt + self.constraints(mbs).T @ multipliers - forces

    def forces(self, mbs: Any) -> np.ndarray:
        """Return f (n,), without those of constraints."""
        self._solver.ComputeODE2RHS(mbs)
        return self._solver.GetSystemResidual()[: self.size].copy()

    def drifts(self, mbs: Any, rows: Sequence[np.ndarray]) -> np.ndarray:
        """Return g (S, all) in rows of t, q, q_t, q_tt, multipliers."""
        found = []
        with state_kept(mbs.systemData):
            for t, *state in zip(*rows, strict=True):
                set_state(mbs.systemData, t, state)
                found.append(self.drift(mbs))
        return np.array(found)
