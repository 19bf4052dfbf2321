"""Damping given by ratios of the lowest modes, proportional above: products with it, without a full matrix."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from .eigenmodes import Modes
from .oscillator import damping_ratios


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
