"""Files with one matrix: Abaqus's .mtx in both formats, CalculiX's, Matrix Market, Harwell-Boeing, .npz, .npy."""

from __future__ import annotations

import gzip
import re
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from .calculix_files import MATRICES as OF_CALCULIX
from .calculix_files import names_of_rows
from .fe_data import Matrix, symmetric
from .file_kind import is_packed, known_kind
from .harwell_boeing import mapping_beside, read_harwell

MARKET = "%%MatrixMarket"
BY_ABAQUS = re.compile(r".*_?(MASS|STIF)\d+\.mtx", re.IGNORECASE)  # how it calls its files
KNOWN = (
    "Matrix Market, Harwell-Boeing, .npz of scipy, .npy, lines of row, column, value (*Matrix Output, "
    "format=coordinate of Abaqus, .sti and .mas of CalculiX), and of node, coordinate, node, coordinate, value "
    "(format=matrix input)"
)
HELD = 1e35  # on the diagonal of a stiffness matrix: Abaqus holds a coordinate by 1e36


def read_matrix(path: str | Path, name: str = "path") -> Matrix:
    """Return the one matrix of a file; name: of the argument, for messages.

    Raises
    ------
    InputError
        Not one of these formats, reduced already, not square, empty, or an entry that cannot be read; internal nodes
        of Abaqus.
    """
    path = Path(path)
    kind = known_kind(name, path, KNOWN)
    try:
        if kind == "npz":
            return Matrix(_square(sp.load_npz(path), path))
        if kind == "npy":
            return Matrix(_square(np.load(path, allow_pickle=False), path))
        if kind == "harwell":
            return _harwell(path)
        return _text(path)
    except (OSError, ValueError, EOFError, KeyError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} cannot be read as a matrix: {error}") from error


def _square(matrix, path: Path) -> sp.csr_matrix:
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.shape[0]:
        raise InputError(f"{path} has a matrix of shape {matrix.shape}; needed: square")
    return symmetric(matrix)


def _harwell(path: Path) -> Matrix:
    matrix, labels = _square(read_harwell(path), path), mapping_beside(path)
    if labels is not None and len(labels) != matrix.shape[0]:
        raise InputError(f"{path} has {matrix.shape[0]} rows, its .mapping names {len(labels)}")
    return Matrix(matrix, labels, "HBMAT")


def _text(path: Path) -> Matrix:
    first, columns = "", 0
    with _opened(path) as stream:
        for first in stream:
            if first.startswith(MARKET):
                break
            if first.strip() and not first.startswith("*"):
                columns = len(first.replace(",", " ").split())
                break
    if first.startswith(MARKET):
        from scipy.io import mmread  # here, for few need it

        with gzip.open(path) if is_packed(path) else open(path, "rb") as stream:
            return Matrix(_square(sp.csr_matrix(mmread(stream)), path))
    if columns not in (3, 5):
        raise InputError(f"{path} begins with {first.strip()[:60]!r}; known: {KNOWN}")
    rows = _numbers(path, columns)
    return _coordinate(rows, path) if columns == 3 else _labelled(rows, path)


def _opened(path: Path):
    opener = gzip.open if is_packed(path) else open
    return opener(path, "rt", encoding="ascii", errors="replace")


def _numbers(path: Path, columns: int) -> np.ndarray:
    """All numbers of a text, (lines, columns)."""
    with _opened(path) as stream:
        rows = np.loadtxt(stream, comments="*", delimiter="," if columns == 5 else None, ndmin=2)
    if rows.shape[1] != columns:
        raise ValueError(f"{rows.shape[1]} numbers a line, {columns} in the first")
    return rows


def _coordinate(rows: np.ndarray, path: Path) -> Matrix:
    """Lines of row, column, value, counted from 1."""
    at = rows[:, :2].astype(int) - 1
    if at.min(initial=0) < 0:
        raise InputError(f"{path} has a row or column {at.min() + 1}; they are counted from 1")
    size = 2 * (int(at.max(initial=-1)) + 1,)
    matrix = _square(sp.csr_matrix((rows[:, 2], at.T), shape=size), path)
    labels = names_of_rows(path, matrix.shape[0])
    if labels is not None or path.suffix.lower() in OF_CALCULIX.values():
        return Matrix(matrix, labels, "CalculiX")
    return Matrix(matrix, program="Abaqus" if BY_ABAQUS.fullmatch(path.name) else "")


def _labelled(rows: np.ndarray, path: Path) -> Matrix:
    """Lines of node, coordinate, node, coordinate, value; coordinates from 1."""
    ends = rows[:, :4].astype(int).reshape(-1, 2, 2)
    if ends[:, :, 0].min(initial=1) < 1:
        raise InputError(
            f"{path} has internal nodes of Abaqus (negative numbers), as elements like B33 or hybrid ones have: "
            "coordinates that no node of the mesh has are not read; take elements without"
        )
    if ends[:, :, 1].max(initial=1) > 6:
        raise InputError(f"{path} has coordinate {ends[:, :, 1].max()} of a node; displacements are 1 to 6")
    # one number for both, which sorts far faster than pairs
    keys, at = np.unique(8 * ends[:, :, 0] + ends[:, :, 1] - 1, return_inverse=True)
    at, size = at.reshape(-1, 2), (len(keys), len(keys))
    matrix = _square(sp.csr_matrix((rows[:, 4], at.T), shape=size), path)
    return Matrix(matrix, np.column_stack([keys // 8, keys % 8]), "Abaqus")
