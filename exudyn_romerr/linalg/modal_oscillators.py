"""Modal oscillators eta'' + 2 zeta omega eta' + omega^2 eta = f, solved exactly for polynomial f (theory.md 4, 5)."""

from __future__ import annotations

from functools import cache
from math import comb, factorial
from typing import Any, NamedTuple

import numpy as np

from ..compiled.loops import loops

TAYLOR_TERMS = 18  # of phi functions at arguments of at most 1: the next term is 1/19! relative
FIRST_ORDER = 1e-8  # of change in a step's angle, and of its length: the square of it is rounding
SEPARATE = 1.1  # damping ratio above which the two real roots are far enough apart to be taken one by one


def phi_functions(w: np.ndarray, zeta: np.ndarray, count: int) -> np.ndarray:
    """Return phi_0(Z) = exp(Z), ..., phi_count(Z), phi_k(Z) = sum_j Z^j/(j + k)!, of the oscillator per step.

    Z = [[0, 1], [-w^2, -2 zeta w]], w = omega h; w and zeta broadcast. Each is a I + b Z, since
    Z^2 = -w^2 I - 2 zeta w Z: a and b, (count + 1, 2, ...).

    Taylor series of Z / 2^s and s doublings: uniform in under- and critically damped modes, where formulas with roots
    of the characteristic polynomial cancel. Doublings multiply rounding by the fast root: well overdamped modes,
    whose slow root may not move at all in a step, are taken root by root.
    """
    w, zeta = np.broadcast_arrays(np.asarray(w, dtype=float), np.asarray(zeta, dtype=float))
    radius = w * (zeta + np.sqrt(np.maximum((zeta - 1) * (zeta + 1), 0.0)) + 1)
    doublings = np.ceil(np.log2(np.maximum(radius, 1.0))).astype(int)  # each mode its own: doubling doubles rounding
    small = w / 2.0**doublings
    square, double = small * small, 2 * zeta * small
    phis = _taylor(square, double, count)
    for done in range(int(doublings.max(initial=0))):
        active = doublings > done
        np.copyto(phis, _doubled(phis, square, double), where=active)
        square, double = np.where(active, 4 * square, square), np.where(active, 2 * double, double)
    apart = (zeta > SEPARATE) & (doublings > 0)
    return np.where(apart, _by_roots(w, zeta, count), phis) if apart.any() else phis


def _by_roots(w: np.ndarray, zeta: np.ndarray, count: int) -> np.ndarray:
    """Return a, b with a + b r = phi_k(r) at both roots r < 0 of Z; anything where zeta <= SEPARATE."""
    zeta = np.maximum(zeta, SEPARATE)
    fast = -w * (zeta + np.sqrt((zeta - 1) * (zeta + 1)))
    slow = w**2 / fast
    at_slow, at_fast = _of_numbers(slow, count), _of_numbers(fast, count)
    b = (at_slow - at_fast) / (slow - fast)
    return np.stack([at_slow - b * slow, b], axis=1)


def _of_numbers(r: np.ndarray, count: int) -> np.ndarray:
    """phi_0(r), ..., phi_count(r) of numbers r < 0: (phi_k-1 - 1/(k - 1)!)/r, or Taylor's series near zero."""
    near = np.maximum(r, -1.0)
    phis = [np.exp(r)]
    for k in range(1, count + 1):
        series = sum(near**j / float(factorial(j + k)) for j in range(TAYLOR_TERMS, -1, -1))
        phis.append(np.where(r >= -1, series, (phis[-1] - 1 / factorial(k - 1)) / np.minimum(r, -1.0)))
    return np.array(phis)


def _taylor(square: np.ndarray, double: np.ndarray, count: int) -> np.ndarray:
    """By Horner: 1/j! + Z (...), from the last term of phi_count down to phi_0."""
    phis, x = [], np.zeros((2, *square.shape))
    for j in range(TAYLOR_TERMS + count, -1, -1):
        x = np.stack([1 / factorial(j) - square * x[1], x[0] - double * x[1]])
        if j <= count:
            phis.insert(0, x)
    return np.array(phis)


def _doubled(phis: np.ndarray, square: np.ndarray, double: np.ndarray) -> np.ndarray:
    """phi_k(2 Z) = 2^-k (phi_0 phi_k + sum_j=1..k phi_j/(k - j)!); b is halved as it now multiplies 2 Z."""
    (a, b), both = phis[0], phis[0, 1] * phis[:, 1]
    result = a * phis
    result[:, 0] -= square * both
    result[:, 1] += b * phis[:, 0] - double * both
    for k in range(len(phis)):
        result[k] += sum(phis[j] / factorial(k - j) for j in range(1, k + 1))
        result[k] /= 2**k
        result[k, 1] /= 2
    return result


