"""Polynomials of degree 5 in Bezier form: Hermite interpolation, subdivision, interpolation at nodes."""

from __future__ import annotations

from math import comb
from typing import Any

import numpy as np

from ..compiled.loops import loops
from .blocked_products import combined

DEGREE = 5
NODES = np.arange(DEGREE + 1) / DEGREE  # where a function is interpolated
CHECKS = (NODES[:-1] + NODES[1:]) / 2  # where what the polynomial misses is looked at


def _bernstein(x: np.ndarray) -> np.ndarray:
    j = np.arange(DEGREE + 1)
    binomials = np.array([comb(DEGREE, i) for i in j])
    return binomials * x[:, None] ** j * (1 - x[:, None]) ** (DEGREE - j)


def _elevation(degree: int) -> np.ndarray:
    """Matrix (6, degree + 1): control points of a polynomial to those of the same one as degree 5."""
    matrix = np.eye(degree + 1)
    for d in range(degree + 1, DEGREE + 1):
        share = (np.arange(1, d) / d)[:, None]
        matrix = np.concatenate([matrix[:1], share * matrix[:-1] + (1 - share) * matrix[1:], matrix[-1:]])
    return matrix


RAISE = {degree: _elevation(degree) for degree in (3, 4)}
FROM_NODES = np.linalg.inv(_bernstein(NODES))  # values at NODES -> control points
AT_CHECKS = _bernstein(CHECKS)  # control points -> values at CHECKS


def hermite_controls(h: np.ndarray, q, q_t, q_tt) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return control points (S, 6, n) of the quintic Hermite interpolants, of their first and second derivatives.

    h (S,) are the distances of S + 1 samples q, q_t, q_tt (S+1, n). First and last control points are the samples
    themselves, bit for bit, so that R is continuous between steps.
    """
    q0, q1, v0, v1, a0, a1 = (x[part] for x in (q, q_t, q_tt) for part in (slice(None, -1), slice(1, None)))
    h = h[:, None]
    dq = q1 - q0
    position = [
        q0,
        q0 + h * v0 / 5,
        q0 + 2 * h * v0 / 5 + h**2 * a0 / 20,
        q1 - 2 * h * v1 / 5 + h**2 * a1 / 20,
        q1 - h * v1 / 5,
        q1,
    ]
    middle = 5 * dq / h - 2 * (v0 + v1) + h * (a1 - a0) / 4
    velocity = [v0, v0 + h * a0 / 4, middle, v1 - h * a1 / 4, v1]
    bend = 20 * dq / h**2
    acceleration = [a0, bend - (8 * v1 + 12 * v0) / h + a1 - 2 * a0, -bend + (12 * v1 + 8 * v0) / h + a0 - 2 * a1, a1]
    points = np.stack(position), combined(RAISE[4], velocity), combined(RAISE[3], acceleration)
    return tuple(x.swapaxes(0, 1) for x in points)


def hermite_bends(h: np.ndarray, q, q_t, q_tt) -> tuple[np.ndarray, np.ndarray]:
    """Return how far control points of hermite_controls, 1 to 4, are from the chords, (4, S, n): of q, and of q'."""
    v0, v1, a0, a1 = (x[part] for x in (q_t, q_tt) for part in (slice(None, -1), slice(1, None)))
    h, dq, dv = h[:, None], np.diff(q, axis=0), np.diff(q_t, axis=0)
    first, last, bend = (h * v0 - dq) / 5, (dq - h * v1) / 5, h**2 / 20
    position = np.stack([first, 2 * first + bend * a0, 2 * last + bend * a1, last])
    velocity = [(h * a0 - dv) / 4, 5 * (dq / h - (v0 + v1) / 2) + h * (a1 - a0) / 4, (dv - h * a1) / 4]
    return position, combined(RAISE[4][1:-1, 1:-1], velocity)


def hermite_rows(layout: Any, h: np.ndarray, samples: tuple, controls: np.ndarray | None) -> np.ndarray:
    """Return control points (S, 6, .) of layout(q, q', q'', u) between samples, each (S + 1, .).

    controls : of u (S, 6, p); None: straight lines. layout.rayleigh : alpha and beta where it is (q'' + alpha q',
    q + beta q', u); None: it is another one. First and last control points are the layout of samples, bit for bit.
    """
    *states, u = samples
    if loops is None or layout.rayleigh is None:
        return layout(*hermite_controls(h, *states), straight(u[:-1], u[1:]) if controls is None else controls)
    ends = layout(*samples)
    rows = np.empty((len(h), DEGREE + 1, ends.shape[1]))
    given = [None if x is None else np.ascontiguousarray(x, dtype=float) for x in (h, *samples, controls, ends)]
    loops.curves(len(h), states[0].shape[1], u.shape[1], *layout.rayleigh, *given, rows)
    return rows


def interpolated(
    first: np.ndarray, last: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return control points (S, 6, p) of interpolants with given ends, and what they miss; values (S, 9, p).

    Those are at CHECKS and inner NODES in turn. What is missed: the largest at CHECKS, and the sum of all (S, p).
    Last: the largest size of a value at NODES.
    """
    if loops is not None:
        S, _, p = values.shape
        controls, missed = np.empty((S, len(NODES), p)), np.empty((2, S, p))
        given = [np.ascontiguousarray(x, dtype=float) for x in (first, last, values, FROM_NODES, AT_CHECKS)]
        return controls, *missed, loops.interpolate(S, p, *given, controls, *missed)
    at_nodes = np.concatenate([first[:, None], values[:, 1::2], last[:, None]], axis=1)
    controls = FROM_NODES @ at_nodes
    controls[:, 0], controls[:, -1] = first, last
    miss = np.abs(values[:, 0::2] - AT_CHECKS @ controls)
    return controls, miss.max(axis=1), miss.sum(axis=1), float(np.abs(at_nodes).max())


def straight(first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return control points (S, 6, n) of straight lines between first and last (S, n)."""
    controls, part = np.empty((len(first), len(NODES), first.shape[1])), np.empty_like(first)
    for j, share in enumerate(NODES):  # one by one, for they stay in the cache: four times as fast as all at once
        np.multiply(first, 1 - share, out=controls[:, j])
        controls[:, j] += np.multiply(last, share, out=part)
    return controls


def subdivided(c: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return control points (S, 6, n) of the parts [a, b] (S,) of curves with control points c (de Casteljau)."""
    right = _halves(c, a)[1]
    rest = 1 - a
    return _halves(right, np.where(rest > 0, (b - a) / np.where(rest > 0, rest, 1.0), 1.0))[0]


def _halves(c: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    left, right, rest, x = [c[:, 0]], [c[:, -1]], c, x[:, None, None]
    while rest.shape[1] > 1:
        rest = (1 - x) * rest[:, :-1] + x * rest[:, 1:]
        left.append(rest[:, 0])
        right.append(rest[:, -1])
    return np.stack(left, axis=1), np.stack(right[::-1], axis=1)
