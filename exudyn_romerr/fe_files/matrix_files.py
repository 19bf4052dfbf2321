"""Files with one matrix: Abaqus's .mtx in both formats, CalculiX's, Matrix Market, Harwell-Boeing, .npz, .npy."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from .fe_data import Matrix, symmetric
from .file_kind import known_kind, opened

MARKET = "%%MatrixMarket"
BY_ABAQUS = re.compile(r".*_?(MASS|STIF)\d+\.mtx", re.IGNORECASE)  # how it calls its files
KNOWN = (
    "Matrix Market, Harwell-Boeing, .npz of scipy, .npy, lines of row, column, value (*Matrix Output, "
    "format=coordinate of Abaqus, .sti and .mas of CalculiX), and of node, coordinate, node, coordinate, value "
    "(format=matrix input)"
)
OF_CALCULIX = {"stiffness": ".sti", "mass": ".mas"}
COORDINATES = 6
DIRECTIONS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
ROW = re.compile(r"\s*(\d+)\s+(\d+)\s+([A-Z]+)\s*", re.IGNORECASE)  # number of the row, node, direction
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
    matrix, labels = _square(_read_harwell(path), path), _mapping_beside(path)
    if labels is not None and len(labels) != matrix.shape[0]:
        raise InputError(f"{path} has {matrix.shape[0]} rows, its .mapping names {len(labels)}")
    return Matrix(matrix, labels, "HBMAT")


def _text(path: Path) -> Matrix:
    first, columns = "", 0
    with opened(path, "rt", encoding="ascii", errors="replace") as stream:
        for first in stream:
            if first.startswith(MARKET):
                break
            if first.strip() and not first.startswith("*"):
                columns = len(first.replace(",", " ").split())
                break
    if first.startswith(MARKET):
        from scipy.io import mmread  # here, for few need it

        with opened(path) as stream:
            return Matrix(_square(sp.csr_matrix(mmread(stream)), path))
    if columns not in (3, 5):
        raise InputError(f"{path} begins with {first.strip()[:60]!r}; known: {KNOWN}")
    rows = _numbers(path, columns)
    return _coordinate(rows, path) if columns == 3 else _labelled(rows, path)


def _numbers(path: Path, columns: int) -> np.ndarray:
    """All numbers of a text, (lines, columns)."""
    with opened(path, "rt", encoding="ascii", errors="replace") as stream:
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
    labels = _names_of_rows(path, matrix.shape[0])
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


def _names_of_rows(path: Path, rows: int) -> np.ndarray | None:
    """Return (node, coordinate) of the rows, (n, 2), of the .dof beside a matrix; None if there is none.

    Raises
    ------
    InputError
        Another number of names than rows, a line that is not node.direction, directions that are no displacements.
    """
    other = path.with_suffix(".dof")
    if not other.is_file():
        return None
    words = other.read_text(encoding="ascii", errors="replace").split()
    wrong = next((word for word in words if not re.fullmatch(rf"\d+\.[1-{COORDINATES}]", word)), None)
    if wrong is not None:
        raise InputError(f"{other} has {wrong!r}; needed: node.direction, of displacements (1, 2, 3)")
    if len(words) != rows:
        raise InputError(f"{other} names {len(words)} rows, {path} has {rows}: they are not of one run of CalculiX")
    pairs = np.array([word.split(".") for word in words], dtype=int)
    return pairs - [0, 1]


def _read_harwell(path: Path) -> sp.csc_matrix:
    """Return the matrix as the file has it, one triangle if it says that it is symmetric.

    scipy.io.hb_read refuses symmetric ones, right-hand sides and exponents with D: all that Ansys writes.

    Raises
    ------
    InputError
        A matrix that is not real, not assembled, or of which lines are missing.
    """
    lines = path.read_text(encoding="ascii", errors="replace").splitlines()
    kind = lines[2][:3].upper()
    if kind not in ("RSA", "RUA", "ISA", "IUA"):
        raise InputError(f"{path} has a Harwell-Boeing matrix of type {kind}; known: real and assembled, RSA and RUA")
    counts = [int(x) for x in lines[1].split()]
    rows, columns, entries = (int(x) for x in lines[2][3:].split()[:3])
    formats = re.findall(r"\(([^)]*)\)", lines[3])
    at, parts = 5 if len(counts) > 4 and counts[4] else 4, []
    for count, form, size in zip(counts[1:4], formats, (columns + 1, entries, entries), strict=False):
        parts.append(_fixed_numbers(lines[at : at + count], form, size, path))
        at += count
    pointers, indices, values = parts
    return sp.csc_matrix((values, indices.astype(int) - 1, pointers.astype(int) - 1), shape=(rows, columns))


def _mapping_beside(path: Path) -> np.ndarray | None:
    """(node, coordinate) of the rows, (n, 2), of the .mapping of that name; None if there is none."""
    beside = (path.with_suffix(ending) for ending in (".mapping", ".MAPPING"))
    other = next((other for other in beside if other.is_file()), None)
    if other is None:
        return None
    lines = other.read_text(encoding="ascii", errors="replace").splitlines()
    found = [match.groups() for line in lines if (match := ROW.fullmatch(line))]
    unknown = [name for *_, name in found if name.upper() not in DIRECTIONS]
    if unknown or not found:
        raise InputError(f"{other} names {unknown[0] if unknown else 'no row'}; known are {', '.join(DIRECTIONS)}")
    rows = np.array([[int(row), int(node), DIRECTIONS.index(name.upper())] for row, node, name in found])
    return rows[np.argsort(rows[:, 0]), 1:]


def _fixed_numbers(lines: list[str], form: str, size: int, path: Path) -> np.ndarray:
    """All numbers of some lines of a format such as 16I5 or 1P,3D25.16: between spaces, else of its width."""
    text = [line.upper().replace("D", "E") for line in lines]
    words = " ".join(text).split()
    if len(words) != size and (width := re.search(r"[IEDFG](\d+)", form.upper())):
        step = int(width[1])
        words = [line[i : i + step] for line in text for i in range(0, len(line.rstrip()), step)]
    if len(words) != size:
        raise InputError(f"{path} has {len(words)} numbers where its header promises {size}: it is damaged")
    return np.array(words, dtype=float)
