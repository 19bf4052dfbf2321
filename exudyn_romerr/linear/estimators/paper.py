"""The estimators of Ruiner, Fehr, Haasdonk, Eberhard (2012): "state-space" (11), "fast" (26), "convolution" (25)."""

from __future__ import annotations

import numpy as np

from ...linalg import oscillator
from ...linalg.blocked_products import decaying_sums
from ..residual.kernels import LagTable
from ..residual.problem import Problem
from ..residual.residual import times
from ..residual.samples import Block, Start
from .bounds import Bounds, Estimator


class MassNormEstimator(Estimator):
    """Shared part of the estimators that bound |e|_M by the integral of |R|_{M^-1} (paper, section 4).

    _state_bounds(t, integral, block) : their bounds of |e|_M and |e'|_M after times t (S,) from the start, with
    int |R| up to there.
    initial : |e0|_M, |e0|_K, |e0'|_M of the initial error.
    """

    name: str

    def __init__(self, problem: Problem):
        self.norm = problem.dual.norm_M
        self.C2, self.velocity_rows = problem.rows.C_M, problem.rows.velocity_rows
        self.start_norms = problem.dual.start_norms

    def start(self, start: Start) -> Bounds:
        """Begin a run; return the bounds at its first instant."""
        self.t0, self.integral, self.initial = start.t, 0.0, (0.0, 0.0, 0.0)
        if start.y0 is not None:
            norm_K, norm_static, norm_M = self.start_norms
            self.initial = float(norm_static(start.y0)), float(norm_K(start.y0)), float(norm_M(start.y0_t))
        return self._bounds(*self._state_bounds(np.zeros(1), np.zeros(1), None))

    def advance(self, block: Block) -> Bounds:
        """Go on by one block; return the bounds at the ends of its segments."""
        total = self.integral + np.cumsum(block.integral(self.norm))
        self.integral = float(total[-1])
        return self._bounds(*self._state_bounds(block.t - self.t0, total, block))

    def _bounds(self, position: np.ndarray, velocity: np.ndarray) -> Bounds:
        self._given = position, velocity
        outputs = np.where(self.velocity_rows, times(velocity, self.C2), times(position, self.C2))
        return Bounds(position, velocity, outputs)


class StateSpace(MassNormEstimator):
    """(|e|_M^2 + |e'/omega_1|_M^2)^(1/2) <= C1 (|e_s0| + int |R|_{M^-1} / omega_1): the baseline with the hump.

    Paper (11), with time measured in 1/omega_1: C1 mixes displacements and velocities, so that in seconds, hours or
    milliseconds it would give a different bound each.
    """

    name = "state-space"
    assumes = "Rayleigh damping, all modes known (up to 2000 coordinates)"

    def __init__(self, problem: Problem):
        super().__init__(problem)
        body = problem.body
        body.require_rayleigh("estimator 'state-space'")
        omega = body.all_modes().omega
        self.omega_1 = w = float(omega[0])
        s_max = oscillator.largest_impulse_response(omega, body.damping_ratios(omega))
        self.C1 = oscillator.largest_state_response(omega / w, s_max * w)

    def _state_bounds(self, t, integral, block):
        w, (e_M, _, v_M) = self.omega_1, self.initial
        bound = self.C1 * (np.hypot(e_M, v_M / w) + integral / w)
        return bound, w * bound


class Fast(MassNormEstimator):
    """|e|_M <= C11 |e0|_M + C12 |e0'|_M + C12 int |R|_{M^-1}, paper (26): one addition a step.

    |e'|_M <= sqrt(|e0|_K^2 + |e0'|_M^2) + int |R|_{M^-1} from the energy of the error. Where damping is no Rayleigh
    damping, C11 |e0|_M is replaced by |e0|_K / omega_1.
    """

    name = "fast"
    assumes = "dissipative damping"

    def __init__(self, problem: Problem):
        super().__init__(problem)
        self.kernel = problem.kernel

    def _state_bounds(self, t, integral, block):
        kernel, (e_M, e_K, v_M) = self.kernel, self.initial
        displaced = e_K / kernel.omega_1 if kernel.C11 is None else kernel.C11 * e_M
        return displaced + kernel.C12 * (v_M + integral), float(np.hypot(e_K, v_M)) + integral


class Convolution(Fast):
    """|e(t)|_M <= Ct11(t)|e0| + Ct12(t)|e0'| + int Ct12(t - s) |R(s)|_{M^-1} ds, paper (25).

    Exponential envelopes of Ct12: one recurrence a step each, the smallest result counts. Other kernels: summed over
    all steps before, with the kernel's maximum over each step's lag interval (quadratic in the number of steps).
    """

    name = "convolution"

    def __init__(self, problem: Problem):
        super().__init__(problem)
        self.table = None if self.kernel.envelopes else LagTable(self.kernel)

    def start(self, start):
        """Begin a run; return the bounds at its first instant."""
        self._reset()
        return super().start(start)

    def _reset(self) -> None:
        self.sums = [0.0] * len(self.kernel.envelopes)
        self.history = (np.zeros(0), np.zeros(0), np.zeros(0))  # step ends, step lengths, int |R| of each step

    def _state_bounds(self, t, integral, block):
        fast, velocity = super()._state_bounds(t, integral, block)
        if block is None:
            forced = np.zeros_like(t)
        else:
            forced = self._by_recurrence(block) if self.table is None else self._by_history(block)
        return np.minimum(fast, self.kernel.free_motion(t, *self.initial) + forced), velocity

    def _by_recurrence(self, block: Block) -> np.ndarray:
        added = block.integral(self.norm)
        rates = [rate for _, rate in self.kernel.envelopes]
        decays = np.exp(-np.array(rates)[:, None] * block.h)
        sums = decaying_sums(decays, np.tile(added, (len(decays), 1)), self.sums)
        self.sums = [float(x[-1]) for x in sums]
        return np.min([a * x for (a, _), x in zip(self.kernel.envelopes, sums, strict=True)], axis=0)

    def _by_history(self, block: Block) -> np.ndarray:
        """Sum over all segments so far of the kernel's maximum over the lag interval times int |R|."""
        new = (block.t, block.h, block.integral(self.norm))
        self.history = tuple(map(np.concatenate, zip(self.history, new, strict=True)))
        ends, lengths, added = self.history
        hi = block.t[:, None] - (ends - lengths)
        lo = np.maximum(block.t[:, None] - ends, 0.0)
        past = ends <= block.t[:, None]
        finite = np.isfinite(added)
        sums = np.where(past, self.table(lo, np.maximum(hi, lo)), 0.0)[:, finite] @ added[finite]
        return np.where(past[:, ~finite].any(axis=1), np.inf, sums)
