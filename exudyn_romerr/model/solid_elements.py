"""Elements of a mesh by type, nodes in the order of Abaqus, Ansys and VTK; strain at their nodes as rows."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ..checks import check_array, check_nodes
from ..errors import InputError

STRAINS = ("xx", "yy", "zz", "yz", "xz", "xy")  # Exudyn's order; shears are engineering shears, 2 eps
# middle nodes lie between these corners, in the order of Abaqus and Ansys
TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
HEX_EDGES = tuple((ring + i, ring + (i + 1) % 4) for ring in (0, 4) for i in range(4)) + tuple(
    (i, i + 4) for i in range(4)
)
BULGE = 0.3  # of an edge: how far its middle node may be off; an arc of 120 degrees has 0.29
FLAT = 1e-10  # |det J| over the product of J's columns; below, an element has no volume at a node

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


class Element(NamedTuple):
    """A type of element: reference nodes (n, 3), powers (n, 3) of its monomials."""

    nodes: np.ndarray
    powers: np.ndarray


def _with_middles(corners: np.ndarray, edges: tuple) -> np.ndarray:
    return np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in edges]])


def _types() -> dict[str, Element]:
    grid = np.array(list(product(range(3), repeat=3)))
    tet = np.vstack([np.zeros(3), np.eye(3)])
    hexa = np.array([(x, y, z) for z in (-1.0, 1.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    return {
        "Tet4": Element(tet, grid[grid.sum(axis=1) <= 1]),
        "Tet10": Element(_with_middles(tet, TET_EDGES), grid[grid.sum(axis=1) <= 2]),
        "Hex8": Element(hexa, grid[grid.max(axis=1) <= 1]),
        "Hex20": Element(_with_middles(hexa, HEX_EDGES), grid[(grid == 2).sum(axis=1) <= 1]),
    }


TYPES = _types()


def strain_rows(fem: Any, node: int) -> np.ndarray:
    """Return the strain at a node as rows (6, 3 nodes) in the order of STRAINS, the mean over its elements.

    Every element at the node has the same weight, as in Exudyn's ComputePostProcessingModes.

    Raises
    ------
    InputError
        A fem without elements, of other types than Tet4, Tet10, Hex8, Hex20, or with nodes in none; node out of
        range; an element that is turned inside out or flat.
    """
    positions = check_array("fem node positions", fem.GetNodePositionsAsArray(), (None, 3))
    node = int(check_nodes([node], len(positions))[0])
    rows, count = np.zeros((6, *positions.shape)), 0
    for kind, elements in elements_of(fem, positions):
        for number in np.flatnonzero((elements == node).any(axis=1)):
            own = elements[number]
            slopes = _slopes(kind, positions[own], f"{kind} element {number} (nodes {own.tolist()})")
            rows[:, own] += _strain(slopes[np.flatnonzero(own == node)[0]])
            count += 1
    return rows.reshape(6, -1) / count


@cache
def _reference_slopes(kind: str) -> np.ndarray:
    """Derivatives (b, a, 3) of shape function a at node b: the monomials' own, times their inverse Vandermonde."""
    nodes, powers = TYPES[kind]
    values = np.prod(nodes[:, None] ** powers, axis=2)
    slopes = []
    for k in range(3):
        lower = powers - np.eye(3, dtype=int)[k]
        slopes.append(powers[:, k] * np.prod(nodes[:, None] ** np.maximum(lower, 0), axis=2))
    return np.stack([slope @ np.linalg.inv(values) for slope in slopes], axis=2)


def _slopes(kind: str, where: np.ndarray, name: str) -> np.ndarray:
    """Gradients (b, a, 3) of the shape functions a in space, at every node b of one element."""
    reference = _reference_slopes(kind)
    jacobian = np.einsum("ai,bak->bik", where, reference)
    volume, box = np.linalg.det(jacobian), np.prod(np.linalg.norm(jacobian, axis=1), axis=1)
    # ngsolve counts the corners of its tetrahedra the other way round: all negative is as good as all positive
    if np.any(volume * np.sign(volume[0]) <= FLAT * box):
        raise InputError(f"fem: {name} is flat or turned inside out: its Jacobian is not of one sign at all nodes")
    return reference @ np.linalg.inv(jacobian)


