"""The admissible space of displacements: coordinates fixed, or reference conditions C_0 q = 0 that hold the body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import ArrayLike

from ..checks import check_array, check_nodes
from ..errors import AssumptionError, InputError
from ..linalg.free_mass_matrix import FreeCoordinates, FreeMassMatrix
from .floating_frame import skew

RIGID_MODES = 6
NOT_HELD = 1e-10  # of scaled reference rows; below, some rigid motion is not held
HELD = 1e-8  # |C_0 v| relative to |C_0| |v|: what Exudyn's own modes keep of the conditions they were made with


@dataclass(frozen=True)
class MeanMotion:
    """Reference conditions: weighted mean displacement and rotation of some nodes are zero (mean_motion)."""

    nodes: np.ndarray
    weights: np.ndarray

    def rows(self, positions: np.ndarray, mass: sp.csc_matrix | None = None) -> np.ndarray:
        """Return C_0 (6, 3 nodes): sum w_i u_i and sum w_i (x_i - x_mean) x u_i."""
        where = positions[check_nodes(self.nodes, len(positions))]
        shifts = np.broadcast_to(np.eye(3), (len(where), 3, 3))
        parts = self.weights[:, None, None] * np.hstack([shifts, skew(where - self.weights @ where)])
        C = np.zeros((len(positions), RIGID_MODES, 3))
        np.add.at(C, self.nodes, parts)
        return C.swapaxes(0, 1).reshape(RIGID_MODES, -1)

    def motion_rows(self, positions: np.ndarray) -> np.ndarray:
        """Return the mean displacement and the mean rotation (about the mean position) as rows (6, 3 nodes)."""
        C = self.rows(positions)
        turns = C[3:] @ rigid_modes(positions)[:, 3:]
        if np.linalg.cond(turns) > 1 / NOT_HELD:
            raise InputError(f"nodes {self.nodes[:8].tolist()} lie on a line: they have no mean rotation")
        return np.vstack([C[:3], np.linalg.solve(turns, C[3:])])


@dataclass(frozen=True)
class MassOrthogonal:
    """Reference conditions: u is M-orthogonal to all rigid motions, as free eigenmodes are (mass_orthogonal)."""

    def rows(self, positions: np.ndarray, mass: sp.csc_matrix) -> np.ndarray:
        """Return C_0 = Rg^T M (6, 3 nodes), Rg the rigid motions; every row is full."""
        return (mass @ rigid_modes(positions)).T


def mass_orthogonal() -> MassOrthogonal:
    """Return the reference conditions of free eigenmodes: no part of u is a rigid motion in the M inner product."""
    return MassOrthogonal()


def rigid_modes(positions: np.ndarray) -> np.ndarray:
    """Return three translations and three rotations about the origin of nodes (nodes, 3): (3 nodes, 6)."""
    shifts = np.broadcast_to(np.eye(3), (len(positions), 3, 3))
    return np.concatenate([shifts, skew(-positions)], axis=2).reshape(-1, RIGID_MODES)


def mean_motion(nodes: ArrayLike, weights: ArrayLike | None = None) -> MeanMotion:
    """Return the reference conditions that hold a body by the mean motion of some nodes, as RBE3 interfaces do.

    Parameters
    ----------
    nodes : sequence of int
        At least three, not on one line.
    weights : sequence of float, optional
        Scaled to sum 1; default: equal. Weight 0 (middle nodes of quadratic elements) has no say.

    Raises
    ------
    InputError
        Too few nodes, or weights that do not fit them.
    """
    numbers = check_array("nodes", nodes, (None,))
    share = np.ones(len(numbers)) if weights is None else check_array("weights", weights, (len(numbers),))
    if np.any(share < 0):
        raise InputError(f"weights contains {share.min():g}; allowed: positive numbers and 0")
    if np.count_nonzero(share) < 3:
        found = f"{np.count_nonzero(share)} nodes" + (" with a weight" if np.any(share == 0) else "")
        raise InputError(f"nodes lists {found}; needed: at least three that are not on one line")
    return MeanMotion(numbers.astype(int), share / share.sum())


class Space:
    """q = Z y: y are the coordinates that are neither fixed nor follow from conditions.

    Parameters
    ----------
    N : int
    fixed : ndarray of int
        Coordinates held at zero.
    conditions : ndarray, (6, N), optional
        C_0 with C_0 q = 0.
    rigid : sequence of (coordinates (m,), motions (m, 6))
        Parts that move as rigid bodies only; six coordinates of each stay in y.
    """

    def __init__(self, N: int, fixed: np.ndarray, conditions: np.ndarray | None = None, rigid: Sequence[tuple] = ()):
        self.N, self.fixed, self.conditions, self.is_rigid = N, fixed, conditions, bool(rigid)
        followers = [_followers(*part) for part in rigid]
        if conditions is not None:
            followers.append(_determined(conditions))
        self.free = np.setdiff1d(np.arange(N), np.concatenate([fixed, *(rows for rows, _, _ in followers)]))
        Z = sp.eye(N, format="csr")
        for rows, columns, matrix in followers:
            entries = (matrix.ravel(), (np.repeat(rows, len(columns)), np.tile(columns, len(rows))))
            Z = Z + sp.csr_matrix(entries, shape=(N, N))
        self.Z = sp.csc_matrix(Z.tocsc()[:, self.free])

    def matrix(self, A: sp.csc_matrix) -> sp.csc_matrix:
        """Return Z^T A Z."""
        return sp.csc_matrix(self.Z.T @ A @ self.Z)

    def pencil(self, mass: sp.csc_matrix, stiffness: sp.csc_matrix) -> tuple[sp.csc_matrix, sp.csc_matrix]:
        """Return Z^T M Z and Z^T K Z."""
        return self.matrix(mass), self.matrix(stiffness)

    def loads(self, B: np.ndarray) -> np.ndarray:
        """Return Z^T B."""
        return self.Z.T @ B

    def rows(self, C: np.ndarray) -> np.ndarray:
        """Return C Z."""
        return np.ascontiguousarray((self.Z.T @ C.T).T)

    def coordinates(self, name: str, q: np.ndarray) -> np.ndarray:
        """Return y of q = Z y; InputError if q, called `name`, is not in the space."""
        moved = np.max(np.abs(q[self.fixed]), initial=0.0)
        if moved > 0:
            raise InputError(f"{name} moves fixed coordinates (largest entry there {moved:.3g}); they must be 0")
        if self.conditions is not None:
            _check_held(name, self.conditions, q)
        if self.is_rigid and np.max(np.abs(q - self.Z @ q[self.free])) > HELD * np.max(np.abs(q)):
            raise InputError(f"{name} deforms an interface that is to be rigid (RBE2 modes do not)")
        return q[self.free]

    def expand(self, y: np.ndarray) -> np.ndarray:
        """Return q = Z y."""
        return self.Z @ y

    def extended(self, C: np.ndarray) -> np.ndarray:
        """Return rows (r, N) that take from q = Z y what rows C (r, n_free) take from y."""
        rows = np.zeros((len(C), self.N))
        rows[:, self.free] = C
        return rows


class FreeSpace(FreeCoordinates):
    """All displacements that are M-orthogonal to the rigid motions of a body: a Space whose Z is never made.

    Z is full, and so are Z^T M Z and products with it; see linalg/free_mass_matrix.py.
    """

    def __init__(self, mass: sp.csc_matrix, positions: np.ndarray):
        super().__init__(mass, rigid_modes(positions - positions.mean(axis=0)))
        self.N, self.fixed = mass.shape[0], np.zeros(0, dtype=int)
        self.conditions = mass_orthogonal().rows(positions, mass)

    def pencil(self, mass: sp.csc_matrix, stiffness: sp.csc_matrix) -> tuple[FreeMassMatrix, sp.csc_matrix]:
        """Return Z^T M Z, which has products only, and Z^T K Z = K of the free coordinates, since K Rg = 0."""
        return FreeMassMatrix(mass, stiffness, self), sp.csc_matrix(stiffness[self.free][:, self.free])

    def matrix(self, A: sp.csc_matrix) -> sp.csc_matrix:
        """Return Z^T A Z, which is full."""
        return sp.csc_matrix(self.loads(self.loads(A).T).T)

    def rows(self, C: np.ndarray) -> np.ndarray:
        """Return C Z."""
        return np.ascontiguousarray(self.loads(C.T).T)

    def coordinates(self, name: str, q: np.ndarray) -> np.ndarray:
        """Return y of q = Z y; InputError if q, called `name`, is not in the space."""
        _check_held(name, self.conditions, q)
        return self.seen(q)

    def extended(self, C: np.ndarray) -> np.ndarray:
        """Return rows (r, N) that take from q = Z y what rows C (r, n_free) take from y."""
        return self.balanced(C.T).T


def _check_held(name: str, conditions: np.ndarray, q: np.ndarray) -> None:
    """Raise InputError unless q (N,) or (N, k), called `name`, meets the conditions (6, N)."""
    columns = q.reshape(len(q), -1)
    size = np.outer(np.linalg.norm(conditions, axis=1), np.linalg.norm(columns, axis=0))
    worst = np.max(np.abs(conditions @ columns) / np.where(size > 0, size, 1.0))
    if worst > HELD:
        raise InputError(f"{name} misses the reference conditions by {worst:.1e} of its size; allowed {HELD:g}")


def space_of(
    body: Any, reference: MeanMotion | MassOrthogonal | None, rigid: Sequence[Sequence[int]]
) -> Space | FreeSpace:
    """Return the space of a body held by `fixed` or by a reference, parts of it rigid; InputError if it cannot be."""
    if reference is not None:
        if not isinstance(reference, MeanMotion | MassOrthogonal):
            raise InputError(f"reference={reference!r}; needed: mean_motion(nodes, weights) or mass_orthogonal()")
        if body.fixed.size:
            raise InputError("fixed and reference were both given; a body is held by one of them")
        if body.dofs_per_node != 3:
            raise InputError("reference needs 3 coordinates a node (solids); hold nodes with rotations by fixed=")
    if rigid and (not body.fixed.size or body.dofs_per_node != 3):
        raise InputError("rigid needs a solid body (3 coordinates a node) held by fixed=, not by reference=")
    if isinstance(reference, MassOrthogonal):
        return FreeSpace(body.mass, body.positions)
    conditions = None if reference is None else reference.rows(body.positions)
    return Space(body.N, body.fixed, conditions, rigid_parts(rigid, body.fixed, body.positions) if rigid else ())


def rigid_parts(rigid: Sequence[Sequence[int]], fixed: np.ndarray, positions: np.ndarray) -> list[tuple]:
    """Return (coordinates, motions) of node sets for Space; InputError if they share nodes, also fixed ones."""
    parts = [check_nodes(nodes, len(positions)) for nodes in rigid]
    held = np.unique(fixed // 3)
    if np.unique(np.concatenate([held, *parts])).size != held.size + sum(map(len, parts)):
        raise InputError("rigid: node sets overlap one another or the fixed nodes; every node may be in one only")
    motions = rigid_modes(positions - positions.mean(axis=0))
    coordinates = [(3 * nodes[:, None] + np.arange(3)).ravel() for nodes in parts]
    return [(part, motions[part]) for part in coordinates]


def _followers(coordinates: np.ndarray, motions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates of a rigid part that follow from six of its own, those six, and how."""
    motions = motions / np.linalg.norm(motions, axis=0)
    six = _six(motions.T)
    if six is None:
        raise InputError("nodes of a rigid interface lie on a line: they do not tell its rotation")
    rest = np.setdiff1d(np.arange(len(motions)), six)
    return coordinates[rest], coordinates[six], np.linalg.solve(motions[six].T, motions[rest].T).T


def _determined(conditions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Six coordinates that the conditions determine, all others, and how."""
    six = _six(conditions)
    if six is None:
        raise AssumptionError(
            "reference conditions do not hold all six rigid motions, as nodes on one line do not: name "
            "three nodes or more that are not on one line"
        )
    others = np.setdiff1d(np.arange(conditions.shape[1]), six)
    return six, others, -np.linalg.solve(conditions[:, six], conditions[:, others])


def _six(rows: np.ndarray) -> np.ndarray | None:
    """Six columns of six rows, chosen by pivoting, that are independent; None if there are none."""
    length = np.linalg.norm(rows, axis=1)[:, None]
    triangle, order = la.qr(rows / np.where(length > 0, length, 1.0), mode="r", pivoting=True)
    diagonal = np.abs(np.diag(triangle))
    return np.sort(order[:RIGID_MODES]) if diagonal[-1] > NOT_HELD * diagonal[0] else None
