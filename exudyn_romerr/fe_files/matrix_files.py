"""Files with one matrix: Abaqus's .mtx in both formats, Matrix Market, scipy's .npz, .npy."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from .fe_data import Matrix, symmetric

MARKET = "%%MatrixMarket"
HELD = 1e35  # on the diagonal of a stiffness matrix: Abaqus holds a coordinate by 1e36


def read_matrix(path: str | Path) -> Matrix:
    """Return the one matrix of a file.

    Raises
    ------
    InputError
        Not one of these formats, not square, empty, or an entry that cannot be read; internal nodes of Abaqus.
    """
    path = Path(path)
    try:
        if path.suffix == ".npz":
            return Matrix(_square(sp.load_npz(path), path))
        if path.suffix == ".npy":
            return Matrix(_square(np.load(path, allow_pickle=False), path))
        return _text(path)
    except (OSError, ValueError, EOFError, KeyError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} cannot be read as a matrix: {error}") from error


def _square(matrix, path: Path) -> sp.csr_matrix:
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.shape[0]:
        raise InputError(f"{path} has a matrix of shape {matrix.shape}; needed: square")
    return symmetric(matrix)


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

        return Matrix(_square(sp.csr_matrix(mmread(path)), path))
    if columns not in (3, 5):
        raise InputError(
            f"{path} begins with {first.strip()[:60]!r}; known: Matrix Market, and what Abaqus writes with "
            "*Matrix Output, format=coordinate or matrix input"
        )
    rows = _numbers(path, columns)
    return _coordinate(rows, path) if columns == 3 else _labelled(rows, path)


def _opened(path: Path):
    opener = gzip.open if path.suffix == ".gz" else open
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
    return Matrix(_square(sp.csr_matrix((rows[:, 2], at.T), shape=size), path))


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
    return Matrix(
        _square(sp.csr_matrix((rows[:, 4], at.T), shape=size), path), np.column_stack([keys // 8, keys % 8])
    )
