"""ResidualPasses: what linear equations leave of a mechanism's residual goes through them once more.

Modes leave no residual in their span. The motion that the linearised mechanism corrects does, for that misses terms
of second order: less this residual, as a force, drives a correction of the correction. Bounds hold for every
correction, if the residual is that of what it leads to (theory.md 8).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from .columns import Columns
from .mechanism_feedback import held

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from .march import Steps, Tangent

PASSES = 2
# rows, or as many as before, or all of a block: whether passes pay is asked of so many at once; of more far from it
TOGETHER, SELDOM = 256, 1024
KNOWN = 5  # samples that a spline begins with
SMALLER = 0.3  # than what they correct: passes that are not do not converge, and are given up


class Residuals(Protocol):
    """Residuals of a mechanism along its run, of which some rows are known at a time.

    is_far : whether passes were far from paying when that was asked last.
    """

    rows: Sequence[np.ndarray]
    is_far: bool

    def left(self, part: slice, e: np.ndarray) -> np.ndarray:
        """Return less the residual (S, k) of modes and vectors in rows of the run that e (3, S, k) corrects."""

    def second_order(self, part: slice, e: np.ndarray) -> np.ndarray:
        """Return forces (S, k) on frames that no residual of a body shows, as far as linear equations miss them."""

    def largest(self, e: np.ndarray) -> float:
        """Return the largest energy norm of e (3, S, k)."""

    def pay(self, part: slice, e: np.ndarray) -> bool:
        """Return whether bounds would be sharper without these."""


class ResidualPasses:
    """PASSES along a run from where they pay, each through the steps of Feedback.

    Attributes
    ----------
    are_made : whether they have begun. added : (3, S, k) what they add to e, e', e'' in the last rows.
    beside : (S, k) forces of second order that are left; nan where there was no pass. multipliers : (S, c) of what
    the last call of follow has added.
    """

    def __init__(self, residuals: Residuals, size: int):
        self.residuals, self.are_made = residuals, False
        self._moving, self._converge, self._largest = np.zeros((PASSES, 4, size, 1)), True, 0.0
        self._asked, self._waiting = 0, []  # number of rows that was asked of, e in those that was not
        self.multipliers: np.ndarray | float = 0.0

    def start(self, tangent: Tangent, rows: Sequence[np.ndarray], e: np.ndarray, at_rest: bool) -> None:
        """Begin at the first of rows of the run, where e, e', e'' are e (3, k); at_rest : in an equilibrium."""
        self.residuals.rows = rows
        self.are_made, here, e = self.residuals.pay(slice(1), e[:, None]), slice(1), e.copy()
        for moving in self._moving if self.are_made else ():
            force = self.residuals.left(here, e[:, None])[0]
            if at_rest:
                moving[0, :, 0] = held(tangent.K, tangent, force)
            else:
                moving[2:, :, 0] = held(tangent.M, tangent, force)
            e += moving[:3, :, 0]
        self.added = self.state[:, None]

    def go_on(self, before: ResidualPasses) -> None:
        """Go on from the state of those of another run."""
        self.are_made, self._moving, self._asked = before.are_made, before._moving, before._asked
        self._converge, self._largest = before._converge, before._largest
        self.added = self.state[:, None]

    @property
    def state(self) -> np.ndarray:
        """What is added to e, e', e'' now, (3, k)."""
        return self._moving[:, :3, :, 0].sum(axis=0)

    def begin(self, rows: Sequence[np.ndarray]) -> None:
        """Steps to rows t (S,), q, q_t, q_tt (S, coordinates of the mechanism) of the run follow."""
        self.residuals.rows = rows
        self.added = np.zeros((3, len(rows[0]), self._moving.shape[2]))
        self.beside = np.full(self.added.shape[1:], np.nan)

    def follow(self, steps: Steps, part: slice, e: np.ndarray) -> np.ndarray | None:
        """Return what is added to e, e', e'' (3, S, k) in some steps; None: nothing is."""
        self.are_made = self.are_made or self._pay(part, e)
        self.multipliers = 0.0
        if not self.are_made:
            return None
        before = self._moving.copy()
        added, self.beside[part] = self._driven(steps, part, e) if self._converge else self._free(steps)
        self._largest = max(self._largest, self.residuals.largest(e))
        if self._converge and not self.residuals.largest(added) <= SMALLER * self._largest:  # or nan
            self._converge, self._moving = False, before
            added, self.beside[part] = self._free(steps)
        self.added[:, part] = added
        return added

    def _pay(self, part: slice, e: np.ndarray) -> bool:
        """Whether they do, when enough rows are known."""
        self._waiting.append(e.copy())
        count = sum(one.shape[1] for one in self._waiting)
        enough = min(self._asked, SELDOM if self.residuals.is_far else TOGETHER)
        if count < enough and part.stop < len(self.residuals.rows[0]):
            return False
        e, self._waiting, self._asked = np.concatenate(self._waiting, axis=1), [], self._asked + count
        return self.residuals.pay(slice(part.stop - count, part.stop), e)

    def _driven(self, steps: Steps, part: slice, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is added, and the forces of second order that are left."""
        corrected, applied = e, 0.0
        for i, moving in enumerate(self._moving):
            beside = self.residuals.second_order(part, corrected)
            force = self.residuals.left(part, corrected) - (beside - applied)
            [(found, multipliers)] = steps.march(Columns(moving, force[..., None]), multipliers=True)
            self._moving[i], applied = found[-1], beside
            self.multipliers = self.multipliers + multipliers[..., 0]
            corrected = corrected + found[:, :3, :, 0].swapaxes(0, 1)
        return corrected - e, self.residuals.second_order(part, corrected) - applied

    def _free(self, steps: Steps) -> tuple[np.ndarray, float]:
        """The same where nothing drives: what was added goes on without a force."""
        moving = np.concatenate([*self._moving], axis=2)
        [(found, multipliers)] = steps.march(Columns(moving), multipliers=True)
        self._moving = np.array(np.split(found[-1], PASSES, axis=2))
        self.multipliers = multipliers.sum(axis=2)
        return found[:, :3].sum(axis=3).swapaxes(0, 1), np.nan


class JointDrift:
    """What joints of full bodies drift by beside those of the simulation, where solvers keep C e' + C' e zero.

    With C e = 0, as the others march, e' = (C e)' - C' e is missed by p = C e' + C' e at the samples. The trapezoidal
    rule that makes p zero lets C e drift:

        C e = g ,   g_{n+1} = g_n - h/2 (p_n + p_{n+1})          but for h |C'| of g

    simulated : count -> what the simulation's own joints have drifted by at the last samples (count, c), or None.

    Attributes
    ----------
    added : (3, S, k) what they add to e, e', e'' in the last rows. own : likewise, what the simulation's own drift
    does. values : g (S, c) in the steps of the last call of follow. multipliers : (S, c) of what that has added.
    """

    def __init__(self, size: int, simulated: Callable[[int], np.ndarray | None]):
        self._simulated = simulated
        self._moving, self._moving_own = np.zeros((PASSES, 4, size, 1)), np.zeros((4, size, 1))
        self.added, self.own = self.state[:, None], self._moving_own[:3, :, 0][:, None]

    @property
    def state(self) -> np.ndarray:
        """What is added to e, e', e'' now, (3, k)."""
        return self._moving[:, :3, :, 0].sum(axis=0)

    def start(self, tangent: Tangent) -> None:
        """Begin without, at a tangent."""
        self._p, self._g = np.zeros((2, PASSES, 1, len(tangent.C)))  # at the last sample
        self._C, self._h = tangent.C[None], np.zeros(1)  # of the last samples, and steps to these

    def go_on(self, before: JointDrift) -> None:
        """Go on from the state of another run's."""
        self._moving, self._p, self._g, self._C, self._h = before._moving, before._p, before._g, before._C, before._h
        self._moving_own = before._moving_own
        self.added, self.own = self.state[:, None], self._moving_own[:3, :, 0][:, None]

    def begin(self, count: int) -> None:
        """So many steps follow."""
        self.added, self.own = np.zeros((2, 3, count, self._moving.shape[2]))

    def follow(self, steps: Steps, part: slice, e: np.ndarray) -> np.ndarray:
        """Return what is added to e, e', e'' (3, S, k) in some steps."""
        k, corrected = e.shape[2], e
        C = np.asarray(steps.moved)[:, k:, :k]
        C_t = self._rates(C, steps.h)
        self.values, self.multipliers = 0.0, 0.0
        for i, moving in enumerate(self._moving):
            p = np.vstack([self._p[i], _seen(C, corrected[1]) + _seen(C_t, corrected[0])])
            g = self._g[i] - np.cumsum(steps.h[:, None] / 2 * (p[:-1] + p[1:]), axis=0)
            [(found, multipliers)] = steps.march(Columns(moving, values=g[..., None]), multipliers=True)
            self._moving[i], self._p[i], self._g[i] = found[-1], p[-1:], g[-1:]
            self.values, self.multipliers = self.values + g, self.multipliers + multipliers[..., 0]
            corrected = corrected + found[:, :3, :, 0].swapaxes(0, 1)
        self.added[:, part] = corrected - e
        simulated = self._simulated(len(steps))
        [found] = steps.march(Columns(self._moving_own, values=None if simulated is None else simulated[..., None]))
        self._moving_own, self.own[:, part] = found[-1], found[:, :3, :, 0].swapaxes(0, 1)
        return self.added[:, part]

    def _rates(self, C: np.ndarray, h: np.ndarray) -> np.ndarray:
        """C' (S, c, k), of a spline: parabolas miss as much as joints drift by."""
        from scipy.interpolate import CubicSpline  # here, for it takes long to import: see CoupledSubject

        known, steps = np.concatenate([self._C, C]), np.append(self._h, h)
        self._C, self._h = known[-KNOWN:].copy(), steps[-KNOWN:]
        times = np.cumsum(steps)
        return CubicSpline(times, known)(times[-len(h) :], 1)


def _seen(C: np.ndarray, e: np.ndarray) -> np.ndarray:
    """C e (S, c)."""
    return np.einsum("sck,sk->sc", C, e)
