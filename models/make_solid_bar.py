"""Mesh the bar of models/solid_bar.py with ngsolve and write models/data/solid_bar_0.npz, _1.npz, _2.npz.

Needs the optional extra `mesh` (pip install .[mesh]); the stored meshes do not. What is written is checked first: the
matrices that solid_bar makes of the mesh must be those that Exudyn imports from ngsolve.

    python models/make_solid_bar.py
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

os.environ.setdefault("EXUDYN_SUPPRESS_UI_WINDOW_OPEN", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import netgen.occ as occ
import ngsolve
import numpy as np
from exudyn.FEM import FEMinterface
from scipy.spatial import cKDTree

import exudyn_romerr as romerr
from models import solid_bar
from models.beam3d import STEEL

MESH_SIZES = (0.03, 0.02, 0.014)  # m
SAME = 1e-12  # of the largest entry: two summations of the same integrals


def geometry() -> occ.OCCGeometry:
    """Return the bar less its notch."""
    bar = occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(*solid_bar.SIZE))
    return occ.OCCGeometry(bar - occ.Box(*(occ.Pnt(*corner) for corner in solid_bar.NOTCH)))


def imported(mesh: Any) -> FEMinterface:
    """Return Exudyn's FEMinterface of a netgen mesh, in quadratic tetrahedra of steel."""
    fem = FEMinterface()
    fem.ImportMeshFromNGsolve(
        ngsolve.Mesh(mesh),
        density=STEEL.density,
        youngsModulus=STEEL.youngs_modulus,
        poissonsRatio=STEEL.poisson_ratio,
        meshOrder=2,
    )
    return fem


def tetrahedra(fem: FEMinterface) -> np.ndarray:
    """Return the node numbers (e, 10) of the tetrahedra, of which the fem has the corners only."""
    nodes, corners = fem.GetNodePositionsAsArray(), np.asarray(fem.elements[0]["Tet4"])
    middles = np.stack([nodes[corners[:, edge]].mean(axis=1) for edge in solid_bar.EDGES], axis=1)
    distance, found = cKDTree(nodes).query(middles)
    if distance.max() > 1e-9:
        raise ValueError(f"mid-edge nodes are off the middle by {distance.max():.1e} m: edges must be straight")
    return np.hstack([corners, found])


def arrays(fem: FEMinterface) -> dict[str, np.ndarray]:
    """Return the fields of solid_bar.Mesh."""
    nodes = fem.GetNodePositionsAsArray()
    clamped, tip = (np.flatnonzero(np.abs(nodes[:, 0] - x) < 1e-9) for x in (0.0, solid_bar.SIZE[0]))
    fixed = (3 * clamped[:, None] + np.arange(3)).ravel()
    omega = romerr.ElasticBody.from_fem(fem, fixed=fixed).modes(10).omega
    numbers = {"tets": tetrahedra(fem), "clamped": clamped, "tip": tip}
    return {"nodes": nodes, **{name: x.astype(np.int16) for name, x in numbers.items()}, "omega": omega}


def check(fem: FEMinterface, mesh: dict[str, np.ndarray]) -> None:
    """Raise ValueError unless solid_bar's matrices are Exudyn's."""
    theirs = fem.GetMassMatrix(sparse=True), fem.GetStiffnessMatrix(sparse=True)
    for name, mine, other in zip("MK", solid_bar.matrices(mesh["nodes"], mesh["tets"]), theirs, strict=True):
        worst = abs(mine - other).max() / abs(other).max()
        print(f"  {name}: differs from Exudyn's by {worst:.1e} of its largest entry")
        if worst > SAME:
            raise ValueError(f"{name} differs from Exudyn's by {worst:.1e} of its largest entry; allowed: {SAME:g}")


def main() -> None:
    """Write the three meshes."""
    solid_bar.DATA.mkdir(exist_ok=True)
    for level, mesh_size in enumerate(MESH_SIZES):
        fem = imported(geometry().GenerateMesh(maxh=mesh_size))
        mesh = arrays(fem)
        path = solid_bar.DATA / f"solid_bar_{level}.npz"
        print(f"{path.name}: {3 * len(mesh['nodes'])} coordinates, {len(mesh['tets'])} tetrahedra")
        check(fem, mesh)
        np.savez_compressed(path, **mesh)


if __name__ == "__main__":
    main()
