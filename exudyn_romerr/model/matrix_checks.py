"""Checks of what a body is built from: numbers and shapes, definite matrices, triangles; in words what is wrong."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..checks import check_array, check_finite, check_numbers, real_array
from ..errors import AssumptionError, InputError
from ..linalg.eigenmodes import count_below
from ..linalg.symmetric_factor import SINGULAR_PIVOT, SymmetricFactor, negative_eigenvalues

DOUBLE = float(np.finfo(float).eps)
SYMMETRY = 1e-9  # relative to the largest entry: assembled FE matrices printed with 10 digits still pass
FREE = 1e-6  # of the largest sum of terms of a row: matrices printed with 7 digits
NAMED = 8  # coordinates at most
# relative to the stiffest coordinate: above rounding (1e-16), below the elastic modes of meshed bodies
RIGID = 1e-13
# rotations of a lumped beam that are fixed make its lowest frequency 15 times as high (tests/model/test_massless.py)
CONDENSE = (
    "condense {} statically, which is exact without mass: with i their numbers and c all others, "
    "K[c, c] - K[c, i] @ solve(K[i, i], K[i, c]) and M[c, c], and of loads B[c] - K[c, i] @ solve(K[i, i], B[i]). "
    "Fixing would make the model stiffer"
)
SAME = 1e-6  # of the largest entry: files have 7 digits at least
TWICE = "twice what they should be: a triangle was added twice"
KEEP = "Keep the other: sparse.{0}(A) + sparse.{0}(A, {1}).T"


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
    """Return the relative spacing of the numbers of an array or a sparse matrix, by its type; double of all else.

    Does not cover: numbers that were in single precision, or in decimal digits, before they came as double.
    """
    kind = np.dtype(getattr(value, "dtype", float))
    return max(float(np.finfo(kind).eps), DOUBLE) if kind.kind == "f" else DOUBLE


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


def check_not_swapped(mass: sp.spmatrix, stiffness: sp.spmatrix) -> None:
    """Raise InputError if the mass lets all nodes translate for nothing, and the stiffness does not.

    Of 3 or 6 coordinates a node; bodies of other coordinates, and those that are held already, are not told apart.
    """
    for per_node in (3, 6):
        if mass.shape[0] % per_node == 0 and _is_free(mass, per_node) and not _is_free(stiffness, per_node):
            raise InputError(
                "mass and stiffness are swapped: against translations of all nodes the matrix given as mass has no "
                "inertia, as the stiffness of a free body has none, and the one given as stiffness has; pass each as "
                "the other"
            )


def _is_free(matrix: sp.spmatrix, per_node: int) -> bool:
    """Whether a matrix that is not zero takes all three translations to zero, but for rounding of its terms."""
    translations = np.zeros((matrix.shape[0], 3))
    for axis in range(3):
        translations[axis::per_node, axis] = 1.0
    terms = np.max(abs(matrix) @ translations)
    return bool(terms > 0 and np.max(np.abs(matrix @ translations)) <= FREE * terms)


def check_masses(M: sp.csc_matrix, free: np.ndarray) -> None:
    """Raise InputError unless the diagonal of M > 0; free: numbers of its coordinates."""
    massless = free[M.diagonal() <= 0]
    if massless.size:
        raise InputError(
            f"mass has no positive diagonal entry at coordinates {massless[:NAMED].tolist()}"
            f"{' ...' if massless.size > NAMED else ''} ({massless.size} in all): {CONDENSE.format('them')}"
        )


def check_mass(factor: SymmetricFactor) -> None:
    """Raise InputError unless the mass whose factor this is is positive definite."""
    if factor.smallest_pivot <= SINGULAR_PIVOT:
        raise InputError(
            "mass is not positive definite: some motion has no inertia, or a negative one; check its off-diagonal "
            f"entries, give coordinates mass, or take such a motion as a coordinate and {CONDENSE.format('it')}"
        )


def check_stiffness(
    K: sp.csc_matrix, M: sp.csc_matrix, factor: SymmetricFactor, fixed: int, precision: float
) -> None:
    """Raise AssumptionError unless K > 0; fixed: how many coordinates are; precision: spacing of K's numbers."""
    if factor.smallest_pivot > SINGULAR_PIVOT:
        return
    tiny = RIGID * np.max(np.abs(K.diagonal()) / M.diagonal()) or 1.0  # no stiffness at all: any shift
    rigid = count_below(M, K, np.sqrt(tiny))
    if precision > DOUBLE:
        raise AssumptionError(
            f"stiffness came in single precision and is not positive definite ({rigid} modes are not held or "
            "unstable): rounding to 7 digits alone may do that; pass it in double precision"
        )
    raise AssumptionError(
        f"stiffness is not positive definite with {fixed} fixed coordinates: {rigid} rigid-body "
        "(or unstable) modes are left; hold the body by fixed=... (coordinate numbers: 3 node + 0, 1, 2 for "
        "solids, not node numbers) or reference=mean_motion(nodes); a body that joints let move: "
        "floating_body(fem, items). A link so stiff that 16 digits hold nothing beside it looks the same: join what "
        "it links to one coordinate"
    )


