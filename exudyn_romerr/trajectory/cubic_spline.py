"""A cubic spline; scipy.interpolate, which has one, takes as long to import as some runs."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la


class CubicSpline:
    """The cubic spline through values y (n, ...) at times t (n,), n >= 2, ascending.

    Its third derivative is continuous at the second and the last but one of the times ("not-a-knot"). Of three values
    it is a parabola, of two a line. Outside the times its first and last piece go on.

    Attributes
    ----------
    slopes : (n, ...), derivatives at the times.

    Source: de Boor, A practical guide to splines (1978), IV.
    """

    def __init__(self, t: np.ndarray, y: np.ndarray):
        self._t, self._y = np.asarray(t, dtype=float), np.asarray(y, dtype=float)
        self.slopes = _slopes(self._t, self._y.reshape(len(self._t), -1)).reshape(self._y.shape)

    def __call__(self, t: float | np.ndarray) -> np.ndarray:
        """Return values (..., *y.shape[1:]) at times t (...)."""
        t = np.asarray(t, dtype=float)
        i = np.clip(np.searchsorted(self._t, t, side="right") - 1, 0, len(self._t) - 2)
        h = self._t[i + 1] - self._t[i]
        ahead = (t - self._t[i]) / h
        wide = (..., *(None,) * (self._y.ndim - 1))
        s, h = ahead[wide], h[wide]
        change = self._y[i + 1] - self._y[i]
        first, last = h * self.slopes[i] - change, change - h * self.slopes[i + 1]
        return self._y[i] + s * change + s * (1 - s) * ((1 - s) * first + s * last)


def _slopes(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    h, n = np.diff(t), len(t)
    rises = np.diff(y, axis=0) / h[:, None]
    if n == 2:
        return np.repeat(rises, 2, axis=0)
    if n == 3:
        bend = (rises[1] - rises[0]) / (t[2] - t[0])
        return np.stack([rises[0] - h[0] * bend, rises[0] + h[0] * bend, rises[1] + h[1] * bend])
    bands, right = np.zeros((3, n)), np.empty_like(y)
    bands[0, 2:], bands[1, 1:-1], bands[2, :-2] = h[:-1], 2 * (h[:-1] + h[1:]), h[1:]
    right[1:-1] = 3 * (h[1:, None] * rises[:-1] + h[:-1, None] * rises[1:])
    ends = t[2] - t[0], t[-1] - t[-3]
    bands[1, 0], bands[0, 1], bands[1, -1], bands[2, -2] = h[1], ends[0], h[-2], ends[1]
    right[0] = ((h[0] + 2 * ends[0]) * h[1] * rises[0] + h[0] ** 2 * rises[1]) / ends[0]
    right[-1] = (h[-1] ** 2 * rises[-2] + (2 * ends[1] + h[-1]) * h[-2] * rises[-1]) / ends[1]
    return la.solve_banded((1, 1), bands, right)
