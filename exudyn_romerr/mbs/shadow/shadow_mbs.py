"""Shadow: an mbs of our own beside that of a run, whose flexible bodies have their auxiliary vectors as modes.

A copy of the mbs (copied_mbs.py), so that Exudyn's own equations can be asked in states for which the mbs of the run
has no coordinates. The run's mbs is read and set back, nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np

from ...errors import RunError
from ..access.copied_mbs import copy_items
from ..access.equations import Equations
from ..access.object_terms import object_terms
from ..access.state_guard import current_state, set_state, state_kept
from ..control.mbs_by_name import hints
from ..derivatives.frame_inertia import FrameInertia
from ..mechanism.stored_residuals import GONE, HOLDS, MEMORY, user_functions
from ..memory.user_memory import memory_kept

if TYPE_CHECKING:
    from ..derivatives.linearisation import Tangents
    from ..mechanism.enriched_body import EnrichedBody

    Parts = Sequence[tuple[EnrichedBody, slice]]

AGREES = 1e-9  # of the largest entry; measured: up to 3e-13
AWAY = 0.01  # of coordinates: where both are compared, so that nothing vanishes by chance
SEED = 17
NO_COPY = "it cannot be copied: {}"
MORE = "it has data coordinates, or such of first order, which stored steps lack"
OTHER = (
    "its copy has other equations: {} differ by {:.1e} of the largest entry (a user function that looks at another "
    "mbs than the one that it is given makes it so{})"
)


class Shadow:
    """Equations of an mbs with vectors: coordinates q (k,) are those of the mbs, then the vectors of all bodies.

    parts : bodies, and where their vectors are among these coordinates. tangents : of the running solver.

    Raises
    ------
    RunError
        The mbs cannot be copied, or its copy has other equations; a user function keeps something from call to call.
    """

    def __init__(self, mbs: Any, parts: Parts, tangents: Tangents, hollow: bool = False):
        """Hollow: bodies have neither mass nor stiffness, and nothing is compared."""
        if mbs is None:
            raise RunError(GONE)
        self._original, self._functions = tangents.equations, user_functions(mbs)
        self._rows = slice(0) if tangents.independent is None else tangents.independent  # None: nothing was read yet
        self._is_massless = False  # in this mbs, until all are found in closed forms
        if len(mbs.systemData.GetDataCoordinates()) or len(mbs.systemData.GetODE1Coordinates()):
            raise RunError(MORE)
        try:
            self._container = exu.SystemContainer()  # goes when nobody holds it, and what is in it
            self._mbs = self._container.AddSystem()
            wider = {b.flex.number: object_terms(b) for b, _ in parts}
            copy_items(mbs, self._mbs, wider, wider if hollow else (), tangents.functions_look)
            self._mbs.Assemble()
            self._inertias = list(FrameInertia.all_of(self._mbs))
            for one in self._inertias:
                self._mbs.SetObjectParameter(one.number, "computeFFRFterms", False)
            self._mbs.Assemble()
            self._equations = Equations(self._mbs, tangents.equations.threads)
            self._places = _places(mbs, self._mbs, parts)
        except Exception as error:
            raise RunError(NO_COPY.format(error)) from error
        if not hollow:
            with self.functions_kept():
                self.compare(mbs)

    @property
    def size(self) -> int:
        """Number k of coordinates."""
        return len(self._places)

    def forces(self, t: float, state: Sequence[np.ndarray]) -> np.ndarray:
        """Return f (k,) in a state q, q_t, q_tt (k,); to be asked within functions_kept."""
        self._set(t, state)
        return self._equations.forces(self._mbs)[self._places]

    def residuals(self, rows: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return M q'' + G^T l - f (S, k), and what constraints keep zero (S, c), in rows t, q, q_t, q_tt (S, k).

        Multipliers l are those that leave least of it. To be asked within functions_kept.
        """
        t, *states = rows
        wide = self._wide(states)
        found = [self._at(*at) for at in zip(t, *wide, strict=True)]
        forces, masses, G, g = (np.array(x) for x in zip(*found, strict=True))
        for one in self._inertias:
            force, mass = one.force_and_masses(*wide[:, :, one.columns])
            forces[:, one.columns] += force
            masses[:, one.columns] += mass
        of = (x[..., self._places] for x in (forces, masses, G))
        return without_constraints(*of), g

    def _at(self, t: float, *state: np.ndarray) -> tuple[np.ndarray, ...]:
        """M q'' - f (k,), the diagonal of M (k,), G (c, k), g (c,) as this mbs has them, in its own order."""
        own, mbs = self._equations, self._mbs
        set_state(mbs.systemData, t, (*state, mbs.systemData.GetAECoordinates()))
        G, g, forces = own.constraints(mbs)[self._rows], own.drift(mbs)[self._rows], own.forces(mbs)
        if self._is_massless:
            return -forces, np.zeros(len(forces)), G, g
        M = own.mass(mbs)
        return M @ state[2] - forces, np.diag(M), G, g

    def _equations_of(self, own: Equations, mbs: Any) -> tuple[np.ndarray, ...]:
        """M, M q'' - f, G and g of independent constraints, in the current state."""
        M, G, g = own.mass(mbs), own.constraints(mbs)[self._rows], own.drift(mbs)[self._rows]
        return M, M @ mbs.systemData.GetODE2Coordinates_tt() - own.forces(mbs), G, g

    def _set(self, t: float, state: Sequence[np.ndarray]) -> None:
        system = self._mbs.systemData
        set_state(system, t, (*self._wide(state), system.GetAECoordinates()))

    def _wide(self, states: Sequence[np.ndarray]) -> np.ndarray:
        """States (3, ..., k) in the order of this mbs."""
        wide = np.zeros(np.shape(states))
        wide[..., self._places] = states
        return wide

    @contextmanager
    def functions_kept(self) -> Iterator[None]:
        """Call user functions, RunError if they keep something; that is put back."""
        if not self._functions:
            yield
            return
        with memory_kept(self._mbs, self._functions) as memory:
            if memory.lost:
                raise RunError(HOLDS.format(memory.lost))
            try:
                yield
            finally:
                if memory.changed:
                    raise RunError(MEMORY)  # whatever came of it

    def compare(self, mbs: Any) -> None:
        """RunError unless M, forces, G and g are those of the mbs where no vector moves; within functions_kept."""
        if mbs is None:
            raise RunError(GONE)
        own, rng, system = self._original, np.random.default_rng(SEED), mbs.systemData
        t = system.GetTime()
        state = [x + AWAY * rng.uniform(0.5, 1.0, len(x)) * np.abs(x).max(initial=1.0) for x in current_state(system)]
        at = self._places[: own.size]
        with state_kept(system):
            set_state(system, t, state)
            wanted = [x.copy() for x in self._equations_of(own, mbs)]
        wide = [np.append(x, np.zeros(len(self._places) - own.size)) for x in state[:3]]
        self._set(t, wide)
        M, force, G, g = self._equations_of(self._equations, self._mbs)
        self._is_massless = not M.any()  # closed forms have all of it
        for one in self._inertias:
            state = self._wide(wide)[:, one.columns]
            M[np.ix_(one.columns, one.columns)] += one.mass(state[0])
            force[one.columns] += one.force(*state)
        found = M[np.ix_(at, at)], force[at], G[:, at], g
        for name, one, other in zip(("masses", "forces", "G", "constraints"), wanted, found, strict=True):
            off = np.abs(one - other).max(initial=0.0) / max(np.abs(one).max(initial=0.0), np.finfo(float).tiny)
            if not off <= AGREES:
                looking = "; ".join(hints(mbs))
                raise RunError(OTHER.format(name, off, looking and f": {looking}"))


