"""The step error: what the time integration got wrong in every step, by the exact flow of the reduced mechanism.

A step's error is the computed end less where the equations, frozen in the middle of the step, go from the computed
begin: their flow is a series of Faber polynomials. e = computed - exact, so that y_full - y_reduced is -e.
docs/theory.md.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
import scipy.linalg as la

from ..compiled.loops import loops
from ..mechanism.rotations import times
from ..mechanism.rows import Rows
from ..mechanism.unknowns import Unknowns
from .reduced_system import FrozenSteps, ReducedSystem, consistent_rates, cubics, saddle_inverses

ABOVE = 1.1  # times lambda h of a few steps of a block: what the series are made for
BEYOND = (1.0, 3.0)  # how far the ellipse goes beyond lambda = 0: terms are e to that at most, and cancel
POINTS = 2048  # of the ellipse
GROWS = 20.0  # Re lambda h: what grows by e to that in a step leaves nothing of terms but rounding
EPSILON = np.finfo(float).eps
MOST_TERMS = 600  # with more a matrix exponential is cheaper
FAST = 3.0  # |lambda| h above which loads between samples are asked for


class InnerLoads(Protocol):
    """What knows accelerations between samples; is_shifting: and looks there in any case."""

    is_shifting: bool

    def __call__(
        self, rows: Rows, frozen: FrozenSteps, inverses: np.ndarray, at: np.ndarray, cubic: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return coefficients (T, m, n) of loads over steps `at`, and how far their means may be off (T, n).

        inverses : of [[M, G^T], [C, 0]] at rows, whose rates obey the constraints. cubic (T, 4, n) : those that
        samples tell.
        """


