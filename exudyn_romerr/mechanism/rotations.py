"""Rotations: cross products as matrices, Euler parameters, and what a small rotation does to them.

Small rotations dphi are vectors in global axes: A -> exp(dphi~) A.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import comb

import numpy as np

CYCLE = ((1, 2), (2, 0), (0, 1))  # (a x b)_r = a_i b_j - a_j b_i
SMALL = 1e-8  # rad, below which sin x / x and its like are their limits to the last digit
SERIES = 7  # terms of the exponential of a screw: of 0.5 rad, 1e-7 are missed


def _filled(rows: tuple, like: np.ndarray, *shape: int) -> np.ndarray:
    """Matrices (..., *shape) of their entries (...), row by row."""
    found = np.empty((*like.shape[:-1], len(rows)))
    for i, entry in enumerate(rows):
        found[..., i] = entry
    return found.reshape(*like.shape[:-1], *shape)


def _entries(x: np.ndarray) -> list[np.ndarray]:
    return [x[..., i] for i in range(x.shape[-1])]


def skew(v: np.ndarray) -> np.ndarray:
    """Return v~ (..., 3, 3) of v (..., 3): v~ x = v x x."""
    x, y, z = _entries(v)
    return _filled((0.0, -z, y, z, 0.0, -x, -y, x, 0.0), v, 3, 3)


def body_rates(p: np.ndarray) -> np.ndarray:
    """Return B (..., 3, 4): angular velocity in body axes w = B p' of Euler parameters p (..., 4)."""
    a, b, c, d = _entries(2 * p)
    return _filled((-b, a, d, -c, -c, -d, a, b, -d, c, -b, a), p, 3, 4)


def rotation_matrix(p: np.ndarray) -> np.ndarray:
    """Return A (..., 3, 3) of Euler parameters (..., 4) of length one.

    Where the length drifts the diagonal is 2 (|p|^2 - 1) more than Exudyn's, which has 1 - 2 (c^2 + d^2).
    """
    a, b, c, d = _entries(p)
    aa, bb, cc, dd = a * a, b * b, c * c, d * d
    ab, ac, ad, bc, bd, cd = a * b, a * c, a * d, b * c, b * d, c * d
    rows = (
        *(2 * (aa + bb) - 1, 2 * (bc - ad), 2 * (bd + ac)),
        *(2 * (bc + ad), 2 * (aa + cc) - 1, 2 * (cd - ab)),
        *(2 * (bd - ac), 2 * (cd + ab), 2 * (aa + dd) - 1),
    )
    return _filled(rows, p, 3, 3)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a x b (..., 3); a fourth of the time of NumPy's."""
    found = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for r, (i, j) in enumerate(CYCLE):
        found[..., r] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return found


def exponential(v: np.ndarray) -> np.ndarray:
    """Return exp(v~) (..., 3, 3)."""
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    is_small = angle < SMALL
    x, K = np.where(is_small, 1.0, angle), skew(v)
    first = np.where(is_small, 1.0, np.sin(x) / x)
    second = np.where(is_small, 0.5, (1 - np.cos(x)) / x**2)
    return np.eye(3) + first * K + second * (K @ K)


def along_screw(phi: Sequence[np.ndarray], x: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return V(phi) x, V = sum of phi~^k / (k + 1)!, and as many derivatives as x has, whose phi and x are given.

    Where a point goes that begins to move by x (..., 3) while its body turns by phi (..., 3): if it turns
    about another that is fixed, x = phi x d and V x = (exp(phi~) - 1) d.
    """
    return _series(cross, phi, x, 2)


def _series(
    product: Callable[[np.ndarray, np.ndarray], np.ndarray],
    phi: Sequence[np.ndarray],
    x: Sequence[np.ndarray],
    first: int,
) -> list[np.ndarray]:
    """Return x + phi x / first + phi (phi x) / (first (first + 1)) + ..., and its derivatives, by Leibniz' rule."""
    found, term = [*x], x
    for k in range(first, SERIES + 1):
        term = [sum(comb(n, m) * product(phi[m], term[n - m]) for m in range(n + 1)) / k for n in range(len(x))]
        found = [a + b for a, b in zip(found, term, strict=True)]
    return found


def times(A: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return A v for stacks of matrices (..., i, j) and vectors (..., j)."""
    return (A @ v[..., None])[..., 0]


def times_transposed(A: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return A^T v for stacks of matrices (..., i, j) and vectors (..., i)."""
    return (v[..., None, :] @ A)[..., 0, :]


def parameter_rates(p: np.ndarray) -> np.ndarray:
    """Return E (..., 4, 3): dp = E dphi of Euler parameters p by a small rotation; linear in p."""
    a, b, c, d = _entries(p / 2)
    return _filled((-b, -c, -d, a, d, -c, -d, a, b, c, -b, a), p, 4, 3)


def global_rates(p: np.ndarray) -> np.ndarray:
    """Return 4 E^T (..., 3, 4): dphi = 4 E^T dp, and the angular velocity in global axes 4 E^T p'."""
    return 4 * np.swapaxes(parameter_rates(p), -1, -2)


def turned_parameters(p: Sequence[np.ndarray], phi: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return Euler parameters (..., 4) after a finite rotation phi (..., 3) in global axes, and their derivatives."""
    return _series(lambda turn, x: times(parameter_rates(x), turn), phi, p, 1)
