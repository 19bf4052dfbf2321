"""Twin: a copy of the mbs of a run with light meshes, where its equations are the same and cost less."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import exudyn as exu
import numpy as np

from ..access.equations import Equations
from ..access.state_guard import current_state, set_state, state_set
from .copied_mbs import copy_items
from .frame_inertia import FrameInertia

MOVED = 1e-4  # of coordinates and rates: where both are compared, so that nothing vanishes by chance
# of an entry, and of the largest one: sums of nodes in another order; measured 3e-16 of the largest
AGREES, ROUNDING = 1e-9, 1e-13


class Place(NamedTuple):
    """Where equations are asked: of an mbs, or of its twin, in the current state.

    inertias : of bodies that have neither mass nor stiffness in this mbs.
    """

    equations: Equations
    mbs: Any
    inertias: tuple[FrameInertia, ...] = ()

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
        found, (*state, _) = self.equations.residual(self.mbs), current_state(self.mbs.systemData)
        for one in self.inertias:
            found[one.columns] += one.force(*(x[one.columns] for x in state))
        return found

    def look(self, t: float, state: Sequence[np.ndarray]) -> list[np.ndarray]:
        """M, forces, G and what constraints keep zero, near a state."""
        q, q_t, *others = state
        by = MOVED * (1 + np.sin(np.arange(len(q))))
        near = [x + by * np.abs(x).max(initial=1.0) for x in (q, q_t)]
        with state_set(self.mbs.systemData, t, (*near, *others)):
            G, drift = self.equations.constraints(self.mbs).copy(), self.equations.drift(self.mbs)
            return [self.mass().copy(), self.forces(), G, drift]


class Twin(Place):
    """A copy of an mbs. None of `of`: none is needed, or none can be had."""

    @classmethod
    def of(cls, mbs: Any, threads: int, whole: bool = False) -> Twin | None:
        """Make it of an mbs whose meshes can be lighter, and whose states tell all its coordinates.

        whole : whether bodies keep their masses, which cost less than inertias where nothing is differentiated.
        """
        if len(mbs.systemData.GetDataCoordinates()) or len(mbs.systemData.GetODE1Coordinates()):
            return None
        container = exu.SystemContainer()
        copy = container.AddSystem()
        try:
            inertias = () if whole else tuple(FrameInertia.all_of(mbs))
            if not (copy_items(mbs, copy, hollow=[one.number for one in inertias]) or inertias):
                return None
            copy.Assemble()
            twin = cls(Equations(copy, threads), copy, inertias)
        except Exception:  # of Exudyn, for an item that cannot be copied
            return None
        twin.container = container  # it goes with it, and what is in it
        return twin

    def shows(self, t: float, state: Sequence[np.ndarray], seen: list[np.ndarray]) -> bool:
        """Whether it shows near a state what the mbs shows there."""
        try:
            return all(map(_near, seen, self.look(t, state)))
        except Exception:  # of a user function that finds something missing
            return False

    def at(self, t: float, state: Sequence[np.ndarray]) -> Twin:
        """Set time, q, q_t, q_tt and multipliers."""
        set_state(self.mbs.systemData, t, state)
        return self


def _near(one: np.ndarray, other: np.ndarray) -> bool:
    size = np.abs(one)
    return bool(np.all(np.abs(one - other) <= AGREES * size + ROUNDING * size.max(initial=0.0)))
