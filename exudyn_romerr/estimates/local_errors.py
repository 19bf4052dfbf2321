"""Local errors of time steps, from samples alone (estimates.md 2).

At the samples of a simulation its q, v, a satisfy the equations of motion; what is wrong is that v and a are not the
derivatives of q and v. For a step of size h from sample 0 to 1, a_m in its middle:

    dq = q1 - q0 - h/2 (v0 + v1) + h^2/12 (a1 - a0) ,     dv = v1 - v0 - h/6 (a0 + 4 a_m + a1)
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

NODES = 4  # samples that a cubic goes through
SAME_STEP = 1e-6  # of a step size: times of samples are rounded
# between steps that are looked at first: odd, so that what changes its sign from step to step shows; the narrow ones
# where few steps follow, for a cubic goes through four
GAPS, NARROW = (15, 17), (7, 9)
# times what is at the steps looked at around it: these do not tell of it. Second differences of what is there at one
# step only are twice those beside it
STANDS_OUT = 1.5


def in_the_middle(
    t: np.ndarray, x: np.ndarray, share: float = 0.5, steps: np.ndarray | slice = slice(None)
) -> np.ndarray:
    """Return x (T - 1, ...) within the steps between times t (T,), at a share of each; or of those steps alone.

    Cubic through the two samples before and the two after, at the ends of the series through the nearest four; of a
    degree less than the number of samples, where there are fewer.
    """
    T = len(t)
    n = min(NODES, T)
    first = np.clip(np.arange(T - 1) - (NODES // 2 - 1), 0, T - n)[steps]
    return _through(t, x, first[:, None] + np.arange(n), (t[:-1] + share * np.diff(t))[steps])


def _through(t: np.ndarray, x: np.ndarray, nodes: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Polynomials (S, ...) at times now (S,), through x (T, ...) at nodes (S, n) of times t (T,)."""
    times, found = t[nodes], np.zeros((len(nodes), *x.shape[1:]))
    for j in range(nodes.shape[1]):
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


def seldom(count: int) -> np.ndarray:
    """Return which of so many steps are looked at where residuals are smooth, (count,): the last ones, too."""
    looked = np.zeros(count, dtype=bool)
    at = np.append(0, np.cumsum(np.resize(GAPS if count > NODES * sum(GAPS) else NARROW, count)))
    looked[at[at < count]] = looked[-1:] = True
    return looked


def standing_out(sizes: np.ndarray, looked: np.ndarray, least: float | np.ndarray = 0.0) -> np.ndarray:
    """Return where sizes (S, n) are far above those at the steps looked at around them, and above the least, (S,)."""
    before, after = _around(looked)
    return np.any(sizes > STANDS_OUT * np.maximum(sizes[before], sizes[after]) + least, axis=1)


def told(
    t: np.ndarray,
    x: np.ndarray,
    looked: np.ndarray,
    look: Callable[[np.ndarray], np.ndarray],
    sizes: np.ndarray,
    least: float,
) -> np.ndarray:
    """Look between steps that are looked at until cubics tell the rest; return what they have missed (S,), in sizes.

    x (S, n) and looked (S,), which are gone on with, at times t (S,), the ends by themselves; look : numbers of steps
    -> x there; sizes (S, n) : of 1. In the middle of a gap x is looked at in any case: where the cubic through the
    others is off by more than the least, both halves are gaps.
    """
    off, inner = np.zeros(len(t)), slice(1, -1)
    gaps = list(pairwise(np.flatnonzero(looked)))
    while gaps := [(a, b) for a, b in gaps if b - a > 1]:
        ends = np.array(gaps)
        # an odd number of steps from the first: what alternates from step to step is the same at even ones
        middle = ends[:, 0] + (np.diff(ends)[:, 0] // 2 | 1)
        cubic = filled(t[inner], x[inner], looked[inner])[middle - 1]
        x[middle], looked[middle] = look(middle), True
        off[middle] = (sizes[middle] * np.abs(x[middle] - cubic)).max(axis=1, initial=0.0)
        bent = off[middle] > least
        halves = zip(ends[bent, 0], middle[bent], ends[bent, 1], strict=True)
        gaps = [gap for a, m, b in halves for gap in ((a, m), (m, b))]
    return off


def filled(t: np.ndarray, x: np.ndarray, looked: np.ndarray) -> np.ndarray:
    """Return x (S, n) at steps looked at, and at others the cubic through those around."""
    at, others = np.flatnonzero(looked), np.flatnonzero(~looked)
    if others.size:
        first = np.clip(np.searchsorted(at, others) - NODES // 2, 0, len(at) - NODES)
        x = x.copy()
        x[others] = _through(t[at], x[at], first[:, None] + np.arange(NODES), t[others])
    return x


def _around(looked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (S,) of the steps looked at that are next to each, before and after it; the ends are among them."""
    at, steps = np.flatnonzero(looked), np.arange(len(looked))
    after = np.searchsorted(at, steps)
    return at[after - ~looked], at[after]
