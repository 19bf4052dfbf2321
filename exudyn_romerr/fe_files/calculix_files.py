"""CalculiX: names of rows in .dof, and which program wrote an .inp that has no matrices beside it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

MATRICES = {"STIF": ".sti", "MASS": ".mas"}
WORDS = {"MASS": "mass", "STIF": "stiffness"}
COORDINATES = 6
OF_CALCULIX = re.compile(r"SOLVER *= *MATRIXSTORAGE", re.IGNORECASE)
OF_ABAQUS = re.compile(r"^\*(MATRIX GENERATE|MATRIX OUTPUT|PART|ASSEMBLY|INSTANCE)\b", re.IGNORECASE | re.MULTILINE)


def names_of_rows(path: Path, rows: int) -> np.ndarray | None:
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


def nothing_beside(path: Path, what: str) -> str:
    """Return that an .inp lacks a matrix, and how its program, both if it does not tell, writes it.

    what : "MASS" or "STIF".
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    mtx, mas, word = f"{path.stem}_{what}1.mtx", f"{path.stem}{MATRICES[what]}", WORDS[what]
    by_calculix = f"CalculiX writes with *Frequency, solver=MatrixStorage, {path.stem}.dof beside it"
    if OF_CALCULIX.search(text):
        return f"there is no {mas} beside {path.name}: the {word} matrix, which {by_calculix}"
    by_both = "" if OF_ABAQUS.search(text) else f" ({mas}, which {by_calculix}, will do, too)"
    return (
        f"there is no {mtx} beside {path.name}: the {word} matrix, which Abaqus writes after *Matrix Generate, "
        f"stiffness, mass and *Matrix Output, stiffness, mass{by_both}"
    )
