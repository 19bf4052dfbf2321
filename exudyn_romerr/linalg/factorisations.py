"""Factorisations of sparse symmetric matrices: SuperLU in its own order or METIS's, and MKL's PARDISO.

The last two need packages of the extra `large`; symmetric_factor.py, which scales, and counts of eigenvalues are made
of what is here. All know the diagonal of their matrix to be +-1.
"""

from __future__ import annotations

import platform
import sys
from functools import cached_property
from importlib.util import find_spec
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from .pardiso import PardisoFactor, count_negative_pivots, pardiso_solve, too_large

if TYPE_CHECKING:
    from collections.abc import Callable

PACKAGES = {"pardiso": "pymklpardiso", "metis": "pymetis"}  # the best first
MANY = 30_000  # coordinates whose factorisation takes longer than a user likes to wait
SECONDS = {"superlu": 17.0, "metis": 9.0, "pardiso": 2.3}  # of 55,488 coordinates: benchmarks/large_bodies.py
# coordinates; below, an order that fills less and supernodes do not make up for finding and building them
FEW = 5_000


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


def faster(n: int) -> str | None:
    """Return what would make the factorisation of n coordinates much faster, as a sentence; None if nothing would."""
    kind, intel = solver(n), sys.platform != "darwin" and platform.machine() in ("x86_64", "AMD64")
    if n < MANY or kind == "pardiso" or (kind == "metis" and not intel):
        return None
    package, better = ("py-mkl-pardiso", "pardiso") if intel else ("pymetis", "metis")
    taken = {"superlu": "SuperLU", "metis": "SuperLU in METIS's order"}[kind]
    return (
        f"{n} coordinates are factorised several times by {taken}, which takes long. `pip install {package}` before "
        f"makes it faster (measured: 55,000 coordinates of a solid in {SECONDS[better]:g} s in place of "
        f"{SECONDS[kind]:g} s) and takes less memory; bounds stay the same"
    )


def factorised(matrix: sp.csc_matrix) -> Factor:
    """Return a factorisation of a matrix that is meant to be definite; `complete` and the pivots tell."""
    kind = solver(matrix.shape[0])
    return PardisoFactor(matrix) if kind == "pardiso" else SuperLUFactor(matrix, _order(matrix, kind))


def solve_with(matrix: sp.spmatrix) -> Callable[[np.ndarray], np.ndarray]:
    """Return what solves with any regular matrix (n, n), real or complex, for columns (n, k) of its kind."""
    if solver(matrix.shape[0]) == "pardiso":
        return pardiso_solve(matrix)
    try:
        return splu(sp.csc_matrix(matrix)).solve
    except (MemoryError, SystemError) as error:
        raise too_large(matrix, error) from error


def count_negative(matrix: sp.csc_matrix, order: np.ndarray | None = None) -> int | None:
    """Return the number of negative eigenvalues (Sylvester's law of inertia); None if the factorisation breaks down.

    order : a good order of elimination, if it is known.
    """
    kind = solver(matrix.shape[0])
    found = count_negative_pivots(matrix) if kind == "pardiso" else None
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
        self._given, self._lu = order, None
        try:
            ordered = matrix if order is None else matrix[order][:, order]
            self._lu = _eliminated(ordered, "MMD_AT_PLUS_A" if order is None else "NATURAL")
        except RuntimeError:  # SuperLU: "Factor is exactly singular"; the pivots stay zero, which says so
            self.pivots = np.zeros(matrix.shape[0])
        except (MemoryError, SystemError) as error:  # SuperLU, out of memory or of 32-bit indices
            raise too_large(matrix, error) from error

    @cached_property
    def pivots(self) -> np.ndarray:
        """Pivots (n,), which only those ask for who do not know that the matrix is definite: SciPy copies L and U."""
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            return np.zeros(self._lu.shape[0])
        try:
            return self._lu.U.diagonal()
        except (MemoryError, SystemError) as error:
            raise too_large(self._lu, error) from error

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


def _order(matrix: sp.csc_matrix, kind: str) -> np.ndarray | None:
    """Order of elimination by METIS's nested dissection, where it is installed; None: SuperLU finds its own."""
    if kind == "superlu" or not find_spec("pymetis"):
        return None
    from pymetis import CSRAdjacency, nested_dissection

    graph = neighbours(matrix)
    return np.asarray(nested_dissection(CSRAdjacency(graph.indptr, graph.indices))[0])


def neighbours(matrix: sp.csc_matrix) -> sp.csr_matrix:
    """Return which coordinates stand in one entry: symmetric, without a diagonal.

    METIS crashes on graphs that are not symmetric, and rounding may leave a zero on one side of the diagonal alone.
    """
    there = matrix.tocoo()
    off = (there.row != there.col) & (there.data != 0)
    pairs = there.row[off], there.col[off]
    pattern = sp.csr_matrix((np.ones(len(pairs[0]), dtype=np.int8), pairs), shape=matrix.shape)
    return sp.csr_matrix(pattern + pattern.T)


def _eliminated(matrix: sp.csc_matrix, order: str) -> SuperLU:
    return splu(matrix, permc_spec=order, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
