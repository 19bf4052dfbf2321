"""Elements of a mesh by type, nodes in the order of Abaqus, Ansys and VTK, tetrahedra not inside out."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from ..checks import check_array, check_nodes
from ..errors import InputError
from .solid_elements import elements_of

VERTEX = "Vertex"
BY_COLUMNS = {2: "Line2", 3: "Trig3", 4: "Tet4", 8: "Hex8", 10: "Tet10", 20: "Hex20"}
NODES = {
    "Line2": 2,
    "Trig3": 3,
    "Trig6": 6,
    "Quad4": 4,
    "Quad8": 8,
    "Tet4": 4,
    "Tet10": 10,
    "Pyramid5": 5,
    "Wedge6": 6,
    "Wedge15": 15,
    "Hex8": 8,
    "Hex20": 20,
}
SURFACE = {"Trigs": "Trig3", "Quads": "Quad4"}  # Exudyn's names
# ngsolve's tetrahedra turn the other way round: nodes 1 and 2, and the middles of their edges, change places
TURNED = {"Tet4": [0, 2, 1, 3], "Tet10": [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]}


def cells_of(mesh: Any, positions: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Return types and node numbers (e, k) of the elements of a mesh; nodes alone where it has none.

    Parameters
    ----------
    mesh : FEMinterface; what read_body returns; (positions, elements (e, k) or None); None
    positions : (nodes, 3)
        That the mesh must have.

    Raises
    ------
    InputError
        Other positions, node numbers out of range, or a number of columns that is no element.
    """
    found: list[tuple[str, np.ndarray]] = []
    if hasattr(mesh, "GetNodePositionsAsArray"):
        _check_positions(mesh.GetNodePositionsAsArray(), positions)
        found = _of_fem(mesh, positions)
    elif hasattr(mesh, "elements"):
        _check_positions(mesh.body.positions, positions)
        found = list(mesh.elements.items())
    elif mesh is not None:
        given, elements = mesh
        _check_positions(given, positions)
        found = [] if elements is None else [_by_columns(np.atleast_2d(elements))]
    for kind, elements in found:
        check_nodes(elements.ravel(), len(positions))
        if elements.shape[1] != NODES[kind]:
            raise InputError(f"elements {kind!r} of mesh have {elements.shape[1]} nodes each; needed: {NODES[kind]}")
    vertices = [(VERTEX, np.arange(len(positions))[:, None])]
    return [(kind, _upright(kind, np.asarray(e, dtype=int), positions)) for kind, e in found] or vertices


def _check_positions(given: Any, positions: np.ndarray) -> None:
    given = check_array("positions of mesh", given, positions.shape)
    if np.max(np.abs(given - positions), initial=0.0) > 1e-9 * np.max(np.ptp(positions, axis=0), initial=0.0):
        raise InputError("mesh has nodes elsewhere than the body of this report; pass the mesh that it was made of")


def _by_columns(elements: np.ndarray) -> tuple[str, np.ndarray]:
    if elements.shape[1] not in BY_COLUMNS:
        known = ", ".join(f"{k} ({name})" for k, name in BY_COLUMNS.items())
        raise InputError(f"elements of mesh has {elements.shape[1]} columns; needed: {known}")
    return BY_COLUMNS[elements.shape[1]], elements


def _of_fem(fem: Any, positions: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Its elements; of those that are of no known type its surface."""
    with suppress(InputError):  # with the middle nodes that ngsolve's tetrahedra lost
        return elements_of(fem, positions)
    sets = [(kind, np.asarray(x)) for part in fem.elements for kind, x in part.items() if kind != "Name" and len(x)]
    if not sets or any(kind not in NODES for kind, _ in sets):
        sets = [(SURFACE[kind], np.asarray(x)) for part in fem.surface for kind, x in part.items() if kind in SURFACE]
    return [(kind, elements) for kind, elements in sets if len(elements)]


def _upright(kind: str, elements: np.ndarray, positions: np.ndarray) -> np.ndarray:
    if kind not in TURNED:
        return elements
    edges = positions[elements[:, 1:4]] - positions[elements[:, :1]]
    return np.where((np.linalg.det(edges) < 0)[:, None], elements[:, TURNED[kind]], elements)
