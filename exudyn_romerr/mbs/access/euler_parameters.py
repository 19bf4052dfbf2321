"""Euler parameters p (..., 4) of rigid body nodes as Exudyn has them, also off unit norm."""

from __future__ import annotations

import numpy as np

from ...model.floating_frame import skew

# G of unit parameters, -2 v and 2 (s I - v~) side by side; entries of a product with them are single ones, doubled
RATES = np.concatenate(
    [np.eye(4)[:, 1:, None] * -2, 2 * np.eye(4)[:, :1, None] * np.eye(3) - 2 * skew(np.eye(4)[:, 1:])], axis=2
).reshape(4, 12)


def axes_of(p: np.ndarray) -> np.ndarray:
    """A = (1 - 2 v.v) I + 2 v v^T + 2 s v~ (..., 3, 3) of p = s, v."""
    s, v = p[..., :1, None], p[..., 1:]
    diagonal = (1 - 2 * np.einsum("...i,...i->...", v, v))[..., None, None] * np.eye(3)
    return diagonal + 2 * v[..., :, None] * v[..., None, :] + 2 * s * skew(v)


def rates_of(p: np.ndarray) -> np.ndarray:
    """G (..., 3, 4), which is linear in p: w = G(p) p' in body axes, al = G(p) p''."""
    return (p @ RATES).reshape(*p.shape[:-1], 3, 4)