def _strain(slopes: np.ndarray) -> np.ndarray:
    """Strain (6, a, 3) of displacements of the nodes a, from the gradients (a, 3)."""
    rows = np.zeros((6, *slopes.shape))
    for row, (i, j) in enumerate(("xyz".index(a), "xyz".index(b)) for a, b in STRAINS):
        rows[row, :, i] = slopes[:, j]
        rows[row, :, j] = slopes[:, i]
    return rows


def _sets_of(fem: Any) -> list[tuple[str, np.ndarray]]:
    return [(kind, np.asarray(x)) for part in fem.elements for kind, x in part.items() if kind != "Name" and len(x)]


def elements_of(fem: Any, positions: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Types and node numbers (e, n) of all elements; tetrahedra of ngsolve get their middle nodes back."""
    sets = _sets_of(fem)
    if not sets:
        raise InputError("fem has no elements; import them with the mesh, or pass your own rows: Output(name, rows)")
    for i, (kind, elements) in enumerate(sets):
        if kind not in TYPES or elements.shape[1:] != TYPES[kind].nodes.shape[:1]:
            raise InputError(f"fem.elements has {kind!r} of shape {elements.shape}; allowed: {', '.join(TYPES)}")
        sets[i] = kind, check_nodes(elements.ravel(), len(positions)).reshape(elements.shape)
    loose = np.setdiff1d(np.arange(len(positions)), np.concatenate([elements.ravel() for _, elements in sets]))
    if not loose.size:
        return sets
    if {kind for kind, _ in sets} != {"Tet4"}:
        raise InputError(f"fem: {loose.size} nodes, {loose[:8].tolist()} ..., are in none of its elements")
    tets = np.vstack([elements for _, elements in sets])
    return [("Tet10", _with_middle_nodes(tets, positions, loose, fem))]


def _with_middle_nodes(tets: np.ndarray, positions: np.ndarray, loose: np.ndarray, fem: Any) -> np.ndarray:
    """Node numbers (e, 10): Exudyn keeps the corners only of ngsolve's quadratic tetrahedra."""
    from scipy.spatial import cKDTree  # here, for it takes a third of the time to import the package

    pairs = np.sort(np.stack([tets[:, edge] for edge in TET_EDGES], axis=1), axis=2)
    edges, own = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    middles = _middles_on_surface(edges, len(positions), fem)
    # the other edges are straight, or the fem does not tell: the node next to the middle
    others, left = np.flatnonzero(middles < 0), np.setdiff1d(loose, middles)
    if len(edges) == loose.size and others.size:
        ends = positions[edges[others]]
        distance, found = cKDTree(positions[left]).query(ends.mean(axis=1))
        near = distance <= BULGE * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        middles[others[near]] = left[found[near]]
    if not np.array_equal(np.sort(middles), loose):
        raise InputError(
            f"fem: {loose.size} nodes are in none of its Tet4 elements, nor the middles of their {len(edges)} edges; "
            "give fem.elements the 'Tet10' of the mesh, or pass your own rows: Output(name, rows)"
        )
    return np.hstack([tets, middles[own.reshape(len(tets), 6)]])


def _middles_on_surface(edges: np.ndarray, count: int, fem: Any) -> np.ndarray:
    """Middle nodes of edges (n, 2) that are on the surface, where the fem has its 6-node triangles; -1 elsewhere."""
    middles, keys = np.full(len(edges), -1), edges @ [count, 1]
    for part in fem.surface:
        triangles = np.asarray(part.get("Trigs6", ())).reshape(-1, 6)
        ends = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2) @ [count, 1]
        at = np.minimum(np.searchsorted(keys, ends), len(keys) - 1)
        middles[at[keys[at] == ends]] = triangles[:, 3:].ravel()[keys[at] == ends]
    return middles


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
    sets = _sets_of(fem)
    if not sets or any(kind not in NODES for kind, _ in sets):
        sets = [(SURFACE[kind], np.asarray(x)) for part in fem.surface for kind, x in part.items() if kind in SURFACE]
    return [(kind, elements) for kind, elements in sets if len(elements)]


def _upright(kind: str, elements: np.ndarray, positions: np.ndarray) -> np.ndarray:
    if kind not in TURNED:
        return elements
    edges = positions[elements[:, 1:4]] - positions[elements[:, :1]]
    return np.where((np.linalg.det(edges) < 0)[:, None], elements[:, TURNED[kind]], elements)
