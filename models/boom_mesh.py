"""The boom of a loader crane: a welded box of thin walls, arched, as solid elements; and its matrices.

    python models/boom_mesh.py [FILE]      writes models/data/boom.inp, a mesh as Abaqus reads it, with node sets

Sections of four by four nodes stand one behind the other along x. Between two of them there are eight cells of walls;
the ninth, inside, is a bulkhead where something is mounted, and elsewhere air. m, kg, s.
"""

from __future__ import annotations

import sys
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from exudyn.FEM import FEMinterface
from scipy import sparse

from exudyn_romerr.fe_files.abaqus_input import read_input
from models.floating import DATA
from models.hex_bar import CORNERS, GAUSS

FILE = DATA / "boom.inp"
LENGTH, WIDTH, WALL = 4.0, 0.18, 0.012
CELLS = 24  # along x
ARCH = 0.35  # how far the middle is above the line between the ends
HEIGHTS = (0.24, 0.34, 0.2)  # of the section at the hinge, in the middle, at the tip
STEEL = (2.1e11, 7850.0, 0.3)  # N/m^2, kg/m^3, Poisson's ratio
# sections that are mounted on: which, and what of them: 0 the whole, -1 the lower flange, 1 the upper one
MOUNTS = {"hinge": ((0,), 0), "lug": ((8, 9), -1), "bracket": ((17, 18), 1), "tip": ((CELLS,), 0)}


def input_file() -> str:
    """Return the text of the .inp."""
    number = {place: i for i, place in enumerate(product(range(CELLS + 1), range(4), range(4)), start=1)}
    lines = ["*Heading", "boom of a loader crane, m, kg, s", "*Node"]
    lines += [f"{i}, " + ", ".join(f"{x:.6g}" for x in _position(*place)) for place, i in number.items()]
    lines += ["*Element, type=C3D8I, elset=boom"]
    bulkheads = {min(section, CELLS - 1) for sections, _ in MOUNTS.values() for section in sections}
    cells = [
        place for place in product(range(CELLS), range(3), range(3)) if place[1:] != (1, 1) or place[0] in bulkheads
    ]
    for e, place in enumerate(cells, start=1):
        corners = (number[tuple(place + step)] for step in (CORNERS + 1) // 2)
        lines.append(", ".join(map(str, [e, *corners])))
    for name, (sections, side) in MOUNTS.items():
        heights = {0: range(4), -1: range(1), 1: range(3, 4)}[side]
        lines += [f"*Nset, nset={name}"]
        lines += [", ".join(str(number[i, j, k]) for j, k in product(range(4), heights)) for i in sections]
    return "\n".join(lines) + "\n"


def _position(i: int, j: int, k: int) -> tuple[float, float, float]:
    """Of node j across and k upwards in section i."""
    s = i / CELLS
    height = np.interp(s, [0.0, 0.5, 1.0], HEIGHTS)
    middle = ARCH * np.sin(np.pi * s)
    across, up = ([-x / 2, -x / 2 + WALL, x / 2 - WALL, x / 2] for x in (WIDTH, height))
    return LENGTH * s, across[j], middle + up[k]


def boom_fem() -> FEMinterface:
    """Return the boom as if just imported, without modes; node sets of equal weights have the names of MOUNTS."""
    mesh = read_input(FILE)
    hexes = np.searchsorted(mesh.numbers, mesh.elements["Hex8"])
    fem = FEMinterface()
    fem.nodes, fem.elements = {"Position": mesh.positions}, [{"Name": "boom", "Hex8": hexes}]
    fem.massMatrix, fem.stiffnessMatrix = matrices(mesh.positions, hexes)
    fem.nodeSets = [
        {"Name": name, "NodeNumbers": nodes, "NodeWeights": np.full(len(nodes), 1 / len(nodes))}
        for name, nodes in ((name, np.searchsorted(mesh.numbers, mesh.sets[name])) for name in MOUNTS)
    ]
    return fem


def matrices(positions: np.ndarray, hexes: np.ndarray) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """Mass and stiffness matrices of hexahedra with incompatible modes, which let thin walls bend."""
    modulus, density, ratio = STEEL
    shear = modulus / (2 * (1 + ratio))
    lame = 2 * shear * ratio / (1 - 2 * ratio)
    x, e = positions[hexes], len(hexes)
    centre = np.linalg.inv(np.einsum("ai,eaj->eij", CORNERS / 8, x))
    M, K = np.zeros((e, 8, 8)), np.zeros((e, 33, 33))
    for point in GAUSS:
        factors = (1 + CORNERS * point) / 2
        reference = np.stack(
            [CORNERS[:, i] / 2 * np.delete(factors, i, axis=1).prod(axis=1) for i in range(3)], axis=1
        )
        jacobian = np.einsum("ai,eaj->eij", reference, x)
        volume = np.linalg.det(jacobian)
        bubbles = np.linalg.det(np.linalg.inv(centre)) / volume  # of 1 - xi^2, ...: they vanish in the mean
        slopes = np.concatenate(
            [
                np.einsum("ai,eji->eaj", reference, np.linalg.inv(jacobian)),
                np.einsum("e,ai,eji->eaj", bubbles, -2 * np.diag(point), centre),
            ],
            axis=1,
        )
        stretch = np.einsum("eai,ebj->eaibj", slopes, slopes)
        twist = np.einsum("eaj,ebi->eaibj", slopes, slopes)
        both = np.einsum("eak,ebk,ij->eaibj", slopes, slopes, np.eye(3))
        K += volume[:, None, None] * (lame * stretch + shear * (twist + both)).reshape(e, 33, 33)
        values = factors.prod(axis=1)
        M += density * volume[:, None, None] * np.outer(values, values)
    inner = K[:, 24:, :24]
    K = K[:, :24, :24] - inner.swapaxes(1, 2) @ np.linalg.solve(K[:, 24:, 24:], inner)
    return tuple(_assembled(A, hexes, positions.size) for A in (np.kron(M, np.eye(3)), (K + K.swapaxes(1, 2)) / 2))


def _assembled(own: np.ndarray, hexes: np.ndarray, n: int) -> sparse.csr_matrix:
    """Sum of the matrices (e, 24, 24)."""
    at = (3 * hexes[:, :, None] + np.arange(3)).reshape(len(hexes), 24)
    rows, columns = np.repeat(at, 24, axis=1).ravel(), np.tile(at, (1, 24)).ravel()
    return sparse.csr_matrix((own.ravel(), (rows, columns)), shape=(n, n))


if __name__ == "__main__":
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    path.write_text(input_file(), encoding="ascii")
    print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")
