"""Modal oscillators eta'' + 2 zeta omega eta' + omega^2 eta = f, solved exactly for polynomial f (theory.md 4, 5)."""

from __future__ import annotations

import copy
from functools import cache
from math import comb, factorial
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg.blas import dtbsv

from ..compiled.loops import loops

TAYLOR_TERMS = 18  # of phi functions at arguments of at most 1: the next term is 1/19! relative
FIRST_ORDER = 1e-8  # of change in a step's angle, and of its length: the square of it is rounding
SEPARATE = 1.1  # damping ratio above which the two real roots are far enough apart to be taken one by one


class Element:
    """a I + b Z in the algebra of Z = [[0, 1], [-w^2, -2 zeta w]], where Z^2 = -w^2 I - 2 zeta w Z; arrays."""

    def __init__(self, a, b):
        self.a, self.b = a, b

    def where(self, chosen: np.ndarray, other: Element) -> Element:
        """Return this element where chosen, the other elsewhere."""
        return Element(np.where(chosen, self.a, other.a), np.where(chosen, self.b, other.b))

    def times(self, other: Element, square, double) -> Element:
        """Return the product; square = w^2 and double = 2 zeta w of the present Z."""
        both = self.b * other.b
        return Element(self.a * other.a - square * both, self.a * other.b + self.b * other.a - double * both)


def phi_functions(w: np.ndarray, zeta: np.ndarray, count: int) -> list[Element]:
    """Return phi_0(Z) = exp(Z), ..., phi_count(Z), phi_k(Z) = sum_j Z^j/(j + k)!, of the oscillator per step.

    w = omega h and zeta broadcast. Taylor series of Z / 2^s and s doublings: uniform in under- and critically damped
    modes, where formulas with roots of the characteristic polynomial cancel. Doublings multiply rounding by the fast
    root; well overdamped modes, whose slow root may not move at all in a step, are taken root by root.
    """
    w, zeta = np.broadcast_arrays(np.asarray(w, dtype=float), np.asarray(zeta, dtype=float))
    radius = w * (zeta + np.sqrt(np.maximum((zeta - 1) * (zeta + 1), 0.0)) + 1)
    doublings = np.ceil(np.log2(np.maximum(radius, 1.0))).astype(int)  # each mode its own: doubling doubles rounding
    w_given, w = w, w / 2.0**doublings
    square, double = w * w, 2 * zeta * w
    phis = _taylor(square, double, count)
    for done in range(int(doublings.max(initial=0))):
        active = doublings > done
        phis = [new.where(active, old) for new, old in zip(_doubled(phis, square, double), phis, strict=True)]
        square, double = np.where(active, 4 * square, square), np.where(active, 2 * double, double)
    apart = (zeta > SEPARATE) & (doublings > 0)
    if not apart.any():
        return phis
    return [new.where(apart, old) for new, old in zip(_by_roots(w_given, zeta, count), phis, strict=True)]


def _by_roots(w: np.ndarray, zeta: np.ndarray, count: int) -> list[Element]:
    """phi_k = a I + b Z with a + b r = phi_k(r) at both roots r < 0 of Z; anything where zeta <= SEPARATE."""
    zeta = np.maximum(zeta, SEPARATE)
    fast = -w * (zeta + np.sqrt((zeta - 1) * (zeta + 1)))
    slow = w**2 / fast
    pairs = zip(_of_numbers(slow, count), _of_numbers(fast, count), strict=True)
    slopes = [(at_slow, (at_slow - at_fast) / (slow - fast)) for at_slow, at_fast in pairs]
    return [Element(at_slow - b * slow, b) for at_slow, b in slopes]


def _of_numbers(r: np.ndarray, count: int) -> list[np.ndarray]:
    """phi_0(r), ..., phi_count(r) of numbers r < 0: (phi_k-1 - 1/(k - 1)!)/r, or Taylor's series near zero."""
    near = np.maximum(r, -1.0)
    phis = [np.exp(r)]
    for k in range(1, count + 1):
        series = sum(near**j / float(factorial(j + k)) for j in range(TAYLOR_TERMS, -1, -1))
        phis.append(np.where(r >= -1, series, (phis[-1] - 1 / factorial(k - 1)) / np.minimum(r, -1.0)))
    return phis


def _taylor(square, double, count: int) -> list[Element]:
    top = Element(np.full_like(square, 1 / factorial(TAYLOR_TERMS + count)), np.zeros_like(square))
    for j in range(TAYLOR_TERMS - 1, -1, -1):
        top = _times_z(top, square, double, 1 / factorial(j + count))
    phis = [top]
    for k in range(count - 1, -1, -1):
        phis.insert(0, _times_z(phis[0], square, double, 1 / factorial(k)))
    return phis


def _times_z(x: Element, square, double, added: float) -> Element:
    return Element(added - square * x.b, x.a - double * x.b)


def _doubled(phis: list[Element], square, double) -> list[Element]:
    """phi_k(2 Z) = 2^-k (phi_0 phi_k + sum_j=1..k phi_j/(k - j)!); b is halved as it now multiplies 2 Z."""
    result = []
    for k, phi in enumerate(phis):
        new = phis[0].times(phi, square, double)
        a = new.a + sum(phis[j].a / factorial(k - j) for j in range(1, k + 1))
        b = new.b + sum(phis[j].b / factorial(k - j) for j in range(1, k + 1))
        result.append(Element(a / 2**k, b / 2 ** (k + 1)))
    return result


