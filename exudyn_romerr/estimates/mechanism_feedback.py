"""Feedback between auxiliary modes and a mechanism: its linearised equations over time (theory.md 7).

    M e'' + D e' + K e + G^T l = f(t) ,   C e = 0 ,

e the error of all coordinates of the mechanism and the coordinates of auxiliary modes. Matrices are cubic in time
between tangents that know their rates, linear between others; where C has a kink, constraints strike the mechanism.
The time integration is that of the simulation, so that e is what auxiliary modes would have added to it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import AssumptionError

INVERSE_ERROR = (
    1e-3  # of a solution: what interpolated inverses may miss at first; they are used twice, so its square is left
)
SAME_STEP = 1e-9  # of a step size: solvers add up their steps
GROWN = 1e60  # its square, times masses, is still a number
TOO_SENSITIVE = (
    "the error of the linearised mechanism has grown beyond all numbers: its motion is too sensitive to be "
    "linearised for so long. Ask for estimators='energy', for scope='inputs frozen', or solve for a shorter time"
)
# steps between two tangents: fewer are solved one by one, more with inverses interpolated in time
INTERPOLATED_FROM = 4


@dataclass(frozen=True)
class Scheme:
    """Generalised-alpha: the parameters of the running solver."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float


@dataclass(frozen=True)
class Tangent:
    """The linearised equations at time t: M, D, K (k, k), G and C (c, k) of independent constraints; their rates.

    Forces of constraints are G^T l, what they keep zero is C e. C is G but for what the simulation takes it for.
    """

    t: float
    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    G: np.ndarray
    C: np.ndarray
    rate: Tangent | None = None

    def stacked(self, mass: float, damping: float, scale: float) -> np.ndarray:
        """[[mass M + damping D + K, scale G^T], [scale C, 0]]."""
        c, k = self.G.shape
        A = np.zeros((k + c, k + c))
        A[:k, :k] = mass * self.M + damping * self.D + self.K
        A[k:, :k] = scale * self.C
        A[:k, k:] = scale * self.G.T
        return A


