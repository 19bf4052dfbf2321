"""Undamped modes of a positive definite pencil (K, M), with the proof that none was missed; damping by ratios."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from inspect import signature
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigsh

from ..errors import AssumptionError
from .free_mass_matrix import FreeMassMatrix
from .oscillator import damping_ratios
from .symmetric_factor import SymmetricFactor, negative_eigenvalues

DENSE_LIMIT = 600  # below: LAPACK is faster than Lanczos and finds all modes by construction
RETRIES = 5
GAP = 1e-9  # relative distance of the inertia count from an eigenvalue: above the solvers' rounding
WIDE = 1e-10  # smallest over largest 1/omega^2: below, what LAPACK finds of the highest modes is mostly rounding
MORE = 4  # modes, where one was missed: of two nearly equal ones, as of a square bar, the higher may be found first
STEPS = 3  # of refinement: each squares the error
CONVERGED = 1e-7  # change of a mode by a step: the square of it is what is left
MIXED = 1e-4  # share of another mode in a mode above which a step is not taken


@dataclass(frozen=True)
class Modes:
    """The lowest modes: omega (m,) in rad/s ascending, M-orthonormal shapes (n, m).

    cut (rad/s): every mode that is not listed has omega >= cut.
    """

    omega: np.ndarray
    shapes: np.ndarray
    cut: float

    def first(self, m: int) -> Modes:
        """Return the m lowest of these modes."""
        if m == self.omega.size:
            return self
        return Modes(self.omega[:m], self.shapes[:, :m], float(self.omega[m]) * (1 - GAP))


def lowest_modes(M: sp.csc_matrix, K: sp.csc_matrix, m: int, factor: SymmetricFactor) -> Modes:
    """Return the m lowest modes of K phi = omega^2 M phi; `factor` is K's."""
    n = M.shape[0]
    if n <= DENSE_LIMIT or m > n // 4:
        omega, shapes = _refined(M, factor, _dense_shapes(M.toarray(), K.toarray(), min(m + 1, n)))
        cut = np.inf if m == n else float(omega[m]) * (1 - GAP)
        return Modes(omega[:m], shapes[:, :m], cut)
    for count in (m, m + MORE):
        omega, shapes = _refined(M, factor, _lanczos_shapes(M, K, count, factor))
        modes = Modes(omega, shapes, float(omega[-1]) * (1 - GAP))
        if count == m and _missing_below(M, K, modes) == 0:
            return modes
    check_no_mode_missed(M, K, modes)
    return modes.first(m)


def check_no_mode_missed(M: sp.csc_matrix, K: sp.csc_matrix, modes: Modes) -> None:
    """Raise AssumptionError unless all modes below modes.cut are there, by Sylvester's law of inertia."""
    missing = _missing_below(M, K, modes)
    if missing:
        raise AssumptionError(
            f"{missing} of the modes below {modes.cut:.6g} rad/s are missing: the eigenvalue solver did not find "
            "them; ask for a few modes more or fewer, or check the body for nearly equal frequencies there"
        )


def count_below(M: sp.csc_matrix, K: sp.csc_matrix, limit: float) -> int:
    """Return the number of modes with omega < limit (rad/s), by Sylvester's law of inertia.

    Raises
    ------
    AssumptionError
        No factorisation of K - limit^2 M without pivoting, nor of neighbours of it.
    """
    for retry in range(RETRIES):  # a shift that meets an eigenvalue of a leading block: the next one does not
        square = (limit * (1 - 0.1 * GAP * retry)) ** 2
        free = isinstance(M, FreeMassMatrix)
        count = M.count_below(square) if free else negative_eigenvalues(K - square * M)
        if count is not None:
            return count
    raise AssumptionError(f"the modes below {limit:.6g} rad/s cannot be counted: K - sigma M has no L D L^T there")


def same_start(n: int) -> dict[str, Any]:
    """Return options of eigsh, the same each time: its own first vector, and those it restarts with, are random.

    Random numbers of a generator of its own have a part in all modes, those of a symmetric body, too.
    """
    rng = np.random.default_rng(0)
    options = {"v0": rng.standard_normal(n), "rng": rng}
    return {name: x for name, x in options.items() if name in signature(eigsh).parameters}  # rng: scipy 1.17


def _missing_below(M, K, modes: Modes) -> int:
    return count_below(M, K, modes.cut) - int(np.sum(modes.omega < modes.cut))


def _dense_shapes(M: np.ndarray, K: np.ndarray, m: int) -> np.ndarray:
    """Shapes (n, m) of the lowest modes, omega ascending."""
    # (M, K), not (K, M): LAPACK's error is relative to the largest eigenvalue, so 1/omega^2 as the eigenvalue
    # keeps the digits of the low modes, which carry the response
    n = len(M)
    wanted = [n - m, n - 1] if m < n // 4 else None  # few modes: twice as fast as all
    compliance, shapes = la.eigh(M, K, subset_by_index=wanted)
    compliance, shapes = compliance[::-1][:m], shapes[:, ::-1][:, :m]
    if compliance[-1] > WIDE * compliance[0]:
        return shapes
    squares, high = (x[..., :m] for x in la.eigh(K, M))
    low = _low_count(compliance, squares)
    return np.hstack([shapes[:, :low], high[:, low:]])


