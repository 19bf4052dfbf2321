"""Sparse symmetric factorisation with its inertia: solves, and the count of eigenvalues below a shift."""

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from ..errors import AssumptionError

# A pivot that keeps less than this share of its diagonal entry is what rounding leaves of zero: the
# subtraction that made it carries about ten units of 1e-16 relative to that diagonal entry.
SINGULAR_PIVOT = 1e-14
LIFT = 1e-12  # of the diagonal, added to a singular matrix so that it can be factorised
ITERATIONS = 4  # of the inverse power method: a null vector grows by 1e12 in each


class SymmetricFactor:
    """L D L^T of a sparse symmetric matrix, without pivoting off the diagonal.

    The signs of the pivots are the matrix's inertia (Sylvester), which is why no pivoting is allowed. Where the
    factorisation breaks down, `complete` is False, the pivots stay zero and nothing can be solved.

    Parameters
    ----------
    matrix : sparse matrix, (n, n)
        Symmetric.
    in_order : bool
        Its coordinates come in a good order of elimination already: to find one is half of the work.
    """

    def __init__(self, matrix: sp.spmatrix, in_order: bool = False):
        matrix = sp.csc_matrix(matrix)
        scale = np.sqrt(np.abs(matrix.diagonal()))
        # Symmetric scaling to a unit diagonal: units of translation and rotation no longer mix in the pivots.
        self._scale = np.where(scale > 0, scale, 1.0)
        inverse = sp.diags(1 / self._scale)
        scaled = sp.csc_matrix(inverse @ matrix @ inverse)
        self.pivots, self.complete = np.zeros(matrix.shape[0]), False
        try:
            self._lu = _eliminated(scaled, "NATURAL" if in_order else "MMD_AT_PLUS_A")
        except RuntimeError:  # SuperLU: "Factor is exactly singular"; the pivots stay zero, which says so
            return
        except (MemoryError, SystemError) as error:  # SuperLU, out of memory or of 32-bit indices
            raise AssumptionError(
                f"a matrix of {matrix.shape[0]} coordinates and {matrix.nnz} entries is too large to factorise here "
                f"({type(error).__name__}: {error}); take a coarser mesh, interfaces of fewer nodes, or more memory"
            ) from error
        if np.array_equal(self._lu.perm_r, self._lu.perm_c):
            self.pivots = self._lu.U.diagonal()
            self.complete = bool(np.all(self.pivots != 0))

    @property
    def negative_pivots(self) -> int:
        """Number of negative eigenvalues of the matrix; RuntimeError if the factorisation broke down."""
        if not self.complete:
            raise RuntimeError("the factorisation broke down: no inertia")
        return int(np.sum(self.pivots < 0))

    @property
    def smallest_pivot(self) -> float:
        """Smallest pivot over its diagonal entry: <= SINGULAR_PIVOT means not positive definite."""
        return float(np.min(self.pivots, initial=1.0))

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one vector (n,) or many (n, k)."""
        scale = self._scale if right.ndim == 1 else self._scale[:, None]
        return self._lu.solve(np.ascontiguousarray(right / scale)) / scale

    def half_solve(self, right: np.ndarray) -> np.ndarray:
        """Return Y (n, k) with |Y z|_2 = |right z|_{A^-1}: right in the coordinates where A^-1 is the identity.

        Norms are taken there because products with A itself lose the square of the digits that this loses.
        """
        return self._forward.solve((right / self._scale[:, None])[self.order]) / self._root

    def half_multiply(self, right: np.ndarray) -> np.ndarray:
        """Return right in the coordinates of half_solve: Y (n, k) with |Y z|_2 = |right z|_A."""
        return (self._lower.T @ (right * self._scale[:, None])[self.order]) * self._root

    @cached_property
    def order(self) -> np.ndarray:
        """Coordinates in the order of their elimination, (n,)."""
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


def idle_motion(matrix: sp.spmatrix) -> np.ndarray | None:
    """Return x (n,), largest entry 1, with x^T A x = 0 but for rounding; None if A has no such x, or is indefinite.

    A has a positive diagonal and is singular; of several such x any one.
    """
    diagonal = matrix.diagonal()
    factor = SymmetricFactor(matrix + sp.diags(LIFT * diagonal))
    if not factor.complete or factor.negative_pivots:
        return None
    x = np.random.default_rng(0).standard_normal(len(diagonal))
    for _ in range(ITERATIONS):
        x = factor.solve(diagonal * x)
        x /= np.abs(x).max()
    return x if x @ (matrix @ x) <= LIFT * (x @ (diagonal * x)) else None
