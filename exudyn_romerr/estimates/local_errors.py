"""Local errors of time steps, from samples alone (estimates.md 2).

At the samples of a simulation its q, v, a satisfy the equations of motion; what is wrong is that v and a are not the
derivatives of q and v. For a step of size h from sample 0 to 1, a_m in its middle:

    dq = q1 - q0 - h/2 (v0 + v1) + h^2/12 (a1 - a0) ,     dv = v1 - v0 - h/6 (a0 + 4 a_m + a1)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise, permutations

import numpy as np

NODES = 4  # samples that a cubic goes through
SAME_STEP = 1e-6  # of a step size: times of samples are rounded
# between steps that are looked at first: odd, so that what changes its sign from step to step shows; the narrow ones
# where few steps follow, for a cubic goes through four
GAPS, NARROW = (15, 17), (7, 9)
# times what is at the steps looked at around it: these do not tell of it. Second differences of what is there at one
# step only are twice those beside it
STANDS_OUT = 1.5


def in_the_middle(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return x (T - 1, ...) in the middle of the steps between times t (T,), as `within` does."""
    T = len(t)
    if T <= NODES:
        return within(t, [x], 0.5)[0]
    # inner steps have their nodes one behind the other: no copies of these are made
    first = np.clip(np.arange(T - 1) - (NODES // 2 - 1), 0, T - NODES)
    nodes = first[:, None] + np.arange(NODES)
    weights = weights_of(t[nodes], t[:-1] + 0.5 * np.diff(t))
    flat, found = x.reshape(T, -1), np.empty((T - 1, *x.shape[1:]))
    middle = found.reshape(T - 1, -1)
    inner = middle[1:-1]
    np.multiply(weights[1:-1, :1], flat[: T - NODES + 1], out=inner)
    for j in range(1, NODES):
        inner += weights[1:-1, j : j + 1] * flat[j : j + T - NODES + 1]
    for end in (0, -1):
        middle[end] = weights[end] @ flat[nodes[end]]
    return found


def within(
    t: np.ndarray, states: Sequence[np.ndarray], share: float | np.ndarray, steps: np.ndarray | slice = slice(None)
) -> list[np.ndarray]:
    """Return states (S, ...), each (T, ...) at times t (T,), within S steps between these, at a share of each.

    Cubic through the two samples before and the two after, at the ends of the series through the nearest four; of a
    degree less than the number of samples, where there are fewer.
    """
    T, steps = len(t), np.arange(len(t) - 1)[steps]
    n = min(NODES, T)
    first = np.clip(steps - (NODES // 2 - 1), 0, T - n)
    return _through(t, states, first[:, None] + np.arange(n), t[steps] + share * (t[steps + 1] - t[steps]))


def _through(t: np.ndarray, states: Sequence[np.ndarray], nodes: np.ndarray, now: np.ndarray) -> list[np.ndarray]:
    """Polynomials (S, ...) at times now (S,), through states (T, ...) at nodes (S, n) of times t (T,)."""
    weights = weights_of(t[nodes], now)[:, None]
    found = (weights @ x.reshape(len(x), -1)[nodes] for x in states)
    return [y.reshape(len(nodes), *x.shape[1:]) for x, y in zip(states, found, strict=True)]


def weights_of(times: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Weights (S, n) of values at times (S, n) in the polynomials through them, at times now (S,)."""
    at, found = np.ascontiguousarray(times.T), np.ones(times.shape[::-1])
    gone = now - at
    for j, k in permutations(range(len(at)), 2):
        found[j] *= gone[k] / (at[j] - at[k])
    return found.T


def defects(t: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return dq and dv (T - 1, ...) of the steps between samples at times t (T,)."""
    h = np.diff(t).reshape(-1, *np.ones(q.ndim - 1, dtype=int))
    dq, dv, part, middle = np.diff(q, axis=0), np.diff(v, axis=0), v[1:] + v[:-1], in_the_middle(t, a)
    part *= h / 2  # in place: fresh memory costs more than what fills it
    dq -= part
    np.subtract(a[1:], a[:-1], out=part)
    part *= h**2 / 12
    dq += part
    np.add(a[1:], a[:-1], out=part)
    middle *= 4
    part += middle
    part *= h / 6
    dv -= part
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
        cubic = _cubics(t[inner], x[inner], np.flatnonzero(looked[inner]), middle - 1)
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
        x = x.copy()
        x[others] = _cubics(t, x, at, others)
    return x


def _cubics(t: np.ndarray, x: np.ndarray, at: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Cubics through x (S, n) at those steps around others, there."""
    first = np.clip(np.searchsorted(at, others) - NODES // 2, 0, len(at) - NODES)
    return _through(t, [x], at[first[:, None] + np.arange(NODES)], t[others])[0]


def _around(looked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (S,) of the steps looked at that are next to each, before and after it; the ends are among them."""
    at, steps = np.flatnonzero(looked), np.arange(len(looked))
    after = np.searchsorted(at, steps)
    return at[after - ~looked], at[after]
