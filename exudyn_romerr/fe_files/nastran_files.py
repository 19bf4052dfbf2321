"""Nastran: matrices of DMIG in .pch, .op2 and .op4, GRID and elements of bulk data, by pyyeti (extra [nastran])."""

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


def read_nastran(
    path: Path, kind: str, mass: str | None, stiffness: str | None
) -> tuple[Matrix, Matrix, Mesh | None]:
    """Return stiffness and mass by their names in the file, default: the only ones that begin with k and m; its mesh.

    kind : "pch", "op2" or "op4".

    Raises
    ------
    InputError
        No such package, a damaged file, no or several such matrices, coordinates in local axes.
    """
    nastran = _pyyeti(path)
    try:
        found, uset = _matrices(nastran, path, kind)
    except Exception as error:  # damaged bytes make the readers raise anything
        raise InputError(f"{path} cannot be read: {error}") from error
    pair = [_chosen(found, *asked, path) for asked in (("stiffness", stiffness, "k"), ("mass", mass, "m"))]
    mesh = None
    if uset is not None:
        mesh = _mesh_of(uset, path)
    elif kind == "pch" and _has_grids(nastran, path):
        mesh = read_bulk(path)
    return *pair, mesh


def read_bulk(path: Path) -> Mesh:
    """Return GRIDs, in the basic axes, and elements of bulk data.

    Raises
    ------
    InputError
        No such package, no GRID, coordinates in local axes (CD), constraints between nodes (RBE2, MPC, ...).
    """
    bulk = _pyyeti(path).bulk
    try:
        if not _has_grids(_pyyeti(path), path):
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
    mesh = _mesh_of(uset, path)
    return Mesh(mesh.numbers, mesh.positions, elements)


def _pyyeti(path: Path) -> Any:
    names = ("pyyeti.nastran", "pyyeti.nastran.bulk", "pyyeti.nastran.op2", "pyyeti.nastran.op4")
    nastran, *_ = (imported(path, name, "pyyeti", "'exudyn-romerr[nastran]'") for name in names)
    return nastran


def _has_grids(nastran: Any, path: Path) -> bool:
    return nastran.bulk.rdgrids(str(path)) is not None


def _matrices(nastran: Any, path: Path, kind: str) -> tuple[dict[str, Matrix], Any]:
    """All square matrices by their names, in small letters; the table of coordinates, None if there is none."""
    found, uset = {}, None
    if kind in ("pch", "op2"):
        for name, frame in (nastran.bulk.rddmig(str(path), square=True) or {}).items():
            if frame.shape[0] == frame.shape[1]:
                labels = np.array(frame.index.tolist(), dtype=int)
                found[name.lower()] = Matrix(symmetric(sp.csr_matrix(frame.to_numpy())), labels - [0, 1], PROGRAM)
    if kind == "pch":
        return found, None
    tables = path if kind == "op2" else path.with_suffix(".op2")
    if tables.is_file():
        uset = _uset(nastran, tables)
    if kind == "op4":
        plain = nastran.op4.read(str(path), sparse=True)
    else:
        plain = nastran.op2.rdmats(str(path), lower=True)
    for name, matrix in plain.items():
        if matrix.ndim == 2 and matrix.shape[0] == matrix.shape[1] > 0:
            labels = None if uset is None else _labels(nastran, uset, matrix.shape[0])
            found.setdefault(name.lower(), Matrix(symmetric(sp.csr_matrix(matrix)), labels, PROGRAM))
    return found, uset


def _uset(nastran: Any, path: Path) -> Any:
    """The table of all coordinates and nodes of an .op2; None where it has none."""
    for read in (lambda: nastran.op2.OP2(str(path)).rdn2cop2(), lambda: nastran.op2.rdparampost(str(path))):
        try:
            uset = read()["uset"]
        except Exception:
            continue
        uset = uset[0] if isinstance(uset, dict) else uset
        if uset is not None and len(uset):
            return uset
    return None


def _labels(nastran: Any, uset: Any, count: int) -> np.ndarray | None:
    """(node, coordinate) of the rows of a matrix: those of the only set of coordinates of its size."""
    for name in ("g", "n", "f", "a"):
        try:
            part = uset if name == "g" else uset[nastran.n2p.mksetpv(uset, "g", name)]
        except ValueError:
            continue
        if len(part) == count:
            return np.array(part.index.tolist(), dtype=int) - [0, 1]
    return None


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


def _mesh_of(uset: Any, path: Path) -> Mesh:
    """Nodes of a table of coordinates: position in the row of coordinate 1, number of the axes in that of 2."""
    table, labels = uset[["x", "y", "z"]].to_numpy(dtype=float), np.array(uset.index.tolist(), dtype=int)
    if np.any(labels[:, 1] == 0):
        raise InputError(f"{path} has scalar points, which are no displacements; leave them out of the matrices")
    first = np.flatnonzero(labels[:, 1] == 1)
    local = labels[first[table[first + 1, 0] != 0], 0]
    if local.size:
        raise InputError(f"{path}: node {local[0]} has displacements in local axes (CD of GRID); only 0 is read")
    order = np.argsort(labels[first, 0])
    return Mesh(labels[first[order], 0], table[first[order]])


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
