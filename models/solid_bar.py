"""A notched steel bar of solid tetrahedra, 0.4 m x 0.04 m x 0.06 m, clamped at x = 0 and loaded at its tip face.

The notch (x 0.1 .. 0.2 m, upper half) couples bending with tension: a force in z moves the tip in x as well. Three
meshes of the same planar-faced body, made by models/make_solid_bar.py, are read from models/data. Stored are nodes
and elements; the matrices of 10-node tetrahedra follow from them (K of the finest mesh alone would take 3 MB).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy import sparse

import exudyn_romerr as romerr
from models.beam3d import STEEL

DATA = Path(__file__).parent / "data"
LEVELS = (0, 1, 2)  # 1113, 3231 and 9885 coordinates
SIZE = (0.4, 0.04, 0.06)  # m
NOTCH = ((0.1, 0.0, 0.03), (0.2, 0.04, 0.06))  # m, two corners of the box that is cut out
RAYLEIGH = (5.0, 1e-5)  # 1/s, s: 0.8 % of critical damping in the first mode, the highest overdamped
EDGES = tuple(combinations(range(4), 2))  # mid-edge nodes 4..9 of an element lie between these corners

# x 420 / volume: integrals of products of quadratic shape functions; corner-corner, corner-edge, edge-edge, by the
# number of corners that two edges share
CORNER_EDGE = np.array([[-4.0 if corner in edge else -6.0 for edge in EDGES] for corner in range(4)])
EDGE_EDGE = np.array([[(8.0, 16.0, 32.0)[len({*a} & {*b})] for b in EDGES] for a in EDGES])
UNIT_MASS = np.block([[5 * np.eye(4) + 1, CORNER_EDGE], [CORNER_EDGE.T, EDGE_EDGE]]) / 420
# barycentric coordinates of the four Gauss points of degree 2, as far as B^T C B goes
INNER = (5 - np.sqrt(5)) / 20
GAUSS = INNER + (1 - 4 * INNER) * np.eye(4)


@dataclass(frozen=True)
class Mesh:
    """Nodes (n, 3) in m, tets (e, 10) node numbers, nodes of the clamped face and of the tip face.

    omega : lowest angular frequencies (10,) in rad/s of Exudyn's own matrices of this mesh, for comparison.
    """

    nodes: np.ndarray
    tets: np.ndarray
    clamped: np.ndarray
    tip: np.ndarray
    omega: np.ndarray


def read_mesh(level: int = 0) -> Mesh:
    """Read one of the three meshes.

    Parameters
    ----------
    level : int
        0 (coarse), 1 or 2 (fine).

    Returns
    -------
    Mesh
    """
    with np.load(DATA / f"solid_bar_{level}.npz", allow_pickle=False) as file:
        return Mesh(*(file[name] for name in Mesh.__dataclass_fields__))


def matrices(nodes: np.ndarray, tets: np.ndarray) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
    """Mass and stiffness matrices of 10-node tetrahedra with straight edges, steel, not clamped yet.

    Parameters
    ----------
    nodes : ndarray, (n, 3)
        Positions in m.
    tets : ndarray of int, (e, 10)
        Four corners, then the nodes in the middle of EDGES.

    Returns
    -------
    mass, stiffness : csc_matrix, (3 n, 3 n)
        Coordinate 3 i + j is component j of node i; kg, N/m.
    """
    frame = np.concatenate([np.ones((len(tets), 4, 1)), nodes[tets[:, :4]]], axis=2)
    volume = np.abs(np.linalg.det(frame)) / 6
    slopes = np.linalg.inv(frame)[:, 1:].transpose(0, 2, 1)  # gradients of the barycentric coordinates, (e, 4, 3)
    mass = STEEL.density * volume[:, None, None] * np.kron(UNIT_MASS, np.eye(3))
    stiffness = sum(_stiffness_density(point, slopes) for point in GAUSS) * (volume / 4)[:, None, None]
    return _assembled(mass, tets, len(nodes)), _assembled(stiffness, tets, len(nodes))


def face_weights(mesh: Mesh, face: np.ndarray) -> np.ndarray:
    """Areas that a uniform traction on a plane face gives its nodes.

    Parameters
    ----------
    face : ndarray of int
        Nodes of the face.

    Returns
    -------
    ndarray, (len(face),)
        In m^2; zero at corners of triangles, as quadratic shape functions have it.
    """
    weights = np.zeros(len(mesh.nodes))
    for corners in combinations(range(4), 3):
        middles = [4 + i for i, edge in enumerate(EDGES) if {*edge} <= {*corners}]
        on_face = np.isin(mesh.tets[:, corners], face).all(axis=1)
        a, b, c = (mesh.nodes[mesh.tets[on_face, corner]] for corner in corners)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        np.add.at(weights, mesh.tets[on_face][:, middles], area[:, None] / 3)
    return weights[face]


def build(
    level: int = 0, rayleigh: tuple[float, float] = RAYLEIGH
) -> tuple[romerr.ElasticBody, np.ndarray, list[romerr.Output]]:
    """Clamped bar, its input matrix and its outputs.

    Parameters
    ----------
    level : int
        Mesh: 0 (1113 coordinates), 1 (3231) or 2 (9885).
    rayleigh : (float, float)
        alpha in 1/s, beta in s.

    Returns
    -------
    body : ElasticBody
        All coordinates of the clamped face fixed.
    inputs : ndarray, (N, 1)
        Force of 1 N in z, spread uniformly over the tip face.
    outputs : list of Output
        "tip z" and "tip x": mean displacement of the tip face in m.
    """
    mesh = read_mesh(level)
    fixed = (3 * mesh.clamped[:, None] + np.arange(3)).ravel()
    body = romerr.ElasticBody(*matrices(mesh.nodes, mesh.tets), rayleigh=rayleigh, fixed=fixed, positions=mesh.nodes)
    weights = face_weights(mesh, mesh.tip)
    inputs = np.zeros((body.N, 1))
    inputs[3 * mesh.tip + 2, 0] = weights / weights.sum()
    outputs = [
        romerr.mean_displacement(f"tip {axis}", nodes=mesh.tip, weights=weights, component=axis, unit="m")
        for axis in "zx"
    ]
    return body, inputs, outputs


def craig_bampton(body: romerr.ElasticBody, n: int, level: int = 0) -> romerr.Basis:
    """Six static modes of the tip face as a rigid body, and n eigenmodes with the tip face fixed as well.

    Parameters
    ----------
    body : ElasticBody
        From build(level).
    n : int
        Fixed-interface modes.
    level : int
        Mesh of the body.

    Returns
    -------
    Basis
        6 + n columns.
    """
    tip = read_mesh(level).tip
    held = np.searchsorted(body.free, (3 * tip[:, None] + np.arange(3)).ravel())
    inner = np.setdiff1d(np.arange(body.free.size), held)
    K, M = body.K[inner], body.M[inner]
    fixed_body = romerr.ElasticBody(M[:, inner], K[:, inner])
    rigid = _rigid_motions(body.positions[tip])
    V = np.zeros((body.free.size, 6 + n))
    V[held, :6] = rigid
    V[inner, :6] = fixed_body.stiffness_factor.solve(-K[:, held] @ rigid)
    V[inner, 6:] = fixed_body.modes(n).shapes
    return romerr.Basis(body.expand(V), note=f"Craig-Bampton, 6 static and {n} fixed-interface modes")


def _rigid_motions(positions: np.ndarray) -> np.ndarray:
    """Three translations and three small rotations about the mean position, (3 n, 6)."""
    arms = positions - positions.mean(axis=0)
    turns = np.stack([np.cross(axis, arms) for axis in np.eye(3)], axis=-1)
    return np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=-1).reshape(-1, 6)


def _stiffness_density(point: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Stiffness per volume (e, 30, 30) at barycentric coordinates (4,): lambda div u div v + 2 mu eps : eps."""
    corners = (4 * point - 1)[:, None] * slopes
    middles = [4 * (point[a] * slopes[:, b] + point[b] * slopes[:, a]) for a, b in EDGES]
    gradient = np.concatenate([corners, np.stack(middles, axis=1)], axis=1)  # (e, 10, 3)
    mu, nu = STEEL.shear_modulus, STEEL.poisson_ratio
    products = np.einsum("eia,ejb->eiajb", gradient, gradient)
    inner = np.einsum("eia,eja->eij", gradient, gradient)
    density = 2 * mu * nu / (1 - 2 * nu) * products + mu * products.transpose(0, 1, 4, 3, 2)
    density += mu * np.einsum("eij,ab->eiajb", inner, np.eye(3))
    return density.reshape(-1, 30, 30)


def _assembled(blocks: np.ndarray, tets: np.ndarray, count: int) -> sparse.csc_matrix:
    """Sum element matrices (e, 30, 30) into one; symmetric to the last bit."""
    dofs = (3 * tets.astype(np.int64)[:, :, None] + np.arange(3)).reshape(len(tets), -1)
    rows = np.broadcast_to(dofs[:, :, None], blocks.shape).ravel()
    columns = np.broadcast_to(dofs[:, None, :], blocks.shape).ravel()
    matrix = sparse.coo_matrix((blocks.ravel(), (rows, columns)), shape=(3 * count,) * 2).tocsc()
    return sparse.csc_matrix((matrix + matrix.T) / 2)
