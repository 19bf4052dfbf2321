"""Exact solutions in continuous time, at any instants: loads of sines and of straight pieces with kinks and jumps.

Nothing here uses exudyn_romerr. On each straight piece the forced motion is known in closed form; what is left moves
freely: closed forms of the modes for Rayleigh damping, eigenvectors of the state form for any other (and matrix
exponentials where these are nearly dependent).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la
from numpy.polynomial import polynomial as poly

from tests.helpers.truth import _modes, impulse

RESOLVED = 3.0  # rad of the load per step: more needs more than the points at which the bound looks at the load
DEPENDENT = 1e5  # condition number of eigenvectors above which matrix exponentials are taken: they lose fewer digits


@dataclass(frozen=True)
class Signal:
    """u(t) (p,) = start_i + slope_i (t - knot_i) on piece i, right-continuous, plus size sin(W t + phase).

    knots (P,) ascending, start and slope (P, p); before the first knot its piece goes on. size, W, phase (p,).
    """

    knots: np.ndarray
    start: np.ndarray
    slope: np.ndarray
    size: np.ndarray
    W: np.ndarray
    phase: np.ndarray

    @property
    def p(self):
        return self.start.shape[1]

    @property
    def jumps(self):
        """Times at which the value jumps."""
        reached = self.start[:-1] + self.slope[:-1] * np.diff(self.knots)[:, None]
        jumped = np.abs(self.start[1:] - reached).max(axis=1) > 1e-12 * np.abs(self.start).max(initial=1e-300)
        return self.knots[1:][jumped].tolist()

    def __call__(self, t):
        """U (p,) at one time; a float, or (T,) at many times, if p = 1."""
        values = self.at(np.atleast_1d(t))
        return (values[:, 0] if np.ndim(t) else float(values[0, 0])) if self.p == 1 else values[0]

    def at(self, t):
        """U (T, p) at times t (T,)."""
        i = np.maximum(np.searchsorted(self.knots, t, side="right") - 1, 0)
        straight = self.start[i] + self.slope[i] * (t - self.knots[i])[:, None]
        return straight + self.size * np.sin(np.outer(t, self.W) + self.phase)


def signal(p, knots=(0.0,), start=None, slope=None, size=None, W=None, phase=None):
    """Return a Signal; what is not given is zero."""
    zero, row = np.zeros((len(knots), p)), np.zeros(p)
    parts = (zero if x is None else np.asarray(x, dtype=float).reshape(zero.shape) for x in (start, slope))
    return Signal(np.asarray(knots, dtype=float), *parts, *(row if x is None else x + row for x in (size, W, phase)))


def piecewise_linear(knots, values):
    """Return the Signal that connects values (P, p) at knots (P,) and stays at the last one."""
    slope = np.diff(values, axis=0) / np.diff(knots)[:, None]
    return signal(values.shape[1], knots, values, np.vstack([slope, np.zeros_like(values[:1])]))


class Exact:
    """The exact motion of M q'' + D q' + K q = B u(t), q(t0) = q0, q'(t0) = q0_t; rayleigh None: any matrix D."""

    def __init__(self, M, D, K, rayleigh=None):
        self.M, self.omega, self.shapes = M, *_modes(M, K)
        self.D = self.shapes.T @ D @ self.shapes
        self.zeta = None if rayleigh is None else (rayleigh[0] / self.omega + rayleigh[1] * self.omega) / 2
        if rayleigh is not None:
            self.D = np.diag(2 * self.zeta * self.omega)

    def motion(self, B, u, q0, q0_t, t):
        """Return q and q' at times t (T,) ascending, each (T, N); the initial state is that at t[0]."""
        b = self.shapes.T @ B
        waves = [self._wave(b[:, i] * size, W, phase) for i, (size, W, phase) in enumerate(_sines(u)) if size]
        x, v = np.zeros((2, len(t), len(self.omega)))
        x[0], v[0] = self.shapes.T @ self.M @ q0, self.shapes.T @ self.M @ q0_t
        now, state = t[0], (x[0].copy(), v[0].copy())
        inner = u.knots[(u.knots > t[0]) & (u.knots < t[-1])]
        for end in [*inner, np.inf]:
            here = (t > now) & (t <= end)
            ask = np.append(t[here], end if np.isfinite(end) else [])
            found = self._piece(b, u, waves, now, state, ask)
            x[here], v[here] = (part[: here.sum()] for part in found)
            if np.isfinite(end):
                now, state = end, tuple(part[-1] for part in found)
        return x @ self.shapes.T, v @ self.shapes.T

    def _piece(self, b, u, waves, now, state, t):
        """Modal x and x' at times t (T,) of the piece that begins at `now` in `state`."""
        i = max(np.searchsorted(u.knots, now, side="right") - 1, 0)
        value, slope = b @ (u.start[i] + u.slope[i] * (now - u.knots[i])), b @ u.slope[i]
        drift = slope / self.omega**2
        offset = (value - self.D @ drift) / self.omega**2
        forced = [(wave(now), wave(t)) for wave in waves]
        x = state[0] - offset - sum(at[0][0] for at, _ in forced)
        v = state[1] - drift - sum(at[1][0] for at, _ in forced)
        free = self._free(x, v, t - now)
        position = free[0] + offset + np.outer(t - now, drift) + sum(at[0] for _, at in forced)
        return position, free[1] + drift + sum(at[1] for _, at in forced)

    def _wave(self, load, W, phase):
        dynamic = np.diag(self.omega**2 - W**2).astype(complex) + 1j * W * self.D
        response = la.solve(dynamic, load * np.exp(1j * phase))

        def wave(t):
            z = np.exp(1j * W * np.atleast_1d(t))[:, None] * response
            return z.imag, W * z.real

        return wave

    def _free(self, x, v, t):
        """Free motion after times t (T,)."""
        if self.zeta is not None:
            omega, zeta = self.omega, self.zeta
            s, s_t = impulse(omega, zeta, t[:, None])
            return (s_t + 2 * zeta * omega * s) * x + s * v, -(omega**2) * s * x + s_t * v
        y = np.concatenate([self.omega * x, v])
        rates, vectors, inverse = self._eigen
        if inverse is None:
            z = np.array([la.expm(h * self._A) @ y for h in t]).reshape(len(t), -1)
        else:
            z = ((np.exp(np.outer(t, rates)) * (inverse @ y)) @ vectors.T).real
        return z[:, : len(x)] / self.omega, z[:, len(x) :]

    @cached_property
    def _A(self):
        Omega = np.diag(self.omega)
        return np.block([[0 * Omega, Omega], [-Omega, -self.D]])

    @cached_property
    def _eigen(self):
        rates, vectors = la.eig(self._A)
        return rates, vectors, la.inv(vectors) if np.linalg.cond(vectors) < DEPENDENT else None


