"""Exact solutions of M q'' + D q' + K q = B u for inputs that are polynomials of degree <= 5 between knots.

Nothing here uses exudyn_romerr. `StateForm` takes any damping (Rayleigh, overdamped, non-modal, gyroscopic) and
unsymmetric (Petrov-Galerkin) matrices; total_truth.Exact is a second, closed form, and agrees with it.
"""

from dataclasses import dataclass, field
from math import factorial

import numpy as np
import scipy.linalg as la

MAX_DEGREE = 5


@dataclass(frozen=True)
class Motion:
    """q, q_t, q_tt at S + 1 knots, each (S + 1, n); q_tt is the value right of the knot (left of it at the end)."""

    q: np.ndarray
    q_t: np.ndarray
    q_tt: np.ndarray


@dataclass
class StateForm:
    """First-order form in coordinates x = (P q, Q q_t) where it is well scaled; steps by one expm per length."""

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    B: np.ndarray
    P: np.ndarray
    Q: np.ndarray
    A: np.ndarray
    E: np.ndarray
    _steps: dict = field(default_factory=dict)

    def step(self, h, degree):
        """Transition (2n, 2n) and input matrices (degree + 1, 2n, p) of u = sum_j F_j (s/h)^j over a step h."""
        if (h, degree) not in self._steps:
            self._steps[h, degree] = self._exponential(h, degree)
        return self._steps[h, degree]

    def _exponential(self, h, degree):
        size, p = self.E.shape
        chain = np.zeros((size + p * (degree + 1),) * 2)
        chain[:size, :size], chain[:size, size : size + p] = h * self.A, h * self.E
        chain[size:-p, size + p :] = np.eye(p * degree) if p else np.zeros((0, 0))
        whole = la.expm(chain) if p else la.expm(h * self.A)
        inputs = [factorial(j) * whole[:size, size + p * j : size + p * (j + 1)] for j in range(degree + 1)]
        return whole[:size, :size], np.array(inputs).reshape(degree + 1, size, p)

    def propagate(self, h, F, q0, q0_t):
        """Solve over steps h (S,) with inputs F (S, d + 1, p), coefficients of (s/h)^j; return a Motion."""
        degree = F.shape[1] - 1
        assert degree <= MAX_DEGREE
        x = np.empty((len(h) + 1, len(self.A)))
        x[0] = np.concatenate([self.P @ q0, self.Q @ q0_t])
        for k, (length, f) in enumerate(zip(h, F, strict=True)):
            transition, inputs = self.step(float(length), degree)
            x[k + 1] = transition @ x[k] + np.einsum("jip,jp->i", inputs, f)
        return self._motion(x, np.vstack([F[:, 0], F[-1:].sum(axis=1)]))

    def _motion(self, x, u):
        n = len(self.P)
        q, q_t = la.solve(self.P, x[:, :n].T).T, la.solve(self.Q, x[:, n:].T).T
        force = self.B @ u.T - self.D @ q_t.T - self.K @ q.T
        return Motion(q, q_t, la.solve(self.M, force).T)


def state_form(M, D, K, B):
    """Return the StateForm of dense matrices; D may be None (undamped)."""
    M, K, B = (np.atleast_2d(np.asarray(x, dtype=float)) for x in (M, K, B))
    D = np.zeros_like(K) if D is None else np.asarray(D, dtype=float)
    make = _energy_form if _is_definite(M) and _is_definite(K) else _scaled_form
    return StateForm(M, D, K, B, *make(M, D, K, B))


def _is_definite(matrix):
    if np.abs(matrix - matrix.T).max() > 1e-12 * np.abs(matrix).max():  # rounding of V^T M V
        return False
    return bool(la.eigvalsh(matrix)[0] > 0)


def _energy_form(M, D, K, B):
    """|x|_2^2 is twice the energy: |exp(A t)|_2 <= 1 and expm loses nothing on stiff bodies."""
    P, Q = la.cholesky(K), la.cholesky(M)
    up = la.solve_triangular(Q, P.T, trans="T").T  # P Q^-1

    def down(right):
        return la.solve_triangular(Q, right, trans="T")  # Q^-T right

    damping = la.solve_triangular(Q, down(D).T, trans="T").T
    A = np.block([[np.zeros_like(K), up], [-up.T, -damping]])
    return P, Q, A, np.vstack([np.zeros_like(B), down(B)])


def _scaled_form(M, D, K, B):
    stiffness, damping, force = la.solve(M, K), la.solve(M, D), la.solve(M, B)
    scale = np.sqrt(la.norm(stiffness, 2))
    n = len(M)
    A = np.block([[np.zeros((n, n)), scale * np.eye(n)], [-stiffness / scale, -damping]])
    return scale * np.eye(n), np.eye(n), A, np.vstack([np.zeros_like(B), force])


def linear_inputs(left, right):
    """Coefficients (S, 2, p) of inputs that run linearly from left to right (S, p) over each step."""
    return np.stack([left, right - left], axis=1)


def _modes(M, K):
    """All modes: the low ones from 1/omega^2, as the solver's rounding is relative to its largest eigenvalue."""
    compliance, low = la.eigh(M, K)
    squares, high = la.eigh(K, M)
    omega = 1 / np.sqrt(compliance[::-1])
    take_low = omega < np.sqrt(omega[0] * omega[-1])
    return np.where(take_low, omega, np.sqrt(squares)), np.where(take_low, low[:, ::-1] * omega, high)


def impulse(omega, zeta, t):
    """Return s(t) and s'(t) of x'' + 2 zeta omega x' + omega^2 x = 0, x(0) = 0, x'(0) = 1, by complex roots."""
    a, g = zeta * omega, omega * np.emath.sqrt((zeta - 1) * (zeta + 1) + 0j)
    small = np.abs(g * t) < 1e-4  # series of sinh(g t)/g: the next term is 1e-16 / 120
    safe = np.where(small, 1.0, g)
    fast, slow = np.exp(-(a + g) * t), np.exp(-(omega**2 / np.where(a + g == 0, 1.0, a + g)) * t)
    slow = np.where(a + g == 0, 1.0, slow)
    s = np.where(small, np.exp(-a * t) * t * (1 + (g * t) ** 2 / 6), (slow - fast) / (2 * safe))
    c = np.where(small, np.exp(-a * t) * (1 + (g * t) ** 2 / 2), (slow + fast) / 2)
    return s.real, (c - a * s).real


def rigid_motions(positions):
    """Three unit translations and three unit rotations about the origin of nodes, (3 n, 6)."""
    shifts = [np.broadcast_to(axis, positions.shape) for axis in np.eye(3)]
    turns = [np.cross(axis, positions) for axis in np.eye(3)]
    return np.array(shifts + turns).reshape(6, -1).T
