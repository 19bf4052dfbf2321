"""Undamped modes of a positive definite pencil (K, M), with the proof that none was missed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigsh

from .errors import AssumptionError
from .factor import SymmetricFactor

DENSE_LIMIT = 600  # below: LAPACK is faster than Lanczos and finds all modes by construction
RETRIES = 5
GAP = 1e-9  # relative distance of the inertia count from an eigenvalue: above the solvers' rounding


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
        return _dense_modes(M, K, m)
    modes = _lanczos_modes(M, K, m, factor)
    check_no_mode_missed(M, K, modes)
    return modes


def check_no_mode_missed(M: sp.csc_matrix, K: sp.csc_matrix, modes: Modes) -> None:
    """Compare the modes below `cut` with the negative pivots of K - cut^2 M (Sylvester's law of inertia).

    Raises
    ------
    AssumptionError
        Modes are missing; the message names the narrowest interval between computed modes that lacks one.
    """
    if _missing_below(M, K, modes.omega, modes.cut) == 0:
        return
    lo, hi = -1, modes.omega.size  # bisection over the gaps: missing below omega[hi], none below omega[lo]
    while hi - lo > 1:
        middle = (lo + hi) // 2
        missing = _missing_below(M, K, modes.omega, modes.omega[middle] * (1 - GAP))
        lo, hi = (lo, middle) if missing else (middle, hi)
    upper = modes.omega[hi] if hi < modes.omega.size else modes.cut
    lower = modes.omega[lo] if lo >= 0 else 0.0
    raise AssumptionError(
        f"a mode is missing between {lower:.6g} and {upper:.6g} rad/s: the eigenvalue solver did not find it; "
        "ask for a few modes more or fewer, or check the body for nearly equal frequencies there"
    )


def count_below(M: sp.csc_matrix, K: sp.csc_matrix, limit: float) -> int:
    """Return the number of modes with omega < limit (rad/s), by Sylvester's law of inertia.

    Raises
    ------
    AssumptionError
        No factorisation of K - limit^2 M without pivoting, nor of neighbours of it.
    """
    for retry in range(RETRIES):  # a shift that meets an eigenvalue of a leading block: the next one does not
        factor = SymmetricFactor(K - (limit * (1 - 0.1 * GAP * retry)) ** 2 * M)
        if factor.complete:
            return factor.negative_pivots
    raise AssumptionError(f"the modes below {limit:.6g} rad/s cannot be counted: K - sigma M has no L D L^T there")


def _missing_below(M, K, omega, limit) -> int:
    return count_below(M, K, limit) - int(np.sum(omega < limit))


def _dense_modes(M, K, m) -> Modes:
    # (M, K), not (K, M): LAPACK's error is relative to the largest eigenvalue, so 1/omega^2 as the eigenvalue
    # keeps the digits of the low modes, which carry the response
    n = M.shape[0]
    wanted = [n - m - 1, n - 1] if m < n // 4 else None  # few modes: twice as fast as all
    compliance, shapes = la.eigh(M.toarray(), K.toarray(), subset_by_index=wanted)
    omega = 1 / np.sqrt(compliance[::-1])
    shapes = shapes[:, ::-1] * omega
    cut = np.inf if m == n else omega[m] * (1 - GAP)
    return Modes(omega[:m], shapes[:, :m], float(cut))


def _lanczos_modes(M, K, m, factor) -> Modes:
    n = M.shape[0]
    inverse = LinearOperator((n, n), matvec=factor.solve, dtype=float)
    start = np.random.default_rng(0).standard_normal(n)  # ARPACK's own start differs from run to run
    squares, shapes = eigsh(K, m, M, sigma=0.0, OPinv=inverse, v0=start)
    order = np.argsort(squares)
    omega = np.sqrt(squares[order])
    return Modes(omega, shapes[:, order], float(omega[-1]) * (1 - GAP))
