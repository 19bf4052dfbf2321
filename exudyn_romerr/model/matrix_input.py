"""Checks of what ElasticBody is built from: matrices, coordinate numbers, damping factors, node positions."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from ..checks import check_array, check_finite, check_numbers, real_array
from ..errors import AssumptionError, InputError
from ..linalg.symmetric_factor import negative_eigenvalues
from .triangles import triangle_twice

if TYPE_CHECKING:
    from collections.abc import Sequence

DOUBLE, SINGLE = float(np.finfo(float).eps), float(np.finfo(np.float32).eps)
WITH_DATA = ("csc", "csr", "coo", "bsr")  # formats of sparse matrices whose numbers are in one array
BITS_OF_SINGLE = 24
SHORT = 20  # bits: what has no more of them may be a number that somebody chose
ENOUGH_TO_TELL = 10  # sizes of numbers: fewer may be chosen. A regular mesh has 20, however many elements it has
SYMMETRY = 1e-9  # relative to the largest entry: assembled FE matrices printed with 10 digits still pass


def checked_matrix(name: str, matrix: Any, size: int | None, symmetric: bool = True) -> sp.csc_matrix:
    if matrix is None or isinstance(matrix, str):
        raise InputError(f"{name}={matrix!r}; needed: a matrix (N, N) of real numbers, scipy.sparse or ndarray")
    try:
        matrix = sp.csc_matrix(matrix)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is not a real matrix: {error}") from error
    matrix = sp.csc_matrix((real_array(name, matrix.data), matrix.indices, matrix.indptr), shape=matrix.shape)
    if matrix.shape[0] != matrix.shape[1] or matrix.shape[0] == 0 or size not in (None, matrix.shape[0]):
        raise InputError(f"{name} has shape {matrix.shape}; needed: square" + (f", {size} rows" if size else ""))
    check_finite(name, matrix.data)
    if symmetric and abs(matrix - matrix.T).max() > SYMMETRY * abs(matrix).max():
        why = triangle_twice(matrix) or f"entries differ by {abs(matrix - matrix.T).max():.2e}"
        raise InputError(f"{name} is not symmetric: {why}")
    return sp.csc_matrix((matrix + matrix.T) / 2) if symmetric else matrix


def precision(value: Any) -> float:
    """Return the relative spacing of the numbers of an array, told by its type and by the numbers themselves.

    Parameters
    ----------
    value : ndarray, scipy.sparse matrix, list, or anything else

    Returns
    -------
    float
        1.2e-7 of single precision, whatever type that was passed on as; 2.2e-16 of all else.

    Notes
    -----
    Does not cover: numbers that were rounded to some decimal digits, as in texts, and never were in single precision.
    """
    if sp.issparse(value):
        numbers = (value if value.format in WITH_DATA else value.tocsc()).data
    else:
        try:
            numbers = np.asarray(value)
        except ValueError:  # rows of different lengths: told where they are read
            return DOUBLE
    if numbers.dtype.kind != "f":
        return DOUBLE
    given = max(float(np.finfo(numbers.dtype).eps), DOUBLE)
    return SINGLE if given < SINGLE and _went_through_single(numbers.ravel()) else given


def _went_through_single(numbers: np.ndarray) -> bool:
    """Whether most of the numbers, each size counted once, are rounded to 24 bits.

    Few numbers, or short ones such as 0.5 and 2000, are exact in single precision and tell nothing. Of others one in
    2^29 happens to be so: what was added in double precision since, such as springs, does not hide what others show.
    """
    sizes = np.abs(numbers[np.isfinite(numbers)])
    with np.errstate(over="ignore"):
        exact = np.unique(sizes[sizes == sizes.astype(np.float32)])
    mantissa = np.ldexp(np.frexp(exact)[0], BITS_OF_SINGLE)
    rounded = np.count_nonzero(mantissa % 2.0 ** (BITS_OF_SINGLE - SHORT))
    return rounded >= ENOUGH_TO_TELL and 2 * rounded >= np.unique(sizes).size


def checked_inputs(inputs: Any, size: int) -> np.ndarray | sp.csc_matrix:
    """Return the input matrix B (size, p); one column may come as a vector, None means no inputs.

    Sparse ones, of which many columns are taken, stay sparse.
    """
    if inputs is None:
        return np.zeros((size, 0))
    if (
        sp.issparse(inputs)
        and inputs.shape[0] == size
        and inputs.dtype.kind == "f"
        and np.isfinite(inputs.data).all()
    ):
        return sp.csc_matrix(inputs, dtype=float)
    B = real_array("inputs", inputs)
    return check_array("inputs", B[:, None] if B.ndim == 1 else B, (size, None))


def checked_dofs(fixed: Sequence[int], size: int) -> np.ndarray:
    if isinstance(fixed, str) or not isinstance(fixed, Iterable):
        raise InputError(f"fixed={fixed!r}; needed: a sequence of coordinate numbers 0..{size - 1}")
    dofs = np.unique(check_numbers("fixed", list(fixed)))
    wrong = dofs[(dofs < 0) | (dofs >= size) | (dofs != np.round(dofs))]
    if wrong.size:
        raise InputError(f"fixed contains {wrong[0]:g}; allowed: coordinate numbers 0..{size - 1}")
    return dofs.astype(int)


def checked_rayleigh(rayleigh: Sequence[float] | None) -> tuple[float, float]:
    alpha, beta = check_array("rayleigh", (0.0, 0.0) if rayleigh is None else rayleigh, (2,))
    if alpha < 0 or beta < 0:
        raise AssumptionError(f"rayleigh=({alpha:g}, {beta:g}) feeds energy in; alpha and beta must be >= 0")
    return float(alpha), float(beta)


def checked_ratios(ratios: Any, size: int, warns: bool = True) -> np.ndarray:
    """Damping ratios of the lowest modes (k,), or of all (); warns=False: they will be checked again."""
    ratios = check_array("modal_damping", ratios, () if np.ndim(ratios) == 0 else (None,))
    if ratios.ndim and not 1 <= ratios.size <= size:
        raise InputError(f"modal_damping has {ratios.size} ratios; allowed: 1..{size} (modes), or a number for all")
    if np.any(ratios < 0):
        raise AssumptionError(f"modal_damping has a ratio {ratios.min():g}: it feeds energy in; ratios must be >= 0")
    if warns and np.any(ratios > 1):
        warnings.warn(
            f"modal_damping has a ratio {ratios.max():g}: above 1 a mode does not ring at all. Ratios are no "
            "percentages: 2 % is 0.02",
            stacklevel=3,
        )
    return ratios


def checked_positions(positions: Any, size: int) -> np.ndarray | None:
    if positions is None:
        return None
    positions = check_array("positions", positions, (None, 3))
    if size not in (3 * len(positions), 6 * len(positions)):
        raise InputError(
            f"positions lists {len(positions)} nodes for N = {size} coordinates; needed: 3 or 6 coordinates a node"
        )
    return positions


def is_dissipative(damping: sp.csc_matrix) -> bool:
    symmetric = sp.csc_matrix((damping + damping.T) / 2)
    diagonal = symmetric.diagonal()
    active = np.flatnonzero(diagonal > 0)
    idle = np.flatnonzero(diagonal <= 0)
    # a semidefinite matrix with a zero diagonal entry has a zero row there
    if abs(symmetric[idle]).sum() > 0:
        return False
    if active.size == 0:
        return True
    block = symmetric[active][:, active]
    # semidefinite is allowed: 1e-10 of the diagonal keeps rounding of zero eigenvalues from counting as negative
    lifted = block + 1e-10 * sp.diags(diagonal[active])
    negative = negative_eigenvalues(lifted)
    if negative is not None:
        return negative == 0
    return bool(np.linalg.eigvalsh(lifted.toarray())[0] >= 0)  # rare: a pivot of exactly zero
