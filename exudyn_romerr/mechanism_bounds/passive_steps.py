"""PassiveSteps: what generalised-alpha makes of an error, whatever dampers there are (theory.md 8).

With kappa = (1 - rho)/(1 + rho) steps of Chung and Hulbert's scheme have a storage S of displacements x, velocities v
and algorithmic accelerations a,

    2 S = |v + kappa h a/2|_M^2 + kappa^2 h^2 |a|_M^2/2
        + |x + kappa h v/2 - kappa^2 h^2 a/4|_K^2 + kappa^2 h^2 |v - kappa h a/2|_K^2/4 ,

that grows by the work of forces on the velocity that the step sees, and by no more: ideal joints do none, dampers and
gyroscopic forces take away or do none. (2 S)^1/2 is a norm of (x, v, a), called g below.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

SAME = 1e-9  # of a parameter of the scheme


class Means(NamedTuple):
    """Of the squared frequencies x of the free body that rows C see, weighed by what |C|_{K^-1}^2 has of each (R,).

    squares : E[x] = |C|_{M^-1}^2 / |C|_{K^-1}^2. inverse, inverse_squares : E[1/x], E[1/x^2]; None: not known.
    """

    squares: np.ndarray
    inverse: np.ndarray | None = None
    inverse_squares: np.ndarray | None = None


@dataclass(frozen=True)
class PassiveSteps:
    """Constants of the scheme with a kappa in [0, 1]; 0 is the trapezoidal rule, which has its energy for S."""

    kappa: float

    @classmethod
    def of(cls, alpha_m: float, alpha_f: float, beta: float, gamma: float) -> PassiveSteps | None:
        """Return those of a scheme; None: it is none of Chung and Hulbert's, nor the trapezoidal rule."""
        if (alpha_m, alpha_f, beta, gamma) == (0.0, 0.0, 0.25, 0.5):
            return cls(0.0)  # Newmark's: its equations hold at samples, so their averages do
        kappa = 1 - 2 * alpha_f
        off = np.subtract((alpha_m, beta, gamma), ((1 - 3 * kappa) / 2, (1 + kappa) ** 2 / 4, 0.5 + kappa))
        return cls(kappa) if -SAME <= kappa <= 1 + SAME and np.abs(off).max() <= SAME else None

    def start(self, h: float, mass: float, stiffness: float) -> float:
        """Return g of a start at rest with accelerations a, sizes |a|_M and |a|_K (of bodies and springs)."""
        size = self.kappa * h
        return float(np.hypot(np.sqrt(3 / 4) * size * mass, np.sqrt(1 / 8) * size**2 * stiffness))

    def displacement(self, h: float, rows: Means) -> np.ndarray:
        """Return c with |C (e + K^-1 f)| <= c |C|_{K^-1} g."""
        return np.sqrt(1 + self._seen(h, rows))

    def velocity(self, h: float, rows: Means) -> np.ndarray:
        """Return c with |C e'| <= c |C|_{M^-1} g."""
        if not self.kappa:
            return np.ones_like(rows.squares)
        seen, ratio = self._seen(h, rows), rows.squares / self._limit(h)
        return np.sqrt(1 / 6 + 4 / 3 * np.divide(seen, ratio, out=np.ones_like(ratio), where=ratio > 0))

    def _limit(self, h: float) -> float:
        return 4 / (3 * (self.kappa * h) ** 2)

    def _seen(self, h: float, rows: Means) -> np.ndarray:
        """|C|^2 in the inverse of K + limit M, over that in K^-1: the mean of x/(x + limit) of squared frequencies x.

        That is concave in x; and at least what a share E[1/x]^2/E[1/x^2] of one frequency, the rest at inf, leaves.
        """
        if not self.kappa:
            return np.zeros_like(rows.squares)
        limit = self._limit(h)
        by_squares = rows.squares / (rows.squares + limit)
        if rows.inverse is None:
            return by_squares
        share, one = rows.inverse**2 / rows.inverse_squares, limit * rows.inverse_squares / rows.inverse
        return np.minimum(by_squares, 1 - share + share / (1 + one))

    @property
    def norms(self) -> tuple[float, float]:
        """Return c with |e + K^-1 f|_K <= c g and |e'|_M <= c g."""
        return (np.sqrt(2.0), np.sqrt(1.5)) if self.kappa else (1.0, 1.0)

    @property
    def from_rest(self) -> tuple[float, float]:
        """Return the same in steps of one size, of what began at rest without accelerations; of rows, too."""
        k = self.kappa
        others = max(1.0, 1 / 2 + 1 / (1 + 2 * k)), max(1.0, 2 / 3 + 2 / 3 / (1 + 3 * k))
        return tuple(float(min(pair)) for pair in zip(self.norms, others, strict=True))

    @property
    def impulse(self) -> float:
        """Return c: a force f beside all others adds c h |f|_{M^-1} to g at most, in a step."""
        return float(np.sqrt(1 + 2 * self.kappa**2 / (1 + 3 * self.kappa) ** 2))
