"""Cubic splines through few knots, ends not-a-knot: the same as scipy.interpolate.CubicSpline.

That one takes 0.1 s to import, as long as some runs take, and pieces of polynomials at all knots, of which few are
wanted.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la


def knot_slopes(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return slopes (T, ...) at the knots t (T,), two or more, of the spline through y (T, ...)."""
    h, y = np.diff(t), np.asarray(y, dtype=float)
    by_row = (slice(None), *[None] * (y.ndim - 1))
    chord = np.diff(y, axis=0) / h[by_row]
    if len(t) == 2:
        return np.concatenate([chord, chord])
    d0, d1 = t[2] - t[0], t[-1] - t[-3]
    if len(t) == 3:  # a parabola
        bend = (chord[1] - chord[0]) / d0
        return np.stack([chord[0] - bend * h[0], chord[0] + bend * h[0], chord[1] + bend * h[1]])
    bands, b = np.zeros((3, len(t))), np.empty_like(y)
    bands[0, 1], bands[0, 2:] = d0, h[:-1]
    bands[1, 0], bands[1, 1:-1], bands[1, -1] = h[1], 2 * (h[:-1] + h[1:]), h[-2]
    bands[2, :-2], bands[2, -2] = h[1:], d1
    b[0] = ((h[0] + 2 * d0) * h[1] * chord[0] + h[0] ** 2 * chord[1]) / d0
    b[1:-1] = 3 * (h[1:][by_row] * chord[:-1] + h[:-1][by_row] * chord[1:])
    b[-1] = (h[-1] ** 2 * chord[-2] + (2 * d1 + h[-1]) * h[-2] * chord[-1]) / d1
    flat = la.solve_banded((1, 1), bands, b.reshape(len(t), -1), overwrite_ab=True, overwrite_b=True)
    return flat.reshape(y.shape)


def spline_weights(t: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return W (S, T): W y are values at times `at` (S,) of the spline through y at the knots t (T,)."""
    slopes = knot_slopes(t, np.eye(len(t)))
    j = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    h, rows = np.diff(t)[j], np.arange(len(at))
    s = (at - t[j]) / h
    found = (h * s * (1 - s) ** 2)[:, None] * slopes[j] - (h * s**2 * (1 - s))[:, None] * slopes[j + 1]
    found[rows, j] += (1 + 2 * s) * (1 - s) ** 2
    found[rows, j + 1] += s**2 * (3 - 2 * s)
    return found