class ModalOscillators:
    """m oscillators, omega and zeta (m,), driven by forces given as Bezier control points on every segment."""

    def __init__(self, omega: np.ndarray, zeta: np.ndarray):
        self.omega, self.zeta = omega, zeta
        self._made: dict[int, _Step] = {}  # degree -> the step that others of nearly its length follow from
        self.drift = 0.0  # s: how far times of the last block were from those of equal steps, and their rounding

    def advance(self, state: np.ndarray, t: np.ndarray, h: np.ndarray, F: np.ndarray) -> np.ndarray:
        """Return (eta, eta') at the ends of S segments, (S, 2, m), from state (2, m); F is (S, d + 1, m).

        t (S,) are the ends, h (S,) the lengths of the segments, d the degree of the forces in time.
        """
        rounding = 16 * np.finfo(float).eps * max(abs(t[-1]), abs(t[0] - h[0]))
        self.drift = 2 * rounding
        if np.max(np.abs(h[:-1] - h[0]), initial=0.0) > rounding:
            return self._different_steps(state, h, F)
        if abs(h[-1] - h[0]) <= rounding:
            return self._equal_steps(state, h, F)
        before = self._equal_steps(state, h[:-1], F[:-1])  # solvers shorten their last step
        return np.concatenate([before, self._different_steps(before[-1], h[-1:], F[-1:])])

    def _equal_steps(self, state: np.ndarray, lengths: np.ndarray, F: np.ndarray) -> np.ndarray:
        """Of one length, but for rounding of times: past a power of two all are longer or shorter by the same."""
        steps, mean = len(F), float(np.mean(lengths))
        self.drift += float(np.max(np.abs(np.cumsum(lengths - mean))))
        step = self._of_length(F.shape[1] - 1, mean)
        weights = step.weights()
        if loops is not None:
            y = np.empty((steps, 2, F.shape[2]))
            loops.oscillators(*F.shape, *map(np.ascontiguousarray, (state, step.A, weights, F)), y)
            return y
        A = np.broadcast_to(step.A[:, :, None], (2, 2, *F[:, 0].shape))
        return _marched(A, state, np.einsum("cjm,sjm->scm", weights, F))

    def _different_steps(self, state: np.ndarray, h: np.ndarray, F: np.ndarray) -> np.ndarray:
        step = self._step(F.shape[1] - 1, h[:, None])
        return _marched(step.A, state, np.einsum("cjsm,sjm->scm", step.weights(), F))

    def inside(self, state: np.ndarray, states: np.ndarray, h: np.ndarray, F: np.ndarray) -> tuple:
        """Return the largest |eta| and |eta'| (S, m) within the segments of `advance`.

        (eta'^2 + omega^2 eta^2)^(1/2) grows by at most the integral of |F|. About the moving centre s = F / omega^2
        the energy changes by the work of s' only: (eta'^2 + omega^2 (eta - s)^2)^(1/2) grows by at most omega times
        the variation of s. The first is small where omega h is, the second where it is not.
        """
        start = np.concatenate([state[None], states[:-1]])
        if loops is not None:
            y = np.empty(start.shape)
            loops.inside(*F.shape, *map(np.ascontiguousarray, (self.omega, h, start, F)), y)
            return y[:, 0], y[:, 1]
        w, s = self.omega, F / self.omega**2
        about = np.hypot(w * (start[:, 0] - s[:, 0]), start[:, 1]) + w * np.abs(np.diff(s, axis=1)).sum(axis=1)
        whole = np.hypot(w * start[:, 0], start[:, 1]) + h[:, None] * np.abs(F).mean(axis=1)
        return np.minimum(np.abs(s).max(axis=1) + about / w, whole / w), np.minimum(about, whole)

    def _of_length(self, d: int, h: float) -> _Step:
        """The step of length h; where solvers add up steps, h changes by rounding again and again."""
        made = self._made.get(d)
        rate = max(np.max(2 * (self.zeta + 1) * self.omega), 1 / h)  # J grows with powers of h, however slow a mode
        if made is None or abs(made.h - h) * rate > FIRST_ORDER:
            made = self._made[d] = self._step(d, h)
        return made.nearby(h, self.omega, self.zeta)

    def _step(self, d: int, h: Any) -> _Step:
        w, zeta = self.omega * h, self.zeta
        (a, b), *integrals = phi_functions(w, zeta, d + 1)
        A = np.array([[a, b * h], [-(w**2) * b / h, a - 2 * zeta * w * b]])
        return _Step(h, A, np.array([(b * h**2, (a - 2 * zeta * w * b) * h) for a, b in integrals]))


class _Step(NamedTuple):
    """A step of length h: (eta, eta') <- A (2, 2, ..., m) (eta, eta') + J_k (2, ..., m) for forces (s/h)^k/k!."""

    h: Any
    A: np.ndarray
    J: np.ndarray

    def weights(self) -> np.ndarray:
        """Return what control points of a force add to (eta, eta'), (2, d + 1, ..., m)."""
        return np.einsum("kj,kc...->cj...", _monomials(range(len(self.J))), self.J)

    def nearby(self, h: float, omega: np.ndarray, zeta: np.ndarray) -> _Step:
        """Return the step of length h to first order: A' = Z A, J_k' = Z J_k - k J_k/h + (0, 1)/k!."""
        if h == self.h:
            return self

        def by_Z(x: np.ndarray) -> np.ndarray:
            return np.stack([x[..., 1, :], -(omega**2) * x[..., 0, :] - 2 * zeta * omega * x[..., 1, :]], axis=-2)

        k = np.arange(len(self.J))
        change = by_Z(self.J) - (k / self.h)[:, None, None] * self.J
        change[:, 1] += np.array([1 / factorial(i) for i in k])[:, None]
        turned = by_Z(self.A.swapaxes(0, 1)).swapaxes(0, 1)
        return _Step(h, self.A + (h - self.h) * turned, self.J + (h - self.h) * change)


@cache
def _monomials(of: range) -> np.ndarray:
    """Control points to factors of (s/h)^k/k!, (d + 1, d + 1) for range(d + 1)."""
    return np.tril([[(-1) ** (k - j) * comb(of[-1], k) * comb(k, j) * factorial(k) for j in of] for k in of])


def _marched(A: np.ndarray, state: np.ndarray, driven: np.ndarray) -> np.ndarray:
    """Return y (S, 2, m) of y_k = A_k y_{k-1} + driven_k, from state (2, m); A (2, 2, S, m)."""
    y = np.empty(driven.shape)  # row by row: loops in C go on with it
    for k, more in enumerate(driven):
        y[k] = state = A[:, 0, k] * state[0] + A[:, 1, k] * state[1] + more
    return y