class Flow:
    """Errors of the time integration, block after block.

    columns : the best loads; a second opinion of these; once loads have jumped, how far their means may be off.
    e (columns, 2 n_q) : after the last row, of coordinates and rates. fastest : largest |lambda| h met. drift :
    largest |v - v~|_M over |v|_M, rates off the constraints.
    """

    def __init__(
        self, unknowns: Unknowns, constraints: np.ndarray, count: int, inner: InnerLoads, e: np.ndarray | None
    ):
        """Begin.

        Parameters
        ----------
        constraints : numbers of the independent ones among all `count` multipliers
        inner : loads between samples, where steps are fast, or user functions may do what samples do not tell
        e : (columns, 2 n_q), what a run before has left wrong of coordinates and rates; None: nothing
        """
        self._unknowns, self._constraints, self._count, self._inner = unknowns, constraints, count, inner
        self._looks_inside = inner.is_shifting  # stays so once it is
        self.e = np.zeros((2, 2 * unknowns.n_q))
        if e is not None:
            self.e[:] = e[:1]
        self._off = self._rate = self.fastest = 0.0

    def __call__(
        self, rows: Rows, system: ReducedSystem, first: int, count: int, delay: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return errors at rows first .. first + count - 1 of these, which have neighbours around if there are any.

        delay (T, n_q) : forces that exact equations have at rows beside those of the run; None: the same.

        Returns
        -------
        e (count, 3, n_q, columns), multipliers (count, all, columns)
        """
        n, h = self._unknowns.n_q, np.diff(rows.t)
        inverses = saddle_inverses(system.M, system.G, system.C)
        v, a = consistent_rates(rows.t, rows.q, rows.v, rows.a, system.C, inverses[:, :n, n:])
        a = a + times(inverses[:, :n, :n], times(system.D, rows.v - v))  # dampers feel other rates
        if delay is not None:
            a = a + times(inverses[:, :n, :n], delay)
        steps = np.arange(max(first - 1, 0), first + count - 1)
        if len(steps):
            beyond = np.arange(steps[0], min(steps[-1] + 2, len(h)))
            around = FrozenSteps.of(system, inverses, rows.t, beyond)
            frozen = around[: len(steps)]
            values = frozen.eigenvalues(h[steps])
            pace = float(np.abs(values).max())
            self.fastest = max(self.fastest, pace)
            self._looks_inside |= pace > FAST
            loads = self._loads(rows, v, a, frozen, inverses, steps)
        found, lam = np.zeros((count, 3, n, self.columns)), np.zeros((count, self._count, self.columns))
        if first == 0:
            found[0, :2] = self.e.T.reshape(2, n, self.columns)
        if len(steps):
            ends = self._ends(rows, v, frozen, loads, steps, h, Series.of(values))
            x, w, where = ends[..., :n].swapaxes(1, 2), ends[..., n:].swapaxes(1, 2), steps + 1 - first
            found[where, 0], found[where, 1] = x, w
            both, (A, B) = np.concatenate([x, w], axis=1), around.between(len(steps))
            found[where, 2] = A @ both
            lam[where[:, None], self._constraints] = (B @ both)[:, : len(self._constraints)]
        own = slice(first, first + count)
        lam[:, self._constraints] += self._of_multipliers(
            system[own], inverses[own], rows.v[own] - v[own], rows.a[own] - a[own]
        )
        if delay is not None:
            of_delay = times(inverses[own, n : n + len(self._constraints), :n], delay[own])
            lam[:, self._constraints] -= of_delay[..., None]
        found[:, 1] += (rows.v - v)[own, :, None]
        found[:, 2] += (rows.a - a)[own, :, None]
        masses = np.einsum("tii->ti", system.M)
        off, rate = (np.sqrt((masses * x**2).sum(axis=1)).max() for x in (rows.v - v, rows.v))
        self._off, self._rate = max(self._off, off), max(self._rate, rate)
        return found, lam

    def _of_multipliers(
        self, system: ReducedSystem, inverses: np.ndarray, dv: np.ndarray, da: np.ndarray
    ) -> np.ndarray:
        """What rates and accelerations that disobey the constraints make of multipliers (T, c, 1)."""
        n, c = self._unknowns.n_q, len(self._constraints)
        forces = np.concatenate([-times(system.D, dv), times(system.C, da)], axis=1)
        return times(inverses[:, n : n + c], forces)[..., None]

    @property
    def columns(self) -> int:
        """See the class."""
        return len(self.e)

    @property
    def drift(self) -> float:
        """Largest |v - v~|_M over the largest |v|_M, by the diagonal of M; 0 where nothing moves."""
        return self._off / self._rate if self._rate else 0.0

    def _loads(
        self,
        rows: Rows,
        v: np.ndarray,
        a: np.ndarray,
        frozen: FrozenSteps,
        inverses: np.ndarray,
        at: np.ndarray,
    ) -> np.ndarray:
        """Coefficients (columns, T, m, n) over steps."""
        first, weights = cubics(rows.t, at)
        near = first[:, None] + np.arange(weights.shape[2])
        moved = np.concatenate([rows.q[near] - rows.q[at, None], v[near]], axis=2)
        phi = a[near] - moved @ frozen.A.swapaxes(1, 2)
        cubic = weights @ phi
        if self._looks_inside:
            inner, margin = self._inner(Rows(rows.t, rows.q, v, a, rows.multipliers), frozen, inverses, at, cubic)
            m = max(inner.shape[1], cubic.shape[1])
            inner, cubic = (np.pad(x, ((0, 0), (0, m - x.shape[1]), (0, 0))) for x in (inner, cubic))
            if self.columns == 2:
                if not margin.any():
                    return np.stack([inner, cubic])
                self.e = np.concatenate([self.e, self.e[:1]])
            wide = inner.copy()
            wide[:, 0] += margin
            return np.stack([inner, cubic, wide])
        linear, k = np.zeros_like(cubic), (at - first)[:, None]
        begin, end = (np.take_along_axis(phi, (k + i)[..., None], axis=1)[:, 0] for i in (0, 1))
        linear[:, 0], linear[:, 1] = begin, end - begin
        return np.stack([cubic, linear])

    def _ends(
        self,
        rows: Rows,
        v: np.ndarray,
        frozen: FrozenSteps,
        loads: np.ndarray,
        at: np.ndarray,
        h: np.ndarray,
        series: Series | None,
    ) -> np.ndarray:
        """Errors and their rates (T, columns, 2 n) after each step."""
        y = np.concatenate([np.zeros_like(v[at]), v[at] * h[at, None]], axis=1)
        z = np.concatenate([rows.q[at + 1] - rows.q[at], v[at + 1] * h[at, None]], axis=1)
        given, ends = (self.e, y, z, h[at], frozen, loads), None
        if loops is not None and series is not None:
            ends = by_series(*given, series)
        if ends is None:
            ends = by_exponentials(*given)
        self.e = ends[-1].copy()
        return ends


class Series(NamedTuple):
    """exp(x) as a sum of Faber polynomials, which are small in an ellipse of x: of terms the fewest that do.

    The ellipse is centre + gamma w + r / w, |w| = 1. Factors (terms,) of f_k: f_0 = 1, f_1 = z, f_2 = z f_1 - 2 r /
    gamma, f_k+1 = z f_k - r / gamma f_k-1 at z = (x - centre) / gamma; for r = 0 the series is Taylor's.
    """

    centre: float
    gamma: float
    r: float
    factors: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray) -> Series | None:
        """Return the series for eigenvalues lambda h, of which none is far right of zero; None: too many terms.

        So where some are damped most of all, others ring as fast, and a narrow ellipse holds not both.
        """
        all_of_them = (cls._right_of_zero(ABOVE * values, beyond) for beyond in BEYOND)
        short = [one for one in all_of_them if one is not None and len(one.factors) <= MOST_TERMS]
        return min(short, key=lambda one: len(one.factors), default=None)

    @classmethod
    def _right_of_zero(cls, values: np.ndarray, beyond: float) -> Series | None:
        left, right = values.real.min() - beyond, max(values.real.max(), 0.0) + beyond
        centre, a = (left + right) / 2, (right - left) / 2
        b = np.max(np.abs(values.imag) / np.sqrt(1 - ((values.real - centre) / a) ** 2))
        if not max(a, b) < POINTS / 4 or right > GROWS:  # more terms than the points tell
            return None
        gamma, r = (a + b) / 2, (a - b) / 2
        w = np.exp(2j * np.pi * np.arange(POINTS) / POINTS)
        factors = np.fft.fft(np.exp(centre + gamma * w + r / w)).real / POINTS
        rounding = EPSILON * np.exp(right) * (2 + abs(centre) + gamma + abs(r)) / POINTS**0.5
        last = np.flatnonzero(np.abs(factors[: POINTS // 2]) > 4 * rounding)[-1]
        return cls(centre, gamma, r, factors[: max(last + 1, 2)])


def by_series(
    e: np.ndarray, y: np.ndarray, z: np.ndarray, h: np.ndarray, frozen: FrozenSteps, loads: np.ndarray, series: Series
) -> np.ndarray | None:
    """Return ends (T, columns, 2 n) of errors: z - flow(y - e); y, z (T, 2 n) : begin and end, rates times h.

    e (columns, 2 n) : before. None: something is faster than what the series is made for. In C.
    """
    T, n, m = len(h), y.shape[1] // 2, loads.shape[2]
    e, ends = e.copy(), np.empty((T, len(e), 2 * n))
    arrays = h, frozen.A, y, z, loads, frozen.C, frozen.C1, frozen.W, series.factors
    sizes = T, n, frozen.C.shape[1], len(e), m, len(series.factors)
    ellipse = series.centre, 1 / series.gamma, -series.r / series.gamma
    done = loops.flow(sizes, ellipse, tuple(map(np.ascontiguousarray, arrays)), e, ends)
    return ends if done == T else None


def by_exponentials(
    e: np.ndarray, y: np.ndarray, z: np.ndarray, h: np.ndarray, frozen: FrozenSteps, loads: np.ndarray
) -> np.ndarray:
    """Return the same by one matrix exponential a step, where steps are stiff, or without the compiled loops."""
    T, n, m = len(h), y.shape[1] // 2, loads.shape[2]
    ends, whole = np.empty((T, len(e), 2 * n)), np.zeros((T, *2 * [2 * n + len(e) * m]))
    one, two = h[:, None, None], h[:, None]
    whole[:, :n, n : 2 * n] = np.eye(n)
    whole[:, n : 2 * n, :n], whole[:, n : 2 * n, n : 2 * n] = frozen.A[:, :, :n] * one**2, frozen.A[:, :, n:] * one
    for column in range(len(e)):
        first = 2 * n + column * m
        for k in range(m):
            whole[:, n : 2 * n, first + k] = loads[column, :, k] * two**2 * (1, 1, 2, 6)[k]
            if k:
                whole[:, first + k, first + k - 1] = 1.0
    E, firsts = la.expm(whole), 2 * n + m * np.arange(len(e))
    for i in range(T):
        x = np.concatenate([y[i, :n, None] - e[:, :n].T, y[i, n:, None] - h[i] * e[:, n:].T])
        x = E[i, : 2 * n, : 2 * n] @ x + E[i, : 2 * n][:, firsts]
        e = np.concatenate(frozen.projected(z[i, :n, None] - x[:n], (z[i, n:, None] - x[n:]) / h[i], i)).T
        ends[i] = e
    return ends
