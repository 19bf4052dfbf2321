"""Equations: what Exudyn computes in the current state of an mbs, by a static solver of our own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import exudyn as exu
import numpy as np

from ...errors import AssumptionError

IN_PLACE = exu.ConfigurationType.Current, False  # not copied: memory of the mbs, to be read or written at once


def current_state(system: Any) -> tuple[np.ndarray, ...]:
    """Return copies of q, q_t, q_tt and multipliers as Rows have them; integrals of coordinates of first order: 0."""
    q, v, a, multipliers, x, rates = state_in_place(system)
    return np.append(q, 0.0 * x), np.append(v, x), np.append(a, rates), multipliers.copy()


def set_state(system: Any, t: float, state: Sequence[np.ndarray]) -> None:
    """Set time, q, q_t, q_tt and multipliers as Rows have them.

    In place: Exudyn's functions that set them make a list of numbers first, which takes five times as long.
    """
    system.SetTime(t)
    fill(state_in_place(system), *state)


def state_in_place(system: Any) -> tuple[np.ndarray, ...]:
    """Return q, q_t, q_tt, multipliers, coordinates of first order, their rates: memory of the mbs."""
    rates = system.GetODE2Coordinates_t(*IN_PLACE), system.GetODE2Coordinates_tt(*IN_PLACE)
    first_order = system.GetODE1Coordinates(*IN_PLACE), system.GetODE1Coordinates_t(*IN_PLACE)
    return system.GetODE2Coordinates(*IN_PLACE), *rates, system.GetAECoordinates(*IN_PLACE), *first_order


def fill(
    places: Sequence[np.ndarray], q: np.ndarray, v: np.ndarray, a: np.ndarray, multipliers: np.ndarray | None = None
) -> None:
    """Fill what state_in_place gives; coordinates of first order, the last of v, and multipliers where given."""
    n = len(places[0])
    places[0][:], places[1][:], places[2][:] = q[:n], v[:n], a[:n]
    if multipliers is not None:
        places[3][:] = multipliers
    if len(v) > n:
        places[4][:], places[5][:] = v[n:], a[n:]


@contextmanager
def state_set(system: Any, t: float, state: Sequence[np.ndarray]) -> Iterator[None]:
    """Set the current state for a while: time, q, q_t, q_tt and multipliers."""
    before = system.GetTime(), current_state(system)
    try:
        set_state(system, t, state)
        yield
    finally:
        set_state(system, *before)


CONFIGURATIONS = (exu.ConfigurationType.Current, exu.ConfigurationType.Initial, exu.ConfigurationType.StartOfStep)
_LAST: list[exu.MainSolverStatic] = []  # of ours; when one goes, the threads of the run go with it


class Equations:
    """M q'' + G^T l = f and g = 0 of an mbs in its current state; the solver writes into itself only.

    size : number of coordinates. Those of first order are rates of further ones behind the others, as in Rows;
    masses : factors of their equations.
    """

    def __init__(self, mbs: Any, threads: int, masses: np.ndarray | None = None):
        """Initialise a solver; threads : of the running one.

        masses : factors of the equations of first order; None: these are left out.
        """
        self._solver = _own_solver(mbs, threads)
        self.masses = np.zeros(0) if masses is None else masses
        self._plain = self._solver.GetODE2size()
        self.size = self._plain + len(self.masses)
        self._first_constraint = self._plain + self._solver.GetODE1size()
        self._left_out = slice(self.size, self._first_constraint)
        self._no_jacobian = np.zeros((self._first_constraint + self._solver.GetAEsize(),) * 2)
        self._settings = exu.SimulationSettings()

    def mass(self, mbs: Any) -> np.ndarray:
        """M (n, n)."""
        self._solver.ComputeMassMatrix(mbs)
        n, M = self._plain, self._solver.GetSystemMassMatrix()
        if not len(self.masses):
            return M[:n, :n]
        found = np.diag(np.append(np.zeros(n), self.masses))
        found[:n, :n] = M[:n, :n]
        return found

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

    def forces(self, mbs: Any) -> np.ndarray:
        """Return f (n,), without those of constraints."""
        of_first_order = self.static_balance(mbs)[self._plain : self.size] if len(self.masses) else None
        self._solver.ComputeODE2RHS(mbs)
        found = self._solver.GetSystemResidual()[: self._plain]
        return found if of_first_order is None else np.append(found, of_first_order)

    def static_balance(self, mbs: Any) -> np.ndarray:
        """Return f + G^T l of the multipliers that are set, (n,), and g (all,): one call, a third of the time."""
        self._solver.ComputeNewtonResidual(mbs, self._settings)
        found = self._solver.GetSystemResidual()
        if len(self.masses):
            found[self._plain : self.size] *= self.masses
        return found if self.size == self._first_constraint else np.delete(found, self._left_out)


def _own_solver(mbs: Any, threads: int) -> exu.MainSolverStatic:
    """Return a static solver of our own, initialised beside a run with so many threads, which goes on as it was.

    Exudyn's one task manager starts anew with as many threads as the solver initialised last asks for, and says so.
    """
    settings, solver = exu.SimulationSettings(), exu.MainSolverStatic()
    settings.solution.file.write = settings.solution.sensors.active = False
    settings.staticSolver.verboseMode = 0
    settings.parallel.numberOfThreads = threads
    warnings_off = exu.config.suppressWarnings
    _LAST.clear()
    try:
        exu.config.suppressWarnings = True
        with _states_kept(mbs.systemData):
            if not solver.InitializeSolver(mbs, settings):
                raise AssumptionError(f"the mechanism has no tangent: {solver.GetErrorString()}")
    finally:
        exu.config.suppressWarnings = warnings_off
    _LAST.append(solver)
    return solver


@contextmanager
def _states_kept(system: Any) -> Iterator[None]:
    """Put back what the initialisation of a solver changes: states, accelerations and times."""
    kept = [
        (system.GetSystemState(where), system.GetODE2Coordinates_tt(where), system.GetTime(where), where)
        for where in CONFIGURATIONS
    ]
    try:
        yield
    finally:
        for state, q_tt, t, where in kept:
            system.SetSystemState(state, where)
            system.SetODE2Coordinates_tt(q_tt, where)
            system.SetTime(t, where)
