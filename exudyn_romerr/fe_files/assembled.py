"""From matrices and a mesh, each by the numbers of its file, to one model: nodes from 0, all their coordinates."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from ..model.admissible_space import rigid_modes
from ..model.matrix_checks import doubled, forces, triangle_twice
from ..model.solid_elements import NODES
from .fe_data import Matrix, Mesh
from .fe_model import FEModel
from .matrix_files import HELD

STRAINED = 1e-6  # |K R| of rigid motions R, of the size of its terms: files have 7 digits at least
NAMES_ROWS = {  # by the program that wrote the matrices: what names their rows
    "Abaqus": "Let Abaqus write *Matrix Output, format=matrix input, which names the nodes of its rows",
    "CalculiX": "Put the .dof that CalculiX wrote with the matrices beside them: it names the nodes of their rows",
    "Nastran": "Let Nastran write DMIG (.pch, PARAM,EXTOUT,DMIGPCH), which name the nodes of their rows",
    "HBMAT": "If HBMAT of Ansys wrote them, let it write their .mapping, too (its last option: YES), and put it "
    "beside them: it names the nodes of their rows",
    "": "Put the rows in that order: matrix[p][:, p], with p the rows of the nodes by ascending number",
}


def assembled(stiffness: Matrix, mass: Matrix, mesh: Mesh | None, **options: Any) -> FEModel:
    """Return the model; of a coordinate without row in the matrices it is assumed that it is held at zero.

    Raises
    ------
    InputError
        Matrices of different nodes, nodes without positions, or an order of rows that cannot be the one of the nodes.
    """
    for name, matrix in (("stiffness", stiffness), ("mass", mass)):
        if wrong := triangle_twice(matrix.entries):
            raise InputError(f"the {name} matrix is not symmetric: {wrong}")
    stiffness, held_rows = _without_held(stiffness)
    named = stiffness.labels is not None and mass.labels is not None
    if not named:
        if mass.entries.shape != stiffness.entries.shape:
            rows, others = mass.entries.shape[0], stiffness.entries.shape[0]
            raise InputError(f"the mass matrix has {rows} rows, the stiffness matrix {others}")
        if mesh is None:
            if not held_rows.size:
                _check_translations(stiffness.entries)
            return FEModel(mass.entries, stiffness.entries, held=held_rows, **options)
        labels = _in_order(stiffness, mesh)
        stiffness, mass = (Matrix(matrix.entries, labels, matrix.program) for matrix in (stiffness, mass))
    model = _by_labels(stiffness, mass, mesh, held_rows, options)
    if model.positions is not None:
        asks = not named and (not len(model.held) or len(labels) < model.mass.shape[0])
        _check_rigid(model, stiffness.program if asks else None)
    elif not len(model.held):
        _check_translations(model.stiffness)
    return model


def _by_labels(stiffness: Matrix, mass: Matrix, mesh: Mesh | None, held_rows: np.ndarray, options: dict) -> FEModel:
    labels = _used(stiffness, mass)
    # nodes whose rows are empty, all held, too: elements have them
    numbers = np.unique(np.concatenate([stiffness.labels[:, 0], mass.labels[:, 0]]))
    per_node = 6 if labels[:, 1].max() >= 3 else 3
    if mesh is not None:
        _check_known(numbers, mesh, stiffness.program)
        numbers = np.union1d(numbers, _wholly_held(mesh, per_node)).astype(int)
    N = per_node * len(numbers)
    at = _places(labels, numbers, per_node)
    held = np.union1d(np.setdiff1d(np.arange(N), at), _places(stiffness.labels[held_rows], numbers, per_node))
    parts = [_spread(matrix, numbers, per_node) for matrix in (mass, stiffness)]
    return _model(*parts, numbers, per_node, mesh, held, options)


def _places(labels: np.ndarray, numbers: np.ndarray, per_node: int) -> np.ndarray:
    """Coordinates of the model that rows with these labels (n, 2) are."""
    return (per_node * np.searchsorted(numbers, labels[:, 0]) + labels[:, 1]).astype(int)


def _without_held(stiffness: Matrix) -> tuple[Matrix, np.ndarray]:
    """The matrix without rows and columns of coordinates that Abaqus holds, and which they are."""
    held = np.flatnonzero(stiffness.entries.diagonal() >= HELD)
    if not held.size:
        return stiffness, held
    kept = np.ones(stiffness.entries.shape[0])
    kept[held] = 0.0
    return Matrix(sp.csr_matrix(sp.diags(kept) @ stiffness.entries @ sp.diags(kept)), stiffness.labels), held


def _used(stiffness: Matrix, mass: Matrix) -> np.ndarray:
    """Labels (n, 2) of all rows that have an entry in one of the matrices."""
    found = []
    for matrix in (stiffness, mass):
        filled = np.zeros(len(matrix.labels), dtype=bool)
        entries = sp.coo_matrix(matrix.entries)
        filled[entries.row[entries.data != 0]] = True
        found.append(matrix.labels[filled])
    labels = np.unique(np.vstack(found), axis=0)
    if not len(labels):
        raise InputError("the matrices have no entries")
    return labels


def _wholly_held(mesh: Mesh, per_node: int) -> np.ndarray:
    """Nodes of elements whose coordinates are all held: matrices may have no rows of them."""
    held = np.array(sorted({(n, k) for n, k in mesh.held if k < per_node}), dtype=int).reshape(-1, 2)
    numbers, counts = np.unique(held[:, 0], return_counts=True)
    return np.intersect1d(numbers[counts == per_node], _in_elements(mesh))


def _in_elements(mesh: Mesh) -> np.ndarray:
    return np.unique([n for elements in mesh.elements.values() for nodes in elements for n in nodes]).astype(int)


def _check_known(numbers: np.ndarray, mesh: Mesh, program: str) -> None:
    unknown = np.setdiff1d(numbers, mesh.numbers)
    if unknown.size:
        made = ". Of shells and beams CalculiX makes solids with nodes of their own, which are not read"
        raise InputError(
            f"node {unknown[0]} has rows in the matrices and no position ({unknown.size} such nodes); pass mesh=, "
            f"the file that has all nodes{made if program == 'CalculiX' else ''}"
        )


def _spread(matrix: Matrix, numbers: np.ndarray, per_node: int) -> sp.csr_matrix:
    """The entries at their places in (N, N)."""
    entries, at, N = sp.coo_matrix(matrix.entries), _places(matrix.labels, numbers, per_node), per_node * len(numbers)
    kept = entries.data != 0  # of other rows, rotations of solids, at may be wrong
    return sp.csr_matrix((entries.data[kept], (at[entries.row[kept]], at[entries.col[kept]])), shape=(N, N))


def _in_order(matrix: Matrix, mesh: Mesh) -> np.ndarray:
    """Labels (N, 2) of rows that nobody names: coordinates of the nodes in ascending order, or the free of them."""
    N, used, held = matrix.entries.shape[0], _in_elements(mesh), set(mesh.held)
    for numbers in (mesh.numbers, used):
        for per_node in (3, 6):
            labels = np.column_stack([np.repeat(numbers, per_node), np.tile(np.arange(per_node), len(numbers))])
            if len(labels) == N:
                return labels
            if held and len(free := [pair for pair in map(tuple, labels.tolist()) if pair not in held]) == N:
                return np.array(free)
    raise InputError(
        f"the matrices have {N} rows, the mesh {len(mesh.numbers)} nodes, {len(used)} of them in elements: neither 3 "
        f"nor 6 a node. {NAMES_ROWS[matrix.program]}"
    )


def _check_translations(stiffness: sp.csr_matrix) -> None:
    """Refuse a matrix without positions that lets all nodes translate if some of its terms are halved."""
    N = stiffness.shape[0]
    for per_node in (3, 6):
        if N % per_node == 0:
            translations = np.tile(np.eye(per_node, 3), (N // per_node, 1))
            if wrong := doubled(stiffness, translations):
                raise InputError(f"the stiffness matrix does not let all nodes translate: {wrong}")


def _check_rigid(model: FEModel, program: str | None) -> None:
    """Refuse matrices by which rigid motions need forces.

    program : of matrices whose rows nobody named; None: they are named, and only doubled terms are refused.
    """
    per_node = model.mass.shape[0] // len(model.positions)
    rows = _far_from_held(model, per_node)
    if not rows.size:
        return
    R = rigid_modes(model.positions)
    if per_node == 6:
        wide = np.zeros((len(model.positions), 6, 6))
        wide[:, :3], wide[:, 3:, 3:] = R.reshape(-1, 3, 6), np.eye(3)
        R = wide.reshape(-1, 6)
    strained = forces(model.stiffness, R, rows)
    if strained <= STRAINED:
        return
    need = f"rigid motions of the nodes need forces by this stiffness matrix ({strained:.1g} of its terms)"
    if wrong := doubled(model.stiffness, R, rows):
        raise InputError(f"{need}: {wrong}")
    if program is not None:
        raise InputError(
            f"{need}: its rows are not those of the nodes in ascending order, or something holds the body. "
            f"{NAMES_ROWS[program]}"
        )


def _far_from_held(model: FEModel, per_node: int) -> np.ndarray:
    """Rows of nodes that share no element with a coordinate that is held; all if none is."""
    if not len(model.held):
        return np.arange(model.mass.shape[0])
    if not model.elements:
        return np.array([], dtype=int)
    held = np.unique(model.held // per_node)
    near = [cells[np.isin(cells, held).any(axis=1)].ravel() for cells in model.elements.values()]
    inside = np.concatenate([cells.ravel() for cells in model.elements.values()])
    nodes = np.setdiff1d(inside, np.concatenate([held, *near]))
    return (per_node * nodes[:, None] + np.arange(per_node)).ravel()


def _model(mass, stiffness, numbers: np.ndarray, per_node: int, mesh: Mesh | None, held, options: dict) -> FEModel:
    if mesh is None:
        return FEModel(mass, stiffness, node_numbers=numbers, held=held, **options)
    place = {number: i for i, number in enumerate(numbers.tolist())}
    more = [per_node * place[n] + k for n, k in mesh.held if n in place and k < per_node]
    elements = {
        kind: np.array([[place[n] for n in nodes] for nodes in found])
        for kind, found in mesh.elements.items()
        if kind in NODES and all(len(nodes) == NODES[kind] and place.keys() >= set(nodes) for nodes in found)
    }
    return FEModel(
        mass,
        stiffness,
        positions=mesh.positions[np.searchsorted(mesh.numbers, numbers)],
        node_numbers=numbers,
        node_sets={name: np.array([place[n] for n in nodes if n in place], int) for name, nodes in mesh.sets.items()},
        elements=elements,
        held=np.union1d(held, np.array(more, dtype=int)),
        **options,
    )
