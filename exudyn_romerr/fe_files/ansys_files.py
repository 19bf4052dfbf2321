"""Ansys: matrices of .full, nodes and elements of .cdb and .rst, by ansys-mapdl-reader (extra [ansys])."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..model.solid_elements import NODES
from .fe_data import Matrix, Mesh, imported, symmetric

WORD = 4  # bytes, that a file is counted in
FIELDS = 10  # of an element before its nodes
# by the number of the element; those with a corner more than once are of other shapes, and only drawn: left out
TYPES = {
    45: "Hex8",
    92: "Tet10",
    95: "Hex20",
    181: "Quad4",
    185: "Hex8",
    186: "Hex20",
    187: "Tet10",
    188: "Line2",
    285: "Tet4",
}


def read_full(path: Path) -> tuple[Matrix, Matrix]:
    """Return stiffness and mass; constrained coordinates have no entries.

    Raises
    ------
    InputError
        No such package, a damaged file, lumped mass or unsymmetric matrices, constraint equations, a matrix that is
        not in the file, coordinates that are no displacements.
    """
    reader = _reader(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a matrix that is not there: said below
            full = reader.read_binary(str(path))
            if path.stat().st_size < WORD * full._header["ptrEND"]:  # the reader would crash the process
                raise EOFError("it is truncated")
            labels, *matrices = full.load_km(sort=True)
    except NotImplementedError as error:
        raise InputError(
            f"{path}: {error}; write it with a consistent mass matrix (LUMPM, OFF), symmetric"
        ) from error
    except Exception as error:  # damaged bytes make a reader in C raise anything
        raise InputError(f"{path} cannot be read as a .full file: {error}") from error
    if count := full._header.get("ncefull", 0):
        raise InputError(f"{path} has {count} constraint equations (CE, CP, RBE3), which are not read")
    for name, matrix in zip(("stiffness", "mass"), matrices, strict=True):
        if matrix is None or not np.count_nonzero(abs(matrix).sum()):
            raise InputError(f"{path} has no {name} matrix; a modal analysis (ANTYPE, MODAL with WRFULL) writes both")
    if labels[:, 1].max() > 5:
        raise InputError(
            f"{path} has coordinates that are no displacements or rotations (number {labels[:, 1].max()})"
        )
    return tuple(Matrix(symmetric(matrix), labels.astype(int), "Ansys") for matrix in matrices)


def read_ansys_mesh(path: Path, archive: bool) -> Mesh:
    """Return nodes, elements and node components of a .cdb (archive) or .rst.

    Raises
    ------
    InputError
        No such package, a damaged file, nodes that have axes of their own (NROTAT).
    """
    reader = _reader(path)
    try:
        found: Any = reader.Archive(str(path), parse_vtk=False) if archive else reader.read_binary(str(path)).mesh
        order = np.argsort(found.nnum)
        angles = np.asarray(found.node_angles if archive else found._node_angles)
    except Exception as error:
        raise InputError(f"{path} cannot be read as a mesh of Ansys: {error}") from error
    if angles.size and np.any(angles):
        raise InputError(f"{path}: nodes have axes of their own (NROTAT), which are not read; turn them back")
    kinds = dict(found.ekey[:, :2].tolist())
    elements: dict[str, list] = {}
    for element in found.elem:
        kind = TYPES.get(kinds[int(element[1])])
        nodes = [int(n) for n in element[FIELDS:]][: NODES.get(kind, 0)]
        if kind is not None and len(set(nodes)) == NODES[kind]:
            elements.setdefault(kind, []).append(nodes)
    sets = {name: [int(n) for n in nodes] for name, nodes in found.node_components.items()}
    return Mesh(found.nnum[order].astype(int), found.nodes[order, :3].astype(float), elements, sets)


def _reader(path: Path) -> Any:
    return imported(path, "ansys.mapdl.reader", "ansys-mapdl-reader", "'exudyn-romerr[ansys]'")
