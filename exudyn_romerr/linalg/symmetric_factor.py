"""Factorisations of sparse matrices, symmetric ones scaled: solves, norms, definiteness, counts of eigenvalues.

By SuperLU, or MKL's PARDISO, which needs a package of the extra `large`.
"""

from __future__ import annotations

import platform
import sys
from collections.abc import Callable
from functools import cached_property
from importlib.util import find_spec

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from .blocked_products import by_columns
from .pardiso import PardisoFactor, count_negative_pivots, enough_memory, pardiso_solve

MANY = 30_000  # coordinates whose factorisation takes longer than a user likes to wait
FEW = 5_000  # coordinates; below, supernodes do not make up for finding and building them
# A pivot that keeps less than this share of its diagonal entry is what rounding leaves of zero: the
# subtraction that made it carries about ten units of 1e-16 relative to that diagonal entry.
SINGULAR_PIVOT = 1e-14


class SymmetricFactor:
    """Factorisation of a sparse symmetric matrix that is meant to be positive definite.

    Where it breaks down nothing can be solved; `definite` tells whether half_solve and half_multiply make sense.

    Parameters
    ----------
    matrix : sparse matrix, (n, n)
        Symmetric.
    """

    def __init__(self, matrix: sp.spmatrix):
        scaled, scale = _scaled(matrix)
        self._scale = scale[:, None]
        self._factor = (PardisoFactor if solver(len(scale)) == "pardiso" else SuperLUFactor)(scaled)

    @property
    def definite(self) -> bool:
        """Whether the matrix is positive definite; without it, or close to it, smallest_pivot is what to ask."""
        return self._factor.complete and self._factor.negative_pivots == 0

    @property
    def smallest_pivot(self) -> float:
        """Smallest pivot over its diagonal entry: <= SINGULAR_PIVOT means not positive definite."""
        return self._factor.smallest_pivot

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one vector (n,) or many (n, k), which may be a sparse matrix."""
        columns = right[:, None] if right.ndim == 1 else right
        solved = by_columns(lambda part: self._factor.solve(part / self._scale) / self._scale, columns)
        return solved.reshape(right.shape)

    def half_solve(self, right: np.ndarray) -> np.ndarray:
        """Return Y (n, k) with |Y z|_2 = |right z|_{A^-1}: right in the coordinates where A^-1 is the identity.

        Norms are taken there because products with A itself lose the square of the digits that this loses.
        """
        return by_columns(lambda part: self._factor.half_solve(part / self._scale), right)

    def half_multiply(self, right: np.ndarray) -> np.ndarray:
        """Return right in the coordinates of half_solve: Y (n, k) with |Y z|_2 = |right z|_A."""
        return by_columns(lambda part: self._factor.half_multiply(part * self._scale), right)


class SubspaceFactor:
    """Solves with a definite matrix (n, n) on the span of sparse columns S (n, s)."""

    def __init__(self, matrix: sp.spmatrix, S: sp.spmatrix):
        self._S, self._factor = S, SymmetricFactor((S.T @ matrix @ S).tocsc())

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return S (S^T A S)^-1 S^T right (n, k)."""
        return self._S @ self._factor.solve(self._S.T @ right)


def negative_eigenvalues(matrix: sp.spmatrix) -> int | None:
    """Return the number of negative eigenvalues, by Sylvester's law of inertia; None if it cannot be told."""
    scaled = _scaled(matrix)[0]
    found = count_negative_pivots(scaled) if solver(matrix.shape[0]) == "pardiso" else None
    if found is not None:
        return found
    factor = SuperLUFactor(scaled)
    return factor.negative_pivots if factor.complete else None


def _scaled(matrix: sp.spmatrix) -> tuple[sp.csc_matrix, np.ndarray]:
    """Return S^-1 A S^-1 with a diagonal of +-1, and the diagonal of S.

    Units of translation and rotation no longer mix in the pivots.
    """
    matrix = sp.csc_matrix(matrix)
    scale = np.sqrt(np.abs(matrix.diagonal()))
    scale = np.where(scale > 0, scale, 1.0)
    inverse = sp.diags(1 / scale)
    return sp.csc_matrix(inverse @ matrix @ inverse), scale


