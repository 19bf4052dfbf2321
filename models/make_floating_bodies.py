"""Mesh the bodies of models/floating.py with ngsolve and write models/data/floating_bar.npz, _bar_fine, _rotor.

Needs the optional extra `mesh` (pip install .[mesh]); the stored bodies do not. Stored are nodes, corner nodes of the
tetrahedra, surface triangles, node sets with weights by surface area, and both matrices as the parts of a CSR matrix.

    python models/make_floating_bodies.py
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ.setdefault("EXUDYN_SUPPRESS_UI_WINDOW_OPEN", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import netgen.occ as occ
import ngsolve
import numpy as np
from exudyn.FEM import FEMinterface
from scipy import sparse

from models import floating
from models.beam3d import STEEL

BAR = (0.4, 0.04, 0.06)  # m
ROTOR = (0.6, 0.015, 0.1, 0.03)  # m: length and radius of the shaft, radius and thickness of the disc
DISC_POSITION = 0.25  # m, middle of the disc along the shaft
HOLE = (0.06, 0.02)  # m: through the disc, distance from the axis (along z) and radius
X = occ.Vec(1, 0, 0)


def bar() -> occ.TopoDS_Shape:
    """Return the box of BAR."""
    return occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(*BAR))


def rotor() -> occ.TopoDS_Shape:
    """Return shaft and disc along x, with a hole through the disc: the rotor's only imbalance."""
    length, shaft_radius, disc_radius, thickness = ROTOR
    begin = DISC_POSITION - thickness / 2
    shaft = occ.Cylinder(occ.Pnt(0, 0, 0), X, r=shaft_radius, h=length)
    disc = occ.Cylinder(occ.Pnt(begin, 0, 0), X, r=disc_radius, h=thickness)
    return (shaft + disc) - occ.Cylinder(occ.Pnt(begin, 0, HOLE[0]), X, r=HOLE[1], h=thickness)


def imported(shape: occ.TopoDS_Shape, order: int, **mesh_size: float) -> FEMinterface:
    """Return Exudyn's FEMinterface of a steel body of tetrahedra."""
    fem = FEMinterface()
    fem.ImportMeshFromNGsolve(
        ngsolve.Mesh(occ.OCCGeometry(shape).GenerateMesh(**mesh_size)),
        density=STEEL.density,
        youngsModulus=STEEL.youngs_modulus,
        poissonsRatio=STEEL.poisson_ratio,
        meshOrder=order,
    )
    return fem


def node_sets(fem: FEMinterface, length: float, probe: tuple[str, tuple]) -> dict[str, tuple]:
    """Return name -> (nodes, weights): the end faces, and the node next to a point, for sensors."""
    faces = {"left": 0.0, "right": length}
    sets = {name: fem.GetNodesInPlane([x, 0, 0], [1, 0, 0]) for name, x in faces.items()}
    weighted = {name: (nodes, fem.GetNodeWeightsFromSurfaceAreas(nodes)) for name, nodes in sets.items()}
    name, point = probe
    distance = np.linalg.norm(fem.GetNodePositionsAsArray() - point, axis=1)
    return {**weighted, name: ([distance.argmin()], [1.0])}


def csr_parts(name: str, matrix: sparse.csr_matrix) -> dict[str, np.ndarray]:
    """Return the three arrays of a matrix, symmetric to the last bit and without the zeros that ngsolve stores."""
    matrix = sparse.csr_matrix((matrix + matrix.T) / 2)
    matrix.eliminate_zeros()
    indices = {"indices": matrix.indices.astype(np.int32), "indptr": matrix.indptr.astype(np.int32)}
    return {f"{name}_{part}": array for part, array in {"data": matrix.data, **indices}.items()}


def arrays(fem: FEMinterface, sets: dict[str, tuple]) -> dict[str, np.ndarray]:
    """Return everything that floating.load_fem reads."""
    stored = {
        "nodes": fem.GetNodePositionsAsArray(),
        "tets": np.asarray(fem.elements[0]["Tet4"], dtype=np.int32),
        "triangles": np.asarray(fem.surface[0]["Trigs"], dtype=np.int32),
        "sets": np.array(list(sets)),
        **csr_parts("mass", fem.GetMassMatrix(sparse=True)),
        **csr_parts("stiffness", fem.GetStiffnessMatrix(sparse=True)),
    }
    for name, (nodes, weights) in sets.items():
        stored |= {f"{name}_nodes": np.asarray(nodes, dtype=np.int32), f"{name}_weights": np.asarray(weights)}
    return stored


def write(name: str, fem: FEMinterface, sets: dict[str, tuple]) -> None:
    """Write one body and print its size."""
    path = floating.DATA / f"floating_{name}.npz"
    np.savez_compressed(path, **arrays(fem, sets))
    faces = ", ".join(f"{len(nodes)} {key}" for key, (nodes, _) in sets.items())
    print(f"{path.name}: {fem.NumberOfNodes()} nodes ({faces}), {path.stat().st_size / 1e3:.0f} kB")


def main() -> None:
    """Write the three bodies."""
    floating.DATA.mkdir(exist_ok=True)
    for name, order, mesh_size in (("bar", 1, 0.04), ("bar_fine", 2, 0.04)):
        fem = imported(bar(), order, maxh=mesh_size)
        write(name, fem, node_sets(fem, BAR[0], ("tip", BAR)))
    fem = imported(rotor(), 1, maxh=0.03, curvaturesafety=0.6, segmentsperedge=0.1, grading=0.9)
    rim = (DISC_POSITION, 0.0, -ROTOR[2])
    write("rotor", fem, node_sets(fem, ROTOR[0], ("rim", rim)))


if __name__ == "__main__":
    main()
