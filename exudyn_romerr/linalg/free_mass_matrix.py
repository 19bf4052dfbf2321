"""Mass of a free body on displacements that are M-orthogonal to its rigid motions: products and solves stay sparse.

Written in coordinates that six of them follow from, M is full there. What follows needs sparse matrices alone, since
K Rg = 0 and M-orthogonality splits the free body's equations into those of rigid motions and of deformations.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve, lapack, qr
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from ..errors import AssumptionError
from .symmetric_factor import SymmetricFactor, negative_eigenvalues

EXPLICIT = 3000  # coordinates: a full matrix of these is what a laptop factorises in seconds
WORK = 64  # columns that LAPACK reflects at once
AT_REST = 1e-6  # |K Rg| of its terms: matrices printed with 7 digits


class FreeCoordinates:
    """u = P [y, 0]: y (N - 6,) is u as seen from six statically determinate supports, P takes rigid motions out.

        u = P [y, 0] ,  P = I - Rg (Rg^T M Rg)^-1 Rg^T M ,     y = T u = u_f - Rg_f Rg_d^-1 u_d

    Parameters
    ----------
    mass : sparse matrix, (N, N)
    motions : ndarray, (N, 6)
        Rg, rigid motions about a point in the body.

    Attributes
    ----------
    free, held : (N - 6,), (6,) numbers of the coordinates f of y, and of d. motions : (N, 6), scaled.
    carried : (N, 6), M motions.
    """

    def __init__(self, mass: sp.csc_matrix, motions: np.ndarray):
        self.motions = motions / np.linalg.norm(motions, axis=0)
        self.carried = mass @ self.motions
        self._gram = cho_factor(self.motions.T @ self.carried)
        self.held = np.sort(qr(self.motions.T, mode="r", pivoting=True)[1][: motions.shape[1]])
        self.free = np.setdiff1d(np.arange(len(motions)), self.held)

    def loads(self, B: np.ndarray | sp.spmatrix) -> np.ndarray:
        """Return what forces B (N, k) do work with on y, (N - 6, k) or (N - 6,)."""
        rigid = cho_solve(self._gram, (B.T @ self.motions).T)
        return _dense(B)[self.free] - self.carried[self.free] @ rigid

    def expand(self, y: np.ndarray) -> np.ndarray:
        """Return u (N, ...) of y (N - 6, ...)."""
        u = np.zeros((len(self.motions), *y.shape[1:]), dtype=y.dtype)
        u[self.free] = y
        return u - self.motions @ cho_solve(self._gram, self.carried.T @ u)

    def seen(self, u: np.ndarray) -> np.ndarray:
        """Return y (N - 6, ...) of u (N, ...); rigid motions have none."""
        return u[self.free] - self.motions[self.free] @ np.linalg.solve(self.motions[self.held], u[self.held])

    def balanced(self, b: np.ndarray) -> np.ndarray:
        """Return forces (N, k) on all coordinates, in balance, whose work on y is that of b (N - 6, k): T^T b."""
        found = np.zeros((len(self.motions), b.shape[1]))
        found[self.free] = b
        found[self.held] = -np.linalg.solve(self.motions[self.held].T, self.motions[self.free].T @ b)
        return found


class FreeMassMatrix(LinearOperator):
    """M of y, (N - 6, N - 6), as products; `whole` (N, N) is that of all coordinates, K (N, N) the stiffness there.

    Raises
    ------
    AssumptionError
        K resists rigid motions.
    """

    def __init__(self, whole: sp.csc_matrix, stiffness: sp.csc_matrix, y: FreeCoordinates):
        super().__init__(float, (y.free.size, y.free.size))
        self.whole, self._K, self._y = whole, stiffness, y
        forces, terms = (
            np.abs(A @ x).max(axis=0) for A, x in ((stiffness, y.motions), (abs(stiffness), abs(y.motions)))
        )
        if np.any(forces > AT_REST * terms):
            raise AssumptionError(
                f"stiffness resists rigid motions (a force of {np.max(forces / terms):.1e} of its terms, allowed "
                f"{AT_REST:g}): that of a free body is needed here; hold it by fixed= or reference=mean_motion(nodes)"
            )

    def _matmat(self, Y: np.ndarray) -> np.ndarray:
        return self._y.loads(self.whole @ self._y.expand(Y))

    def _adjoint(self) -> FreeMassMatrix:
        return self

    def __abs__(self) -> sp.csc_matrix:
        """Sizes of the entries that products are made of, for what rounding leaves of them."""
        return abs(self.whole)[self._y.free][:, self._y.free]

    def diagonal(self) -> np.ndarray:
        """Return the masses (N - 6,) at the coordinates of y, rigid motions left in."""
        return self.whole.diagonal()[self._y.free]

    def toarray(self) -> np.ndarray:
        """Return the full matrix."""
        found = self @ np.eye(self.shape[0])
        return (found + found.T) / 2

    def count_below(self, square: float) -> int | None:
        """Return how many modes have omega^2 < square: those of the free body but its rigid motions."""
        found = negative_eigenvalues(self._K - square * self.whole)
        return None if found is None else found - self._y.motions.shape[1]

    def factor(self) -> FreeMassFactor:
        """Return the factorisation."""
        return FreeMassFactor(self.whole, self._y)


class FreeMassFactor:
    """Solves and norms with a FreeMassMatrix: M_y^-1 = T M^-1 T^T, as a SymmetricFactor has them.

    Where |.|_M is the 2-norm, deformations are orthogonal to the six rigid motions: reflections (Householder) that
    take these to the first six axes leave six zeros, which are dropped.
    """

    def __init__(self, whole: sp.csc_matrix, y: FreeCoordinates):
        self._factor, self._y = SymmetricFactor(whole), y
        self._reflections, _ = qr(self._factor.half_multiply(y.motions), mode="raw")

    @property
    def smallest_pivot(self) -> float:
        """Smallest pivot of the mass on all coordinates over its diagonal entry."""
        return self._factor.smallest_pivot

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one vector (N - 6,) or many (N - 6, k)."""
        columns = right.reshape(len(right), -1)
        return self._y.seen(self._factor.solve(self._y.balanced(columns))).reshape(right.shape)

    def half_solve(self, right: np.ndarray) -> np.ndarray:
        """Return Y (N - 6, k) with |Y z|_2 = |right z|_{M^-1}."""
        return self._reflected(self._factor.half_solve(self._y.balanced(_dense(right))))

    def half_multiply(self, right: np.ndarray) -> np.ndarray:
        """Return right in the coordinates of half_solve: Y (N - 6, k) with |Y z|_2 = |right z|_M."""
        return self._reflected(self._factor.half_multiply(self._y.expand(_dense(right))))

    def _reflected(self, Y: np.ndarray) -> np.ndarray:
        (vectors, shares), room = self._reflections, max(1, WORK * Y.shape[1])
        return lapack.dormqr("L", "T", vectors, shares, Y, lwork=room)[0][len(shares) :]


def explicit(M: sp.csc_matrix | FreeMassMatrix) -> sp.csc_matrix:
    """Return M as a matrix with entries; AssumptionError where that would be full and large."""
    if not isinstance(M, FreeMassMatrix):
        return M
    if M.shape[0] > EXPLICIT:
        raise AssumptionError(
            f"{M.shape[0]} coordinates M-orthogonal to rigid motions have a full mass matrix, which is needed for "
            f"damping matrices, krylov_basis and gramian_basis; allowed up to {EXPLICIT}: use "
            "reference=mean_motion(nodes)"
        )
    return sp.csc_matrix(M.toarray())


def damping_of(
    M: sp.csc_matrix | FreeMassMatrix, K: sp.csc_matrix, alpha: float, beta: float
) -> sp.csc_matrix | LinearOperator:
    """Return alpha M + beta K, for products at least."""
    if isinstance(M, FreeMassMatrix):
        return alpha * M + beta * aslinearoperator(K)
    return sp.csc_matrix(alpha * M + beta * K)


def _dense(columns: np.ndarray | sp.spmatrix) -> np.ndarray:
    return columns.toarray() if sp.issparse(columns) else columns
