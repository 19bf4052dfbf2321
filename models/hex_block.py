"""Blocks of equal hexahedra with eight nodes, as large as wanted: bodies for what grows with their size.

No mesh generator is needed, and 1e6 coordinates take some seconds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from exudyn.FEM import FEMinterface
from scipy import sparse

from .hex_bar import CORNERS, matrices


def hex_block(
    elements: Sequence[int],
    size: Sequence[float] = (0.4, 0.1, 0.1),
    material: tuple[float, float, float] = (2.1e11, 7850.0, 0.3),
) -> FEMinterface:
    """Return a block as if just imported, without modes; node sets "left" and "right" are its end faces.

    Parameters
    ----------
    elements : (int, int, int)
        Along x, y, z; 3 (x + 1) (y + 1) (z + 1) coordinates.
    size : (float, float, float)
        m.
    material : (float, float, float)
        Young's modulus in N/m^2, density in kg/m^3, Poisson's ratio.
    """
    counts = np.asarray(elements)
    grid = np.indices(counts + 1).reshape(3, -1).T
    positions = grid * np.asarray(size) / counts
    cells = np.indices(counts).reshape(3, -1).T
    corners = cells[:, None] + (CORNERS + 1).astype(int) // 2
    hexes = np.ravel_multi_index(tuple(np.moveaxis(corners, 2, 0)), counts + 1)
    fem = FEMinterface()
    fem.nodes = {"Position": positions}
    fem.elements = [{"Name": "block", "Hex8": hexes}]
    own = matrices(positions[hexes[0]], np.arange(8)[None], *material)
    fem.massMatrix, fem.stiffnessMatrix = (_assembled(A.toarray(), hexes, positions.size) for A in own)
    faces = {"left": grid[:, 0] == 0, "right": grid[:, 0] == counts[0]}
    fem.nodeSets = [
        {"Name": name, "NodeNumbers": np.flatnonzero(on), "NodeWeights": _weights(grid[on, 1:], counts[1:])}
        for name, on in faces.items()
    ]
    return fem


def _assembled(own: np.ndarray, hexes: np.ndarray, n: int) -> sparse.csr_matrix:
    """Sum of the matrix (24, 24) of every element (e, 8)."""
    coordinates = (3 * hexes[:, :, None] + np.arange(3)).reshape(len(hexes), 24).astype(np.int32)
    rows, columns = np.repeat(coordinates, 24, axis=1).ravel(), np.tile(coordinates, (1, 24)).ravel()
    return sparse.csr_matrix((np.tile(own.ravel(), len(hexes)), (rows, columns)), shape=(n, n))


def _weights(grid: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Share of a face's area that belongs to each of its nodes; half at the rim."""
    share = np.prod(np.where((grid == 0) | (grid == counts), 0.5, 1.0), axis=1)
    return share / share.sum()