def _low_count(compliance: np.ndarray, squares: np.ndarray) -> int:
    """Number of modes to take from 1/omega^2 (m,), the rest from omega^2 (m,), both in the order of omega."""
    middle = np.sqrt(compliance[0] / squares[-1])
    known = np.where(compliance > middle, 1 / np.maximum(compliance, middle), squares)
    lost = np.maximum(known[:-1] * compliance[0], squares[-1] / known[1:])  # rounding of either, over 1e-16
    gap = np.maximum(1 - known[:-1] / known[1:], GAP)  # a cluster that is cut would be found twice, or half
    return 1 + int(np.argmin(lost / gap))


def _lanczos_shapes(M, K, m, factor) -> np.ndarray:
    """Shapes (n, m) of the lowest modes, omega ascending."""
    n = M.shape[0]
    inverse = LinearOperator((n, n), matvec=factor.solve, dtype=float)
    squares, shapes = eigsh(K, m, M, sigma=0.0, OPinv=inverse, **same_start(n))
    return shapes[:, np.argsort(squares)]


def _refined(M: sp.csc_matrix, factor: SymmetricFactor, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return omega (m,) ascending and M-orthonormal shapes, right to rounding: steps of Ogita and Aishima (2018).

    Eigenvalue solvers leave (omega_m/omega_1)^2 times the rounding in the highest of them. `factor` is K's: products
    in its coordinates do not cancel.
    """
    X = X / np.sqrt(np.einsum("ij,ij->j", X, M @ X))
    for _ in range(STEPS):
        Y, R = factor.half_multiply(X), _missing(M, X)
        S = Y.T @ Y
        squares = np.diag(S) / (1 - np.diag(R))
        gap, mixed = squares - squares[:, None], S + (squares + squares[:, None]) / 2 * R
        near = np.abs(mixed) >= MIXED * np.abs(gap)  # equal but for rounding: any vectors of their common space do
        turn = np.where(near, 0.0, mixed / np.where(near, 1.0, gap))  # antisymmetric: its exponential is orthogonal
        E = R / 2 + turn + turn @ (turn + turn @ turn / 3) / 2
        X = X + X @ E
        if np.abs(E).max() < CONVERGED:
            break
    order = np.argsort(squares)
    return np.sqrt(squares[order]), X[:, order]


def _missing(M, X: np.ndarray) -> np.ndarray:
    """What X^T M X lacks of the identity, symmetric to the last bit."""
    product = X.T @ (M @ X)
    return np.eye(X.shape[1]) - (product + product.T) / 2


@dataclass(frozen=True)
class ModalDamping:
    """D = alpha M + beta K + M Phi diag(d) Phi^T M: modes phi_1 .. phi_k have the ratios zeta, all others Rayleigh's.

    modes : the k lowest; ratios : (k,); rayleigh : (alpha, beta). d_i = 2 zeta_i omega_i - alpha - beta omega_i^2.
    """

    M: sp.csc_matrix
    K: sp.csc_matrix
    modes: Modes
    ratios: np.ndarray
    rayleigh: tuple[float, float]

    @property
    def count(self) -> int:
        """Number k of modes with a ratio of their own."""
        return len(self.ratios)

    @cached_property
    def _MPhi(self) -> np.ndarray:
        return self.M @ self.modes.shapes

    def __matmul__(self, V: np.ndarray) -> np.ndarray:
        """Return D V."""
        (alpha, beta), omega = self.rayleigh, self.modes.omega
        own = 2 * (self.ratios - damping_ratios(omega, alpha, beta)) * omega
        return alpha * (self.M @ V) + beta * (self.K @ V) + self._MPhi @ (own[:, None] * (self._MPhi.T @ V))

    def ratios_of(self, omega: np.ndarray) -> np.ndarray:
        """Return zeta of the lowest modes, whose omega (m,) ascend."""
        zeta = damping_ratios(omega, *self.rayleigh)
        zeta[: self.count] = self.ratios[: len(omega)]
        return zeta

    def aligned(self, modes: Modes) -> Modes:
        """Return the modes with those of D as the first: of equal frequencies another solve may mix other vectors."""
        k = self.count
        rest = modes.shapes[:, k:]
        rest = rest - self.modes.shapes @ (self._MPhi.T @ rest)
        gram = np.linalg.cholesky(rest.T @ (self.M @ rest)) if rest.shape[1] else np.zeros((0, 0))
        shapes = np.hstack([self.modes.shapes, np.linalg.solve(gram, rest.T).T])
        return Modes(np.concatenate([self.modes.omega, modes.omega[k:]]), shapes, modes.cut)
