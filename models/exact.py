"""Closed-form motion of M q'' + D q' + K q = B a sin(W t), Rayleigh damping: the truth of examples and tests.

No time integration. In the undamped modes the equations are scalar: the forced motion is a sine and a cosine, the
rest is free motion, for which exudyn_romerr.linalg.oscillator has closed forms at any damping ratio.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg

import exudyn_romerr as romerr
from exudyn_romerr.linalg import oscillator

# 80 bits on x86, where rounding of V^T K V would otherwise shift the low frequencies by 1e-11 of themselves and hide
# reduction errors below 1e-10 of the signal; elsewhere it may be no more than double
EXTENDED = np.longdouble
INSTANTS_AT_ONCE = 4096  # (modes, instants) arrays of this many columns stay in the cache


@dataclass(frozen=True)
class ForcedModes:
    """Modal coordinates eta'' + 2 zeta omega eta' + omega^2 eta = load sin(W t), and their shapes.

    Parameters
    ----------
    omega, zeta, load : ndarray, (m,)
        Angular frequency in rad/s, damping ratio (overdamped ones too), modal load.
    shapes : ndarray, (n, m)
        q = shapes eta; rows of fixed coordinates are zero.
    W : float
        Angular frequency of the load in rad/s; not that of an undamped mode.
    start, start_t : ndarray, (m,)
        eta and eta' at t = 0.
    """

    omega: np.ndarray
    zeta: np.ndarray
    load: np.ndarray
    shapes: np.ndarray
    W: float
    start: np.ndarray
    start_t: np.ndarray

    def motion(self, t: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return q, q_t, q_tt at times t >= 0 (T,), each (T, n)."""
        blocks = zip(*([eta.T @ self.shapes.T for eta in self._modal(part)] for part in _parts(t)), strict=True)
        return tuple(np.vstack(block) for block in blocks)

    def output(self, rows: np.ndarray, t: Any) -> np.ndarray:
        """Return rows q at times t (T,), as (T, r), without forming q."""
        participation = (rows @ self.shapes).T
        return np.vstack([self._modal(part)[0].T @ participation for part in _parts(t)])

    def _modal(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return eta, eta', eta'' at times t (T,), each (m, T)."""
        W, omega, zeta = self.W, self.omega[:, None], self.zeta[:, None]
        forced = (self.load / (self.omega**2 - W**2 + 2j * self.zeta * self.omega * W))[:, None]
        a, v = self.start[:, None] - forced.imag, self.start_t[:, None] - W * forced.real
        s, p = oscillator.impulse_response(omega, zeta, t), oscillator.step_release(omega, zeta, t)
        # s and p solve the homogeneous equation: s' = p - 2 zeta omega s, p' = -omega^2 s
        s_t, p_t = p - 2 * zeta * omega * s, -(omega**2) * s
        s_tt, p_tt = p_t - 2 * zeta * omega * s_t, -(omega**2) * s_t
        wave = forced * np.exp(1j * W * t)
        return (
            wave.imag + a * p + v * s,
            W * wave.real + a * p_t + v * s_t,
            -(W**2) * wave.imag + a * p_tt + v * s_tt,
        )


def full_solution(
    body: romerr.ElasticBody,
    inputs: np.ndarray,
    amplitude: Any,
    W: float,
    initial: tuple[np.ndarray, np.ndarray] | None = None,
) -> ForcedModes:
    """Return the exact solution of the full body.

    Parameters
    ----------
    body : ElasticBody
        Rayleigh damping or none; a dense eigenproblem of its free coordinates is solved.
    inputs : ndarray, (N, p)
        Input matrix B.
    amplitude : float or (p,)
        Amplitudes a of the inputs a sin(W t).
    W : float
        Angular frequency in rad/s.
    initial : ((N,), (N,)), optional
        q(0), q'(0); default zero.

    Returns
    -------
    ForcedModes
    """
    free = body.free
    state = None if initial is None else tuple(np.asarray(x)[free] for x in initial)
    pencil = tuple(matrix.toarray().astype(EXTENDED) for matrix in (body.M, body.K))
    return _solution(body, body.expand(np.eye(free.size)), inputs, amplitude, W, state, pencil)


def reduced_solution(
    body: romerr.ElasticBody,
    basis: romerr.Basis,
    inputs: np.ndarray,
    amplitude: Any,
    W: float,
    initial: tuple[np.ndarray, np.ndarray] | None = None,
) -> ForcedModes:
    """Return the exact solution of V^T M V qr'' + V^T D V qr' + V^T K V qr = V^T B a sin(W t).

    Parameters
    ----------
    basis : Basis
        Galerkin only; W != V leaves no symmetric eigenproblem.
    initial : ((n,), (n,)), optional
        qr(0), qr'(0); default zero.
    body, inputs, amplitude, W
        As in full_solution.

    Returns
    -------
    ForcedModes
        In reduced coordinates; multiply rows by V for outputs.

    Raises
    ------
    ValueError
        Petrov-Galerkin basis.
    """
    if not basis.is_galerkin:
        raise ValueError("reduced_solution needs a Galerkin basis, found W != V")
    V = basis.restricted_to(body)[0].astype(EXTENDED)
    pencil = tuple(V.T @ (matrix.toarray().astype(EXTENDED) @ V) for matrix in (body.M, body.K))
    return _solution(body, np.eye(basis.n), basis.V.T @ inputs, amplitude, W, initial, pencil)


def reduced_trajectory(
    solution: ForcedModes, t: np.ndarray, amplitude: Any, inputs_count: int = 1
) -> romerr.Trajectory:
    """Return the solution at times t (T,) as evaluate takes it, inputs a sin(W t) included."""
    u = np.sin(solution.W * t)[:, None] * np.broadcast_to(amplitude, (inputs_count,))
    return romerr.Trajectory(t, *solution.motion(t), u)


def _solution(body, placed, inputs, amplitude, W, initial, pencil) -> ForcedModes:
    """Solve the eigenproblem of the pencil (M, K); `placed` puts its coordinates among those of the result."""
    M, K = pencil
    omega, vectors = _modes(M, K)
    shapes = placed @ vectors
    load = shapes.T @ inputs @ np.broadcast_to(amplitude, inputs.shape[1:])
    start, start_t = np.zeros((2, omega.size)) if initial is None else (vectors.T @ (M @ x) for x in initial)
    zeta = oscillator.damping_ratios(omega, *body.require_rayleigh("closed-form solutions"))
    return ForcedModes(omega, zeta, load, shapes, W, start, start_t)


def _modes(M: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return omega (m,) and M-orthonormal vectors (n, m) of the pencil, right to the last digits in double."""
    # (M, K), not (K, M): LAPACK's error is relative to the largest eigenvalue, so 1/omega^2 as the eigenvalue keeps
    # the digits of the low modes
    compliance, vectors = linalg.eigh(M.astype(float), K.astype(float))
    vectors = (vectors / np.sqrt(compliance)).astype(EXTENDED)
    for _ in range(2):
        squares, vectors = _refined(M, K, vectors)
    return np.sqrt(squares).astype(float), vectors.astype(float)


def _refined(M: np.ndarray, K: np.ndarray, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return omega^2 and improved vectors: one step of Ogita and Aishima (2018), quadratically convergent."""
    R, S = np.eye(X.shape[1]) - X.T @ (M @ X), X.T @ (K @ X)
    squares = np.diag(S) / (1 - np.diag(R))
    gap = squares - squares[:, None]
    far = np.abs(gap) > 1e-9 * squares  # nearly equal frequencies: any vectors of their common space will do
    E = np.where(far, (S + squares * R) / np.where(far, gap, 1), R / 2)
    return squares, X + X @ E


def _parts(t: Any) -> list[np.ndarray]:
    t = np.asarray(t, dtype=float)
    return [t[first : first + INSTANTS_AT_ONCE] for first in range(0, len(t), INSTANTS_AT_ONCE)]
