"""Scheme: what a generalised-alpha solver does in a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