class Feedback:
    """e, e' and e'' along a run that starts without error."""

    def __init__(self, scheme: Scheme):
        self.scheme = scheme
        self._interval: _Interval | None = None

    def start(
        self, tangent: Tangent, force: np.ndarray, rest: np.ndarray | None = None, t: float | None = None
    ) -> None:
        """Begin under the force (k,), without error or in equilibrium with `rest`, at t if not the tangent's time."""
        k = len(force)
        e = np.zeros(k) if rest is None else _held(tangent.K, tangent, rest)
        e_tt = _held(tangent.M, tangent, force - tangent.K @ e)
        self.t = tangent.t if t is None else t
        self._moving = np.array([e, np.zeros(k), e_tt, e_tt])

    @property
    def state(self) -> np.ndarray:
        """e, e', e'' (3, k) now."""
        return self._moving[:3]

    def advance(
        self, t: np.ndarray, force: np.ndarray, times: np.ndarray, tangent: Callable[[int], Tangent]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Go on to times t (S,) under forces (S, k); return e, e', e'' (3, S, k) and the mass norm (S,) of e'.

        times : (T,) of tangents, the first not after the last time before t; the last one is held. tangent : i -> it.
        """
        found, speed = np.zeros((3, *force.shape)), np.zeros(len(t))
        after = np.minimum(np.searchsorted(times, t, side="left"), len(times) - 1)
        for j in np.unique(after).tolist():
            first, last = tangent(max(j - 1, 0)), tangent(j)
            steps = np.flatnonzero(after == j)
            for i in steps.tolist():
                found[:, i] = self._step(float(t[i]), force[i], first, last, steps[-1] + 1 - i)
            speed[steps] = _speed(found[1, steps], t[steps], first, last)
        if not np.isfinite(found).all():
            raise AssumptionError(SINGULAR)
        if np.max(np.abs(found), initial=0.0) > GROWN:
            raise AssumptionError(TOO_SENSITIVE)
        return found, speed

    def _step(self, now: float, force: np.ndarray, first: Tangent, last: Tangent, left: int) -> np.ndarray:
        """One step of generalised-alpha, constraints at the level of positions; `left`: steps in the interval."""
        h = now - self.t
        if self._interval is None or not self._interval.holds(first, last, h):
            self._interval = _Interval(first, last, h, self.scheme, left)
        self.t, self._moving = now, self._interval.step(now, force, self._moving)
        return self._moving[:3]


class _Interval:
    """Steps of one size between two tangents: A z = f - W (e, e') ahead, A and W cubic in time."""

    def __init__(self, first: Tangent, last: Tangent, h: float, s: Scheme, steps: int):
        self._ends, self._h = (first, last), h
        mass, damping = (1 - s.alpha_m) / (s.beta * h**2 * (1 - s.alpha_f)), s.gamma / (h * s.beta)
        known = np.array([0.0, 0.0, s.alpha_f, -s.alpha_m]) / (1 - s.alpha_m)
        ahead = np.array([1.0, h, 0.0, h**2 * (0.5 - s.beta)]) + h**2 * s.beta * known
        ahead_t = np.array([0.0, 1.0, 0.0, h * (1 - s.gamma)]) + h * s.gamma * known
        self._ahead = np.array([ahead, ahead_t, known])
        # e, e', e'' and the algorithmic a of what is ahead, known, and z
        grown = (1 - s.alpha_f) / (1 - s.alpha_m) * mass
        self._next = np.array([[1, 0, 0, 1], [0, 1, 0, damping], [0, 0, 0, mass], [0, 0, 1, grown]], dtype=float)
        scale = mass * np.abs(np.diag(first.M)).max()  # of constraints: all rows of one size
        self._A = _cubic(*self._ends, lambda tangent: tangent.stacked(mass, damping, scale))
        self._W = _cubic(*self._ends, lambda tangent: _wide(tangent, scale))
        self._inverses = None if steps < INTERPOLATED_FROM else self._inverted()

    def _inverted(self) -> np.ndarray | None:
        """A^-1 as a polynomial of second degree in time, from three instants; None if that is not exact enough."""
        try:
            start, half, end = (np.linalg.inv(_matrix(self._A, _powers(share))) for share in (0.0, 0.5, 1.0))
        except np.linalg.LinAlgError as error:
            raise AssumptionError(SINGULAR) from error
        inverses = np.vstack([start, 4 * half - 3 * start - end, 2 * (start + end) - 4 * half])
        x, powers = np.ones(len(start)), _powers(0.25)
        off = _matrix(inverses, powers[:3]) @ (_matrix(self._A, powers) @ x) - x
        return inverses if np.abs(off).max() <= INVERSE_ERROR else None

    def holds(self, first: Tangent, last: Tangent, h: float) -> bool:
        """Whether this is the interval of a step."""
        return self._ends[0] is first and self._ends[1] is last and abs(h - self._h) <= SAME_STEP * self._h

    def step(self, now: float, force: np.ndarray, moving: np.ndarray) -> np.ndarray:
        """Return e, e', e'' and the algorithmic a (4, k) after a step."""
        parts = np.empty_like(moving)
        parts[:3] = self._ahead @ moving
        parts[3] = self._solve(now, force, parts[:2].ravel())
        return self._next @ parts

    def _solve(self, now: float, force: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        """Return the increment z (k,)."""
        first, last = self._ends
        share = float(_share(now, first, last))
        powers = _powers(share)
        right = -(powers @ (self._W @ ahead).reshape(4, -1))
        right[: len(force)] += force
        if self._inverses is not None:
            x = powers[:3] @ (self._inverses @ right).reshape(3, -1)
            left = powers @ (self._A @ x).reshape(4, -1)
            x += powers[:3] @ (self._inverses @ (right - left)).reshape(3, -1)
            return x[: len(force)]
        try:
            return np.linalg.solve(_matrix(self._A, powers), right)[: len(force)]
        except np.linalg.LinAlgError as error:
            raise AssumptionError(SINGULAR) from error


def _cubic(first: Tangent, last: Tangent, of: Callable[[Tangent], np.ndarray]) -> np.ndarray:
    """Coefficients of what is made `of` tangents between two, one upon the other, by the share of the time gone."""
    A, B = of(first), of(last)
    change, dt = B - A, last.t - first.t
    start, end = (change if one.rate is None else dt * of(one.rate) for one in (first, last))
    bend = start + end - 2 * change
    return np.vstack([A, start, change - start - bend, bend])


def _powers(share: float) -> np.ndarray:
    """What the coefficients of a cubic polynomial are summed with; those of a quadratic one with the first three."""
    return np.array([1.0, share, share * share, share * share * share])


def _matrix(stacked: np.ndarray, powers: np.ndarray) -> np.ndarray:
    """Value of a polynomial whose coefficients are stacked."""
    return np.tensordot(powers, stacked.reshape(len(powers), -1, stacked.shape[1]), axes=1)


SINGULAR = (
    "the linearised equations of the mechanism are singular (constraints that contradict each other, or coordinates "
    "without mass); no auxiliary modes with feedback: pass scope='inputs frozen'"
)


def _share(t: Any, first: Tangent, last: Tangent) -> Any:
    """Where times are between two tangents, 0..1; the last one is held."""
    return 0.0 * t if first is last else np.clip((t - first.t) / (last.t - first.t), 0.0, 1.0)


def _speed(e_t: np.ndarray, t: np.ndarray, first: Tangent, last: Tangent) -> np.ndarray:
    """Mass norm (S,) of velocities (S, k) at times between two tangents."""
    squares = [np.einsum("si,ij,sj->s", e_t, tangent.M, e_t) for tangent in (first, last)]
    share = _share(t, first, last)
    return np.sqrt(np.maximum((1 - share) * squares[0] + share * squares[1], 0.0))


def _held(A: np.ndarray, tangent: Tangent, force: np.ndarray) -> np.ndarray:
    """Solve A x + G^T l = force, C x = 0 for x (k,)."""
    c, k = tangent.G.shape
    scale = np.abs(np.diag(A)).max()
    whole = np.block([[A, scale * tangent.G.T], [scale * tangent.C, np.zeros((c, c))]])
    try:
        return np.linalg.solve(whole, np.append(force, np.zeros(c)))[:k]
    except np.linalg.LinAlgError as error:
        raise AssumptionError(SINGULAR) from error


def _wide(tangent: Tangent, scale: float) -> np.ndarray:
    """[[K, D], [scale C, 0]]."""
    c, k = tangent.G.shape
    wide = np.zeros((k + c, 2 * k))
    wide[:k, :k], wide[:k, k:], wide[k:, :k] = tangent.K, tangent.D, scale * tangent.C
    return wide
