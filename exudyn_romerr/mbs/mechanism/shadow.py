"""Shadow: an mbs of our own beside that of a run, whose flexible bodies have their auxiliary vectors as modes.

Made from the dictionary of the mbs, so that Exudyn's own equations can be asked in states for which the mbs of the
run has no coordinates. That is read and set back, nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np

from ...errors import RunError
from ..access.equations import Equations
from ..access.state_guard import current_state, set_state, state_kept
from ..memory.user_memory import memory_kept
from .stored_residuals import HOLDS, MEMORY, user_functions

if TYPE_CHECKING:
    from .enriched_body import EnrichedBody

AGREES = 1e-9  # of the largest entry; measured: up to 3e-13
AWAY = 0.01  # of coordinates: where both are compared, so that nothing vanishes by chance
SEED = 17
CROSS = np.zeros((3, 3, 3))  # (a x b)_c = CROSS_cij a_i b_j
CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]], CROSS[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1.0, -1.0
NO_COPY = "Exudyn's GetDictionary and SetDictionary make no copy of it: {}"
OTHER = "its copy has other equations: {} differ by {:.1e} of the largest entry"


class Shadow:
    """Equations of an mbs with vectors: coordinates q (k,) are those of the mbs, then the vectors of all bodies.

    parts : bodies, and where their vectors are among these coordinates. rows : numbers of independent constraints.
    threads : of the running solver.

    Raises
    ------
    RunError
        The mbs cannot be copied, or its copy has other equations; a user function keeps something from call to call.
    """

    def __init__(self, mbs: Any, parts: Sequence[tuple[EnrichedBody, slice]], rows: np.ndarray, threads: int):
        self._rows, self._functions = rows, user_functions(mbs)
        try:
            self._container = exu.SystemContainer()  # goes when nobody holds it, and what is in it
            self._mbs = self._container.AddSystem()
            self._mbs.SetDictionary(_widened(mbs, [body for body, _ in parts]))
            self._mbs.Assemble()
            self._equations = Equations(self._mbs, threads)
            self._places = _places(mbs, self._mbs, parts)
        except Exception as error:
            raise RunError(NO_COPY.format(error)) from error
        self._compare(mbs, threads)

    def residuals(self, rows: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return M q'' + G^T l - f (S, k), and what constraints keep zero (S, c), in rows t, q, q_t, q_tt (S, k).

        Multipliers l are those that leave least of it.
        """
        with self._functions_kept():
            found = [self._at(t, state) for t, *state in zip(*rows, strict=True)]
        forces, M, G, g = (np.array(x) for x in zip(*found, strict=True))
        return without_constraints(forces, M, G), g

    def _at(self, t: float, state: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
        """M q'' - f (k,), the diagonal of M (k,), G (c, k), g (c,)."""
        places = self._places
        self._set(t, state)
        M, force, G, g = self._equations_of(self._equations, self._mbs)
        return force[places], np.diag(M)[places], G[:, places], g

    def _equations_of(self, own: Equations, mbs: Any) -> tuple[np.ndarray, ...]:
        """M, M q'' - f, G and g of independent constraints, in the current state."""
        M, G, g = own.mass(mbs), own.constraints(mbs)[self._rows], own.drift(mbs)[self._rows]
        return M, M @ mbs.systemData.GetODE2Coordinates_tt() - own.forces(mbs), G, g

    def _set(self, t: float, state: Sequence[np.ndarray]) -> None:
        system, wide = self._mbs.systemData, np.zeros((3, len(self._places)))
        wide[:, self._places] = state
        set_state(system, t, (*wide, system.GetAECoordinates()))

    @contextmanager
    def _functions_kept(self) -> Iterator[None]:
        """Call user functions, RunError if they keep something; that is put back."""
        with memory_kept(self._mbs, self._functions) as memory:
            if memory.lost:
                raise RunError(HOLDS.format(memory.lost))
            yield
            if memory.changed:
                raise RunError(MEMORY)

    def _compare(self, mbs: Any, threads: int) -> None:
        """RunError unless M, forces, G and g are those of the mbs where no vector moves."""
        own, rng, system = Equations(mbs, threads), np.random.default_rng(SEED), mbs.systemData
        t = system.GetTime()
        state = [x + AWAY * rng.uniform(0.5, 1.0, len(x)) * np.abs(x).max(initial=1.0) for x in current_state(system)]
        at = self._places[: own.size]
        with self._functions_kept():
            with state_kept(system):
                set_state(system, t, state)
                wanted = [x.copy() for x in self._equations_of(own, mbs)]
            self._set(t, [np.append(x, np.zeros(len(self._places) - own.size)) for x in state[:3]])
            M, force, G, g = self._equations_of(self._equations, self._mbs)
            found = M[np.ix_(at, at)], force[at], G[:, at], g
        for name, one, other in zip(("masses", "forces", "G", "constraints"), wanted, found, strict=True):
            off = np.abs(one - other).max(initial=0.0) / max(np.abs(one).max(initial=0.0), np.finfo(float).tiny)
            if not off <= AGREES:
                raise RunError(OTHER.format(name, off))


def _widened(mbs: Any, bodies: Sequence[EnrichedBody]) -> dict[str, Any]:
    """Return the dictionary of the mbs with vectors behind the modes of bodies; no sensors, no functions of steps."""
    found = mbs.GetDictionary()
    found["sensorList"] = []
    found["userFunctions"] = dict.fromkeys(found["userFunctions"], 0)
    for body in bodies:
        number = body.flex.number
        item = found["objectList"][number] = {**found["objectList"][number], **_object_terms(body)}
        number = int(item["nodeNumbers"][1])
        node = found["nodeList"][number] = {**found["nodeList"][number]}
        node["numberOfODE2Coordinates"] = body.shapes.shape[1]
        for name in ("referenceCoordinates", "initialCoordinates", "initialCoordinates_t"):
            node[name] = np.append(node[name], np.zeros(body.m))
    return found


def _object_terms(body: EnrichedBody) -> dict[str, Any]:
    """Return what ObjectFFRFreducedOrder has of its modes U, as ObjectFFRFreducedOrderInterface makes it.

    M = m (x) I, so that all of it follows from the sums of u_i (m u)_j over the nodes.
    """
    flex, U, (alpha, beta) = body.flex, body.shapes, body.rayleigh
    MU, k, nodes = flex.mass @ U, U.shape[1], len(flex.positions)
    M, K = U.T @ MU, U.T @ (flex.stiffness @ U)
    U_, MU = (X.reshape(nodes, 3, k) for X in (U, MU))
    of_U = np.einsum("aik,ajl->ijkl", U_, MU, optimize=True)
    of_x = np.einsum("ai,ajl->ijl", flex.positions, MU)
    pull = MU.sum(axis=0)
    twice = np.einsum("cd,iikl->kcld", np.eye(3), of_U) - of_U.transpose(2, 1, 3, 0)
    once = np.einsum("cd,iil->cld", np.eye(3), of_x) - of_x.transpose(1, 2, 0)
    matrices = {"mass": M, "stiffness": K, "damping": alpha * M + beta * K}
    return {
        **{f"{name}MatrixReduced": exu.MatrixContainer(matrix) for name, matrix in matrices.items()},
        "modeBasis": U,
        "outputVariableModeBasis": np.zeros((0, 0)),
        "outputVariableTypeModeBasis": exu.OutputVariableType._None,
        "mPsiTildePsi": np.einsum("cij,jikl->kcl", CROSS, of_U).reshape(3 * k, k),
        "mPsiTildePsiTilde": twice.reshape(3 * k, 3 * k),
        "mPhitTPsi": pull,
        "mPhitTPsiTilde": np.einsum("cid,il->cld", CROSS, pull).reshape(3, 3 * k),
        "mXRefTildePsi": np.einsum("cij,jil->cl", CROSS, of_x),
        "mXRefTildePsiTilde": once.reshape(3, 3 * k),
    }


def _places(mbs: Any, shadow: Any, parts: Sequence[tuple[EnrichedBody, slice]]) -> np.ndarray:
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
    l = np.linalg.solve(by @ G.swapaxes(1, 2), -(by @ forces[..., None]))
    return forces + (G.swapaxes(1, 2) @ l)[..., 0]
