"""Errors of harmonic responses: what modes of the full body answer to the residual, and a bound of the rest.

A reduced response V q to loads B exp(i w t) leaves R = L z, and A e = -R with A = K + i w D - w^2 M (theory.md 12).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...linalg.eigenmodes import GAP
from ..residual.decay_rates import is_symmetric, smallest_rate
from ..residual.modal_split import NormsAbove
from ..residual.residual import OrthonormalNorm

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..residual.problem import Problem

ROUNDED = 8  # times: what sums of some hundred terms are off by, as in "auxiliary"
RESONANCE = "resonance: the frequency is an eigenfrequency of the undamped body, to the digits that this is known in"
TOO_HIGH = "the undamped body has eigenfrequencies there that are not among the {} modes that are computed"
GYROSCOPIC = "damping that is not symmetric (gyroscopic): nothing is proved of it"
UNDAMPED_MOTIONS = "above the lowest eigenfrequency, and the damping matrix leaves some motions undamped"


class Errors(NamedTuple):
    """Of S responses: known (S, R) complex, the error as far as it is known; slack (S, R), of what is not, at most.

    reasons : of every response, why slack is inf; "" where it is not. Velocities are not yet multiplied by i w.
    """

    known: np.ndarray
    slack: np.ndarray
    reasons: np.ndarray


class ProportionalDamping:
    """Rayleigh's or modal damping: m modes P answer one by one, the rest above them is static but for a gain g.

        C e = C P eta - C K^-1 R_rest/(1 + i w beta) + rest,   |rest| <= |C|_rest g(w) |R_rest|_{K^-1}

    What computed modes lack of being eigenvectors, and rounding, are bounded and added.
    """

    def __init__(self, problem: Problem):
        body, split, modes = problem.body, problem.split, problem.split.modes
        above, k = NormsAbove(problem.rows, modes), problem.map.coordinates.k
        self.omega, self.cut = modes.omega, modes.cut
        self.damping, self.rayleigh = 2 * body.damping_ratios(modes.omega) * modes.omega, body.proportional
        self.PL, self.CP = split.PL, above.C @ modes.P
        self.static_rows = above.Y_C_K.T @ problem.dual.Y_K[:, :k]
        self.norm, self.C_rest, self.C_K = split.norm_K, above.C_K, problem.rows.C_K
        rounded = body.stiffness_factor.half_solve(abs(body.K) @ np.abs(modes.P))
        eps = ROUNDED * body.precision["stiffness"]
        self.inexact = modes.residual + eps * np.linalg.norm(rounded, axis=0) / modes.omega

    def __call__(self, w: np.ndarray, z: np.ndarray, r: np.ndarray) -> Errors:
        """Return errors at w (S,) in rad/s; z (S, k) complex; r (S,): |R|_{K^-1} that rounding may hide."""
        kappa = 1 + 1j * w * self.rayleigh[1]
        of_K = np.abs(kappa)
        with np.errstate(divide="ignore", invalid="ignore"):  # resonances
            stiffness = self.omega**2 - w[:, None] ** 2 + 1j * w[:, None] * self.damping
            eta = -(z @ self.PL.T) / stiffness
            known = eta @ self.CP.T - (z / kappa[:, None]) @ self.static_rows.T
            amplified = self.omega**2 / np.abs(stiffness)
            gain = self.gain(w)
            rest = 1 / of_K + gain
            largest = np.maximum(rest, amplified.max(axis=1))
            left = complex_norm(self.norm, z)
            # E = K P - M P Omega^2 makes every mode, and the rest, feel of_K * inexact * |e|_K beside R
            felt = of_K[:, None] * self.inexact * amplified
            kept = 1 - np.hypot(np.linalg.norm(felt, axis=1), rest * of_K * np.linalg.norm(self.inexact))
            whole = (np.hypot(np.linalg.norm(eta * self.omega, axis=1), rest * left) + largest * r) / kept
            slack = np.outer(gain * left + rest * of_K * np.linalg.norm(self.inexact) * whole, self.C_rest)
            slack += (whole[:, None] * felt / self.omega) @ np.abs(self.CP).T + np.outer(largest * r, self.C_K)
        high, resonant = ~np.isfinite(gain), ~(kept > 0)
        reasons = np.where(high, TOO_HIGH.format(len(self.omega)), np.where(resonant, RESONANCE, ""))
        known[reasons == RESONANCE] = np.inf
        return Errors(known, np.where((reasons == "")[:, None], slack, np.inf), reasons)

    def gain(self, w: np.ndarray) -> np.ndarray:
        """Return max |1/kappa - 1/(kappa - (w^2 - i w alpha) s)| over all s = 1/omega^2 <= 1/cut^2, (S,).

        kappa = 1 + i w beta. With (w^2 - i w alpha) s/kappa = exp(i theta)/y it is 1/|kappa (y - exp(i theta))|.
        """
        alpha, beta = self.rayleigh
        kappa = 1 + 1j * w * beta
        c = (w**2 - 1j * w * alpha) / kappa
        theta = np.angle(c)
        with np.errstate(divide="ignore"):
            y = np.maximum(self.cut**2 / np.abs(c), np.cos(theta))
            return 1 / (np.abs(kappa) * np.hypot(y - np.cos(theta), np.sin(theta)))


class AnyDamping:
    """A damping matrix: C e is about C (P x - K^-1 R), P m undamped modes; what that leaves bounds the rest.

        |C e - known| <= |C|_{K^-1} |R + A (P x - K^-1 R)|_{K^-1} / gamma,
        gamma^2 = min (1 - w^2 s)^2 + (w mu s)^2 over 0 <= s <= 1/omega_1^2,   D - mu M >= 0

    Symmetric matrices only.
    """

    def __init__(self, problem: Problem):
        body, factor = problem.body, problem.body.stiffness_factor
        modes, L = body.modes(problem.options.auxiliary_modes), problem.map.L
        P, responses = modes.shapes, factor.solve(L)
        self.omega, self.lowest = modes.omega, float(modes.omega[0]) * (1 - GAP)
        self.DP, self.PL, self.CP = P.T @ (body.D @ P), P.T @ L, problem.rows.C @ P
        columns = [body.M @ P, body.D @ P, body.M @ responses, body.D @ responses]
        self.norm = OrthonormalNorm(np.hstack([factor.half_multiply(P), *map(factor.half_solve, columns)]))
        self.static_rows, self.C_K = problem.rows.C @ responses, problem.rows.C_K
        self.symmetric = is_symmetric(body.D)
        self.rate = smallest_rate(body) if self.symmetric else 0.0

    def __call__(self, w: np.ndarray, z: np.ndarray, r: np.ndarray) -> Errors:
        """Return errors as ProportionalDamping does."""
        squares, forces, iw = self.omega**2, z @ self.PL.T, 1j * w[:, None]
        stiffness = (np.diag(squares + v**2) + v * self.DP for v in iw[:, 0])
        x = forces / squares - np.array([solved(*pair) for pair in zip(stiffness, forces, strict=True)])
        left = complex_norm(self.norm, np.hstack([x, iw**2 * x, iw * x, -(iw**2) * z, -iw * z]))
        gamma = self.gamma(w)
        with np.errstate(divide="ignore"):
            slack = np.outer((left + r) / gamma, self.C_K)
        why = UNDAMPED_MOTIONS if self.symmetric else GYROSCOPIC
        return Errors(x @ self.CP.T - z @ self.static_rows.T, slack, np.where(gamma > 0, "", why))

    def gamma(self, w: np.ndarray) -> np.ndarray:
        """Return the smallest |x^* A x|/|x|_K^2 that is proved, (S,)."""
        if not self.symmetric:
            return np.zeros_like(w)
        most = 1 / self.lowest**2
        s = np.minimum(1 / np.maximum(w**2 + self.rate**2, 1 / most), most)
        below = w < self.lowest
        return np.where(below | (self.rate > 0), np.hypot(1 - w**2 * s, w * self.rate * s), 0.0)


def solved(stiffness: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return stiffness^-1 forces; inf where an undamped body is in resonance."""
    try:
        return np.linalg.solve(stiffness, forces)
    except np.linalg.LinAlgError:
        return np.full(forces.shape, np.inf, dtype=complex)


def complex_norm(norm: Callable, z: np.ndarray) -> np.ndarray:
    """Return the norms (S,) of complex z (S, k), of a norm of real linear maps."""
    return np.hypot(norm(z.real), norm(z.imag))
