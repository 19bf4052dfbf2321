"""Remainder: what linear equations leave out of the motion they predict, from the residual of that motion.

    M r'' + D r' + K r + G^T l = -(M q'' + G^T l - f) ,   C r = -g     of the predicted motion

Nonlinear equations less these are of second order in the prediction, so r is known to that order, and it knows what
tangents that are interpolated miss, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .march import Columns
from .mechanism_feedback import held

if TYPE_CHECKING:
    from .march import Steps, Tangent

# samples: in as many one at least is looked at, each time so many later, for where tangents are read they are exact,
# and one between two tangents; between them the residual is taken for linear
EVERY, LATER = 8, 3
DENSE = 32  # first samples of a run, and after accelerations jump, where all sets in: all of them are looked at
# a change of accelerations that is so many times the largest of so many steps before it is a jump
JUMP, QUIET = 3.0, 8
PAYS = 0.02  # of the prediction: steps in which r is larger are looked at sample by sample; r is added from there on
LOST = 1.0  # of the prediction: a larger r is not added, for what it misses itself is larger still
ROUNDING = 1e-9  # of the motion: what is predicted below may be rounding
NEWTON = 1e-8  # of the motion, Exudyn's default tolerance: less of r is what Newton's iteration leaves
RAMP = 32  # steps within which r sets in
# what may be left, in sizes of r: looked at now and then it came out down to 0.17 of what it is, looked at everywhere
# within 2 %; the rest is for what is of third order, and for motion outside the span of the vectors
SAMPLED, LOOKED = 8.0, 2.0
Loads = tuple[np.ndarray, np.ndarray]
Residuals = Callable[[Sequence[np.ndarray]], Loads | None]
Sizes = Callable[[np.ndarray], np.ndarray]
Moved = Callable[[Sequence[np.ndarray], np.ndarray], Sequence[np.ndarray]]


def straight(states: Sequence[np.ndarray], e: np.ndarray) -> list[np.ndarray]:
    """States q, q_t, q_tt (S, k) that e (3, S, k) moves."""
    return [x + dx for x, dx in zip(states, e, strict=True)]


class Measured(NamedTuple):
    """What was found at the rows of a block: r and the part of it that was added to the prediction, (3, S, k).

    times : (S,), SAMPLED or LOOKED.
    """

    r: np.ndarray
    added: np.ndarray
    times: np.ndarray

    def left(self) -> list[np.ndarray]:
        """What the prediction may still lack, the sum of the sizes of these: so many times what was not added."""
        return [self.times[:, None] * (self.r - self.added), self.added][: 1 + self.added.any()]


class Remainder:
    """r along a run, through the steps of Feedback, after it.

    sizes : of x (3, S, k), (S, quantities), that r and the prediction are compared by. at_once : whether all of r is
    added where that pays first; else it sets in, from rest.

    Attributes
    ----------
    adds : whether r is added to the prediction. multipliers (S, c) : of what the last call of follow has added.
    """

    def __init__(self, size: int, quantities: int, sizes: Sizes, at_once: bool = False, moved: Moved = straight):
        self._sizes, self._at_once, self._moved = sizes, at_once, moved
        self._moving = np.zeros((4, size, 2))  # r and what is added of it: e, e', e'', algorithmic a
        self._count, self._ramp, self.adds, self._ended = 0, 0, False, False
        self.multipliers = np.zeros((0, 0))
        self._largest = np.zeros((3, quantities))  # of r, of the prediction, of the motion

    def start(self, t: float, constraints: int) -> None:
        """Begin at time t, where nothing is predicted."""
        self._known = t, np.zeros(self._moving.shape[1]), np.zeros(constraints)

    def rest(self, tangent: Tangent, rows: Sequence[np.ndarray], e: np.ndarray, residuals: Residuals) -> None:
        """Begin at the first of rows t (1,), q, q_t, q_tt (1, k), where e (3, 1, k) is known; e' is 0.

        If e is not 0, both motions are in equilibrium there, under whatever loads.
        """
        (t, q, *_), none = rows, 0 * e[0]
        if e[0].any():
            (F, g), (before, _) = (residuals((t, *self._moved((q, none, none), x))) for x in (e, 0 * e))
            self._moving[0, :, 0] = held(tangent.K, tangent, (before - F)[0] + tangent.K @ e[0, 0], -g[0])
            self._known = t[0], none[0], g[0]

    def go_on(self, before: Remainder) -> None:
        """Go on from the state of another run's."""
        self._moving, self._known, self._count = before._moving, before._known, before._count
        self._ramp, self.adds, self._largest = before._ramp, before.adds, before._largest

    @property
    def state(self) -> np.ndarray:
        """What is added to e, e', e'' now, (3, k)."""
        return self._moving[:3, :, 1]

    @property
    def at_start(self) -> Measured:
        """What is known where the run starts."""
        return Measured(*self._moving[:3].transpose(2, 0, 1)[:, :, None], np.array([LOOKED]))

    @property
    def shares(self) -> np.ndarray:
        """Largest r so far over the largest of the prediction, (quantities,)."""
        return self._shares(self._largest)

    @staticmethod
    def _shares(largest: np.ndarray) -> np.ndarray:
        r, predicted, motion = largest
        return r / np.maximum(np.maximum(predicted, ROUNDING * motion), np.finfo(float).tiny)

    def begin(self, rows: Sequence[np.ndarray], residuals: Residuals, due: np.ndarray | None = None) -> None:
        """Steps to rows t (S,), q, q_t, q_tt (S, k) follow. due (S,) : which are looked at beside those of here."""
        self._rows, self._residuals, self._found = rows, residuals, []  # None of it: they are not known any more
        self._due = np.zeros(len(rows[0]), dtype=bool) if due is None else due

    def follow(self, steps: Steps, part: slice, e: np.ndarray, own: Loads | None = None) -> np.ndarray | None:
        """Go through some of the steps, where e, e', e'' (3, S, k) are predicted; return what is added to these.

        own : loads (S, k) and values of constraints (S, c) that belong to the prediction; None: none.
        """
        rows, number = [x[part] for x in self._rows], self._count + 1 + np.arange(len(steps))
        looked = (number <= DENSE) | (number % EVERY == LATER * (number // EVERY) % EVERY)
        looked |= self._due[part]
        looked[-1] |= len(steps) >= EVERY  # else it is held from the last before
        known = self._look(rows, e, own, looked, [self._known])
        beside = [self._sizes(e), self._sizes(np.array(rows[1:]))]
        found, largest = self._marched(steps, rows[0], known, beside)
        if not looked.all() and self._pays(largest):
            known = self._look(rows, e, own, ~looked, known)
            looked[:] = True
            found, largest = self._marched(steps, rows[0], known, beside)
        if not self.adds and self._begins_to_add(largest[:, -1]):
            found, largest = self._marched(steps, rows[0], known, beside)
        self._moving, self._known, self._largest = found[-1], known[-1], largest[:, -1]
        self._count += len(steps)
        found = found[:, :3].transpose(3, 1, 0, 2)
        self._found.append(Measured(*found, np.full(len(steps), LOOKED if looked.all() else SAMPLED)))
        added = found[1] if self.adds else None
        self._ramp += self.adds * len(steps)
        return added

    def _pays(self, largest: np.ndarray) -> bool:
        """Whether r is worth to be looked at sample by sample, and to be added."""
        r, _, motion = largest
        return bool(np.any((self._shares(largest) > PAYS) & (r > NEWTON * motion)))

    def _begins_to_add(self, largest: np.ndarray) -> bool:
        """Begin to add r if that pays, and helps."""
        self.adds = not self._ended and self._pays(largest) and bool(np.all(self._shares(largest) < LOST))
        if self.adds and self._at_once:
            self._moving[..., 1], self._ramp = self._moving[..., 0], RAMP
        return self.adds

    def found(self) -> Measured | None:
        """Return what was found since `begin`; None: it did not follow."""
        return joined(self._found) if self._found else None

    def _look(
        self, rows: Sequence[np.ndarray], e: np.ndarray, own: Loads | None, where: np.ndarray, known: list[tuple]
    ) -> list[tuple]:
        """Return t, residuals and values of constraints where they are known, in the order of time, and here."""
        t, *states = (x[where] for x in rows)
        if not len(t) or self._ended:
            return known
        residuals = self._residuals((t, *self._moved(states, e[:, where])))
        if residuals is None:
            self._ended = True
            return known
        if own is not None:
            residuals = [x - of[where] for x, of in zip(residuals, own, strict=True)]
        first, *more = known
        return [first, *sorted([*more, *zip(t, *residuals, strict=True)], key=lambda one: one[0])]

    def _marched(
        self, steps: Steps, t: np.ndarray, known: list[tuple], beside: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return e, e', e'', a (S, 4, k, 2) of r and what is added, and the largest so far (3, S, quantities).

        beside : sizes (S, quantities) of the prediction and of the motion.
        """
        times, *values = (np.array(x) for x in zip(*known, strict=True))
        F, g = (_linear(t, times, x)[..., None] for x in values)
        share = self.adds * np.minimum((self._ramp + 1 + np.arange(len(steps))) / RAMP, 1.0)
        both = np.column_stack([np.ones(len(steps)), share**2 * (3 - 2 * share)])[:, None]
        [(found, forces)] = steps.march(Columns(self._moving, -F * both, -g * both), multipliers=True)
        self.multipliers = forces[..., 1]
        r = found[:, :3, :, 0].swapaxes(0, 1)
        sizes = np.array([self._sizes(r), *beside])
        return found, np.maximum(np.maximum.accumulate(sizes, axis=1), self._largest[:, None])


class Jumps:
    """Where accelerations jump along a run, as under loads that begin suddenly. sizes : as of Remainder."""

    def __init__(self, size: int, sizes: Sizes):
        self._sizes, self._quiet = sizes, DENSE  # samples since the last jump
        self._last = np.zeros((0, size))

    def go_on(self, before: Jumps) -> None:
        """Go on from another run's."""
        self._last, self._quiet = before._last, before._quiet

    def follow(self, q_tt: np.ndarray) -> np.ndarray:
        """Return whether the next samples, of accelerations (S, k), are among DENSE from a jump on, (S,)."""
        accelerations = np.vstack([self._last, q_tt])
        self._last = accelerations[-QUIET - 2 :]
        if len(accelerations) < QUIET + 2:
            return np.ones(len(q_tt), dtype=bool)
        change = np.diff(accelerations, axis=0)
        changes = self._sizes(np.broadcast_to(change, (3, *change.shape)))
        before = sliding_window_view(changes[:-1], QUIET, axis=0).max(axis=-1)
        jumps = np.any(changes[QUIET:] > JUMP * before, axis=1)[-len(q_tt) :]
        jumps = np.append(np.zeros(len(q_tt) - len(jumps), dtype=bool), jumps)
        since = np.arange(len(q_tt)) - np.maximum.accumulate(np.where(jumps, np.arange(len(q_tt)), -self._quiet))
        self._quiet = int(since[-1]) + 1
        return since < DENSE


def joined(parts: Sequence[Measured]) -> Measured:
    """Return what was found in several blocks as one."""
    r, added, times = zip(*parts, strict=True)
    return Measured(np.concatenate(r, axis=1), np.concatenate(added, axis=1), np.concatenate(times))


def middles(t: np.ndarray, read: np.ndarray) -> np.ndarray:
    """Return whether samples (S,) are nearest to the middle between two times of tangents, not at one of these."""
    if len(read) < 2:
        return np.zeros(len(t), dtype=bool)
    nearest = np.abs(t[:, None] - (read[:-1] + read[1:]) / 2).argmin(axis=0)
    return np.isin(np.arange(len(t)), nearest) & ~np.isin(t, read)


def _linear(t: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (S, ...) at t (S,), linear between times (T,), held after the last."""
    after = np.minimum(np.searchsorted(times, t), len(times) - 1)
    before = np.maximum(after - 1, 0)
    dt = np.where(after > before, times[after] - times[before], np.inf)
    share = np.clip((t - times[before]) / dt, 0.0, 1.0)
    return values[before] + share[:, None] * (values[after] - values[before])
