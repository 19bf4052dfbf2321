"""Euler parameters p (..., 4) of rigid body nodes as Exudyn has them, also off unit norm."""

from __future__ import annotations

import numpy as np

CYCLIC = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


def axes_of(p: np.ndarray) -> np.ndarray:
    """A = (1 - 2 v.v) I + 2 v v^T + 2 s v~ (..., 3, 3) of p = s, v."""
    v = p[..., 1:]
    A, turned = (2 * v)[..., :, None] * v[..., None, :], 2 * p[..., :1] * v
    rest = 1 - 2 * np.einsum("...i,...i->...", v, v)
    for i, j, k in CYCLIC:
        A[..., i, i] += rest
        A[..., k, j] += turned[..., i]
        A[..., j, k] -= turned[..., i]
    return A


def rates_of(p: np.ndarray) -> np.ndarray:
    """G (..., 3, 4), which is linear in p: w = G(p) p' in body axes, al = G(p) p''."""
    twice = 2 * p
    found = np.empty((*p.shape[:-1], 3, 4))
    for i, j, k in CYCLIC:
        found[..., i, 0], found[..., i, 1 + i] = -twice[..., 1 + i], twice[..., 0]
        found[..., k, 1 + j], found[..., j, 1 + k] = -twice[..., 1 + i], twice[..., 1 + i]  # less 2 v~
    return found
