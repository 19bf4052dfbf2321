"""Admissible decay rates r of the energy bound (theory.md 3): D - 2 r M >= 0 and K - r D + r^2 M > 0."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigsh

from ...linalg.eigenmodes import GAP, ModalDamping, lowest_modes, same_start
from ...linalg.oscillator import largest_decay_rate
from ...linalg.symmetric_factor import SINGULAR_PIVOT, SymmetricFactor, negative_eigenvalues
from ...model.body import ElasticBody

SHARES = (0.0, 0.5, 0.9)  # of the largest admissible rate: 0 is best for short runs, 0.9 for long ones
HALVINGS = 8  # tries to find an admissible rate of a general damping matrix


@dataclass(frozen=True)
class DecayRate:
    """One admissible rate r (1/s) and what follows from |d|_{K_r} <= g.

    |d|_K <= c g, |d|_M <= per_mass g (s), |e'|_M <= velocity g.
    """

    r: float
    c: float
    per_mass: float
    velocity: float

    @classmethod
    def of(cls, r: float, c: float, kappa: float) -> DecayRate:
        """Make it of |d|_K <= c |d|_{K_r} and the lowest kappa with K_r - kappa M >= 0."""
        return cls(float(r), float(c), float(1 / np.sqrt(kappa)), float(np.sqrt(1 + r**2 / kappa)))


def rayleigh_rates(*parts: tuple[float, float, float]) -> list[DecayRate]:
    """Return rates for modes of some parts, in each all with angular frequency >= omega under D = alpha M + beta K.

    parts : (omega, alpha, beta) of each; what is admissible for all of them.
    """
    limit, found = min(largest_decay_rate(*part) for part in parts), []
    for r in (limit * np.array(SHARES if limit > 0 else SHARES[:1])).tolist():
        rates = [_rayleigh_rate(r, *part) for part in parts]
        found.append(DecayRate(r, *(max(getattr(rate, x) for rate in rates) for x in ("c", "per_mass", "velocity"))))
    return found


def _rayleigh_rate(r: float, omega: float, alpha: float, beta: float) -> DecayRate:
    kappa = omega**2 - (alpha + beta * omega**2) * r + r**2
    return DecayRate.of(r, np.sqrt(max(omega**2 / kappa, 1 / (1 - beta * r))), kappa)


def modal_rates(damping: ModalDamping) -> list[DecayRate]:
    """Return rates for all modes where the lowest have ratios of their own: what is admissible for each of them."""
    omega, cut = damping.modes.omega * (1 - GAP), damping.modes.cut
    parts = [(w, 2 * zeta * w, 0.0) for w, zeta in zip(omega.tolist(), damping.ratios.tolist(), strict=True)]
    return rayleigh_rates(*parts, *([(cut, *damping.rayleigh)] if np.isfinite(cut) else []))


def body_rates(body: ElasticBody) -> list[DecayRate]:
    """Return rates for the whole body: closed form for Rayleigh damping, one tried rate for symmetric D > 0."""
    omega = float(body.modes(1).omega[0]) * (1 - GAP)
    if body.rayleigh is not None:
        return rayleigh_rates((omega, *body.rayleigh))
    if body.modal is not None:
        return modal_rates(body.modal)
    plain = DecayRate(0.0, 1.0, 1 / omega, 1.0)
    found = _general_rate(body)
    return [plain] if found is None else [plain, found]


def _general_rate(body: ElasticBody) -> DecayRate | None:
    """Half the smallest damping rate, halved until K_r > 0; None for unsymmetric or semidefinite D."""
    D, M, K = body.D, body.M, body.K
    r = 0.5 * smallest_rate(body) if is_symmetric(D) else 0.0  # gyroscopic parts do not survive the shift
    if not r:
        return None
    for _ in range(HALVINGS):
        K_r = K - r * D + r**2 * M
        factor = SymmetricFactor(K_r)
        if factor.smallest_pivot > SINGULAR_PIVOT:
            kappa = (lowest_modes(M, K_r, 1, factor).omega[0] * (1 - GAP)) ** 2
            c = np.sqrt(_bound_of_ratio(K, K_r, _largest_ratio(K, K_r, factor)))
            return DecayRate.of(r, c, kappa)
        r /= 2
    return None


def is_symmetric(D: sp.spmatrix) -> bool:
    """Return whether a damping matrix is symmetric: has no gyroscopic part."""
    return abs(D - D.T).max() <= 1e-12 * abs(D).max()


def smallest_rate(body: ElasticBody) -> float:
    """Return mu (1/s) with D - mu M >= 0 of a symmetric damping matrix; 0: some motions are undamped."""
    factor = SymmetricFactor(body.D)
    if factor.smallest_pivot <= SINGULAR_PIVOT:
        return 0.0
    return float(lowest_modes(body.M, body.D, 1, factor).omega[0] ** 2 * (1 - GAP))


def _bound_of_ratio(K, K_r, ratio: float) -> float:
    """Raise the ratio until ratio K_r - K >= 0 is proved by its pivots."""
    while True:
        ratio *= 1 + 1e-6
        if negative_eigenvalues(ratio * K_r - K) == 0:
            return ratio


def _largest_ratio(K, K_r, factor: SymmetricFactor) -> float:
    """Largest x^T K x / x^T K_r x, as the eigenvalue solver finds it."""
    n = K.shape[0]
    if n < 4:  # ARPACK wants more coordinates than eigenvalues
        return float(np.max(np.linalg.eigvals(factor.solve(K.toarray())).real) * (1 + GAP))
    solve = LinearOperator((n, n), matvec=factor.solve, dtype=float)
    largest = eigsh(K, 1, K_r, which="LA", Minv=solve, return_eigenvectors=False, **same_start(n))
    return float(largest[0] * (1 + GAP))
