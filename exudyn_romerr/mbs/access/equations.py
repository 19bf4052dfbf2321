"""Equations: what Exudyn computes in the current state of an mbs, by a static solver of our own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import exudyn as exu
import numpy as np

from .state_guard import own_solver, set_state, state_kept

TOGETHER = 64  # rows whose matrices are solved at once
AHEAD = 1e-4  # of coordinates, to differentiate twice by: constraints are of low degree
# what accelerations may add to coordinates there: of accelerations, the second derivative is off by a quarter of it,
# and by rounding over it
BENT = 2e-8


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
        self._settings = exu.SimulationSettings()

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
        system = mbs.systemData
        return self._made(mbs, system.GetODE2Coordinates_tt(), system.GetAECoordinates())[0]

    def _made(self, mbs: Any, q_tt: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """That of the q'' and l which are set, M and G (all, n)."""
        forces, M, G = self.forces(mbs), self.mass(mbs), self.constraints(mbs)
        return M @ q_tt + G.T @ multipliers - forces, M, G

    def forces(self, mbs: Any) -> np.ndarray:
        """Return f (n,), without those of constraints."""
        self._solver.ComputeODE2RHS(mbs)
        return self._solver.GetSystemResidual()[: self.size].copy()

    def static_balance(self, mbs: Any) -> np.ndarray:
        """Return f + G^T l of the multipliers that are set, (n,), and g (all,): one call, a third of the time."""
        self._solver.ComputeNewtonResidual(mbs, self._settings)
        found = self._solver.GetSystemResidual()
        return np.concatenate([found[: self.size], found[self._first_constraint :]])

    def balanced(self, mbs: Any, rows: Sequence[np.ndarray], independent: np.ndarray) -> list[np.ndarray]:
        """Return rows with q_tt and multipliers that obey equations of motion, and constraints twice differentiated.

        rows : t (S,), q, q_t, q_tt (S, n), multipliers (S, all); one Newton step from these, with G in place of C.
        independent : numbers of such constraints.
        """
        t, q, q_t, *forces = rows
        parts = [slice(a, a + TOGETHER) for a in range(0, len(t), TOGETHER)]
        changes = [self._step_to_balance(mbs, [x[part] for x in rows], independent) for part in parts]
        q_tt, multipliers = (x.copy() for x in forces)
        for part, change in zip(parts, changes, strict=True):
            q_tt[part] += change[:, : self.size]
            multipliers[part, independent] += change[:, self.size :]
        return [t, q, q_t, q_tt, multipliers]

    def _step_to_balance(self, mbs: Any, rows: Sequence[np.ndarray], independent: np.ndarray) -> np.ndarray:
        """Changes (S, n + c) of q_tt and multipliers of some of the rows."""
        S, n, size = len(rows[0]), self.size, self.size + len(independent)
        whole, left, scales = np.zeros((S, size, size)), np.zeros((S, size)), np.ones((S, size))
        for i, (t, *state) in enumerate(zip(*rows, strict=True)):
            set_state(mbs.systemData, t, state)
            left[i, :n], M, G = self._made(mbs, *state[2:])
            scale = np.abs(np.diag(M)).max()
            G = scale * G[independent]
            whole[i, :n, :n], whole[i, :n, n:], whole[i, n:, :n] = M, G.T, G
            left[i, n:] = scale * self._bend(mbs, t, *state[:3])[independent]
            scales[i, n:] = scale
        return scales * np.linalg.solve(whole, -left[..., None])[..., 0]

    def _bend(self, mbs: Any, t: float, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray) -> np.ndarray:
        """Second derivative over time (all,) of what constraints keep zero, along a motion that is set; moves it."""
        rate, bend = (np.abs(x).max(initial=0.0) for x in (q_t, q_tt))
        dt, found = min(AHEAD / max(1.0, rate), np.sqrt(BENT / max(1.0, bend))), [self.drift(mbs)]
        for step in (-dt, dt):
            mbs.systemData.SetTime(t + step)
            mbs.systemData.SetODE2Coordinates(q + step * q_t + step**2 / 2 * q_tt)
            found.append(self.drift(mbs))
        now, before, after = found
        return (after - 2 * now + before) / dt**2

    def drifts(self, mbs: Any, rows: Sequence[np.ndarray]) -> np.ndarray:
        """Return g (S, all) in rows of t, q, q_t, q_tt, multipliers."""
        found = []
        with state_kept(mbs.systemData):
            for t, *state in zip(*rows, strict=True):
                set_state(mbs.systemData, t, state)
                found.append(self.drift(mbs))
        return np.array(found)
