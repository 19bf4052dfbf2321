"""Linearisation of a running mechanism: M, D, K and constraints G, read inside the hook without touching the run.

A static solver of our own, initialised once, computes them from the current state and writes into itself only:
the simulation stays equal bit for bit (measured with Exudyn 1.13.6; ComputeLinearizedSystem starts a solver each
time, and states, accelerations and time have to be restored after it). So it does where a stored state is set
(late_readings.py), and what is read there equals, bit for bit, what would have been read in passing.
"""

from __future__ import annotations

from bisect import bisect, bisect_left
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import AssumptionError
from ..memory.kept_values import Copies
from .dependence import Dependences, moved_by, normalised
from .equations import Equations
from .load_functions import controllers, loads_with_functions
from .state_guard import (
    coordinates_kept,
    current_state,
    of_coordinates,
    state_kept,
    state_set,
)
from .tangent_reading import (
    INCREMENTS,
    PARAMETERS,
    REDUNDANT,
    Carried,
    Reading,
    carried_of,
    compared,
    hashed,
    independent_rows,
    masses_of,
    quaternions_of,
    rotations_of,
    turned_share,
)

CHANGE = 0.6  # of G and K from one tangent to the next: more, and they are taken more often
# steps between tangents, also where nothing changes; they double from 1 on (from 8 on, what rings after a sudden
# start was predicted 5 to 20 times worse)
LONGEST = 256
SMALL = 0.4  # of CHANGE: less, and less often
DIFFERENCE = 1e-7  # of coordinates, to differentiate by
WIDE = 1e-4  # the same at both sides, to differentiate twice: constraints are of low degree
TURNED = 0.2  # share of G: more, and how it changes with the coordinates is another one
KEPT = 3  # readings of the block before: a spline through them goes on smoothly
FAILED = "the mechanism's tangent could not be computed"


