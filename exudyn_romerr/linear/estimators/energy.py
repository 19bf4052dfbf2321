"""Estimator "energy": static reconstruction and the total variation of the residual; static solves (theory.md 3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...linalg.blocked_products import decaying_sums
from ...model.body import ElasticBody
from ..residual.decay_rates import DecayRate, body_rates
from ..residual.problem import Problem
from ..residual.residual import DualNorms, OutputNorms
from ..residual.samples import Block, Start
from .bounds import Bounds, Estimator


class Energy(Estimator):
    """|e + K^-1 R|_K <= g and |e'|_M <= g, with g growing by the total variation of R in the K^-1 norm.

        |C e| <= |C K^-1 R| + |C|_{K^-1} g ,   |C e'| <= |C|_{M^-1} g ,   |e|_M <= |K^-1 R|_M + g/omega_1

    For a few admissible decay rates r: g <- exp(-r h) g + variation (constants then change a little); the
    smallest result counts. Of every rate g bounds |d|_{K_r}, d = e + K^-1 R; g_jump is what load jumps made of it.
    """

    name = "energy"
    assumes = "dissipative damping"

    def __init__(self, problem: Problem):
        self._take(problem, problem.dual, body_rates(problem.body), problem.rows)

    def _take(self, problem: Problem, norms: DualNorms, rates: list[DecayRate], rows: OutputNorms) -> None:
        """Take what is bounded: R and outputs as they are, or the rest of both above auxiliary modes."""
        self.rates, self.smooth = rates, Smooth.of(problem.body, rates)
        self.bounds = [*rates, *([] if self.smooth is None else [self.smooth.bound])]  # what follows from rows of g
        self.has_jumps = np.size(problem.options.jumps) > 0
        self.norm, self.norm_static, self.start_norms = norms.norm_K, norms.norm_static, norms.start_norms
        self.static_rows, self.rows = rows.static_rows, rows

    def start(self, start: Start) -> Bounds:
        """Begin a run; return the bounds at its first instant."""
        return self._bounds(*self._started(start))

    def _started(self, start: Start) -> tuple[np.ndarray, ...]:
        """Begin g; return z (1, k), |K^-1 R|_M (1,), g and g_jump (1, rows).

        g(0)^2 = |e0' + r d0|_M^2 + |d0|_{K_r}^2 <= |e0'|_M^2 + 2 r |e0'|_M |d0|_M + |d0|_K^2 since K_r <= K - r^2 M,
        with K d0 = L (y0 + z0).
        """
        if start.y0 is None:  # e0 = e0' = 0, d0 = K^-1 R(0)
            g = np.full(len(self.bounds), float(self.norm(start.z)))
        else:
            w = start.y0.copy()
            w[: len(start.z)] += start.z
            r, (norm_K, norm_static, norm_M) = np.array([rate.r for rate in self.bounds]), self.start_norms
            d_K, d_M, v_M = float(norm_K(w)), float(norm_static(w)), float(norm_M(start.y0_t))
            g = np.hypot(d_K, np.sqrt(v_M * (v_M + 2 * r * d_M)))
        self.g, self.g_jump, self.before = g, np.zeros(len(g)), start.z
        self.smooth = None if self.smooth is None else Smooth(self.smooth.bound, float(g[-1]))
        return start.z[None], self.norm_static(start.z[None]), g[None], self.g_jump[None]

    def advance(self, block: Block) -> Bounds:
        """Go on by one block; return the bounds at the ends of its segments."""
        static = self.norm_static(block.c[:, -1])
        g, g_jump, inside = self._grown(block, static)
        if inside is not None:
            largest, d_M, v_M = inside
            self.inside = largest + d_M, v_M
        return self._bounds(block.c[:, -1], static, g.T, g_jump.T)

    def _grown(self, block: Block, static: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple | None]:
        """Let g grow; return g and g_jump (rows, S) at the ends of segments, where |K^-1 R|_M is `static` (S,).

        Where the frame turns |K^-1 R|_M, |d|_M and |e'|_M, too, each (S,), the largest within segments; else None.
        """
        varied, jumps = block.variation(self.norm, self.before)
        n, r = len(self.rates), np.array([rate.r for rate in self.rates])
        decays = np.exp(-r[:, None] * block.h)
        kicks = decays * jumps
        g, g_jump = decaying_sums(decays, kicks + varied, self.g[:n]), decaying_sums(decays, kicks, self.g_jump[:n])
        inside = None if block.turn is None else self._inside(static, varied + jumps, g)
        if self.smooth is not None:
            more = varied - block.length(self.norm)
            self.smooth, last = self.smooth.advanced(block, self.norm, jumps, more, g[0])
            g, g_jump = np.vstack([g, last]), np.vstack([g_jump, g_jump[0]])
        self.g, self.g_jump, self.before = g[:, -1].copy(), g_jump[:, -1].copy(), block.c[-1, -1].copy()
        return g, g_jump, inside

    def _inside(self, ends: np.ndarray, varied: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, ...]:
        """Largest |K^-1 R|_M, |d|_M and |e'|_M within segments, in which R varies by `varied` (S,).

        ends (S,) : the first of these at their ends.
        """
        static = np.append(self.norm_static(self.before), ends)
        per_mass = self.rates[0].per_mass if self.rates else 0.0  # of r = 0: 1/omega
        start = np.hstack([self.g[: len(g), None], g[:, :-1]])
        return np.maximum(static[:-1], static[1:]) + per_mass * varied, *smallest(self.rates, start + varied)[1:]

    def _bounds(self, z: np.ndarray, static: np.ndarray, g: np.ndarray, g_jump: np.ndarray) -> Bounds:
        """Bounds of z (S, k), |K^-1 R|_M (S,), g and g_jump (S, rows)."""
        self._given = z, static, g, g_jump
        d_K, d_M, v_M = smallest(self.bounds, g.T)
        known = np.abs(z @ self.static_rows.T)
        return Bounds(static + d_M, v_M, known + self.rows.share(d_K, v_M), self._jumped(g_jump))

    def _jumped(self, g_jump: np.ndarray) -> np.ndarray | None:
        """What load jumps made of the bounds of outputs; None: none may come."""
        if not self.has_jumps:
            return None
        d_K, _, v_M = smallest(self.bounds, g_jump.T)
        return self.rows.share(d_K, v_M)


class StaticError(Estimator):
    """|C e| = |C K^-1 R| and |e|_M = |K^-1 R|_M, exact; velocities are zero."""

    assumes = "static equilibrium at every load step (exact, no estimate)"

    def __init__(self, problem: Problem):
        self.norm, self.static_rows = problem.dual.norm_static, problem.rows.static_rows

    def start(self, start: Start) -> Bounds:
        """Return the errors at the first load step."""
        return self._bounds(start.z[None])

    def advance(self, block: Block) -> Bounds:
        """Return the errors at further load steps."""
        return self._bounds(block.c[:, -1])

    def _bounds(self, z: np.ndarray) -> Bounds:
        self._given, known = (z,), -(z @ self.static_rows.T)
        return Bounds(self.norm(z), np.zeros(len(z)), np.abs(known), None, known, np.zeros_like(known))


class Smooth:
    """Bounds where R is slow beside what is bounded, without damping: M d'' + K d = M K^-1 R'' =: -R_n.

        |d + K^-1 R_n|_K <= g ,   |d'|_M <= g ,   |R_n|_{K^-1} <= |R''|/omega^2

    g grows by the total variation of R'' over omega^2, at jumps by |[R]| + |[R']|/omega + |[R'']|/omega^2, all in the
    K^-1 norm; omega : the lowest frequency there is. So |d|_K <= g + |R''|/omega^2 and |e'|_M <= g + |R'|/omega.

    bound : what follows from g, of r = 0. last : R' and R'' before, the jumps from which come.
    """

    def __init__(self, bound: DecayRate, g: float = 0.0, last: tuple[np.ndarray | float, ...] = (0.0, 0.0)):
        self.bound, self._g, self._last = bound, g, last

    @classmethod
    def of(cls, body: ElasticBody, rates: Sequence[DecayRate]) -> Smooth | None:
        """Make it for the frequencies that rates are of, the first of which is 0; None: a damped body forgets."""
        damped = body.D is not None if body.rayleigh is None else any(body.rayleigh)
        return None if damped or not rates else cls(rates[0])

    def advanced(
        self, block: Block, norm: Callable, steps: np.ndarray, more: np.ndarray, plain: np.ndarray
    ) -> tuple[Smooth, np.ndarray]:
        """Return what follows a block, and bounds (S,) of |d|_K and |e'|_M at the ends of its segments.

        steps (S,) : jumps of R. more (S,) : variation that control points do not hold. plain (S,) : the bounds by the
        variation of R, taken where segments are so short that R, whose polynomials change from one to the next, is
        not slow.
        """
        per_rate = self.bound.per_mass
        if np.mean(block.h) <= per_rate:
            return Smooth(self.bound, float(plain[-1])), plain
        degree, h = block.c.shape[1] - 1, block.h[:, None, None]
        rate = degree * np.diff(block.c, axis=1) / h
        bend = (degree - 1) * np.diff(rate, axis=1) / h if degree > 1 else np.zeros_like(rate)
        jumps = norm(np.stack([_jumps(x, before) for x, before in zip((rate, bend), self._last, strict=True)]))
        varied = norm(np.diff(bend, axis=1)).sum(axis=1)
        g = self._g + np.cumsum(more + steps + per_rate * jumps[0] + per_rate**2 * (jumps[1] + varied))
        ends = norm(np.stack([rate[:, -1], bend[:, -1]]))
        following = Smooth(self.bound, float(g[-1]), (rate[-1, -1].copy(), bend[-1, -1].copy()))
        return following, g + np.maximum(per_rate * ends[0], per_rate**2 * ends[1])


def _jumps(points: np.ndarray, before: np.ndarray | float) -> np.ndarray:
    """Jumps (S, k) at the begin of segments with control points (S, d, k)."""
    return points[:, 0] - np.vstack([np.broadcast_to(before, points[:1, 0].shape), points[:-1, -1]])


def smallest(rates: Sequence[DecayRate], g: np.ndarray) -> np.ndarray:
    """Return the bounds (3, S) of |d|_K, |d|_M and |e'|_M: the smallest over the rates of g (rates, S)."""
    if not rates:  # nothing is left to bound: all modes are auxiliary
        return np.zeros((3, g.shape[1]))
    factors = np.array([(rate.c, rate.per_mass, rate.velocity) for rate in rates])
    return np.min(factors[:, :, None] * g[:, None, :], axis=0)
