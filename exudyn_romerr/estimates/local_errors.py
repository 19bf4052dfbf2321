"""Local errors of time steps, from samples alone (estimates.md 2).

At the samples of a simulation its q, v, a satisfy the equations of motion; what is wrong is that v and a are not the
derivatives of q and v. For a step of size h from sample 0 to 1, a_m in its middle:

    dq = q1 - q0 - h/2 (v0 + v1) + h^2/12 (a1 - a0) ,     dv = v1 - v0 - h/6 (a0 + 4 a_m + a1)
"""

from __future__ import annotations

import numpy as np

NODES = 4  # samples that a cubic goes through
SAME_STEP = 1e-6  # of a step size: times of samples are rounded


def in_the_middle(t: np.ndarray, x: np.ndarray, share: float = 0.5) -> np.ndarray:
    """Return x (T - 1, ...) within the steps between times t (T,), at a share of each.

    Cubic through the two samples before and the two after, at the ends of the series through the nearest four; of a
    degree less than the number of samples, where there are fewer.
    """
    T = len(t)
    n = min(NODES, T)
    first = np.clip(np.arange(T - 1) - (NODES // 2 - 1), 0, T - n)
    nodes = first[:, None] + np.arange(n)
    times, now = t[nodes], t[:-1] + share * np.diff(t)
    found = np.zeros((T - 1, *x.shape[1:]))
    for j in range(n):
        others = np.delete(times, j, axis=1)
        weights = np.prod((now[:, None] - others) / (times[:, j : j + 1] - others), axis=1)
        found += weights.reshape(-1, *np.ones(x.ndim - 1, dtype=int)) * x[nodes[:, j]]
    return found


def defects(t: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return dq and dv (T - 1, ...) of the steps between samples at times t (T,)."""
    h = np.diff(t).reshape(-1, *np.ones(q.ndim - 1, dtype=int))
    dq = np.diff(q, axis=0) - h / 2 * (v[1:] + v[:-1]) + h**2 / 12 * np.diff(a, axis=0)
    dv = np.diff(v, axis=0) - h / 6 * (a[1:] + a[:-1] + 4 * in_the_middle(t, a))
    return dq, dv


def shared(h: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return local errors d (S, ...) of which each step of size h (S,) gives a quarter to either neighbour.

    To neighbours of the same size, that is: what rings from step to step, which is not resolved, cancels there. Steps
    beside another size keep that quarter, so the sum stays but for the last step's.
    """
    found = d.copy()
    same = (np.abs(np.diff(h)) <= SAME_STEP * h[1:]).reshape(-1, *np.ones(d.ndim - 1, dtype=int))
    given = same * (d[1:] - d[:-1]) / 4
    found[:-1] += given
    found[1:] -= given
    found[-1:] = d[-1:]  # what follows is taken to give and take alike
    return found