class Tangents:
    """Reads the tangent every few steps of a solve; more often where the mechanism turns fast, or its forces change.

    Attributes
    ----------
    equations : in any state. size : number of coordinates. differentiable (size,) : whether K holds all forces
    by them. readings : list of Reading, in the order of time. carried : list of Carried, where G has turned since.
    redundant : number of constraints that follow from others. threads : of the running solver.
    """

    def __init__(self, mbs: Any, threads: int = 1):
        self.equations = Equations(mbs, threads)
        self.size = self.equations.size
        increments = {j for rotation in rotations_of(mbs, INCREMENTS) for j in rotation}
        self.differentiable = np.array([j not in increments for j in range(self.size)])
        self._rotations, self._loads = rotations_of(mbs, PARAMETERS), loads_with_functions(mbs)
        self._copies = Copies()
        self.readings: list[Reading] = []
        self.carried: list[Carried] = []
        self._stride, self._active, self._rows = 1, None, None
        self._quaternions = quaternions_of(mbs)
        self._depends: Dependences | None = None
        self.redundant = 0

    def read(self, mbs: Any, t: float) -> int:
        """Read the tangent now; return after how many steps it is to be read again."""
        change = self.readings[self.add(self._read(mbs, t))].change
        if len(self.readings) > 1:
            self._stride = max(self._stride // 2, 1) if change > 1 else self._stride
            self._stride = min(2 * self._stride, LONGEST) if change < SMALL else self._stride
        return self._stride

    def read_stored(self, mbs: Any, t: float, state: Sequence[np.ndarray]) -> None:
        """Read the tangent of a stored state: q, q_t, q_tt and multipliers at time t."""
        with state_set(mbs.systemData, t, state):
            self.add(self._read(mbs, t))

    def add(self, reading: Reading) -> int:
        """Put a reading where its time belongs; return its number."""
        j = bisect(self.readings, reading.t, key=lambda other: other.t)
        self.readings.insert(j, reading)
        for i in (j, j + 1):
            if 0 < i < len(self.readings):
                self.readings[i] = compared(self.readings[i - 1], self.readings[i], CHANGE)
        return j

    def reads_the_same(self, mbs: Any, reading: Reading) -> bool:
        """Whether Exudyn gives now, in the state of a reading, what it gave then: nothing else has changed."""
        with state_set(mbs.systemData, reading.t, reading.state):
            own = self.equations.mass(mbs), self._constraints(mbs, reading.t), *self._jacobians(mbs)
        return hashed(*own) == reading.own

    def end_before(self, t: float) -> None:
        """Drop readings from a time on."""
        del self.readings[bisect_left(self.readings, t, key=lambda reading: reading.t) :]

    def forget(self) -> None:
        """Keep the last readings, which what follows is interpolated with."""
        del self.readings[:-KEPT]
        self.carried = [self.carried_near(self.readings[-1].t)]

    def moved(self, states: Sequence[np.ndarray], e: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return q, q_t, q_tt (S, k) that e (3, S, k) moves; coordinates behind those of the mbs may follow."""
        return moved_by(e, states, self._quaternions)

    def differences(self, mbs: Any, dq: np.ndarray) -> np.ndarray:
        """K dq in the current state: all forces at both sides of it, over twice the distance."""
        step = DIFFERENCE / np.abs(dq).max()

        def force(at: np.ndarray) -> np.ndarray:
            mbs.systemData.SetODE2Coordinates(at)
            return self.equations.residual(mbs)

        with coordinates_kept(mbs.systemData) as (q, _):
            return (force(q + step * dq) - force(q - step * dq)) / (2 * step)

    def drifts(self, mbs: Any, rows: Sequence[np.ndarray]) -> np.ndarray:
        """What independent constraints keep zero (S, c), in rows of t, q, q_t, q_tt, multipliers."""
        return self.equations.drifts(mbs, rows)[:, self._rows]

    @property
    def independent(self) -> np.ndarray:
        """Numbers (c,) of the constraints that are kept, among all."""
        return self._rows

    def _read(self, mbs: Any, t: float) -> Reading:
        state = current_state(mbs.systemData)
        M, G = self.equations.mass(mbs), self._constraints(mbs, t)
        self._check_loads(mbs)
        D, own, carried, C, C_t = self._forces(mbs, M, G)
        K = own + carried
        springs = np.abs(np.diag(K))
        springs[[j for rotation in self._rotations for j in rotation]] = 0.0
        masses = masses_of(M, self._rotations)
        return Reading(t, state, M, D, K, G, C, C_t, masses, springs, hashed(M, G, D, own))

    def _check_loads(self, mbs: Any) -> None:
        try:
            found = controllers(mbs, self._loads, self._copies)
        except Exception as error:
            raise AssumptionError(f"{FAILED}: {error}") from error
        if found:
            raise AssumptionError(
                f"{', '.join(found.values())} depend on the motion or on earlier calls: pass scope='inputs frozen'"
            )

    def _constraints(self, mbs: Any, t: float) -> np.ndarray:
        """G; AssumptionError if other constraints are active than at the first reading."""
        G = self.equations.constraints(mbs)
        active = G.any(axis=1)
        if self._active is None:
            self._active, self._rows = active, independent_rows(G, active)
            self.redundant = int(active.sum()) - len(self._rows)
        if not np.array_equal(active, self._active):
            raise AssumptionError(
                f"constraints were switched on or off before t = {t:g} s; the linearised mechanism is another one "
                "from there on: pass scope='inputs frozen', or solve up to there and go on with a second solve"
            )
        G = G[self._rows]
        values = np.linalg.svd(G, compute_uv=False) if len(G) else np.ones(1)
        if values[-1] <= REDUNDANT * values[0]:
            raise AssumptionError(
                f"constraints have become redundant before t = {t:g} s (a singular position), where the linearised "
                "mechanism has no solution: pass scope='inputs frozen'"
            )
        return G

    def _forces(self, mbs: Any, M: np.ndarray, G: np.ndarray) -> tuple[np.ndarray, ...]:
        """D, K in two parts, C, C_t by numerical differentiation; what user functions leave half done is set back."""
        try:
            with state_kept(mbs.systemData) as (q, *_):
                if self._depends is None or not self._depends.hold_for(M, G):
                    self._depends = self._found(mbs, q)
                    mbs.systemData.SetODE2Coordinates(q)
                return *self._jacobians(mbs), self._carried_forces(mbs, q, G), *self._kept(mbs, q)
        except Exception as error:
            raise AssumptionError(f"{FAILED}: {error}") from error

    def _found(self, mbs: Any, q: np.ndarray) -> Dependences:
        """What depends on which coordinates."""
        own = self.equations
        of = [of_coordinates(mbs, value) for value in (own.mass, own.constraints, own.drift)]
        return Dependences.at(q, np.flatnonzero(self.differentiable), self._rows, self._quaternions, of)

    def _jacobians(self, mbs: Any) -> tuple[np.ndarray, np.ndarray]:
        return self.equations.jacobian(mbs, 0.0, -1.0, 0), self.equations.jacobian(mbs, -1.0, 0.0, 1)

    def _carried_forces(self, mbs: Any, q: np.ndarray, G: np.ndarray) -> np.ndarray:
        """d(M q'' + G^T l)/dq (n, n), which Exudyn's Jacobians leave out.

        By rotations and by modal coordinates: arms of joints' forces follow the deformation.
        """
        system, carried = mbs.systemData, np.zeros((self.size, self.size))
        parts = []
        for depends, value, moving in (
            (self._depends.mass, self.equations.mass, system.GetODE2Coordinates_tt()),
            (self._depends.forces, lambda mbs: self.equations.constraints(mbs).T, system.GetAECoordinates()),
        ):
            by = depends.forward(of_coordinates(mbs, value), q, DIFFERENCE)
            carried[depends.i, depends.j] += by @ moving
            parts.append((depends, by))
        if self._is_due(system.GetTime(), G):
            self.carried.append(carried_of(system.GetTime(), G, *parts))
        return carried

    def _kept(self, mbs: Any, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """C and C_t, along the motion and over time; Exudyn's G by coordinates that are increments."""
        system = mbs.systemData
        t, q_t = system.GetTime(), system.GetODE2Coordinates_t()
        dt = WIDE / max(1.0, np.abs(q_t).max())
        after, before = (
            self._derivative(mbs, t + dt, normalised(q + dt * q_t, self._quaternions)) for dt in (dt, -dt)
        )
        return (after + before) / 2, (after - before) / (2 * dt)

    def _derivative(self, mbs: Any, t: float, q: np.ndarray) -> np.ndarray:
        """C at another time and place: G, and differences of positions where it is not their derivative."""
        mbs.systemData.SetTime(t)
        G = of_coordinates(mbs, self.equations.constraints)(q)
        return self._depends.unlike.corrected(G, of_coordinates(mbs, self.equations.drift), q, WIDE)[self._rows]

    def _is_due(self, t: float, G: np.ndarray) -> bool:
        """Whether changes of M and G are kept: where steps are read one by one, nothing is interpolated."""
        if not self.carried:
            return True
        return self._stride > 1 and turned_share(self.carried_near(t).G, G) > TURNED

    def carried_near(self, t: float) -> Carried:
        """Return that of the nearest time."""
        return min(self.carried, key=lambda one: abs(one.t - t))
