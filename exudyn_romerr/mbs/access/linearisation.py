"""Linearisation of a running mechanism: M, D, K and constraints G, read inside the hook without touching the run.

A static solver of our own, initialised once, computes them from the current state and writes into itself only:
results of the simulation stay equal bit for bit (measured with Exudyn 1.13.6; ComputeLinearizedSystem starts a solver
each time, and states, accelerations and time have to be restored after it).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
import scipy.linalg as la

from ...errors import AssumptionError
from .state_guard import coordinates_kept, loads_by_motion, loads_with_functions, states_kept

CHANGE = 0.6  # of G and K from one tangent to the next: more, and they are taken more often
LONGEST = 64  # steps between tangents, also where nothing changes
SMALL = 0.1  # of CHANGE: less, and less often; changes that revert in between are not detected
DIFFERENCE = 1e-7  # of coordinates, to differentiate by
REDUNDANT = 1e-10  # of the largest singular value: constraints below are redundant
PARAMETERS = ("RigidBodyEP", "RigidBodyRxyz")  # node types whose rotations are coordinates like others
INCREMENTS = ("RigidBodyRotVecLG", "RigidBodyRotVecDataLG")  # those whose rotations are increments
KEPT = 3  # readings of the block before: a spline through them goes on smoothly
TINY = np.finfo(float).tiny


FAILED = "the mechanism's tangent could not be computed"


@dataclass(frozen=True)
class Reading:
    """Read at time t: q, q_t, q_tt of the mbs in `state`; M, D, K (n, n), G (c, n) of independent constraints.

    K holds loads too, and how inertia and the forces of constraints change with the coordinates. change : of G and K
    since the reading before, over CHANGE.
    """

    t: float
    state: tuple[np.ndarray, np.ndarray, np.ndarray]
    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    G: np.ndarray
    change: float


class Tangents:
    """Reads the tangent every few steps of a solve; more often where the mechanism turns fast, or its forces change.

    Attributes
    ----------
    size : number of coordinates. readings : list of Reading, in the order of time. redundant : number of constraints
    that follow from others.
    """

    def __init__(self, mbs: Any):
        settings = exu.SimulationSettings()
        settings.solution.file.write = settings.solution.sensors.active = False
        settings.staticSolver.verboseMode = 0
        self._solver = exu.MainSolverStatic()
        with states_kept(mbs.systemData):
            if not self._solver.InitializeSolver(mbs, settings):
                raise AssumptionError(f"the mechanism has no tangent: {self._solver.GetErrorString()}")
        self.size = self._solver.GetODE2size()
        self._no_jacobian = np.zeros((self.size + self._solver.GetODE1size() + self._solver.GetAEsize(),) * 2)
        self._first_constraint = self.size + self._solver.GetODE1size()
        increments = {j for rotation in _rotations(mbs, INCREMENTS) for j in rotation}
        self._coordinates = [j for j in range(self.size) if j not in increments]
        self._rotations, self._loads = _rotations(mbs, PARAMETERS), loads_with_functions(mbs)
        self.readings: list[Reading] = []
        self._stride, self._active, self._rows = 1, None, None
        self.redundant = 0

    def read(self, mbs: Any, t: float) -> int:
        """Read the tangent now; return after how many steps it is to be read again."""
        system = mbs.systemData
        state = system.GetODE2Coordinates(), system.GetODE2Coordinates_t(), system.GetODE2Coordinates_tt()
        M, G = self._mass(mbs), self._constraints(mbs, t)
        self._check_loads(mbs)
        D, K = self._forces(mbs)
        change = _change(self.readings[-1], (t, M, K, G), self._rotations) / CHANGE if self.readings else 0.0
        if self.readings:
            self._stride = max(self._stride // 2, 1) if change > 1 else self._stride
            self._stride = min(2 * self._stride, LONGEST) if change < SMALL else self._stride
        self.readings.append(Reading(t, state, M, D, K, G, change))
        return self._stride

    def forget(self) -> None:
        """Keep the last readings, which what follows is interpolated with."""
        del self.readings[:-KEPT]

    def _check_loads(self, mbs: Any) -> None:
        try:
            controllers = loads_by_motion(mbs, self._loads)
        except Exception as error:
            raise AssumptionError(f"{FAILED}: {error}") from error
        if controllers:
            raise AssumptionError(f"{', '.join(controllers)} depend on the motion: pass scope='inputs frozen'")

    def _mass(self, mbs: Any) -> np.ndarray:
        self._solver.ComputeMassMatrix(mbs)
        return self._solver.GetSystemMassMatrix()[: self.size, : self.size]

    def _all_constraints(self, mbs: Any) -> np.ndarray:
        self._solver.SetSystemJacobian(self._no_jacobian)
        if self._solver.GetAEsize():
            self._solver.ComputeJacobianAE(mbs, 1.0, 0.0, 0.0, False)
        return self._solver.GetSystemJacobian()[self._first_constraint :, : self.size]

    def _constraints(self, mbs: Any, t: float) -> np.ndarray:
        """G; AssumptionError if other constraints are active than at the first reading."""
        G = self._all_constraints(mbs)
        active = G.any(axis=1)
        if self._active is None:
            self._active, self._rows = active, _independent(G, active)
            self.redundant = int(active.sum()) - len(self._rows)
        if not np.array_equal(active, self._active):
            raise AssumptionError(
                f"constraints were switched on or off before t = {t:g} s; the linearised mechanism is another one "
                "from there on: pass scope='inputs frozen', or solve up to there and go on with a second solve"
            )
        G = G[self._rows]
        values = la.svd(G, compute_uv=False) if len(G) else np.ones(1)
        if values[-1] <= REDUNDANT * values[0]:
            raise AssumptionError(
                f"constraints have become redundant before t = {t:g} s (a singular position), where the linearised "
                "mechanism has no solution: pass scope='inputs frozen'"
            )
        return G

    def _forces(self, mbs: Any) -> tuple[np.ndarray, np.ndarray]:
        """D and K by numerical differentiation; what user functions leave half done is set back."""
        try:
            with coordinates_kept(mbs.systemData) as (q, _):
                D, K = self._jacobian(mbs, 0.0, -1.0, 0), self._jacobian(mbs, -1.0, 0.0, 1)
                return D, K + self._carried_forces(mbs, q)
        except Exception as error:
            raise AssumptionError(f"{FAILED}: {error}") from error

    def _jacobian(self, mbs: Any, positions: float, rates: float, with_loads: int) -> np.ndarray:
        self._solver.ComputeJacobianODE2RHS(mbs, positions, rates, 0.0, with_loads)
        return self._solver.GetSystemJacobian()[: self.size, : self.size]

    def _carried_forces(self, mbs: Any, q: np.ndarray) -> np.ndarray:
        """d(M q'' + G^T l)/dq (n, n), which Exudyn's Jacobians leave out.

        By rotations and by modal coordinates: arms of joints' forces follow the deformation.
        """
        system = mbs.systemData
        q_tt, multipliers = system.GetODE2Coordinates_tt(), system.GetAECoordinates()

        def force(at: np.ndarray) -> np.ndarray:
            system.SetODE2Coordinates(at)
            return self._mass(mbs) @ q_tt + self._all_constraints(mbs).T @ multipliers

        before, carried = force(q), np.zeros((self.size, self.size))
        for j in self._coordinates:
            moved = q.copy()
            moved[j] += DIFFERENCE
            carried[:, j] = (force(moved) - before) / DIFFERENCE
        return carried


def _rotations(mbs: Any, types: Sequence[str]) -> list[list[int]]:
    """Coordinates of the rotation of every node of some types."""
    found = []
    for node in range(mbs.systemData.NumberOfNodes()):
        item = mbs.GetNode(node)
        if item["nodeType"] in types:
            first = mbs.GetNodeODE2Index(node)
            found.append([*range(first + 3, first + len(item["referenceCoordinates"]))])
    return found


def _change(before: Reading, now: tuple, rotations: Sequence[list[int]]) -> float:
    """Return how much G and K of t, M, K, G have changed: of G its share, of K that of K + M/dt^2, dt the time since.

    Where K is soft, its change accelerates masses for that time. Of a rotation's parameters the lightest axis counts,
    about which a slim body spins: the third largest inertia, for of four parameters one direction has none.
    """
    t, M, K, G = now
    stiffness = np.abs(np.diag(K)) + np.diag(M) / (t - before.t) ** 2
    for parameters in rotations:
        stiffness[parameters] = la.eigvalsh(M[np.ix_(parameters, parameters)])[-3] / (t - before.t) ** 2
    scale = 1 / np.sqrt(np.maximum(stiffness, TINY))
    return max(_turned(before.G, G), float(np.max(scale[:, None] * np.abs(K - before.K) * scale)))


def _turned(before: np.ndarray, G: np.ndarray) -> float:
    """Share of G that has changed; it holds the rotation parameters themselves, too."""
    return float(np.linalg.norm(G - before) / max(np.linalg.norm(G), TINY))


def _independent(G: np.ndarray, active: np.ndarray) -> np.ndarray:
    """Rows of active constraints that none of the others imply."""
    rows = np.flatnonzero(active)
    if not rows.size:
        return rows
    _, triangle, order = la.qr(G[rows].T, mode="economic", pivoting=True)
    size = np.abs(np.diag(triangle))
    return np.sort(rows[order[: int(np.sum(size > REDUNDANT * size[0]))]])
