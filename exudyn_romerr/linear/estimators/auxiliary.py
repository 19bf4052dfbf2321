"""Estimator "auxiliary": m modes of the full body beside the simulation, energy bound of the rest (theory.md 4)."""

from __future__ import annotations

import numpy as np

from ...linalg.blocked_products import largest_sizes, row_norms, rows_times
from ...linalg.modal_oscillators import ModalOscillators
from ..residual.modal_split import above
from ..residual.problem import Problem
from ..residual.samples import Block, Start
from .bounds import Bounds
from .energy import Energy, smallest

EPS = np.finfo(float).eps


class Auxiliary(Energy):
    """The error's lowest m modal coordinates eta are integrated exactly; what is left is bounded by its energy.

        |C e| <= |C P eta - C K^-1 R_rest| + |C|_rest g ,   R_rest = (I - M P P^T) R

    eta'' + D_eta eta' + Omega^2 eta = -P^T R. The signed part corrects the output; the last term is its bound.
    Rounding of eta is estimated and added.
    """

    name = "auxiliary"
    assumes = "Rayleigh damping (or none)"

    def __init__(self, problem: Problem):
        split, modes = problem.split, problem.split.modes
        if problem.body.modal is not None:
            self.assumes = "damping ratios by mode"
        self.oscillators = ModalOscillators(modes.omega, problem.body.damping_ratios(modes.omega))
        rest = above(problem.rows, modes)
        self._take(problem, split, split.rates, rest)
        self.forcing = -split.PL[:, : problem.map.coordinates.k]
        self.start_rows = split.PL
        self.CP = rest.C @ modes.P
        self.mode_residual, self.beta = modes.residual, problem.body.proportional[1]

    def start(self, start: Start) -> Bounds:
        """Begin a run; return the bounds at its first instant."""
        given, omega = self._started(start), self.oscillators.omega
        self.state = np.zeros((2, len(omega)))
        self.rounding = self.missed = np.zeros(len(omega))
        if start.y0 is not None:  # eta = P^T M e0 = Omega^-2 P^T K e0, eta' = P^T M e0'
            rows = self.start_rows[:, : len(start.y0)]
            self.state = np.array([rows @ start.y0 / omega**2, rows @ start.y0_t])
            e, e_t = np.abs(rows) @ np.abs(start.y0) / omega**2, np.abs(rows) @ np.abs(start.y0_t)
            # modes are M-orthogonal to rounding: each eta sees that much of all the others
            self.rounding = 8 * EPS * (e + np.linalg.norm(e) + (e_t + np.linalg.norm(e_t)) / omega)
        return self._bounds(*given, self.state[None], self.rounding[None])

    def advance(self, block: Block) -> Bounds:
        """Go on by one block; return the bounds at the ends of its segments."""
        forces = rows_times(block.c, self.forcing.T)
        states = self.oscillators.advance(self.state, block.t, block.h, forces)
        static, missed = self.norm_static(block.c[:, -1]), self._unresolved(block)
        g, g_jump, inside = self._grown(block, static)
        if inside is not None:
            largest, d_M, v_M = inside
            eta, eta_t = self.oscillators.inside(self.state, states, block.h, forces)
            self.inside = (
                np.hypot(row_norms(eta), largest + d_M) + row_norms(missed),
                np.hypot(row_norms(eta_t), v_M) + row_norms(missed * self.oscillators.omega),
            )
        eta, eta_t = largest_sizes(states.reshape(len(states), -1)).reshape(2, -1)
        self.rounding = self.rounding + self._rounding_of(block, eta, eta_t, g)
        self.state = states[-1].copy()
        # of times: steps follow them but for rounding, which does not add up
        of_times = self.oscillators.drift * (self.oscillators.omega * eta + eta_t)
        inexact = self.rounding + of_times + missed
        return self._bounds(block.c[:, -1], static, g.T, g_jump.T, states, inexact)

    def _rounding_of(self, block: Block, eta: np.ndarray, eta_t: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Estimated error (m,) that rounding adds to eta in a block: its largest per segment, times their number.

        eta, eta_t: the largest of the block.

        A few units in the last place of its amplitude, of the angle omega h and of the terms of -P^T R, which cancel;
        and what inexact modes feel of the whole error, |K phi - omega^2 M phi|_{K^-1} (|e|_K + beta |e'|_K).
        """
        omega, duration = self.oscillators.omega, block.h.sum()
        terms = np.abs(self.forcing) @ block.largest()
        added = 8 * EPS * ((len(block.h) + omega * duration) * (eta + eta_t / omega) + duration / omega * terms)
        d_K = smallest(self.bounds, g)[0].max()
        static = float(self.norm(block.c[-1, -1])) + (g[0].max() if len(g) else 0.0)  # the variation is in g
        whole = float(row_norms((eta + self.beta * eta_t) * omega)) + d_K + static
        return added + duration * self.mode_residual * whole

    def _bounds(self, z, static, g, g_jump, states, inexact) -> Bounds:
        """As in Energy; states (S, 2, m): eta and eta', inexact (S, m): what eta may be off."""
        self._given = z, static, g, g_jump, states, inexact
        d_K, d_M, v_M = smallest(self.bounds, g.T)
        eta, eta_t = states[:, 0], states[:, 1]
        known = np.where(self.rows.velocity_rows, eta_t @ self.CP.T, eta @ self.CP.T - z @ self.static_rows.T)
        omega = np.where(self.rows.velocity_rows[:, None], self.oscillators.omega, 1.0)
        slack = self.rows.share(d_K, v_M) + inexact @ (np.abs(self.CP) * omega).T
        position = np.hypot(row_norms(eta), static + d_M) + row_norms(inexact)
        velocity = np.hypot(row_norms(eta_t), v_M) + row_norms(inexact * self.oscillators.omega)
        return Bounds(position, velocity, np.abs(known) + slack, self._jumped(g_jump), known, slack)

    def _unresolved(self, block: Block) -> np.ndarray:
        """Bounds (S, m) of eta's response to the part of the inputs that the polynomial does not contain."""
        if not block.unresolved.any():  # what earlier blocks missed stays
            return self.missed[None]
        p = block.unresolved.shape[1]
        rows = np.abs(self.forcing[:, self.forcing.shape[1] - p :])
        impulse = (block.h[:, None] * block.unresolved) @ rows.T
        impulse /= self.oscillators.omega
        total = np.cumsum(impulse, axis=0)
        total += self.missed
        self.missed = total[-1].copy()
        return total