class ModalOscillators:
    """m oscillators, omega and zeta (m,), driven by forces given as Bezier control points on every segment."""

    def __init__(self, omega: np.ndarray, zeta: np.ndarray):
        self.omega, self.zeta = omega, zeta
        self._made: dict[int, _Step] = {}  # degree -> the step that others of nearly its length follow from
        self._last: dict[int, tuple[_Step, np.ndarray, np.ndarray]] = {}  # degree -> the last step, weights, bands
        self._lag = 0.0  # s: time that passed, less that of the steps made: rounding of times, and no sum of it
        self.drift = 0.0  # s: how far times of the last block were from those of the steps made, and their rounding

    def started(self) -> ModalOscillators:
        """Return the same oscillators for another run; they share the steps that were made."""
        other = copy.copy(self)
        other._lag = 0.0
        return other

    def advance(self, state: np.ndarray, t: np.ndarray, h: np.ndarray, F: np.ndarray) -> np.ndarray:
        """Return (eta, eta') at the ends of S segments, (S, 2, m), from state (2, m); F is (S, d + 1, m).

        t (S,) are the ends, h (S,) the lengths of the segments, d the degree of the forces in time.
        """
        rounding = 16 * np.finfo(float).eps * max(abs(t[-1]), abs(t[0] - h[0]))
        self.drift = 2 * rounding
        if np.max(np.abs(h[:-1] - h[0]), initial=0.0) > rounding:
            return self._different_steps(state, h, F)
        if abs(h[-1] - h[0]) <= rounding:
            return self._equal_steps(state, h, F, rounding / len(h))
        before = self._equal_steps(state, h[:-1], F[:-1], rounding / len(h))  # solvers shorten their last step
        return np.concatenate([before, self._different_steps(before[-1], h[-1:], F[-1:])])

    def _equal_steps(self, state: np.ndarray, lengths: np.ndarray, F: np.ndarray, rounding: float) -> np.ndarray:
        """Of one length, but for rounding of times: past a power of two all are longer or shorter by the same."""
        steps, degree = len(F), F.shape[1] - 1
        mean = float(np.mean(lengths))
        self.drift += float(np.max(np.abs(np.cumsum(lengths - mean))))
        h = mean + self._lag / steps
        if degree not in self._last or abs(self._last[degree][0].h - h) > rounding:
            step = self._of_length(degree, h)
            self._last[degree] = step, step.weights(), np.zeros((0, 4, 0))
        step, weights, bands = self._last[degree]
        self._lag = steps * (h - step.h)
        if loops is not None:
            y = np.empty((steps, 2, F.shape[2]))
            loops.oscillators(*F.shape, *map(np.ascontiguousarray, (state, step.A, weights, F)), y)
            return y
        if bands.shape[2] < 2 * steps:
            bands = _bands(step.A, steps)
            self._last[degree] = step, weights, bands
        driven = np.einsum("cjm,sjm->scm", weights, F)
        return _marched(bands[:, :, : 2 * steps], _apply(step.A, state), driven)

    def _different_steps(self, state: np.ndarray, h: np.ndarray, F: np.ndarray) -> np.ndarray:
        step = self._step(F.shape[1] - 1, h[:, None])
        driven = np.einsum("cjsm,sjm->scm", step.weights(), F)
        return _marched(_bands(step.A, len(h)), _apply(step.A[:, :, 0], state), driven)

    def inside(self, state: np.ndarray, states: np.ndarray, h: np.ndarray, F: np.ndarray) -> tuple:
        """Return the largest |eta| and |eta'| (S, m) within the segments of `advance`.

        (eta'^2 + omega^2 eta^2)^(1/2) grows by at most the integral of |F|. About the moving centre s = F / omega^2
        the energy changes by the work of s' only: (eta'^2 + omega^2 (eta - s)^2)^(1/2) grows by at most omega times
        the variation of s. The first is small where omega h is, the second where it is not.
        """
        start = np.concatenate([state[None], states[:-1]])
        if loops is not None:
            y = np.empty_like(start)
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
        phis = phi_functions(w, zeta, d + 1)
        A = np.array([[phis[0].a, phis[0].b * h], [-(w**2) * phis[0].b / h, phis[0].a - 2 * zeta * w * phis[0].b]])
        rows = [(phi.b * h**2, (phi.a - 2 * zeta * w * phi.b) * h) for phi in phis[1:]]
        return _Step(h, A, np.array(rows))


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


def _bands(A: np.ndarray, steps: int) -> np.ndarray:
    """y_k - A y_{k-1} = driven_k as lower triangular bands (m, 4, 2 S): y = eta_0, eta_0', eta_1, eta_1', ...

    A is (2, 2, m), or (2, 2, S, m) of steps of different lengths; that of the first step has no place in it.
    """
    A = A[:, :, None] if A.ndim == 3 else A[:, :, 1:]
    bands = np.zeros((A.shape[-1], 2 * steps, 4))  # column by column: what BLAS calls Fortran order
    for row in range(2):
        for column in range(2):
            bands[:, column:-2:2, 2 + row - column] = -A[row, column].T
    return bands.swapaxes(1, 2)


def _marched(bands: np.ndarray, first: np.ndarray, driven: np.ndarray) -> np.ndarray:
    """Solve forwards for y (S, 2, m); first (2, m): what the state before adds to driven_0."""
    steps, _, m = driven.shape
    y = np.ascontiguousarray(driven.reshape(2 * steps, m).T)
    y[:, :2] += first.T
    for band, mode in zip(bands, y, strict=True):  # in place; BLAS knows no triangular bands of many systems
        dtbsv(3, band, mode, lower=1, diag=1, overwrite_x=1)
    return np.ascontiguousarray(y.T).reshape(steps, 2, m)


def _apply(A: np.ndarray, state: np.ndarray) -> np.ndarray:
    """Multiply 2 x 2 matrices (2, 2, m) with a state (2, m)."""
    return A[:, 0] * state[0] + A[:, 1] * state[1]