def _sines(u):
    return zip(u.size, u.W, u.phase, strict=True)


def oscillator_step(omega, zeta, h, controls, state):
    """One step of x'' + 2 zeta omega x' + omega^2 x = Bezier curve, by expm of the chain of its derivatives."""
    s = np.linspace(0, 1, len(controls))
    force = poly.polyfit(s, bezier_curve(controls[:, None], s)[:, 0], len(controls) - 1)
    derivatives = force * np.cumprod([1, *range(1, len(force))])
    free = h * omega * np.array([[0, 1], [-1, -2 * zeta]])  # of omega x, x'
    A = la.block_diag(free, np.eye(len(force), k=1))
    A[1, 2] = h
    x, v = (la.expm(A) @ np.concatenate([[omega * state[0], state[1]], derivatives]))[:2]
    return np.array([x / omega, v])


def bezier_curve(c, s):
    """Points (len(s), n) of the Bezier curve with control points c (d + 1, n), by de Casteljau."""
    points = np.repeat(c[None], len(s), axis=0)
    while points.shape[1] > 1:
        points = (1 - s)[:, None, None] * points[:, :-1] + s[:, None, None] * points[:, 1:]
    return points[:, 0]


# Seeded loads: makers of Signals of p inputs over the span T, sampled with steps of about h; omega: all frequencies.


def _sine(p, T, h, omega, rng):
    """Anywhere up to what the steps resolve, now and then next to a resonance."""
    top = min(RESOLVED / h, omega[-1])
    W = np.exp(rng.uniform(np.log(min(0.2 * omega[0], 0.5 * top)), np.log(top), p))
    near = omega[omega <= top]
    if near.size and rng.random() < 0.25:
        W = rng.choice(near, p) * 1.003
    return signal(p, size=np.ones(p), W=W, phase=rng.uniform(0, np.pi, p) * rng.integers(0, 2))


def _constant(p, T, h, omega, rng):
    return signal(p, start=rng.standard_normal((1, p)))


def _step(p, T, h, omega, rng):
    """One or two jumps, at samples, next to them or inside steps."""
    at = np.sort(rng.uniform(0, 0.8 * T, rng.integers(1, 3)))
    if rng.random() < 0.5:
        at = h * np.unique(np.ceil(at / h)) * (1 + rng.choice([0, 1e-15, -1e-15, 1e-7]))
    start = rng.standard_normal((len(at) + 1, p))
    return signal(p, knots=[0.0, *at], start=start, slope=0.1 / T * rng.standard_normal(start.shape))


def _ramp(p, T, h, omega, rng):
    return piecewise_linear(np.array([0, rng.uniform(0.02, 1) * T]), np.vstack([np.zeros(p), rng.standard_normal(p)]))


def _pulse(p, T, h, omega, rng):
    """A rectangle: two jumps, often inside one step."""
    first, width = rng.uniform(0, 0.5 * T), h * 10 ** rng.uniform(-2, 1)
    return signal(p, knots=[0, first, first + width], start=[np.zeros(p), rng.standard_normal(p), np.zeros(p)])


def _noise(p, T, h, omega, rng):
    """Kinks anywhere, from several in a step to one in thirty."""
    knots = np.cumsum(h * 10 ** rng.uniform(-0.5, 1.5) * np.concatenate([[0], rng.uniform(0.3, 1.7, 500)]))
    return piecewise_linear(knots, rng.standard_normal((len(knots), p)))


LOADS = {
    "sine": _sine,
    "constant": _constant,
    "step": _step,
    "ramp": _ramp,
    "pulse": _pulse,
    "noise": _noise,
    "none": lambda p, T, h, omega, rng: signal(p),
}
