"""Rotations: cross products as matrices, Euler parameters, and what a small rotation does to them.

Small rotations dphi are vectors in global axes: A -> exp(dphi~) A.
"""

from __future__ import annotations

import numpy as np

SMALL = 1e-8  # rad, below which sin x / x and its like are their limits to the last digit


def skew(v: np.ndarray) -> np.ndarray:
    """Return v~ (..., 3, 3) of v (..., 3): v~ x = v x x."""
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*v.shape[:-1], 3, 3)


def body_rates(p: np.ndarray) -> np.ndarray:
    """Return B (..., 3, 4): angular velocity in body axes w = B p' of Euler parameters p (..., 4)."""
    a, b, c, d = np.moveaxis(p, -1, 0)
    rows = [-b, a, d, -c, -c, -d, a, b, -d, c, -b, a]
    return 2 * np.stack(rows, axis=-1).reshape(*p.shape[:-1], 3, 4)


def rotation_matrix(p: np.ndarray) -> np.ndarray:
    """Return A (..., 3, 3), as Exudyn has it, of Euler parameters (..., 4) that need not have length one."""
    a, b, c, d = np.moveaxis(p, -1, 0)
    rows = [
        *(2 * (a * a + b * b) - 1, 2 * (b * c - a * d), 2 * (b * d + a * c)),
        *(2 * (b * c + a * d), 2 * (a * a + c * c) - 1, 2 * (c * d - a * b)),
        *(2 * (b * d - a * c), 2 * (c * d + a * b), 2 * (a * a + d * d) - 1),
    ]
    return np.stack(rows, axis=-1).reshape(*p.shape[:-1], 3, 3)


def exponential(v: np.ndarray) -> np.ndarray:
    """Return exp(v~) (..., 3, 3)."""
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    is_small = angle < SMALL
    x, K = np.where(is_small, 1.0, angle), skew(v)
    first = np.where(is_small, 1.0, np.sin(x) / x)
    second = np.where(is_small, 0.5, (1 - np.cos(x)) / x**2)
    return np.eye(3) + first * K + second * (K @ K)


def times(A: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return A v for stacks of matrices (..., i, j) and vectors (..., j)."""
    return (A @ v[..., None])[..., 0]


def times_transposed(A: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return A^T v for stacks of matrices (..., i, j) and vectors (..., i)."""
    return (v[..., None, :] @ A)[..., 0, :]


def parameter_rates(p: np.ndarray) -> np.ndarray:
    """Return E (..., 4, 3): dp = E dphi of Euler parameters p by a small rotation; linear in p."""
    a, b, c, d = np.moveaxis(p, -1, 0)
    rows = [-b, -c, -d, a, d, -c, -d, a, b, c, -b, a]
    return np.stack(rows, axis=-1).reshape(*p.shape[:-1], 4, 3) / 2


def global_rates(p: np.ndarray) -> np.ndarray:
    """Return 4 E^T (..., 3, 4): dphi = 4 E^T dp, and the angular velocity in global axes 4 E^T p'."""
    return 4 * np.swapaxes(parameter_rates(p), -1, -2)


def turned_parameters(p: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Return Euler parameters (..., 4) after a finite rotation phi (..., 3) in global axes."""
    angle = np.linalg.norm(phi, axis=-1, keepdims=True)
    is_small = angle < SMALL
    share = np.where(is_small, 0.5, np.sin(angle / 2) / np.where(is_small, 1.0, angle))
    return np.cos(angle / 2) * p + 2 * times(parameter_rates(p), share * phi)
