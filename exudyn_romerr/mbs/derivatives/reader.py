"""TangentReader: M, D, K and constraints of a mechanism in its current state, by differences of what Exudyn gives."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import AssumptionError
from ..access.state_guard import current_state, of_coordinates, state_kept
from .dependence import Dependences, normalised
from .tangent_reading import (
    INCREMENTS,
    PARAMETERS,
    REDUNDANT,
    Parts,
    Reading,
    independent_rows,
    masses_of,
    quaternions_of,
    rotations_of,
    shared_rows,
    without_units,
)
from .twin import Place

DIFFERENCE = 1e-7  # of coordinates, to differentiate by
CENTRAL = 1e-5  # the same at both sides, of what user functions make of the motion
WIDE = 1e-4  # the same at both sides, to differentiate twice: constraints are of low degree
FAILED = "the mechanism's tangent could not be computed"


class TangentReader:
    """Reads tangents; what depends on which coordinates is found once.

    Attributes
    ----------
    size : number of coordinates. differentiable (size,) : whether K holds all forces by them. rows : numbers (c,) of
    independent constraints, None before the first reading. redundant : number of those that follow from others.
    """

    def __init__(self, mbs: Any, size: int, functions_look: bool):
        """Functions_look : whether user functions look at the mbs, which Exudyn's Jacobians do not see."""
        self.size, self._functions_look = size, functions_look
        increments = {j for rotation in rotations_of(mbs, INCREMENTS) for j in rotation}
        self.differentiable = np.array([j not in increments for j in range(size)])
        self._rotations, self.quaternions = rotations_of(mbs, PARAMETERS), quaternions_of(mbs)
        self._active, self.rows = None, None
        self._depends: Dependences | None = None
        self.redundant = 0

    def read(self, at: Place, t: float) -> tuple[Reading, Parts]:
        """Return the tangent, and how M and G^T change with the coordinates; M without that of inertias."""
        state = current_state(at.mbs.systemData)
        inertias = [one.tangent(*(x[one.columns] for x in state[:3])) for one in at.inertias]
        light = at.equations.mass(at.mbs)
        M = light.copy()
        for one, (part, *_) in zip(at.inertias, inertias, strict=True):
            M[np.ix_(one.columns, one.columns)] += part
        masses = masses_of(M, self._rotations)
        G = self._constraints(at, t, masses)
        D, own, carried, parts, C, C_t = self._forces(at, light, G)
        K = own + carried
        for one, (_, *others) in zip(at.inertias, inertias, strict=True):
            for whole, part in zip((D, K), others, strict=True):
                whole[np.ix_(one.columns, one.columns)] += part
        springs = np.abs(np.diag(K))
        springs[[j for rotation in self._rotations for j in rotation]] = 0.0
        return Reading(t, state, M, D, K, G, C, C_t, masses, springs), parts

    def shared(self, at: Place) -> np.ndarray:
        """Numbers of redundant constraints, and of those that imply them."""
        return shared_rows(at.equations.constraints(at.mbs), masses_of(at.equations.mass(at.mbs), self._rotations))

    def _constraints(self, at: Place, t: float, masses: np.ndarray) -> np.ndarray:
        """G; AssumptionError if other constraints are active than at the first reading."""
        G = at.equations.constraints(at.mbs)
        active = G.any(axis=1)
        if self._active is None:
            self._active, self.rows = active, independent_rows(G, active, masses)
            self.redundant = int(active.sum()) - len(self.rows)
        if not np.array_equal(active, self._active):
            raise AssumptionError(
                f"constraints were switched on or off before t = {t:g} s; the linearised mechanism is another one "
                "from there on: pass scope='inputs frozen', or solve up to there and go on with a second solve"
            )
        G = G[self.rows]
        values = np.linalg.svd(without_units(G, masses), compute_uv=False) if len(G) else np.ones(1)
        if values[-1] <= REDUNDANT * values[0]:
            raise AssumptionError(
                f"constraints have become redundant before t = {t:g} s (a singular position), where the linearised "
                "mechanism has no solution: pass scope='inputs frozen'"
            )
        return G

    def _forces(self, at: Place, M: np.ndarray, G: np.ndarray) -> tuple:
        """D, K in two parts, how M and G change, C, C_t; what user functions leave half done is set back."""
        system = at.mbs.systemData
        try:
            with state_kept(system) as (q, _, *moving):
                if self._depends is None or not self._depends.hold_for(M, G):
                    self._depends = self._found(at, q)
                    system.SetODE2Coordinates(q)
                return *self._jacobians(at), *self._carried_forces(at, q, moving), *self._kept(at, q)
        except Exception as error:
            raise AssumptionError(f"{FAILED}: {error}") from error

    def _found(self, at: Place, q: np.ndarray) -> Dependences:
        """What depends on which coordinates."""
        own = at.equations
        of = [of_coordinates(at.mbs, value) for value in (own.mass, own.constraints, own.drift)]
        return Dependences.at(q, np.flatnonzero(self.differentiable), self.rows, self.quaternions, of)

    def _jacobians(self, at: Place) -> tuple[np.ndarray, np.ndarray]:
        if self._functions_look:
            return self._differences(at)
        return at.equations.jacobian(at.mbs, 0.0, -1.0, 0), at.equations.jacobian(at.mbs, -1.0, 0.0, 1)

    def _differences(self, at: Place) -> tuple[np.ndarray, np.ndarray]:
        """The same of all forces, by differences to both sides."""
        system = at.mbs.systemData
        found = []
        for x, write in (
            (system.GetODE2Coordinates_t(), system.SetODE2Coordinates_t),
            (system.GetODE2Coordinates(), system.SetODE2Coordinates),
        ):
            columns = np.zeros((self.size, self.size))
            for j in range(self.size):
                step = CENTRAL * max(1.0, np.abs(x[j])) * (np.arange(self.size) == j)
                for side in (1, -1):
                    write(x + side * step)
                    columns[:, j] -= side * at.equations.forces(at.mbs) / (2 * step[j])
            write(x)
            found.append(columns)
        return found[0], found[1]

    def _carried_forces(self, at: Place, q: np.ndarray, moving: list[np.ndarray]) -> tuple[np.ndarray, Parts]:
        """d(M q'' + G^T l)/dq (n, n), which Exudyn's Jacobians leave out, and what it is made of.

        By rotations and by modal coordinates: arms of joints' forces follow the deformation. moving : q'' and l.
        """
        carried, parts = np.zeros((self.size, self.size)), []
        values = at.equations.mass, lambda mbs: at.equations.constraints(mbs).T
        for depends, value, x in zip((self._depends.mass, self._depends.forces), values, moving, strict=True):
            by = depends.forward(of_coordinates(at.mbs, value), q, DIFFERENCE)
            carried[depends.i, depends.j] += by @ x
            parts.append((depends, by))
        return carried, parts

    def _kept(self, at: Place, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """C and C_t, along the motion and over time; Exudyn's G by coordinates that are increments."""
        system = at.mbs.systemData
        t, q_t = system.GetTime(), system.GetODE2Coordinates_t()
        dt = WIDE / max(1.0, np.abs(q_t).max())
        after, before = (self._derivative(at, t + dt, normalised(q + dt * q_t, self.quaternions)) for dt in (dt, -dt))
        return (after + before) / 2, (after - before) / (2 * dt)

    def _derivative(self, at: Place, t: float, q: np.ndarray) -> np.ndarray:
        """C at another time and place: G, and differences of positions where it is not their derivative."""
        at.mbs.systemData.SetTime(t)
        G = of_coordinates(at.mbs, at.equations.constraints)(q)
        drift = of_coordinates(at.mbs, at.equations.drift)
        return self._depends.unlike.corrected(G, drift, q, WIDE)[self.rows]
