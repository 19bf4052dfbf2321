"""Estimator "output-kernel": the paper's convolution with |C Phi12(t)| in place of |C| |Phi12(t)|."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..decay.lag_table import LagTable
from ..linalg import oscillator
from ..residual.modal_split import NormsAbove
from ..trajectory.bounds import Bounds
from ..trajectory.segments import Block
from .paper import Convolution

if TYPE_CHECKING:
    from ..residual.dual_norms import OutputNorms
    from ..residual.modal_split import AuxiliaryModes
    from ..residual.problem import Problem


class OutputKernel:
    """Bound of |c Phi12(t)| (dual to the M-norm) for one output row c.

        |c Phi12(t)|^2 = sum_i (c phi_i)^2 s_i(t)^2

    The lowest m terms are summed; the rest is closed by completeness: |s_i| <= C exp(-r t)/omega_i for every omega_i
    above the modes, hence rest <= C exp(-r t) |c|_rest in the K^-1 norm.
    """

    def __init__(self, modes: AuxiliaryModes, above: OutputNorms, row: int, rates: list[tuple[float, float]]):
        self.omega, self.zeta, self.omega_1 = modes.omega, modes.body.damping_ratios(modes.omega), modes.omega[0]
        self.weights = (above.C[row] @ modes.P) ** 2
        self.rest = [(constant * above.C_K[row], rate) for rate, constant in rates]

    def phi12_on(self, lo, hi):
        """Return the bound over each lag interval [lo, hi]."""
        square = np.zeros(np.shape(lo))
        for omega, zeta, weight in zip(self.omega, self.zeta, self.weights, strict=True):
            square += weight * oscillator.impulse_response_on(omega, zeta, lo, hi) ** 2
        if self.rest:
            square += np.min([(size * np.exp(-rate * lo)) ** 2 for size, rate in self.rest], axis=0)
        return np.sqrt(square)


class OutputConvolution(Convolution):
    """|c e(t)| <= free motion + int |c Phi12(t - s)| |R(s)|_{M^-1} ds for every displacement output row c.

    Position, velocity and velocity outputs are those of "convolution". Summed over all steps before: quadratic in
    their number, for study and for short runs.
    """

    name = "output-kernel"
    assumes = "Rayleigh damping (or none)"

    def __init__(self, problem: Problem):
        if problem.body.modal is not None:
            self.assumes = "damping ratios by mode"
        split = problem.split  # before the kernel, which would ask for the first mode alone
        super().__init__(problem)
        above = NormsAbove(problem.rows, split.modes)
        pairs = [(rate.r, rate.c) for rate in split.rates]
        rows = np.flatnonzero(~self.velocity_rows)
        self.tables = {int(row): LagTable(OutputKernel(split.modes, above, int(row), pairs)) for row in rows}

    def advance(self, block: Block) -> Bounds:
        """Go on by one block; return the bounds at the ends of its segments."""
        bounds = super().advance(block)
        if self.table is None:
            self._remember(block)
        free = self._free_motion(block.t - self.t0)
        outputs = bounds.outputs.copy()
        for row, table in self.tables.items():
            own = self.C2[row] * free + self._summed(block, table)
            outputs[:, row] = np.minimum(outputs[:, row], own)
        return Bounds(bounds.position, bounds.velocity, outputs)
