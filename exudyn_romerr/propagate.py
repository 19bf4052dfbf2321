"""Modal oscillators eta'' + 2 zeta omega eta' + omega^2 eta = f, solved exactly for polynomial f (theory.md 4, 5)."""

from __future__ import annotations

from math import comb, factorial

import numpy as np

TAYLOR_TERMS = 18  # of phi functions at arguments of at most 1: the next term is 1/19! relative


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

    w = omega h and zeta broadcast. Taylor series of Z / 2^s and s doublings: uniform in under-, critically and
    overdamped modes, where formulas with roots of the characteristic polynomial cancel.
    """
    w, zeta = np.broadcast_arrays(np.asarray(w, dtype=float), np.asarray(zeta, dtype=float))
    radius = w * (zeta + np.sqrt(np.maximum((zeta - 1) * (zeta + 1), 0.0)) + 1)
    doublings = np.ceil(np.log2(np.maximum(radius, 1.0))).astype(int)  # each mode its own: doubling doubles rounding
    w = w / 2.0**doublings
    square, double = w * w, 2 * zeta * w
    phis = _taylor(square, double, count)
    for done in range(int(doublings.max(initial=0))):
        active = doublings > done
        phis = [new.where(active, old) for new, old in zip(_doubled(phis, square, double), phis, strict=True)]
        square, double = np.where(active, 4 * square, square), np.where(active, 2 * double, double)
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
        self._cached: dict[int, tuple] = {}  # degree -> step length, transition, weights

    def advance(self, state: np.ndarray, t: np.ndarray, h: np.ndarray, F: np.ndarray) -> np.ndarray:
        """Return (eta, eta') at the ends of S segments, (S, 2, m), from state (2, m); F is (S, d + 1, m).

        t (S,) are the ends, h (S,) the lengths of the segments, d the degree of the forces in time.
        """
        degree = F.shape[1] - 1
        rounding = 16 * np.finfo(float).eps * max(abs(t[-1]), abs(t[0] - h[0]))
        if np.ptp(h) <= rounding:  # equal steps, but for rounding of t
            A, W = self._equal_step(degree, float(np.mean(h)), rounding / len(h))
            driven = np.einsum("cjm,sjm->scm", W, F)
            driven[0] += _apply(A, state)
            return _scan(A, driven)
        A, W = self._step(degree, h[:, None])
        driven = np.einsum("cjsm,sjm->scm", W, F)
        states = np.empty_like(driven)
        for s in range(len(h)):
            state = states[s] = _apply(A[:, :, s], state) + driven[s]
        return states

    def inside(self, state: np.ndarray, states: np.ndarray, h: np.ndarray, F: np.ndarray) -> tuple:
        """Return the largest |eta| and |eta'| (S, m) within the segments of `advance`.

        (eta'^2 + omega^2 eta^2)^(1/2) grows by at most the integral of |F|. About the moving centre s = F / omega^2
        the energy changes by the work of s' only: (eta'^2 + omega^2 (eta - s)^2)^(1/2) grows by at most omega times
        the variation of s. The first is small where omega h is, the second where it is not.
        """
        w, s = self.omega, F / self.omega**2
        start = np.concatenate([state[None], states[:-1]])
        about = np.hypot(w * (start[:, 0] - s[:, 0]), start[:, 1]) + w * np.abs(np.diff(s, axis=1)).sum(axis=1)
        whole = np.hypot(w * start[:, 0], start[:, 1]) + h[:, None] * np.abs(F).mean(axis=1)
        return np.minimum(np.abs(s).max(axis=1) + about / w, whole / w), np.minimum(about, whole)

    def _equal_step(self, d: int, h: float, rounding: float) -> tuple[np.ndarray, np.ndarray]:
        if d not in self._cached or abs(self._cached[d][0] - h) > rounding:
            self._cached[d] = (h, *self._step(d, h))
        return self._cached[d][1:]

    def _step(self, d: int, h) -> tuple[np.ndarray, np.ndarray]:
        """Transition A (2, 2, ..., m) and weights W (2, d + 1, ..., m) of (eta, eta')."""
        w, zeta = self.omega * h, self.zeta
        phis = phi_functions(w, zeta, d + 1)
        rows = [(phi.b * h**2, (phi.a - 2 * zeta * w * phi.b) * h) for phi in phis]
        A = np.array([[phis[0].a, phis[0].b * h], [-(w**2) * phis[0].b / h, phis[0].a - 2 * zeta * w * phis[0].b]])
        monomial = np.array(
            [[(-1) ** (k - j) * comb(d, k) * comb(k, j) * factorial(k) for j in range(d + 1)] for k in range(d + 1)]
        )
        return A, np.einsum("kj,kc...->cj...", np.tril(monomial), np.array(rows[1:]))


def _apply(A: np.ndarray, state: np.ndarray) -> np.ndarray:
    """Multiply 2 x 2 matrices (2, 2, m) with states (..., 2, m)."""
    x, v = state[..., 0, :], state[..., 1, :]
    return np.stack([A[0, 0] * x + A[0, 1] * v, A[1, 0] * x + A[1, 1] * v], axis=-2)


def _scan(A: np.ndarray, driven: np.ndarray) -> np.ndarray:
    """Return y_k = A y_{k-1} + driven_k for all k by doubling: log2(S) array operations instead of S."""
    x, v = driven[:, 0].copy(), driven[:, 1].copy()
    moved, part = np.empty_like(x), np.empty_like(x)
    shift = 1
    while shift < len(x):
        left = len(x) - shift
        old_x, old_v = x[:left].copy(), v[:left]
        _combine(A[0], old_x, old_v, moved[:left], part[:left])
        x[shift:] += moved[:left]
        _combine(A[1], old_x, old_v, moved[:left], part[:left])
        v[shift:] += moved[:left]
        A, shift = np.einsum("abm,bcm->acm", A, A), 2 * shift
    return np.stack([x, v], axis=1)


def _combine(row: np.ndarray, x: np.ndarray, v: np.ndarray, result: np.ndarray, part: np.ndarray) -> None:
    """Write row[0] x + row[1] v into result: arrays that are made once are half the time of the scan."""
    np.multiply(row[0], x, out=result)
    np.multiply(row[1], v, out=part)
    result += part
