"""What is read of a mechanism at one row of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Reading:
    """Of all but floating bodies, in axes of bodies, at one row.

    M, D, K (n_a, n_a) : K without forces of constraints. G, C (c, n_a) of independent constraints: forces G^T lam,
    what is kept zero C z. H (n_a, n_a, all) : change of the forces of constraints, for each multiplier. sampled :
    empty, or (n_a, n_a) twice, what coordinates and rates at the begin of the step make of forces at its end.
    """

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    G: np.ndarray
    C: np.ndarray
    H: np.ndarray
    sampled: tuple[np.ndarray, ...] = ()

    def stiffness(self, multipliers: np.ndarray) -> np.ndarray:
        """K with what turning constraints add to it."""
        return self.K + self.H @ multipliers if multipliers.size else self.K
