"""Twin: copies of the mbs of a run with light meshes, where its equations are the same and cost less."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import exudyn as exu
import numpy as np

from ..access.copied_mbs import copy_items, may_be_lighter
from ..access.equations import Equations
from ..access.state_guard import current_state, set_state, state_in_place, state_set
from .frame_inertia import FrameInertia

MOVED = 1e-4  # of coordinates and rates: where both are compared, so that nothing vanishes by chance
AGREES = 1e-9  # of an entry
# of the largest entry of M, forces, G and what constraints keep zero: sums of nodes in another order; measured 3e-16,
# but in G 5e-13 and 4e-12 for faces of 2 cm and 5 mm: rotations are sums of x_i x u_i over those of squared arms
ROUNDING = (1e-13, 1e-13, 1e-11, 1e-13)
MANY = 128  # steps, from which on a further copy pays


class Place(NamedTuple):
    """Where equations are asked: of an mbs, or of a copy, in the current state.

    inertias : of bodies that have neither mass nor stiffness in this mbs. container : goes with it.
    """

    equations: Equations
    mbs: Any
    inertias: tuple[FrameInertia, ...] = ()
    container: Any = None

    @classmethod
    def copied(
        cls, mbs: Any, threads: int, inertias: tuple[FrameInertia, ...] = (), functions_look: bool = False
    ) -> Place:
        """Copy an mbs, but for the inertia of some bodies; functions_look : see Tangents."""
        container = exu.SystemContainer()
        copy = container.AddSystem()
        copy_items(mbs, copy, hollow=[one.number for one in inertias], functions_look=functions_look)
        copy.Assemble()
        return cls(Equations(copy, threads), copy, inertias, container)

    def mass(self) -> np.ndarray:
        """M (n, n)."""
        M, q = self.equations.mass(self.mbs), self.mbs.systemData.GetODE2Coordinates()
        for one in self.inertias:
            M[np.ix_(one.columns, one.columns)] += one.mass(q[one.columns])
        return M

    def forces(self) -> np.ndarray:
        """Return f (n,), without those of constraints."""
        system, f = self.mbs.systemData, self.equations.forces(self.mbs)
        q, q_t = system.GetODE2Coordinates(), system.GetODE2Coordinates_t()
        for one in self.inertias:
            f[one.columns] -= one.force(*(x[one.columns] for x in (q, q_t, 0 * q)))
        return f

    def residual(self) -> np.ndarray:
        """M q'' + G^T l - f (n,)."""
        found = self.equations.residual(self.mbs)
        state = current_state(self.mbs.systemData)[:3] if self.inertias else ()
        for one in self.inertias:
            found[one.columns] += one.force(*(x[one.columns] for x in state))
        return found

    def residuals(self, t: np.ndarray, states: Sequence[np.ndarray]) -> np.ndarray:
        """M q'' + G^T l - f (S, n) in states q, q_t, q_tt, multipliers (S, ...) at t (S,), which are set."""
        own, mbs, has_mass, has_pull = self.equations, self.mbs, True, bool(np.any(states[3]))
        found, places, system = np.empty((len(t), own.size)), state_in_place(mbs.systemData), mbs.systemData
        for i, now in enumerate(t):
            system.SetTime(now)
            for place, x in zip(places, states, strict=True):
                place[:] = x[i]
            f, pull = own.forces(mbs), own.constraints(mbs).T @ states[3][i] if has_pull else 0.0
            if has_mass:
                M = own.mass(mbs)
                has_mass = not self.inertias or bool(M.any())  # or closed forms have all of it
                pull = M @ states[2][i] + pull
            np.subtract(pull, f, out=found[i])
        for one in self.inertias:
            found[:, one.columns] += one.force(*(x[:, one.columns] for x in states[:3]))
        return found

    def look(self, t: float, state: Sequence[np.ndarray]) -> list[np.ndarray]:
        """M, forces, G and what constraints keep zero, near a state."""
        q, q_t, *others = state
        by = MOVED * (1 + np.sin(np.arange(len(q))))
        near = [x + by * np.abs(x).max(initial=1.0) for x in (q, q_t)]
        with state_set(self.mbs.systemData, t, (*near, *others)):
            G, drift = self.equations.constraints(self.mbs).copy(), self.equations.drift(self.mbs)
            return [self.mass().copy(), self.forces(), G, drift]

    def shows(self, t: float, state: Sequence[np.ndarray], seen: list[np.ndarray]) -> bool:
        """Whether it shows near a state what another mbs shows there."""
        try:
            return all(map(_near, seen, self.look(t, state), ROUNDING))
        except Exception:  # of a user function that finds something missing
            return False

    def at(self, t: float, state: Sequence[np.ndarray]) -> Place:
        """Set time, q, q_t, q_tt and multipliers."""
        set_state(self.mbs.systemData, t, state)
        return self


class Twin(NamedTuple):
    """Copies of an mbs: a light one to ask for forces, one to ask for derivatives, where many modes cost much.

    Both are the mbs as it was when they were made. functions_look : see Tangents.
    """

    light: Place
    hollow: Place
    functions_look: bool

    @classmethod
    def of(
        cls,
        mbs: Any,
        threads: int,
        functions_look: bool,
        t: float,
        state: Sequence[np.ndarray],
        seen: list[np.ndarray],
    ) -> Twin | None:
        """Make it of an mbs whose states tell all its coordinates; None: none is needed, or none can be had."""
        if len(mbs.systemData.GetDataCoordinates()) or len(mbs.systemData.GetODE1Coordinates()):
            return None
        try:
            inertias = tuple(FrameInertia.all_of(mbs))
            if not (inertias or may_be_lighter(mbs)):
                return None
            light = Place.copied(mbs, threads, functions_look=functions_look)
            hollow = Place.copied(mbs, threads, inertias, functions_look) if inertias else light
        except Exception:  # of Exudyn, for an item that cannot be copied
            return None
        places = (light,) if hollow is light else (light, hollow)
        return cls(light, hollow, functions_look) if all(place.shows(t, state, seen) for place in places) else None

    def bare(self, count: int) -> Place:
        """The one to ask for residuals of about so many steps: a copy without inertia where these are enough."""
        inertias = tuple(FrameInertia.all_of(self.light.mbs, least=0))
        if count < MANY or len(inertias) == len(self.hollow.inertias):
            return self.hollow
        try:
            return Place.copied(self.light.mbs, self.light.equations.threads, inertias, self.functions_look)
        except Exception:  # of Exudyn, for an item that cannot be copied
            return self.hollow


def _near(one: np.ndarray, other: np.ndarray, rounding: float) -> bool:
    size = np.abs(one)
    return bool(np.all(np.abs(one - other) <= AGREES * size + rounding * size.max(initial=0.0)))