def _places(mbs: Any, shadow: Any, parts: Parts) -> np.ndarray:
    """Return where the coordinates of the mbs, and the vectors behind them, are among those of its shadow."""
    system, wider = mbs.systemData, shadow.systemData
    found = np.full(sum(body.m for body, _ in parts) + len(system.GetODE2Coordinates()), -1)
    for node in range(system.NumberOfNodes()):
        narrow, wide = (np.array(of.GetNodeLTGODE2(node), dtype=int) for of in (system, wider))
        found[narrow] = wide[: len(narrow)]
    for body, own in parts:
        node = int(mbs.GetObject(body.flex.number)["nodeNumbers"][1])
        found[own] = wider.GetNodeLTGODE2(node)[-body.m :] if body.m else []
    return found


def without_constraints(forces: np.ndarray, masses: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return forces (S, k) with those of constraints, G^T l of G (S, c, k), that leave least of them.

    Least in the norm of the accelerations of masses (S, k), as near as their sizes matter.
    """
    if not G.shape[1]:
        return forces
    light = 1 / np.maximum(masses, np.finfo(float).eps * masses.max(axis=1, keepdims=True))
    by = G * light[:, None]
    multipliers = np.linalg.solve(by @ G.swapaxes(1, 2), -(by @ forces[..., None]))
    return forces + (G.swapaxes(1, 2) @ multipliers)[..., 0]
