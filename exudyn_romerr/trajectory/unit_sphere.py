"""Euler parameters that an error moves: along the unit sphere, for what is straight leaves it to second order.

A rotor whose speed is off by a little is off by an angle that grows: straight, it would be stretched after a tenth of
a turn. Along the sphere it is turned, whatever the angle, and nothing else changes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

SERIES = 1e-2  # square of an angle; below, four terms are exact to 1e-14, the quotients are not


def bend(p: Sequence[np.ndarray], e: Sequence[np.ndarray]) -> np.ndarray:
    """Return p cos|e| + e sin|e|/|e| less p + e, and its rates (3, S, 4), of p, p', p'' and e, e', e'' (S, 4).

    e is perpendicular to p. What is returned is of second order in e; 0 where e is 0 and at rest.
    """
    p, p_t, p_tt = p
    e, e_t, e_tt = e
    if not e.any() and not e_t.any():
        return np.zeros((3, *p.shape))
    s, s_t = np.sum(e * e, axis=1)[:, None], 2 * np.sum(e * e_t, axis=1)[:, None]
    s_tt = 2 * np.sum(e_t * e_t + e * e_tt, axis=1)[:, None]
    cos, (sinc, of_s, of_ss) = -2 * np.sin(np.sqrt(s) / 2) ** 2, _sinc(s)  # less 1, both
    cos_s, cos_ss = -(1 + sinc) / 2, -of_s / 2
    bent_t = p_t * cos + e_t * sinc + (p * cos_s + e * of_s) * s_t
    bent_tt = p_tt * cos + e_tt * sinc + 2 * (p_t * cos_s + e_t * of_s) * s_t
    bent_tt += (p * cos_s + e * of_s) * s_tt + (p * cos_ss + e * of_ss) * s_t**2
    return np.array([p * cos + e * sinc, bent_t, bent_tt])


def _sinc(s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """sin(x)/x - 1 at x^2 = s, and how it changes with s: once, twice."""
    small = s < SERIES
    if small.all():
        return _series(s)
    at = np.where(small, 1.0, s)
    x = np.sqrt(at)
    value = np.sin(x) / x
    once = (np.cos(x) - value) / (2 * at)
    twice = -(value / 2 + 3 * once) / (2 * at)
    pairs = zip(_series(np.where(small, s, 0.0)), (value - 1, once, twice), strict=True)
    return tuple(np.where(small, one, other) for one, other in pairs)


def _series(s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same where s is small."""
    return (
        -s / 6 * (1 - s / 20 * (1 - s / 42 * (1 - s / 72))),
        -1 / 6 * (1 - s / 10 * (1 - s / 28 * (1 - s / 54))),
        1 / 60 * (1 - s / 14 * (1 - s / 36 * (1 - s / 66))),
    )
