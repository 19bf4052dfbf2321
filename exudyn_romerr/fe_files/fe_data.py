"""What files tell, with the numbers that they use: meshes and matrices, before they are put together."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..errors import InputError


@dataclass(frozen=True)
class Mesh:
    """A mesh by the numbers of its file.

    numbers : (nodes,), ascending. positions : (nodes, 3). elements : type -> lists of node numbers. sets : name ->
    node numbers. held : (node number, coordinate 0..5) that are held at zero.
    """

    numbers: np.ndarray
    positions: np.ndarray
    elements: dict[str, list[list[int]]] = field(default_factory=dict)
    sets: dict[str, list[int]] = field(default_factory=dict)
    held: list[tuple[int, int]] = field(default_factory=list)


@dataclass(frozen=True)
class Matrix:
    """A square matrix, and of every row node number and coordinate 0..5, (n, 2), None if the file does not tell.

    program : who wrote the file, "" if it does not tell.
    """

    entries: sp.csr_matrix
    labels: np.ndarray | None = None
    program: str = ""


def symmetric(matrix: sp.spmatrix) -> sp.csr_matrix:
    """Return the matrix; one of which the file has one triangle only, whole."""
    matrix = sp.csr_matrix(matrix)
    lower, upper = sp.tril(matrix, -1), sp.triu(matrix, 1)
    if lower.nnz and upper.nnz:
        return matrix
    return sp.csr_matrix(matrix + (lower + upper).T)


def imported(path: Path, module: str, package: str, install: str) -> Any:
    """Return a module of a package that need not be there; InputError that says how to install it."""
    try:
        return import_module(module)
    except ImportError as error:
        raise InputError(f"{path.name} needs {package}: pip install {install}") from error
