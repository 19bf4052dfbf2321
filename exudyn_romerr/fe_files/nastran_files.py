"""Nastran: matrices of DMIG (.pch), GRID and elements of bulk data, by pyyeti (extra [nastran])."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from .fe_data import Matrix, Mesh, imported, symmetric

TYPES = {
    "ctetra": {4: "Tet4", 10: "Tet10"},
    "chexa": {8: "Hex8", 20: "Hex20"},
    "cpenta": {6: "Wedge6"},
    "cquad4": {4: "Quad4"},
    "ctria3": {3: "Trig3"},
    "cbar": {2: "Line2"},
    "cbeam": {2: "Line2"},
}
PROGRAM = "Nastran"
HEX20 = [*range(12), *range(16, 20), *range(12, 16)]  # Nastran counts the upright edges before those on top
COUPLES = ("rbe2", "rbe3", "rbar", "mpc")


def read_nastran(path: Path, mass: str | None, stiffness: str | None) -> tuple[Matrix, Matrix, Mesh | None]:
    """Return stiffness and mass of DMIG by their names, default: the only ones that begin with k and m; its mesh.

    Raises
    ------
    InputError
        No such package, a damaged file, no or several such matrices, coordinates in local axes.
    """
    bulk, found = _bulk(path), {}
    try:
        for name, frame in (bulk.rddmig(str(path), square=True) or {}).items():
            if frame.shape[0] == frame.shape[1]:
                labels = np.array(frame.index.tolist(), dtype=int) - [0, 1]
                found[name.lower()] = Matrix(symmetric(sp.csr_matrix(frame.to_numpy())), labels, PROGRAM)
        has_grids = bulk.rdgrids(str(path)) is not None
    except Exception as error:  # damaged text makes the readers raise anything
        raise InputError(f"{path} cannot be read: {error}") from error
    pair = [_chosen(found, *asked, path) for asked in (("stiffness", stiffness, "k"), ("mass", mass, "m"))]
    return *pair, read_bulk(path) if has_grids else None


def read_bulk(path: Path) -> Mesh:
    """Return GRIDs, in the basic axes, and elements of bulk data.

    Raises
    ------
    InputError
        No such package, no GRID, coordinates in local axes (CD), constraints between nodes (RBE2, MPC, ...).
    """
    bulk = _bulk(path)
    try:
        if bulk.rdgrids(str(path)) is None:
            raise InputError(f"{path} has no GRID; pass mesh=, the bulk data with the nodes")
        for card in COUPLES:
            if bulk.rdcards(str(path), card, return_var="list", no_data_return=[]):
                raise InputError(f"{path} has {card.upper()}: constraints between nodes are not read; leave them out")
        uset, _ = bulk.bulk2uset(str(path))
        elements = _elements(bulk, path)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path} cannot be read as bulk data: {error}") from error
    # position in the row of coordinate 1 of a node, number of its axes in that of 2
    table, labels = uset[["x", "y", "z"]].to_numpy(dtype=float), np.array(uset.index.tolist(), dtype=int)
    if np.any(labels[:, 1] == 0):
        raise InputError(f"{path} has scalar points, which are no displacements; leave them out of the matrices")
    first = np.flatnonzero(labels[:, 1] == 1)
    local = labels[first[table[first + 1, 0] != 0], 0]
    if local.size:
        raise InputError(f"{path}: node {local[0]} has displacements in local axes (CD of GRID); only 0 is read")
    order = np.argsort(labels[first, 0])
    return Mesh(labels[first[order], 0], table[first[order]], elements)


def _bulk(path: Path) -> Any:
    return imported(path, "pyyeti.nastran.bulk", "pyyeti", "'exudyn-romerr[nastran]'")


def _chosen(found: dict[str, Matrix], word: str, name: str | None, letter: str, path: Path) -> Matrix:
    if name is not None:
        if str(name).lower() not in found:
            raise InputError(f"{word}={name!r} is not in {path}; it has {', '.join(found) or 'no matrix'}")
        return found[str(name).lower()]
    known = [key for key in found if key.startswith(letter)]
    if len(known) != 1:
        has = f"{len(known)} that may be it ({', '.join(known)})" if known else f"{', '.join(found) or 'none'}"
        raise InputError(
            f"{path} has no single {word} matrix among its own: {has}; pass {word}=, its name in the file"
        )
    return found[known[0]]


def _elements(bulk: Any, path: Path) -> dict[str, list]:
    found: dict[str, list] = {}
    for card, kinds in TYPES.items():
        for fields in bulk.rdcards(str(path), card, return_var="list", no_data_return=[]):
            nodes = [int(x) for x in fields[2:] if isinstance(x, int | float) and x]
            nodes = nodes[: max(kinds)] if len(kinds) == 1 else nodes
            kind = kinds.get(len(nodes))
            if kind is not None:
                found.setdefault(kind, []).append([nodes[i] for i in HEX20] if kind == "Hex20" else nodes)
    return found
