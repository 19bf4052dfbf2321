"""Motion of M q'' + D q' + K q = B a sin(W t), Rayleigh damping, with 50 digits: the truth where double is the limit.

For small bodies (a dense eigenproblem of 18 coordinates takes 0.3 s) and a few instants (0.2 ms a mode and instant).
Needs mpmath.
"""

from __future__ import annotations

import mpmath
import numpy as np

DIGITS = 50
EQUAL_ROOTS = mpmath.mpf(10) ** -20  # of sqrt(zeta^2 - 1) omega t: below, sinh(x)/x is 1 to 40 digits


class PreciseModes:
    """The exact motion for the matrices as they stand in memory: every double is taken as the number it is.

    Parameters
    ----------
    M, K : ndarray, (N, N)
    rayleigh : (alpha, beta)
        In 1/s and s; zeros: undamped.
    load : ndarray, (N,)
        B a.
    W : float
        Angular frequency of the load in rad/s; not that of an undamped mode.
    start, start_t : ndarray, (N,), optional
        q(0), q'(0); default zero.
    """

    def __init__(
        self,
        M: np.ndarray,
        K: np.ndarray,
        rayleigh: tuple[float, float],
        load: np.ndarray,
        W: float,
        start: np.ndarray | None = None,
        start_t: np.ndarray | None = None,
    ):
        with mpmath.workdps(DIGITS):
            M, K = _matrix(M), _matrix(K)
            inverse = mpmath.inverse(mpmath.cholesky(M))
            pencil = inverse * K * inverse.T
            self.squares, vectors = mpmath.eigsy((pencil + pencil.T) / 2)
            self.shapes = inverse.T * vectors
            alpha, beta = map(mpmath.mpf, rayleigh)
            self.decays = [(alpha + beta * square) / 2 for square in self.squares]
            self.load, self.W = self.shapes.T * _matrix(load), mpmath.mpf(W)
            zero = np.zeros(M.rows)
            states = (zero if x is None else x for x in (start, start_t))
            self.start, self.start_t = (self.shapes.T * (M * _matrix(x)) for x in states)

    def motion(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return q, q_t at times t (T,), each (T, N), rounded to double."""
        with mpmath.workdps(DIGITS):
            at = [self._at(mpmath.mpf(float(time))) for time in t]
        return tuple(np.array([pair[i] for pair in at]) for i in range(2))

    def _at(self, t: mpmath.mpf) -> tuple[list[float], list[float]]:
        modal = [self._mode(i, t) for i in range(len(self.squares))]
        moved = (self.shapes * mpmath.matrix(list(x)) for x in zip(*modal, strict=True))
        return tuple([float(x) for x in vector] for vector in moved)

    def _mode(self, i: int, t: mpmath.mpf) -> tuple[mpmath.mpf, mpmath.mpf]:
        """Modal coordinate and its rate: forced motion a sine and a cosine, the rest is free."""
        square, a, W = self.squares[i], self.decays[i], self.W
        forced = self.load[i] / mpmath.mpc(square - W**2, 2 * a * W)
        x, v = self.start[i] - forced.imag, self.start_t[i] - W * forced.real
        s, c = _free(a, square, t)
        p = c + a * s  # s and p solve the homogeneous equation: s' = c - a s, p' = -omega^2 s
        wave = forced * mpmath.expj(W * t)
        return wave.imag + x * p + v * s, W * wave.real - x * square * s + v * (c - a * s)


def _free(a: mpmath.mpf, square: mpmath.mpf, t: mpmath.mpf) -> tuple[mpmath.mpf, mpmath.mpf]:
    """exp(-a t) sinh(g t)/g and exp(-a t) cosh(g t), g^2 = a^2 - omega^2 of either sign or zero."""
    root = mpmath.sqrt(mpmath.mpc(a**2 - square))
    if abs(root) * t < EQUAL_ROOTS:
        return mpmath.exp(-a * t) * t, mpmath.exp(-a * t)
    slow, fast = mpmath.exp((root - a) * t), mpmath.exp((-root - a) * t)
    return ((slow - fast) / (2 * root)).real, ((slow + fast) / 2).real


def _matrix(x: np.ndarray) -> mpmath.matrix:
    return mpmath.matrix(np.asarray(x, dtype=float).tolist())