def solver(n: int) -> str:
    """Return what factorises n coordinates here: "superlu" or "pardiso"."""
    return "pardiso" if n >= FEW and find_spec("pymklpardiso") else "superlu"


def faster_solver(n: int) -> str | None:
    """Return what would make the factorisation of n coordinates much faster, as a sentence; None if nothing would."""
    intel = sys.platform != "darwin" and platform.machine() in ("x86_64", "AMD64")
    if n < MANY or not intel or solver(n) == "pardiso":
        return None
    # of 55,488 coordinates: benchmarks/large_bodies.py
    return (
        f"{n} coordinates are factorised several times by SuperLU, which takes long. `pip install py-mkl-pardiso` "
        "before makes it faster (measured: 55,000 coordinates of a solid in 2.3 s in place of 17 s) and takes less "
        "memory; bounds stay the same"
    )


def solve_with(matrix: sp.spmatrix) -> Callable[[np.ndarray], np.ndarray]:
    """Return what solves with any regular matrix (n, n), real or complex, for columns (n, k) of its kind."""
    if solver(matrix.shape[0]) == "pardiso":
        return pardiso_solve(matrix)
    with enough_memory(matrix):
        return splu(sp.csc_matrix(matrix)).solve


class SuperLUFactor:
    """L D L^T without pivoting off the diagonal, coordinates eliminated by minimum degree.

    The signs of the pivots are the matrix's inertia (Sylvester), which is why no pivoting is allowed. Where the
    factorisation breaks down, `complete` is False, the pivots stay zero and nothing can be solved.
    """

    def __init__(self, matrix: sp.csc_matrix):
        try:
            with enough_memory(matrix):
                self._lu = _eliminated(matrix, "MMD_AT_PLUS_A")
        except RuntimeError:  # SuperLU: "Factor is exactly singular"; the pivots stay zero, which says so
            self.pivots = np.zeros(matrix.shape[0])

    @cached_property
    def pivots(self) -> np.ndarray:
        """Pivots (n,), which only those ask for who do not know that the matrix is definite: SciPy copies L and U."""
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            return np.zeros(self._lu.shape[0])
        with enough_memory(self._lu):
            return self._lu.U.diagonal()

    @property
    def complete(self) -> bool:
        """Whether it has not broken down."""
        return bool(np.all(self.pivots != 0))

    @property
    def negative_pivots(self) -> int:
        """Number of negative eigenvalues."""
        return int(np.sum(self.pivots < 0))

    @property
    def smallest_pivot(self) -> float:
        """Smallest pivot."""
        return float(np.min(self.pivots, initial=1.0))

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for many vectors (n, k)."""
        return self._lu.solve(np.asfortranarray(right))

    def half_solve(self, right: np.ndarray) -> np.ndarray:
        """Return Y (n, k) with |Y z|_2 = |right z|_{A^-1}."""
        return self._forward.solve(right[self._order]) / self._root

    def half_multiply(self, right: np.ndarray) -> np.ndarray:
        """Return Y (n, k) with |Y z|_2 = |right z|_A."""
        return (self._lower.T @ right[self._order]) * self._root

    @cached_property
    def _order(self) -> np.ndarray:
        return np.argsort(self._lu.perm_r)

    @cached_property
    def _lower(self) -> sp.csr_matrix:
        return self._lu.L.tocsr()

    @cached_property
    def _forward(self) -> SuperLU:
        """L as a factor of its own: SuperLU solves by blocks of columns, SciPy's triangular solver one by one."""
        return _eliminated(self._lu.L, "NATURAL")

    @cached_property
    def _root(self) -> np.ndarray:
        return np.sqrt(self.pivots)[:, None]


def _eliminated(matrix: sp.csc_matrix, order: str) -> SuperLU:
    return splu(matrix, permc_spec=order, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
