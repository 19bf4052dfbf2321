"""Factorisations of sparse symmetric matrices: SuperLU in its own order or METIS's, and MKL's PARDISO.

The last two need packages of the extra `large`; symmetric_factor.py, which scales, and counts of eigenvalues are made
of what is here. All know the diagonal of their matrix to be +-1.
"""

from __future__ import annotations

from functools import cached_property
from importlib.util import find_spec
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from ..errors import AssumptionError
from .split_product import SplitMatrix

# coordinates; below, an order that fills less and supernodes do not make up for finding and building them
FEW = 5_000
ITERATIONS = 3  # of the inverse power method
CANDIDATES = 4  # coordinates whose compliance is computed
# of PARDISO, from zero: METIS's order, perturbation of pivots below 1e-13, Bunch-Kaufman pivots, no messages of size
OPTIONS = {1: 2, 9: 13, 20: 1}
POSITIVE, NEGATIVE, PERTURBED = 21, 22, 13  # where PARDISO says how many pivots it found
FORWARD = 331  # the phase that solves with L alone
DEFINITE, INDEFINITE = 2, -2
NO_ROOM = "not enough memory"


class Factor(Protocol):
    """What SymmetricFactor asks of a factorisation of A (n, n)."""

    complete: bool
    negative_pivots: int
    smallest_pivot: float
    order: np.ndarray | None

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return A^-1 right, (n,) or (n, k)."""

    def half_solve(self, right: np.ndarray) -> np.ndarray:
        """Return Y (n, k) with |Y z|_2 = |right z|_{A^-1}."""

    def half_multiply(self, right: np.ndarray) -> np.ndarray:
        """Return right in the coordinates of half_solve: Y (n, k) with |Y z|_2 = |right z|_A."""


def solver(n: int) -> str:
    """Return what factorises n coordinates here: "superlu", "metis" (SuperLU in METIS's order) or "pardiso"."""
    if n < FEW:
        return "superlu"
    return next((name for name, package in PACKAGES.items() if find_spec(package)), "superlu")


PACKAGES = {"pardiso": "pymklpardiso", "metis": "pymetis"}  # the best first


def factorised(matrix: sp.csc_matrix) -> Factor:
    """Return a factorisation of a matrix that is meant to be definite; `complete` and the pivots tell."""
    kind = solver(matrix.shape[0])
    return PardisoFactor(matrix) if kind == "pardiso" else SuperLUFactor(matrix, _order(matrix, kind))


def count_negative(matrix: sp.csc_matrix, order: np.ndarray | None = None) -> int | None:
    """Return the number of negative eigenvalues (Sylvester's law of inertia); None if the factorisation breaks down.

    order : a good order of elimination, if it is known.
    """
    kind = solver(matrix.shape[0])
    found = _pardiso_count(matrix) if kind == "pardiso" else None
    if found is not None:
        return found
    factor = SuperLUFactor(matrix, _order(matrix, kind) if order is None else order)
    return factor.negative_pivots if factor.complete else None


class SuperLUFactor:
    """L D L^T without pivoting off the diagonal, coordinates eliminated in `order` (None: minimum degree).

    The signs of the pivots are the matrix's inertia (Sylvester), which is why no pivoting is allowed. Where the
    factorisation breaks down, `complete` is False, the pivots stay zero and nothing can be solved.
    """

    def __init__(self, matrix: sp.csc_matrix, order: np.ndarray | None = None):
        self._given = order
        self.pivots, self.complete = np.zeros(matrix.shape[0]), False
        try:
            ordered = matrix if order is None else matrix[order][:, order]
            self._lu = _eliminated(ordered, "MMD_AT_PLUS_A" if order is None else "NATURAL")
        except RuntimeError:  # SuperLU: "Factor is exactly singular"; the pivots stay zero, which says so
            return
        except (MemoryError, SystemError) as error:  # SuperLU, out of memory or of 32-bit indices
            raise too_large(matrix, error) from error
        if np.array_equal(self._lu.perm_r, self._lu.perm_c):
            self.pivots = self._lu.U.diagonal()
            self.complete = bool(np.all(self.pivots != 0))

    @property
    def negative_pivots(self) -> int:
        """Number of negative eigenvalues."""
        return int(np.sum(self.pivots < 0))

    @property
    def smallest_pivot(self) -> float:
        """Smallest pivot."""
        return float(np.min(self.pivots, initial=1.0))

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one vector (n,) or many (n, k)."""
        if self._given is None:
            return self._lu.solve(np.asfortranarray(right))
        solution = np.empty(right.shape)
        solution[self._given] = self._lu.solve(right[self._given])
        return solution

    def half_solve(self, right: np.ndarray) -> np.ndarray:
        """Return Y (n, k) with |Y z|_2 = |right z|_{A^-1}."""
        return self._forward.solve(right[self.order]) / self._root

    def half_multiply(self, right: np.ndarray) -> np.ndarray:
        """Return Y (n, k) with |Y z|_2 = |right z|_A."""
        return (self._lower.T @ right[self.order]) * self._root

    @cached_property
    def order(self) -> np.ndarray:
        """Coordinates in the order of their elimination, (n,)."""
        order = np.argsort(self._lu.perm_r)
        return order if self._given is None else self._given[order]

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


class PardisoFactor:
    """Cholesky's L L^T; `complete` is False where there is none."""

    order = None  # it is not told
    negative_pivots = 0

    def __init__(self, matrix: sp.csc_matrix):
        self._matrix = matrix
        self._solver = None if matrix.diagonal().min(initial=1.0) <= 0 else _pardiso(matrix, DEFINITE)
        self.complete = self._solver is not None

    @cached_property
    def smallest_pivot(self) -> float:
        """Smallest last pivot of all orders of elimination, 1/max_i (A^-1)_ii, over likely i; 0 without a factor.

        Where rounding alone holds a motion the power method finds it at once, and (A^-1)_ii where it is largest.
        """
        if not self.complete:
            return 0.0
        n = self._matrix.shape[0]
        motion = np.random.default_rng(0).standard_normal((n, 1))
        for _ in range(ITERATIONS):
            motion = self.solve(motion / np.abs(motion).max())
        likely = np.argsort(-np.abs(motion[:, 0]))[:CANDIDATES]
        unit = np.zeros((n, len(likely)))
        unit[likely, range(len(likely))] = 1.0
        return float(1 / np.max(self.solve(unit)[likely, range(len(likely))]))

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one vector (n,) or many (n, k)."""
        return self._solver.solve(np.ascontiguousarray(right) if right.ndim == 1 else np.asfortranarray(right))

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
        return SplitMatrix(sp.csr_matrix(self._matrix))


def _pardiso(matrix: sp.csc_matrix, kind: int):
    """Return PARDISO's factorisation; None if there is none of this kind."""
    from pymklpardiso import PardisoSolver

    upper = sp.tril(matrix, format="csc").T  # of a symmetric matrix, by rows
    upper.sort_indices()
    try:
        return PardisoSolver(upper, kind, OPTIONS)
    except RuntimeError as error:
        if NO_ROOM in str(error):
            raise too_large(matrix, error) from error
        return None


def _pardiso_count(matrix: sp.csc_matrix) -> int | None:
    """Return the number of negative pivots; None if any was perturbed: the sign of such a pivot says nothing."""
    solver = _pardiso(matrix, INDEFINITE)
    if solver is None:
        return None
    positive, negative, perturbed = (solver.get_iparm_value(i) for i in (POSITIVE, NEGATIVE, PERTURBED))
    return negative if perturbed == 0 and positive + negative == matrix.shape[0] else None


def _order(matrix: sp.csc_matrix, kind: str) -> np.ndarray | None:
    """Order of elimination by METIS's nested dissection, where it is installed; None: SuperLU finds its own."""
    if kind == "superlu" or not find_spec("pymetis"):
        return None
    from pymetis import CSRAdjacency, nested_dissection

    graph = sp.csr_matrix(matrix - sp.diags(matrix.diagonal()))
    graph.eliminate_zeros()
    return np.asarray(nested_dissection(CSRAdjacency(graph.indptr, graph.indices))[0])


def _eliminated(matrix: sp.csc_matrix, order: str) -> SuperLU:
    return splu(matrix, permc_spec=order, diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def too_large(matrix: sp.spmatrix, error: Exception) -> AssumptionError:
    """Return the error to raise for a matrix that does not fit."""
    return AssumptionError(
        f"a matrix of {matrix.shape[0]} coordinates and {matrix.nnz} entries is too large to factorise here "
        f"({type(error).__name__}: {error}); take a coarser mesh, interfaces of fewer nodes, or more memory"
    )
