"""Sparse symmetric factorisation of scaled coordinates: solves, norms, definiteness, and counts of eigenvalues."""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from .blocked_products import by_columns
from .factorisations import FEW, Factor, count_negative, factorised

# A pivot that keeps less than this share of its diagonal entry is what rounding leaves of zero: the
# subtraction that made it carries about ten units of 1e-16 relative to that diagonal entry.
SINGULAR_PIVOT = 1e-14
SAME = 4 * np.finfo(float).eps  # of a diagonal of 1
LIFT = 1e-12  # of the diagonal, added to a singular matrix so that it can be factorised
ITERATIONS = 4  # of the inverse power method: a null vector grows by 1e12 in each


class SymmetricFactor:
    """Factorisation of a sparse symmetric matrix that is meant to be positive definite.

    Where it breaks down, `complete` is False and nothing can be solved; `definite` tells whether half_solve and
    half_multiply make sense. factorisations.py chooses what factorises.

    Parameters
    ----------
    matrix : sparse matrix, (n, n)
        Symmetric.
    """

    def __init__(self, matrix: sp.spmatrix):
        scaled, self._scale = _scaled(matrix)
        third = _third(scaled) if len(self._scale) >= FEW else None
        self._factor = factorised(scaled) if third is None else _Thrice(factorised(third))

    @property
    def complete(self) -> bool:
        """Whether anything can be solved."""
        return self._factor.complete

    @property
    def definite(self) -> bool:
        """Whether the matrix is positive definite; without it, or close to it, smallest_pivot is what to ask."""
        return self.complete and self._factor.negative_pivots == 0

    @property
    def smallest_pivot(self) -> float:
        """Smallest pivot over its diagonal entry: <= SINGULAR_PIVOT means not positive definite."""
        return self._factor.smallest_pivot

    @property
    def order(self) -> np.ndarray | None:
        """Coordinates in the order of their elimination, (n,); None if it is not known."""
        return self._factor.order

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one vector (n,) or many (n, k), which may be a sparse matrix."""
        if right.ndim == 1:
            return self._factor.solve(right / self._scale) / self._scale
        scale = self._scale[:, None]
        return by_columns(lambda part: self._factor.solve(part / scale) / scale, right)

    def half_solve(self, right: np.ndarray) -> np.ndarray:
        """Return Y (n, k) with |Y z|_2 = |right z|_{A^-1}: right in the coordinates where A^-1 is the identity.

        Norms are taken there because products with A itself lose the square of the digits that this loses.
        """
        scale = self._scale[:, None]
        return by_columns(lambda part: self._factor.half_solve(part / scale), right)

    def half_multiply(self, right: np.ndarray) -> np.ndarray:
        """Return right in the coordinates of half_solve: Y (n, k) with |Y z|_2 = |right z|_A."""
        scale = self._scale[:, None]
        return by_columns(lambda part: self._factor.half_multiply(part * scale), right)


class _Thrice:
    """The factorisation of A (n/3, n/3) as one of A (x) I3 (n, n), as the mass of solid elements is."""

    order = None  # nobody asks for it

    def __init__(self, factor: Factor):
        self._factor = factor
        self.complete, self.negative_pivots = factor.complete, 3 * factor.negative_pivots

    @property
    def smallest_pivot(self) -> float:
        return self._factor.smallest_pivot

    def solve(self, right: np.ndarray) -> np.ndarray:
        return self._of_all(self._factor.solve, right)

    def half_solve(self, right: np.ndarray) -> np.ndarray:
        return self._of_all(self._factor.half_solve, right)

    def half_multiply(self, right: np.ndarray) -> np.ndarray:
        return self._of_all(self._factor.half_multiply, right)

    def _of_all(self, function: Callable[[np.ndarray], np.ndarray], right: np.ndarray) -> np.ndarray:
        return function(right.reshape(len(right) // 3, -1)).reshape(right.shape)


def _third(matrix: sp.csc_matrix) -> sp.csc_matrix | None:
    """Return A of a matrix A (x) I3, equal but for rounding; None if it is no such matrix."""
    n = matrix.shape[0]
    if n % 3:
        return None
    parts = [matrix[i::3][:, i::3] for i in range(3)]
    if sum(part.nnz for part in parts) < np.count_nonzero(matrix.data):
        return None
    same = max(abs(part - parts[0]).max() for part in parts[1:]) <= SAME
    return sp.csc_matrix(parts[0]) if same else None


class SubspaceFactor:
    """Solves with a definite matrix (n, n) on the span of sparse columns S (n, s)."""

    def __init__(self, matrix: sp.spmatrix, S: sp.spmatrix):
        self._S, self._factor = S, SymmetricFactor((S.T @ matrix @ S).tocsc())

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return S (S^T A S)^-1 S^T right (n, k)."""
        return self._S @ self._factor.solve(self._S.T @ right)


def negative_eigenvalues(matrix: sp.spmatrix, order: np.ndarray | None = None) -> int | None:
    """Return the number of negative eigenvalues (Sylvester's law of inertia); None if the factorisation breaks down.

    order : coordinates in a good order of elimination, if it is known: to find one is half of the work.
    """
    return count_negative(_scaled(matrix)[0], order)


def _scaled(matrix: sp.spmatrix) -> tuple[sp.csc_matrix, np.ndarray]:
    """Return S^-1 A S^-1 with a diagonal of +-1, and the diagonal of S.

    Units of translation and rotation no longer mix in the pivots.
    """
    matrix = sp.csc_matrix(matrix)
    scale = np.sqrt(np.abs(matrix.diagonal()))
    scale = np.where(scale > 0, scale, 1.0)
    inverse = sp.diags(1 / scale)
    return sp.csc_matrix(inverse @ matrix @ inverse), scale


def idle_motion(matrix: sp.spmatrix) -> np.ndarray | None:
    """Return x (n,), largest entry 1, with x^T A x = 0 but for rounding; None if A has no such x, or is indefinite.

    A has a positive diagonal and is singular; of several such x any one.
    """
    diagonal = matrix.diagonal()
    factor = SymmetricFactor(matrix + sp.diags(LIFT * diagonal))
    if not factor.definite:
        return None
    x = np.random.default_rng(0).standard_normal(len(diagonal))
    for _ in range(ITERATIONS):
        x = factor.solve(diagonal * x)
        x /= np.abs(x).max()
    return x if x @ (matrix @ x) <= LIFT * (x @ (diagonal * x)) else None
