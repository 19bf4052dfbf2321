"""Scheme: what a generalised-alpha solver does in a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STRAYS = 1e-3  # of the largest change in a step: steps that Newton rejected make 0.2, others 1e-14 to 2e-5


@dataclass(frozen=True)
class Scheme:
    """Generalised-alpha: the parameters of the running solver."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float

    @classmethod
    def of_radius(cls, radius: float) -> Scheme:
        """Of a spectral radius at high frequencies (Chung and Hulbert 1993)."""
        alpha_m, alpha_f = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
        gamma = 0.5 + alpha_f - alpha_m
        return cls(alpha_m, alpha_f, (gamma + 0.5) ** 2 / 4, gamma)

    def mass_and_damping(self, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Factors of M and D in the matrix of a step, beside K."""
        return (1 - self.alpha_m) / (self.beta * h**2 * (1 - self.alpha_f)), self.gamma / (h * self.beta)


def strays_of_first_order(t: np.ndarray, x: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return numbers of rows whose coordinates of first order x (T, n) are not what the trapezoidal rule makes.

    After a step that Newton rejects Exudyn begins it anew from other rates.
    """
    changes = np.diff(x, axis=0)
    off = np.abs(changes - np.diff(t)[:, None] / 2 * (rates[1:] + rates[:-1]))
    return 1 + np.flatnonzero((off > STRAYS * np.abs(changes).max(axis=0, initial=0.0)).any(axis=1))
