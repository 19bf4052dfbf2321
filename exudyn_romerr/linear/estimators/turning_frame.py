"""Turning: adds Coriolis, centrifugal and Euler terms of a rotating frame to an estimator's bound (theory.md 7)."""

from __future__ import annotations

import copy

import numpy as np

from ...linalg.blocked_products import decaying_sums
from ..residual.decay_rates import body_rates
from ..residual.problem import Problem
from ..residual.samples import Block, Start
from .bounds import Bounds, Estimator
from .energy import smallest

LARGEST = 700.0  # growth of a step whose exponential is still a number; more is no bound anyway


class Turning(Estimator):
    """Bounds in a turning frame: M e'' + (D + 2 M w~) e' + (K + M S) e = -R, S = al~ + w~ w~.

    e = e_a + e_b: e_a as if the frame did not turn, bounded by the estimator; e_b is driven by
    F = M (2 w~ e_a' + S e_a), |F|_{M^-1} <= 2 |w| |e_a'|_M + |S| |e_a|_M, and by what R misses of these terms between
    samples. The Coriolis force does no work and the centrifugal part goes into the stiffness K_r + M w~ w~ > 0, so
    that a steady spin does not make e_b grow:

        g' <= (-r + r |w| p + |al| p/2 + |w| |al| p^2) g + |F|_{M^-1} ,   p^-2 = kappa_r - |w|^2

    and e_b is bounded by g / (1 - |w|^2 / kappa_r)^(1/2) as d is by g in estimator "energy".
    """

    def __init__(self, estimator: Estimator, problem: Problem):
        self.estimator = estimator
        self.assumes = estimator.assumes
        self.rates = body_rates(problem.body)
        self._r, self._per_mass = (
            np.array(x)[:, None] for x in zip(*((e.r, e.per_mass) for e in self.rates), strict=True)
        )
        self.rows = problem.rows
        self.g = [0.0] * len(self.rates)

    def __copy__(self) -> Turning:
        other = object.__new__(Turning)
        other.__dict__ = {**self.__dict__, "estimator": copy.copy(self.estimator)}
        return other

    def start(self, start: Start) -> Bounds:
        """Begin a run; return the bounds at its first instant."""
        self.g = [0.0] * len(self.rates)
        self._before = self.estimator.start(start)
        self._seen = np.zeros((len(self.rates), 1))
        return self._before

    def advance(self, block: Block) -> Bounds:
        """Go on by one block; return the bounds at the ends of its segments."""
        bounds = self.estimator.advance(block)
        before, self._before = self._before, bounds.at(np.array([-1]))
        self._seen = np.zeros((len(self.rates), len(block.h)))
        if block.turn is None and not any(self.g):
            return bounds
        force = self._force(block, before, bounds)
        left, too_fast = self._left(block)
        g = self._grown(left, too_fast, block, force)
        self.g = g[:, -1].tolist()
        with np.errstate(over="ignore"):  # inf is the right answer there
            self._seen = seen = g / np.sqrt(left)
            d_K, d_M, v_M = smallest(self.rates, seen)
            return bounds.widened(d_M, v_M, self.rows.share(d_K, v_M))

    def instant(self, i: int) -> tuple:
        """Return what bounds the outputs at entry i of the bounds returned last."""
        return self.estimator.instant(i), self._seen[:, i : i + 1].copy()

    def bounds_at(self, instant: tuple) -> Bounds:
        """Return the bounds (1, R) at an instant of an estimator with other outputs."""
        inner, seen = instant
        d_K, d_M, v_M = smallest(self.rates, seen)
        return self.estimator.bounds_at(inner).widened(d_M, v_M, self.rows.share(d_K, v_M))

    def _force(self, block: Block, before: Bounds, bounds: Bounds) -> np.ndarray:
        """|F|_{M^-1} (S,), its largest value in every segment."""
        if block.turn is None:
            return np.zeros(len(block.h))
        inside = self.estimator.inside
        if inside is None:  # the others' bounds of |e_a'| only grow, and |e_a| grows by at most its integral
            inside = np.append(before.position, bounds.position[:-1]) + block.h * bounds.velocity, bounds.velocity
        position, velocity = inside
        return 2 * block.turn.w * velocity + block.turn.S * position + block.turn.missed

    def _grown(self, left: np.ndarray, too_fast: np.ndarray, block: Block, force: np.ndarray) -> np.ndarray:
        """Return g (rates, S); left, too_fast: see _left."""
        growth = -self._r
        if block.turn is not None:
            w, al, p = block.turn.w, block.turn.al, self._per_mass / np.sqrt(left)
            growth = growth + self._r * w * p + al * p / 2 + w * al * p**2
        factor = np.exp(np.minimum(growth * block.h, LARGEST))
        return decaying_sums(factor, np.where(too_fast, np.inf, force * block.h * np.maximum(factor, 1.0)), self.g)

    def _left(self, block: Block) -> tuple[np.ndarray, np.ndarray]:
        """1 - |w|^2 / kappa_r (rates, S), and where that is not positive: the frame turns too fast (1 there)."""
        if block.turn is None:
            shape = len(self.rates), len(block.h)
            return np.ones(shape), np.zeros(shape, dtype=bool)
        left = 1 - (block.turn.w * self._per_mass) ** 2
        return np.where(left > 0, left, 1.0), left <= 0
