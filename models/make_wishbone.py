"""Mesh the lower control arm of models/wishbone.py with ngsolve and write models/data/wishbone.npz.

Needs the optional extra `mesh` (pip install .[mesh]); the stored mesh does not. Stored are nodes, 10-node tetrahedra,
surface triangles and the nodes of the four holes with weights by area; the matrices follow from them. What is written
is checked first: the matrices made of the mesh must be those that Exudyn imports from ngsolve.

    python models/make_wishbone.py
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ.setdefault("EXUDYN_SUPPRESS_UI_WINDOW_OPEN", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import netgen.meshing as meshing
import netgen.occ as occ
import numpy as np
from exudyn.FEM import FEMinterface

from models import make_solid_bar, wishbone
from models.solid_bar import EDGES

WIDTH, HEIGHT = 0.022, 0.026  # m, section of the legs
EYE_LENGTH = 0.064  # m, of the bush eyes along x: the legs end within
OUTER = {"front": 0.028, "rear": 0.028, "ball": 0.034, "seat": 0.028}  # m, radii around the holes
HOLES = {"front": 0.019, "rear": 0.019, "ball": 0.019, "seat": 0.011}  # m, radii
AXES = {"front": 0, "rear": 0, "ball": 2, "seat": 2}  # of the holes: x or z
MESH = {"maxh": 0.04, "curvaturesafety": 0.9, "segmentsperedge": 0.2, "grading": 0.95}
FACES = ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))  # corners of a tetrahedron
ON_HOLE = 1e-6  # m


def arm() -> occ.TopoDS_Shape:
    """Return two legs from the bush eyes to the ball joint, a cross member with the spring seat, and four holes."""
    place = {name: np.array(wishbone.POINTS[name]) for name in OUTER}
    share = place["seat"][1] / place["ball"][1]
    cross = [place[eye] + share * (place["ball"] - place[eye]) for eye in ("front", "rear")]
    plate = _strip(place["front"], place["ball"]) + _strip(place["rear"], place["ball"]) + _strip(*cross)
    for name in ("ball", "seat"):
        plate += _disc(place[name], OUTER[name])
    solid = plate.Extrude(HEIGHT)
    for name in ("front", "rear"):
        solid += _cylinder(name, OUTER[name], EYE_LENGTH)
    for name, radius in HOLES.items():
        solid -= _cylinder(name, radius, 2 * EYE_LENGTH if AXES[name] == 2 else EYE_LENGTH)
    return solid


def _strip(begin: np.ndarray, end: np.ndarray) -> occ.TopoDS_Shape:
    """Return a rectangle of WIDTH from one point to another, at the arm's lower face."""
    along = (end - begin) / np.linalg.norm(end - begin)
    corner = begin - WIDTH / 2 * np.array([-along[1], along[0], 0]) - [0, 0, HEIGHT / 2]
    axes = occ.Axes(occ.Pnt(*corner), n=occ.Z, h=occ.Vec(*along))
    return occ.WorkPlane(axes).Rectangle(np.linalg.norm(end - begin), WIDTH).Face()


def _disc(centre: np.ndarray, radius: float) -> occ.TopoDS_Shape:
    axes = occ.Axes(occ.Pnt(centre[0], centre[1], -HEIGHT / 2), n=occ.Z, h=occ.X)
    return occ.WorkPlane(axes).Circle(radius).Face()


def _cylinder(name: str, radius: float, length: float) -> occ.TopoDS_Shape:
    """Return a cylinder around a point, along its axis; those along x have their seam below, away from the legs."""
    begin = np.array(wishbone.POINTS[name]) - length / 2 * np.eye(3)[AXES[name]]
    axis, seam = (occ.Z, occ.X) if AXES[name] == 2 else (occ.X, occ.Vec(0, 0, -1))
    return occ.WorkPlane(occ.Axes(occ.Pnt(*begin), n=axis, h=seam)).Circle(radius).Face().Extrude(length)


def imported() -> FEMinterface:
    """Return Exudyn's FEMinterface of quadratic tetrahedra with straight edges: holes are polygons."""
    mesh = occ.OCCGeometry(arm()).GenerateMesh(**MESH)
    mesh.SetGeometry(meshing.NetgenGeometry())  # or mid-edge nodes go to the cylinders, and elements are curved
    return make_solid_bar.imported(mesh)


def arrays(fem: FEMinterface) -> dict[str, np.ndarray]:
    """Return everything that wishbone.load_fem reads."""
    nodes, tets = fem.GetNodePositionsAsArray(), make_solid_bar.tetrahedra(fem)
    surface = _surface(tets)
    a, b, c, ab, ac, bc = surface.T
    triangles = np.concatenate([np.stack(x, axis=1) for x in ((a, ab, ac), (b, bc, ab), (c, ac, bc), (ab, bc, ac))])
    stored = {"nodes": nodes, "tets": tets.astype(np.int16), "triangles": triangles.astype(np.int16)}
    for name in HOLES:
        stored[f"{name}_nodes"], stored[f"{name}_weights"] = _hole(name, nodes, surface)
    return stored


def _surface(tets: np.ndarray) -> np.ndarray:
    """Return the triangles (t, 6) that belong to one tetrahedron only: corners a, b, c, middles of ab, ac, bc."""
    columns = [[*face, *(4 + EDGES.index(pair) for pair in _pairs(face))] for face in FACES]
    triangles = np.concatenate([tets[:, column] for column in columns])
    _, first, count = np.unique(np.sort(triangles[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
    return triangles[first[count == 1]]


def _pairs(face: tuple[int, int, int]) -> list[tuple[int, int]]:
    return [(face[0], face[1]), (face[0], face[2]), (face[1], face[2])]


def _hole(name: str, nodes: np.ndarray, surface: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes that a uniform traction on the hole loads, which are the mid-edge ones, and their weights."""
    arms = nodes - wishbone.POINTS[name]
    near = np.abs(arms[:, AXES[name]]) < EYE_LENGTH / 2 + ON_HOLE  # both bush eyes are on one axis
    radius = np.linalg.norm(np.delete(arms, AXES[name], axis=1), axis=1)
    on_hole = near & (np.abs(radius - HOLES[name]) < ON_HOLE)
    inside = surface[on_hole[surface[:, :3]].all(axis=1)]
    a, b, c = (nodes[inside[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    weights = np.zeros(len(nodes))
    np.add.at(weights, inside[:, 3:], area[:, None] / 3)
    chosen = np.flatnonzero(weights)
    return chosen.astype(np.int16), weights[chosen] / weights.sum()


def main() -> None:
    """Write the arm."""
    fem = imported()
    mesh = arrays(fem)
    make_solid_bar.check(fem, mesh)
    path = wishbone.DATA / "wishbone.npz"
    np.savez_compressed(path, **mesh)
    holes = ", ".join(f"{len(mesh[f'{name}_nodes'])} {name}" for name in HOLES)
    dof, tets = 3 * len(mesh["nodes"]), len(mesh["tets"])
    print(f"{path.name}: {dof} coordinates, {tets} tetrahedra ({holes}), {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
