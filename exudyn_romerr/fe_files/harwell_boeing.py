"""Harwell-Boeing files, as HBMAT of Ansys writes them, and the .mapping of their rows beside them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from ..errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

DIRECTIONS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
ROW = re.compile(r"\s*(\d+)\s+(\d+)\s+([A-Z]+)\s*", re.IGNORECASE)  # number of the row, node, direction


def read_harwell(path: Path) -> sp.csc_matrix:
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
        parts.append(_numbers(lines[at : at + count], form, size, path))
        at += count
    pointers, indices, values = parts
    return sp.csc_matrix((values, indices.astype(int) - 1, pointers.astype(int) - 1), shape=(rows, columns))


def mapping_beside(path: Path) -> np.ndarray | None:
    """Return (node, coordinate) of the rows, (n, 2), of the .mapping of that name; None if there is none."""
    for ending in (".mapping", ".MAPPING"):
        other = path.with_suffix(ending)
        if other.is_file():
            return _mapping(other)
    return None


def _mapping(path: Path) -> np.ndarray:
    lines = path.read_text(encoding="ascii", errors="replace").splitlines()
    found = [match.groups() for line in lines if (match := ROW.fullmatch(line))]
    unknown = [name for *_, name in found if name.upper() not in DIRECTIONS]
    if unknown or not found:
        raise InputError(f"{path} names {unknown[0] if unknown else 'no row'}; known are {', '.join(DIRECTIONS)}")
    rows = np.array([[int(row), int(node), DIRECTIONS.index(name.upper())] for row, node, name in found])
    return rows[np.argsort(rows[:, 0]), 1:]


def _numbers(lines: list[str], form: str, size: int, path: Path) -> np.ndarray:
    """All numbers of some lines of a format such as 16I5 or 1P,3D25.16: between spaces, else of its width."""
    text = [line.upper().replace("D", "E") for line in lines]
    words = " ".join(text).split()
    if len(words) != size and (width := re.search(r"[IEDFG](\d+)", form.upper())):
        step = int(width[1])
        words = [line[i : i + step] for line in text for i in range(0, len(line.rstrip()), step)]
    if len(words) != size:
        raise InputError(f"{path} has {len(words)} numbers where its header promises {size}: it is damaged")
    return np.array(words, dtype=float)
