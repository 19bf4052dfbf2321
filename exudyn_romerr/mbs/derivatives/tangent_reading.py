"""Readings of a mechanism's tangent, and how much it has changed from one to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg as la

from ...errors import AssumptionError
from ..access.mbs_items import QUATERNIONS, node_coordinates
from .dependence import Dependence, Quaternion
from .frame_inertia import FrameInertia

PARAMETERS = (QUATERNIONS, "RigidBodyRxyz")  # node types whose rotations are coordinates like others
INCREMENTS = ("RigidBodyRotVecLG", "RigidBodyRotVecDataLG")  # those whose rotations are increments
SHARE = 1e-6  # of a force that redundant constraints share: one with less is determined
REDUNDANT = 1e-10  # of the largest singular value: constraints below are redundant
LIGHT = 1e12  # beside the heaviest and stiffest coordinate: what has neither mass nor stiffness
SOFT = 1e-12  # of what single coordinates feel: less is rounding
ITERATIONS = 3  # to come near the smallest mass from above
RESOLVED = 1e-10  # of masses of coordinates: less is near rounding
TINY = np.finfo(float).tiny
Parts = Sequence[tuple[Dependence, np.ndarray]]  # how M and G^T change, see Dependence.forward


@dataclass(frozen=True)
class Reading:
    """Read at time t: M, D, K (n, n), G, C, C_t (c, n) of independent constraints. state : q, q_t, q_tt, multipliers.

    K holds loads too, and how inertia and the forces of constraints change with the coordinates. Constraints have
    forces G^T l; C is the derivative of what they keep zero, C_t its rate. Exudyn's G is not C: where an interface
    turns with the deformation, its rows of rotations are off by as much as it has turned.
    masses, springs (n,) : diagonals of M and K, those of rotations the lightest axis and 0. seen : hash of what the
    mbs of the run showed near this state. motions (n, f) : as motions_of gives them, dt the time since the reading
    before, if there is one.
    change : of G and K since then, over CHANGE.
    """

    t: float
    state: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    G: np.ndarray
    C: np.ndarray
    C_t: np.ndarray
    masses: np.ndarray
    springs: np.ndarray
    seen: int = 0
    motions: np.ndarray | None = None
    change: float = 0.0

    def scale(self, dt: float) -> np.ndarray:
        """Return (K + M/dt^2)^-1/2 (n,), coordinate by coordinate; of rotations M/dt^2 alone."""
        return 1 / np.sqrt(self.springs + self.masses / dt**2)


@dataclass(frozen=True)
class Carried:
    """How M and G change with the coordinates, at time t: what d(M q'' + G^T l)/dq of other q'' and l follows from.

    G : of the reading. j, i (p,) : columns and rows of entries of K that are not always zero. by (p, n + c) : change
    of each by q'' and l. turning (n,) : share of G that changes, by coordinates.
    """

    t: float
    G: np.ndarray
    j: np.ndarray
    i: np.ndarray
    by: np.ndarray
    turning: np.ndarray


def carried_of(reading: Reading, parts: Parts, inertias: Sequence[FrameInertia]) -> Carried:
    """Put together how M and G^T change: where, and by how much; inertias : what is not in the parts."""
    (mass, by_M), (forces, by_G) = parts
    n, c = reading.G.shape[1], by_G.shape[1]
    found = [(mass.j, mass.i, by_M, np.arange(n)), (forces.j, forces.i, by_G, np.arange(n, n + c))]
    for one in inertias:
        changes = one.mass_changes(reading.state[0][one.columns])
        j, i = np.nonzero(changes.any(axis=2))
        found.append((one.columns[j], one.columns[i], changes[j, i], one.columns))
    at, entries = np.unique(np.concatenate([j * n + i for j, i, *_ in found]), return_inverse=True)
    by, first = np.zeros((len(at), n + c), np.float32), 0
    for j, _, values, columns in found:
        by[entries[first : first + len(j), None], columns] = values
        first += len(j)
    turning = np.sqrt(np.bincount(forces.j, (by_G**2).sum(axis=1), n)) / max(np.linalg.norm(reading.G), TINY)
    return Carried(reading.t, reading.G, *np.divmod(at, n), by, turning)


def quaternions_of(mbs: Any) -> list[Quaternion]:
    """Euler parameters of every node that has such."""
    found = []
    for node in range(mbs.systemData.NumberOfNodes()):
        item = mbs.GetNode(node)
        if item["nodeType"] == QUATERNIONS:
            own = [*node_coordinates(mbs, node)[3:]]
            found.append(Quaternion(own, np.array(item["referenceCoordinates"][3:], float)))
    return found


def rotations_of(mbs: Any, types: Sequence[str]) -> list[list[int]]:
    """Coordinates of the rotation of every node of some types."""
    found = []
    for node in range(mbs.systemData.NumberOfNodes()):
        item = mbs.GetNode(node)
        if item["nodeType"] in types:
            found.append([*node_coordinates(mbs, node)[3:]])
    return found


def compared(before: Reading, now: Reading, largest: float) -> Reading:
    """Return a reading with its motions, and how much G and K have changed: G by its share, K by that of K + M/dt^2.

    Where K is soft, its change accelerates masses for the time dt since the reading before. largest : what is 1.
    """
    motions = motions_of(now, now.t - before.t)
    change = np.abs(motions.T @ (now.K - before.K) @ motions).max(initial=0.0)
    return replace(now, motions=motions, change=max(turned_share(before.G, now.G), float(change)) / largest)


def motions_of(reading: Reading, dt: float) -> np.ndarray:
    """Motions (n, f) that constraints admit, by which K + M/dt^2 is diagonal, and of size 1.

    Coordinate by coordinate, a stiff spring that turns would seem to change in directions that it does not act in,
    and Euler parameters, which are stiff along themselves, in all. AssumptionError if the tangent is not finite.
    """
    scale, K = reading.scale(dt), (reading.K + reading.K.T) / 2
    if not (np.isfinite(K).all() and np.isfinite(scale).all()):
        raise AssumptionError(f"the mechanism's tangent is not finite at t = {reading.t:g} s")
    scale = np.minimum(scale, LIGHT * scale.min())
    free = scale[:, None] * admitted(reading.G * scale)
    values, vectors = np.linalg.eigh(free.T @ (reading.M / dt**2 + K) @ free)
    return free @ vectors / np.sqrt(np.maximum(np.abs(values), SOFT))


def admitted(G: np.ndarray) -> np.ndarray:
    """Orthonormal motions (..., n, n - c) that independent constraints G (..., c, n) admit."""
    return np.linalg.qr(G.swapaxes(-1, -2), mode="complete")[0][..., G.shape[-2] :]


def is_lighter(M: np.ndarray, C: np.ndarray, scale: np.ndarray, share: float) -> bool:
    """Whether the smallest mass that constraints admit is, in the last of three states, below a share of the others'.

    M (3, k, k), C (3, c, k) : masses and constraints there. scale (k,) : of coordinates. Of the others the lighter
    one counts. Where it is not, Cholesky's factors tell, at a tenth of what eigenvalues cost: Rayleigh's quotient is
    never below the smallest of these.
    """
    free = scale[:, None] * admitted(C * scale)
    masses = free.swapaxes(1, 2) @ M @ free
    try:
        factor, x = la.cho_factor(masses[0], check_finite=False), np.ones(masses.shape[1])
        for _ in range(ITERATIONS):
            x = la.cho_solve(factor, x / np.linalg.norm(x), check_finite=False)
        least = share * (x @ masses[0] @ x) / (x @ x)
        if least > RESOLVED:
            np.linalg.cholesky([masses[1], masses[2] - least * np.eye(len(x))])
            return False
    except np.linalg.LinAlgError:  # it is, or one of them has no mass
        pass
    *known, last = np.linalg.eigvalsh(masses)[:, 0]
    return bool(last / min(known) < share)


def masses_of(M: np.ndarray, rotations: Sequence[list[int]]) -> np.ndarray:
    """Return the diagonal (n,) of M; of a rotation's parameters the lightest axis, about which a slim body spins.

    It is the third largest inertia, for of four parameters one direction has none.
    """
    found = np.diag(M).copy()
    for parameters in rotations:
        found[parameters] = np.linalg.eigvalsh(M[np.ix_(parameters, parameters)])[-3]
    return np.maximum(found, TINY)


def turned_share(before: np.ndarray, G: np.ndarray) -> float:
    """Share of G that has changed; it holds the rotation parameters themselves, too."""
    return float(np.linalg.norm(G - before) / max(np.linalg.norm(G), TINY))


def without_units(G: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """G (c, n) of constraints that act, by what masses (n,) of coordinates feel, each of size 1.

    In micrometres, displacements at the arms of joints are 1e6 times rotations, whatever constraints imply.
    """
    scaled = G * by_masses(masses)
    return scaled / np.linalg.norm(scaled, axis=1)[:, None]


def by_masses(masses: np.ndarray) -> np.ndarray:
    """Return changes (n,) of coordinates that masses (n,) feel as size 1; of those without as of the lightest."""
    massive = masses > TINY
    if not massive.any():
        return np.ones(len(masses))
    return 1 / np.sqrt(np.where(massive, masses, masses[massive].min()))


def independent_rows(G: np.ndarray, active: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """Rows of active constraints that none of the others imply."""
    rows = np.flatnonzero(active)
    if not rows.size:
        return rows
    _, triangle, order = la.qr(without_units(G[rows], masses).T, mode="economic", pivoting=True)
    size = np.abs(np.diag(triangle))
    return np.sort(rows[order[: int(np.sum(size > REDUNDANT * size[0]))]])


def shared_rows(G: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """Rows of redundant constraints, and of those that imply them; what is zero is no constraint."""
    rows = np.flatnonzero(G.any(axis=1))
    if not rows.size:
        return rows
    combined = la.null_space(without_units(G[rows], masses).T, rcond=REDUNDANT)
    return rows[np.abs(combined).max(axis=1, initial=0.0) > SHARE]


def hashed(*matrices: np.ndarray) -> int:
    """Return a hash of what matrices hold."""
    return hash(tuple(matrix.tobytes() for matrix in matrices))
