"""Bars of few hexahedra with eight nodes: so small a fem that a run with all of its modes takes a second or two.

Full models of sweeps and tests, not of bending: such elements are far too stiff there. Sections may be shifted, so
that the bar is no longer straight and bending, tension and torsion are coupled.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from exudyn.FEM import FEMinterface
from scipy import sparse

CORNERS = np.array([(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])  # Exudyn's order
GAUSS = np.array(list(product((-1, 1), repeat=3))) / np.sqrt(3)


def hex_bar(
    elements: int = 4,
    size: Sequence[float] = (0.4, 0.03, 0.04),
    material: tuple[float, float, float] = (2e9, 2000.0, 0.3),
    shifts: np.ndarray | None = None,
) -> FEMinterface:
    """Return a bar along x as if just imported, without modes.

    Node sets are "left" and "right" (end faces, equal weights), "tip" and "middle" (one node each, on the edge of
    largest y and z).

    Parameters
    ----------
    elements : int
        Hexahedra in a row; 12 (elements + 1) coordinates.
    size : (float, float, float)
        Length, width and height in m.
    material : (float, float, float)
        Young's modulus in N/m^2, density in kg/m^3, Poisson's ratio.
    shifts : ndarray, (elements + 1, 3), optional
        Displacement of every section in m.
    """
    grid = np.array(list(product(range(elements + 1), range(2), range(2))))
    number = {tuple(place): i for i, place in enumerate(grid)}
    positions = grid * np.asarray(size) / [elements, 1, 1]
    if shifts is not None:
        positions += np.asarray(shifts)[grid[:, 0]]
    hexes = np.array([[number[x + i, j, k] for i, j, k in (CORNERS + 1) // 2] for x in range(elements)])
    fem = FEMinterface()
    fem.nodes = {"Position": positions}
    fem.elements = [{"Name": "bar", "Hex8": hexes}]
    fem.massMatrix, fem.stiffnessMatrix = matrices(positions, hexes, *material)
    sets = {"left": [number[0, j, k] for j, k in product(range(2), repeat=2)]}
    sets["right"] = [number[elements, j, k] for j, k in product(range(2), repeat=2)]
    sets |= {"tip": [number[elements, 1, 1]], "middle": [number[elements // 2, 1, 1]]}
    fem.nodeSets = [
        {"Name": name, "NodeNumbers": np.array(nodes), "NodeWeights": np.full(len(nodes), 1 / len(nodes))}
        for name, nodes in sets.items()
    ]
    return fem


def matrices(
    positions: np.ndarray, hexes: np.ndarray, modulus: float, density: float, ratio: float
) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """Mass and stiffness matrices (3 n, 3 n) of hexahedra (e, 8) at positions (n, 3), eight Gauss points each."""
    shear = modulus / (2 * (1 + ratio))
    lame = 2 * shear * ratio / (1 - 2 * ratio)
    M, K = np.zeros((2, positions.size, positions.size))
    for nodes, point in product(hexes, GAUSS):
        factors = (1 + CORNERS * point) / 2
        values = factors.prod(axis=1)
        reference = np.stack(
            [CORNERS[:, i] / 2 * np.delete(factors, i, axis=1).prod(axis=1) for i in range(3)], axis=1
        )
        jacobian = reference.T @ positions[nodes]
        volume = np.linalg.det(jacobian)
        slopes = np.linalg.solve(jacobian, reference.T).T  # (node, direction)
        # energy density: lame/2 (div u)^2 + shear sum eps_ij^2
        energy = lame * np.einsum("ai,bj->aibj", slopes, slopes) + shear * np.einsum("aj,bi->aibj", slopes, slopes)
        energy += shear * np.einsum("ak,bk,ij->aibj", slopes, slopes, np.eye(3))
        own = np.ix_(*[(3 * nodes[:, None] + np.arange(3)).ravel()] * 2)
        K[own] += volume * energy.reshape(24, 24)
        M[own] += volume * density * np.kron(np.outer(values, values), np.eye(3))
    return sparse.csr_matrix((M + M.T) / 2), sparse.csr_matrix((K + K.T) / 2)
