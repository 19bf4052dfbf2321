"""Equations: what Exudyn computes in the current state of an mbs, by a static solver of our own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.linalg import null_space

from .state_guard import current_state, own_solver, set_state, state_kept

SHARE = 1e-6  # of a force that redundant constraints share: one with less is determined
AHEAD = 1e-4  # of coordinates, to differentiate twice by: constraints are of low degree


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

    def shared(self, mbs: Any) -> np.ndarray:
        """Numbers of redundant constraints, and of those that imply them."""
        G = self.constraints(mbs)
        rows = np.flatnonzero(G.any(axis=1))
        return rows[np.abs(null_space(G[rows].T)).max(axis=1, initial=0.0) > SHARE] if rows.size else rows

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
        return self._made(mbs)[0]

    def _made(self, mbs: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """That, M and G (all, n)."""
        forces = self.forces(mbs)
        _, _, q_tt, multipliers = current_state(mbs.systemData)
        M, G = self.mass(mbs), self.constraints(mbs)
        return M @ q_tt + G.T @ multipliers - forces, M, G

    def forces(self, mbs: Any) -> np.ndarray:
        """Return f (n,), without those of constraints."""
        self._solver.ComputeODE2RHS(mbs)
        return self._solver.GetSystemResidual()[: self.size].copy()

    def balance(self, mbs: Any, rows: np.ndarray) -> None:
        """Set q_tt and multipliers for which the equations of motion hold, and constraints do twice differentiated.

        In the current q and q_t; one Newton step from what is set, with G in place of C. rows : numbers of
        independent constraints.
        """
        system, n = mbs.systemData, self.size
        left, M, G = self._made(mbs)
        G = G[rows]
        scale = np.abs(np.diag(M)).max()
        whole = np.block([[M, scale * G.T], [scale * G, np.zeros((len(rows), len(rows)))]])
        change = np.linalg.solve(whole, -np.append(left, scale * self._bend(mbs)[rows]))
        *_, q_tt, multipliers = current_state(system)
        multipliers[rows] += scale * change[n:]
        system.SetODE2Coordinates_tt(q_tt + change[:n])
        system.SetAECoordinates(multipliers)

    def _bend(self, mbs: Any) -> np.ndarray:
        """Second derivative over time (all,) of what constraints keep zero, along the current motion."""
        system, t = mbs.systemData, mbs.systemData.GetTime()
        with state_kept(system) as (q, q_t, q_tt, _):
            dt, found = AHEAD / max(1.0, np.abs(q_t).max(initial=0.0)), []
            for step in (-dt, 0.0, dt):
                system.SetTime(t + step)
                system.SetODE2Coordinates(q + step * q_t + step**2 / 2 * q_tt)
                found.append(self.drift(mbs))
        before, now, after = found
        return (after - 2 * now + before) / dt**2

    def drifts(self, mbs: Any, rows: Sequence[np.ndarray]) -> np.ndarray:
        """Return g (S, all) in rows of t, q, q_t, q_tt, multipliers."""
        found = []
        with state_kept(mbs.systemData):
            for t, *state in zip(*rows, strict=True):
                set_state(mbs.systemData, t, state)
                found.append(self.drift(mbs))
        return np.array(found)
