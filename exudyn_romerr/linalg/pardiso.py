"""MKL's PARDISO by the package py-mkl-pardiso: Cholesky factors, and counts of negative eigenvalues."""

from __future__ import annotations

from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from ..errors import AssumptionError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pymklpardiso import PardisoSolver
    from scipy.sparse.linalg import SuperLU

ITERATIONS = 3  # of the inverse power method
CANDIDATES = 4  # coordinates whose compliance is computed
# of PARDISO, from zero: METIS's order, perturbation of pivots below 1e-13, Bunch-Kaufman pivots, no messages of size
OPTIONS = {1: 2, 9: 13, 20: 1}
POSITIVE, NEGATIVE, PERTURBED = 21, 22, 13  # where PARDISO says how many pivots it found
FORWARD = 331  # the phase that solves with L alone
DEFINITE, INDEFINITE = 2, -2
ANY = {"f": 11, "c": 13}  # real or complex, of no symmetry
NO_ROOM = "not enough memory"
DIGITS = 53  # bits of a double
SMALLEST = 1e-200  # largest entry of a column that is split: of smaller ones the last bits would vanish


class PardisoFactor:
    """Cholesky's L L^T; `complete` is False where there is none."""

    negative_pivots = 0

    def __init__(self, matrix: sp.csc_matrix):
        self._n, self._rows = matrix.shape[0], matrix.T  # by rows, but for rounding, and no copy
        self._solver = None if matrix.diagonal().min(initial=1.0) <= 0 else _pardiso(matrix, DEFINITE)
        self.complete = self._solver is not None

    @cached_property
    def smallest_pivot(self) -> float:
        """Smallest last pivot of all orders of elimination, 1/max_i (A^-1)_ii, over likely i; 0 without a factor.

        Where rounding alone holds a motion the power method finds it at once, and (A^-1)_ii where it is largest.
        """
        if not self.complete:
            return 0.0
        motion = np.random.default_rng(0).standard_normal((self._n, 1))
        for _ in range(ITERATIONS):
            motion = self.solve(motion / np.abs(motion).max())
        likely = np.argsort(-np.abs(motion[:, 0]))[:CANDIDATES]
        unit = np.zeros((self._n, len(likely)))
        unit[likely, range(len(likely))] = 1.0
        return float(1 / np.max(self.solve(unit)[likely, range(len(likely))]))

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for many vectors (n, k)."""
        return self._solver.solve(np.asfortranarray(right))

    def half_solve(self, right: np.ndarray) -> np.ndarray:
        """Return Y (n, k) with |Y z|_2 = |right z|_{A^-1}."""
        result = np.empty(right.shape, order="F")
        if right.size:
            self._solver.run_phase_into(FORWARD, np.asfortranarray(right), result)
        return result

    def half_multiply(self, right: np.ndarray) -> np.ndarray:
        """Return Y (n, k) with |Y z|_2 = |right z|_A: L^T x = L^-1 (A x), for PARDISO has no product with L^T.

        A plain product is not enough: the modes of a linkage, orthonormal here to 2e-14, were so to 5e-11 only.
        """
        return self.half_solve(self._split.times(right))

    @cached_property
    def _split(self) -> SplitMatrix:
        split, self._rows = SplitMatrix(self._rows), None  # which is in it, and of a large body takes room
        return split


def _pardiso(matrix: sp.csc_matrix, kind: int) -> PardisoSolver | None:
    """Return PARDISO's factorisation; None if there is none of this kind."""
    from pymklpardiso import PardisoSolver

    upper = sp.tril(matrix, format="csc").T  # of a symmetric matrix, by rows
    upper.sort_indices()
    try:
        with enough_memory(matrix):
            return PardisoSolver(upper, kind, OPTIONS)
    except RuntimeError:
        return None


def count_negative_pivots(matrix: sp.csc_matrix) -> int | None:
    """Return the number of negative pivots; None if any was perturbed: the sign of such a pivot says nothing."""
    solver = _pardiso(matrix, INDEFINITE)
    if solver is None:
        return None
    positive, negative, perturbed = (solver.get_iparm_value(i) for i in (POSITIVE, NEGATIVE, PERTURBED))
    return negative if perturbed == 0 and positive + negative == matrix.shape[0] else None


def pardiso_solve(matrix: sp.spmatrix) -> Callable[[np.ndarray], np.ndarray]:
    """Return what solves with any regular matrix (n, n), real or complex, for columns (n, k)."""
    from pymklpardiso import PardisoSolver

    rows = sp.csr_matrix(matrix)
    rows.sort_indices()
    with enough_memory(matrix):
        solver = PardisoSolver(rows, ANY[rows.dtype.kind])
    return lambda right: solver.solve(np.asfortranarray(right, dtype=rows.dtype))


class SplitMatrix:
    """A = first + rest (n, n), entries of size 1 at most: products with `first` are exact.

    Forces A x of smooth displacements are what large terms leave of one another. A and x are split into first parts
    of few bits, whose products and sums are exact, and the rest (Ozaki et al., Numer. Algorithms 59, 2012).
    """

    def __init__(self, A: sp.csr_matrix):
        terms = int(np.ceil(np.log2(max(abs(A).sum(axis=1).max(), 1.0)))) + 1
        self._bits = (DIGITS - terms) // 2
        leading = _leading(A.data, 1.0, self._bits)
        self._first, self._rest = (
            sp.csr_matrix((data, A.indices, A.indptr), shape=A.shape) for data in (leading, A.data - leading)
        )

    def times(self, X: np.ndarray) -> np.ndarray:
        """Return A X (n, k)."""
        largest = np.maximum(np.max(np.abs(X), axis=0, initial=0.0), SMALLEST)
        X_first = _leading(X, 2.0 ** np.ceil(np.log2(largest)), self._bits)
        return self._first @ X_first + (self._first @ (X - X_first) + self._rest @ X)


def _leading(x: np.ndarray, unit: float | np.ndarray, bits: int) -> np.ndarray:
    """Return x rounded to multiples of unit / 2^bits; unit: powers of two, not below |x|."""
    step = unit * 2.0**-bits
    return np.round(x / step) * step


@contextmanager
def enough_memory(matrix: sp.spmatrix | SuperLU) -> Iterator[None]:
    """Raise AssumptionError where a matrix, or its factor, does not fit into memory or 32-bit indices."""
    try:
        yield
    except (MemoryError, SystemError, RuntimeError) as error:  # the last: PARDISO
        if isinstance(error, RuntimeError) and NO_ROOM not in str(error):
            raise
        raise AssumptionError(
            f"a matrix of {matrix.shape[0]} coordinates and {matrix.nnz} entries is too large to factorise here "
            f"({type(error).__name__}: {error}); take a coarser mesh, interfaces of fewer nodes, or more memory"
        ) from error
