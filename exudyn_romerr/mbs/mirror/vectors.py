"""Vectors beside a body's modes: which, how many, which of them the rest of the mechanism sees.

Static ones by Enrichment: responses to inertia, loads and wrenches, then to their own inertia, without motion of the
interfaces where modes can move these; those that deform interfaces which the modes make rigid (RBE2) are told apart.
And M^-1 times the same forces: without them the accelerations of a sudden start are wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as la

from ...linalg.orthogonalise import m_orthonormal, without
from ...mechanism.body import Body, Place
from ...mechanism.rows import Rows
from ...mechanism_bounds.free_mass import FreeMass
from ...mechanism_bounds.residual_norm import ResidualNorm
from ...mechanism_errors.modes import GROUPS, OfBody
from ...model.admissible_space import rigid_modes
from ...model.shared_body import made_once
from ...report.data import NodeFields
from ..access.detached import READS_NODES, READS_SENSORS, Detached
from ..access.mbs_items import Items, node_coordinates
from ..floating.floating_body import FloatingBody
from ..floating.loads_and_joints import require_free_node
from ..floating.reference_search import SeenBody, seen_body

SEEN = 1e-7  # of the motion that vectors could make at a marker: less is rounding
HELD, NEW = 1e-6, 1e-6  # of a motion, of a vector: less is rounding, or what others hold
SPANNED = 1e-3  # of |x|_M of a shape: less of it is not left out by others
# of a vector's mass: what is left of it beside motions of frame and modes. With less, vectors are mostly such motions
# themselves, and what oscillators do not feel of turning is large beside the little that all these terms come to
OWN_MASS = 0.1
SAME = 1e-8  # of the largest: directions that are none of their own


@dataclass
class Enriched:
    """A body in closed form and whose force each of its vectors carries.

    body : modes, kept vectors (seen by the rest of the mechanism, or slow), oscillators. shapes (N, k) : all of them.
    projectors (GROUPS, m, m) : of the force on vectors (kept, then oscillators), what belongs to each part. weights :
    numbers of loads on the body's mass, which the closed form has. leaves_interfaces : whether vectors move none.
    """

    body: Body
    shapes: np.ndarray
    projectors: np.ndarray
    weights: list[int]
    known: SeenBody
    leaves_interfaces: bool

    @property
    def kept_shapes(self) -> np.ndarray:
        """Those that all but the body know: modes and kept vectors."""
        return self.shapes[:, : self.body.na]

    @property
    def held_shapes(self) -> np.ndarray:
        """All of them, seen from the frame that the reference conditions hold: modes may move the body a little."""
        return np.hstack([self.known.model.held, self.shapes[:, self.body.n :]])

    def at_nodes(self, name: str, of: OfBody, rows: Rows) -> NodeFields:
        """Return displacements of the mesh where errors of it are largest, seen from the frame, and these errors."""
        n, U, q = self.body.n, self.held_shapes, rows.q[:, self.body.place.modal]
        moved, error = (x.reshape(-1, 3) for x in (U[:, :n] @ q[of.row], U @ of.deformed))
        most = np.sqrt(np.einsum("ti,ti->t", q @ self.body.M[:n, :n], q).max())
        # no linear equation tells an error as large as what is shown
        known, at = ({name: error} if of.size <= most else {}), {name: float(rows.t[of.row])}
        return NodeFields({}, known, {name: moved}, at, self.known.flex.positions)

    def residual_norm(self) -> ResidualNorm:
        """Return what a residual of its mesh is worth."""
        return ResidualNorm(self.body, self.shapes, self.held_shapes, self.known.held, *self.known.forces())


def enriched(mbs: Any, flex: FloatingBody, count: int, slow: float, detached: Detached) -> Enriched:
    """Return a body with vectors.

    Parameters
    ----------
    count : number of static vectors, those that deform rigid interfaces not counted
    slow : rad/s; vectors below are kept beside the modes, with all terms of the turning frame
    detached : copies of user functions
    """
    known, _ = seen_body(mbs, flex)
    model = known.model
    if model.rigid is not None:
        require_free_node(Items(mbs), model)
    P, parts, omega, leaves_interfaces = _vectors(known, count)
    columns = np.hstack([*(place.columns for place in known.actions.places.values()), _read_by(mbs, flex, detached)])
    able = np.linalg.norm(columns, axis=0) * np.linalg.norm(P, axis=0).max(initial=0.0)
    slow = np.inf if READS_NODES in detached.names else slow
    others = np.vstack([np.eye(P.shape[1])[omega < slow], _moving_others(flex, model.V, P)])
    P, parts, kept = _kept_first(P, parts, omega, columns.T @ P, able, others)
    frame, modal = (int(node) for node in mbs.GetObject(flex.number)["nodeNumbers"])
    coordinates = (node_coordinates(mbs, node) for node in (frame, modal))
    place = Place(flex.number, *coordinates, np.asarray(mbs.GetNode(frame)["referenceCoordinates"], float))
    n, shapes = model.V.shape[1], np.hstack([model.V, P])
    held = np.hstack([model.held, P])

    def damping(M: np.ndarray, K: np.ndarray) -> np.ndarray:
        if known.held.modal is None:
            D = model.rayleigh[0] * M + model.rayleigh[1] * K
        else:
            X = known.held.space.coordinates("shapes", held)
            D = X.T @ (known.held.modal @ X)
        D[:n, :n] = model.D
        return D

    gravity = known.actions.gravity_by(detached)
    body = Body(place, (flex.mass, flex.stiffness), flex.positions, shapes, (n, n + kept), damping, gravity)
    weights = [load.number for load in known.actions.gravity]
    return Enriched(body, shapes, parts, weights, known, leaves_interfaces)


def _read_by(mbs: Any, flex: FloatingBody, detached: Detached) -> np.ndarray:
    """Columns (N, .) of displacements of the mesh nodes whose sensors user functions may read."""
    nodes = set()
    if READS_SENSORS in detached.names:
        sensors = map(mbs.GetSensor, range(mbs.systemData.NumberOfSensors()))
        own = (one for one in sensors if int(one.get("bodyNumber", -1)) == flex.number and "meshNodeNumber" in one)
        nodes = {int(one["meshNodeNumber"]) for one in own}
    rows = [3 * node + axis for node in sorted(nodes) for axis in range(3)]
    columns = np.zeros((flex.mass.shape[0], len(rows)))
    columns[rows, range(len(rows))] = 1.0
    return columns


def in_shapes_of(now: Enriched, before: Enriched) -> np.ndarray | None:
    """Return coordinates (k, k before) of a body's shapes before in those of now; None: these do not span them."""
    if now.shapes.shape[0] != before.shapes.shape[0]:
        return None
    mass = now.known.flex.mass @ before.shapes
    found = np.linalg.solve(now.body.M, now.shapes.T @ mass)
    left = np.einsum("nk,nk->k", before.shapes - now.shapes @ found, mass)
    return found if np.all(left <= SPANNED**2 * np.diag(before.body.M)) else None