def check_damping(D: sp.csc_matrix) -> None:
    """Raise AssumptionError unless x^T D x >= 0."""
    if not _is_dissipative(D):
        raise AssumptionError(
            "damping feeds energy in: x^T D x < 0 for some x; bounds need x^T D x >= 0: its symmetric part has "
            "negative eigenvalues, check the signs of its entries"
        )


def _is_dissipative(damping: sp.csc_matrix) -> bool:
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


def triangle_twice(matrix: sp.spmatrix) -> str:
    """Return in words that terms on one side of the diagonal are twice those on the other, and the cure; or ""."""
    lower, upper = sp.csr_matrix(sp.tril(matrix, -1)), sp.csr_matrix(sp.triu(matrix, 1).T)
    size = max(abs(lower).max(), abs(upper).max()) if matrix.shape[0] > 1 else 0.0
    if size == 0:
        return ""
    for side, more, less, keep in (("below", lower, upper, ("triu", 1)), ("above", upper, lower, ("tril", -1))):
        if abs(more - 2 * less).max() <= SAME * size:
            return f"its off-diagonal terms {side} the diagonal are {TWICE}. {KEEP.format(*keep)}"
    return ""


def forces(stiffness: sp.spmatrix, motions: np.ndarray, rows: np.ndarray | slice = slice(None)) -> float:
    """Return the forces in some rows that motions (N, m) need, relative to the size of their terms."""
    part = sp.csr_matrix(stiffness)[rows]
    terms = np.linalg.norm(abs(part) @ np.abs(motions), axis=0)
    return float(np.max(np.linalg.norm(part @ motions, axis=0) / np.where(terms > 0, terms, 1.0), initial=0.0))


def doubled(stiffness: sp.spmatrix, motions: np.ndarray, rows: np.ndarray | slice = slice(None)) -> str:
    """Return in words which terms of a stiffness matrix are twice what they should be, and the cure; or "".

    motions : (N, m), rigid. They need forces by the matrix as it is, and none with half of those terms.
    rows : those that are asked; of others something that is not in the matrix holds the body.
    """
    if forces(stiffness, motions, rows) <= SAME:
        return ""
    half = sp.diags(stiffness.diagonal() / 2)
    if forces(stiffness / 2 + half, motions, rows) <= SAME:
        return f"its off-diagonal terms are {TWICE}. Halve them: (A + sparse.diags(A.diagonal())) / 2"
    if forces(stiffness - half, motions, rows) <= SAME:
        return (
            "its diagonal terms are twice what they should be: the diagonal was added twice, with a triangle and its "
            "transpose. Halve them: A - sparse.diags(A.diagonal()) / 2"
        )
    return ""
