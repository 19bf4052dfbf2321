"""Which kind of file it is: by what it begins with, and only where that does not tell by its ending."""

from __future__ import annotations

import gzip
import os
import re
from pathlib import Path
from typing import Any

from ..errors import InputError

HEAD = 1 << 16  # bytes that are looked at
ENDINGS = {
    ".inp": "deck",
    ".pkl": "exudyn",
    **dict.fromkeys((".mtx", ".gz", ".sti", ".mas"), "matrix"),
    **dict.fromkeys((".bdf", ".dat", ".nas", ".blk"), "bulk"),
    **dict.fromkeys((".op2", ".op4"), "output"),
    **{f".{kind}": kind for kind in ("npz", "npy", "full", "cdb", "rst", "pch")},
}
MATRICES = ("matrix", "harwell", "npz", "npy")
MESHES = ("deck", "cdb", "rst", "bulk")
KNOWN_MESHES = ".inp, .cdb and .rst, and Nastran's bulk data (.bdf, .dat, .nas, .blk)"
KNOWN = (
    ".inp and .mtx of Abaqus; .inp, .sti and .mas of CalculiX; .full of Ansys; .pch of Nastran (DMIG); Matrix "
    "Market; Harwell-Boeing (HBMAT of Ansys); .npz and .npy of one matrix; .npz of FEModel.save"
)
OF_EXUDYN = (
    "{} is what FEMinterface.SaveToFile writes, which Exudyn reads: fem.LoadFromFile. Then pass the fem: "
    "floating_body(fem, items), ElasticBody.from_fem(fem)"
)
REFUSED = {
    "substructure": (
        "{} is a substructure of Abaqus, reduced already: the error of that cannot be told from it. Let "
        "Abaqus write the matrices of the whole body, in place of *Substructure Generate: *Matrix Generate, "
        "stiffness, mass and *Matrix Output, stiffness, mass, format=matrix input"
    ),
    "exudyn": OF_EXUDYN,
    "output": (
        "{} is an output file of Nastran, of which matrices are not read; let it write them as DMIG to a .pch "
        "(PARAM,EXTOUT,DMIGPCH)"
    ),
}
ANSYS = b"\x64\0\0\0\0\0\0\x80"  # 100 words in the first record; then the number of the kind
BINARY = (
    (b"\x93NUMPY", "npy"),
    (b"PK\x03\x04", "npz"),
    (b"\x89HDF\r\n", "exudyn"),
    (ANSYS + b"\x04\0\0\0", "full"),
    (ANSYS + b"\x0c\0\0\0", "rst"),
)
KEYWORDS = r"\*(HEADING|NODE|ELEMENT|PART|ASSEMBLY|INSTANCE|INCLUDE|NSET|ELSET|MATERIAL|STEP|PREPRINT|PARAMETER)\b"
# how the first line begins that tells it, in small or capital letters. *KEYWORD: LS-DYNA, which has *NODE, too
LINES = (
    (r"%%MatrixMarket", "matrix"),
    (r"\*KEYWORD\b", ""),
    (r"\*USER ELEMENT\b|\*MATRIX *, *TYPE *=", "substructure"),
    (KEYWORDS, "deck"),
    (r"/COM, *ANSYS|NBLOCK *,", "cdb"),
    (r"DMIG\*?[ ,\t]", "pch"),
    (r"GRID\*?[ ,\t]|BEGIN +BULK|CEND\b|SOL +\d", "bulk"),
    (r" *\d+ +-?\d+ +\d+ +\d+\w+ +1P,? *\d+E\d+\.\d+", "output"),
)


def kind_of(path: Path) -> str:
    """Return "deck", "matrix", "harwell", "npz", ..., or "" if neither content nor ending is known."""
    head = _head(path)
    for start, kind in BINARY:
        if head.startswith(start):
            return kind
    lines = [] if b"\0" in head else head.decode("ascii", errors="replace").splitlines()
    found = (kind for line in lines for pattern, kind in LINES if re.match(pattern, line, re.IGNORECASE))
    told = "harwell" if _is_harwell(lines) else next(found, "")
    ending = ENDINGS.get(path.suffix.lower(), "")
    if told == "bulk" and ending == "pch":  # nodes before the matrices
        return ending
    return told or ending or ("matrix" if _is_table(lines) else "")


def known_kind(name: str, path: Path, kinds: str = KNOWN) -> str:
    """Return kind_of(path); InputError that names the argument if it is not known, or one that is never read."""
    kind = kind_of(path)
    if kind in REFUSED:
        raise InputError(REFUSED[kind].format(path))
    if not kind:
        raise not_known(name, path, kinds)
    return kind


def not_known(name: str, path: Path, kinds: str) -> InputError:
    """Return the error of a file that is none of some kinds."""
    begins = _head(path)[:40].decode("ascii", errors="replace").split("\n")[0].strip()
    return InputError(
        f"{name}={os.fspath(path)!r}: known are {kinds}; files that end in {path.suffix!r} are not known, and no "
        f"more is what it begins with, {begins!r}"
    )


def opened(path: Path, mode: str = "rb", **options: Any) -> Any:
    """Return the file, open to be read; unpacked if it is a gzip file."""
    with open(path, "rb") as stream:
        is_packed = stream.read(2) == b"\x1f\x8b"
    return (gzip.open if is_packed else open)(path, mode, **options)


def _head(path: Path) -> bytes:
    try:
        with opened(path) as stream:
            return stream.read(HEAD)
    except (OSError, EOFError):  # damaged: said where it is read
        return b""


def _is_harwell(lines: list[str]) -> bool:
    """Whether line 3 has the kind of the matrix, line 4 formats of Fortran."""
    return (
        len(lines) > 4
        and re.match(r"[RCIPQ][SUHZR][AE] ", lines[2], re.IGNORECASE) is not None
        and re.match(r" *\(\w+\) *\(\w+\)", lines[3]) is not None
    )


def _is_table(lines: list[str]) -> bool:
    """Whether the first lines are row, column, value, or node, coordinate, node, coordinate, value."""
    found = [line.replace(",", " ").split() for line in lines if line.strip() and not line.startswith("*")][:3]
    whole = re.compile(r"\d+")
    return bool(found) and all(len(x) in (3, 5) and all(whole.fullmatch(y) for y in x[:-1]) for x in found)