def _vectors(known: SeenBody, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """P (N, m), M-orthonormal oscillators, the projectors of their parts (GROUPS, m, m), frequencies (m,) rad/s.

    And whether they leave interfaces where they are.
    """
    V = known.held.space.coordinates("V", known.model.held)
    of = V, *known.forces(), count, None if known.stiff is None else known.stiff.Z
    return made_once(known.held, "vectors", of, lambda: _made(known, V, count))


def _made(known: SeenBody, V: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """What _vectors returns; modes V: as held.space has them."""
    held, (found, leaves_interfaces) = known.held, known.enrichment(count)
    part = _part_of(found.keeps, found.first)
    squares, turn = la.eigh(found.P.T @ (held.M @ found.P), found.P.T @ (held.K @ found.P))
    turn = turn[:, ::-1] / np.sqrt(squares[::-1])
    static = found.P @ turn
    X = _accelerations(known, np.hstack([V, static]), V.shape[1])
    P, m = np.hstack([static, X]), static.shape[1]
    K = P.T @ (held.K @ P)
    squares, T = la.eigh(K, P.T @ (held.M @ P))
    apart = np.eye(len(K))  # the new ones belong to the first third by what static ones do not answer at rest
    apart[:m, m:] = K[:m, m:] / np.diag(K)[:m, None]
    part, turn = np.append(part, np.zeros(X.shape[1], int)), la.block_diag(turn, np.eye(X.shape[1])) @ apart @ T
    back = np.linalg.inv(turn)  # y = turn eta: force on eta = turn^T force on y
    parts = [turn.T @ np.diag((part == i) * 1.0) @ back.T for i in range(len(GROUPS))]
    return held.space.expand(P @ T), np.array(parts), np.sqrt(squares), leaves_interfaces


def _part_of(keeps: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Number of GROUPS of each vector, in their order; keeps : interfaces rigid; first : of the first two thirds."""
    part = np.zeros(len(keeps), int)
    order = np.flatnonzero(keeps)
    part[order] = np.where(first[order], 0, 2)
    half = order[first[order]]
    part[half[len(half) // 2 :]] = 1
    part[~keeps] = np.where(first[~keeps], 3, 4)
    return part


def _accelerations(known: SeenBody, U: np.ndarray, n: int) -> np.ndarray:
    """M^-1 times forces at interfaces, loads and the frame's support, M-orthonormal, without what U holds.

    With them the accelerations of a sudden start are those of the full mechanism, whatever joints hold. The n modes,
    first in U, take the motion of interfaces out of them, so that joints and loads see none; where they cannot, at
    least of joints, else there are no such vectors.
    """
    held, actions, mass = known.held, known.actions, FreeMass.of(known.held)
    whole = mass.response(np.hstack([*known.forces(), -mass.pull]))
    wrenches, loads = actions.wrenches, [load.place for load in actions.loads]
    for places in ([*wrenches, *loads], wrenches):
        acting = held.space.loads(np.hstack([np.zeros((held.N, 0)), *(place.columns for place in places)]))
        acting = acting / np.maximum(np.linalg.norm(acting, axis=0), np.finfo(float).tiny)
        X = whole - U[:, :n] @ (np.linalg.pinv(acting.T @ U[:, :n], rcond=1e-10) @ (acting.T @ whole))
        if np.abs(acting.T @ X).max(initial=0.0) <= HELD * np.abs(X).max(initial=0.0):
            break
    else:
        return whole[:, :0]
    basis, _ = la.qr(held.mass_factor.half_multiply(U), mode="economic")
    half = held.mass_factor.half_multiply(X)
    size = np.maximum(np.linalg.norm(half, axis=0), np.finfo(float).tiny)
    _, values, turn = la.svd(without(basis, half / size), full_matrices=False)
    use = values > NEW
    return (X / size) @ (turn[use].T / values[use])


def _moving_others(flex: FloatingBody, V: np.ndarray, P: np.ndarray) -> np.ndarray:
    """Combinations (r, m) of vectors P, M-orthonormal, that have less than OWN_MASS beside frame and modes."""
    known = m_orthonormal(flex.mass, np.hstack([rigid_modes(flex.positions), V]))
    _, cosines, combined = la.svd(known.T @ (flex.mass @ P), full_matrices=False)
    return combined[1 - cosines**2 < OWN_MASS]


def _kept_first(
    P: np.ndarray, parts: np.ndarray, omega: np.ndarray, seen: np.ndarray, able: np.ndarray, others: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int]:
    """Vectors turned so that those which all else sees, and others, stand first; how many these are.

    seen (r, m) : motion of markers by vectors; able (r,) : what it could be. others (r, m) : combinations of vectors.
    """
    rows = np.vstack([seen[np.linalg.norm(seen, axis=1) > SEEN * able], others])
    if not len(rows):
        return P, parts, 0
    _, values, basis = la.svd(rows / np.linalg.norm(rows, axis=1, keepdims=True), full_matrices=True)
    kept = int(np.sum(values > SAME * values[0]))
    turn = np.hstack([_oscillators(block, omega) for block in (basis[:kept].T, basis[kept:].T)])
    return P @ turn, np.array([turn.T @ part @ turn for part in parts]), kept


def _oscillators(block: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Orthonormal columns of combinations of vectors, turned so that K is diagonal on them."""
    if not block.shape[1]:
        return block
    return block @ la.eigh(block.T @ ((omega**2)[:, None] * block))[1]
