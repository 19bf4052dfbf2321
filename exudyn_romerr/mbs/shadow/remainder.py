"""Remainder: what linear equations leave out of the motion they predict, from the residual of that motion.

    M r'' + D r' + K r + G^T l = -(M q'' + G^T l - f) ,   C r = -g     of the predicted motion

Nonlinear equations less these are of second order in the prediction, so r is known to that order, and it knows what
tangents that are interpolated miss, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...estimates.march import Columns
from ...estimates.mechanism_feedback import held
from ...online.kept_estimate import LOST
from .looks import DENSE, Loads, Looks, Residuals, Sizes
from .measured import LOOKED, SAMPLED, Measured, joined

if TYPE_CHECKING:
    from ...estimates.march import Steps, Tangent

# samples: two looks are no farther apart, so many times as far where r is smaller than so much of the prediction; one
# is between two tangents, for where these are read they are exact; between looks the residual is taken for linear
# (128 and 256 samples, for smaller r: forces of joints came out 1.9 half widths off)
EVERY, FARTHER, CALM = 32, 2, 1e-3
# the same where all sets in, after a start or a jump: there samples in the middle are to confirm lines; of what rings
# from step to step every fourth and eighth show nothing (1.6 times the bound with 8)
CLOSE = 2
TELL = 8  # likewise where all of r is added at once and no bound depends on it, if lines between them are confirmed
SLIGHT = 1e-6  # of the prediction: what less moves within a step comes to 0.2 % of it at most in DENSE of them
GROWS = 1.5  # times what it was: where the prediction has grown to, it is looked at, for r is of second order
# of the prediction: steps in which r is larger are looked at as close as that needs, and r is added from there on
PAYS = 0.02
ROUNDING = 1e-9  # of the motion: what is predicted below may be rounding
NEWTON = 1e-8  # of the motion, Exudyn's default tolerance: less of r is what Newton's iteration leaves
RAMP = 32  # steps within which r sets in


class Remainder:
    """r along a run, through the steps of Feedback, after it.

    sizes : of x (3, S, k), (S, quantities), that r and the prediction are compared by. at_once : whether all of r is
    added where that pays first, and fewer looks will do, for no bound depends on it; else it sets in, from rest.

    Attributes
    ----------
    adds : whether r is added to the prediction. added : to e, e', e'' (3, S, k) of the last steps, or None.
    multipliers (S, c) : that go with it. beside : sizes of the prediction and of the motion there (S, quantities).
    """

    def __init__(self, size: int, quantities: int, sizes: Sizes, at_once: bool = False):
        self._sizes, self._at_once = sizes, at_once
        self._moving = np.zeros((4, size, 2))  # r and what is added of it: e, e', e'', algorithmic a
        self._count, self._since, self._ramp = 0, 0, 0
        self.adds = self._paid = self._ended = False
        self.added, self.multipliers = None, np.zeros((0, 0))
        self._largest = np.zeros((3, quantities))  # of r, of the prediction, of the motion
        self._loads = np.zeros(quantities)  # largest of what drives r

    def start(self, t: float, constraints: int) -> None:
        """Begin at time t, where nothing is predicted."""
        self._known = self._driven = t, np.zeros(self._moving.shape[1]), np.zeros(constraints)

    def rest(self, tangent: Tangent, rows: Sequence[np.ndarray], e: np.ndarray, residuals: Residuals) -> None:
        """Begin at the first of rows t (1,), q, q_t, q_tt (1, k), where e (3, 1, k) is known; e' is 0.

        If e is not 0, both motions are in equilibrium there, under whatever loads.
        """
        (t, q, *_), none = rows, 0 * e[0]
        if e[0].any():
            (F, g), (before, _) = (residuals((t, q, none, none), np.array([x, none, none])) for x in (e[0], none))
            self._moving[0, :, 0] = held(tangent.K, tangent, (before - F)[0] + tangent.K @ e[0, 0], -g[0])
            self._known = self._driven = t[0], none[0], g[0]

    def go_on(self, before: Remainder) -> None:
        """Go on from the state of another run's."""
        self._moving, self._known, self._driven = before._moving, before._known, before._driven
        self._count, self._since = 0, before._since  # a new start is looked at closely
        self._ramp, self.adds, self._paid = before._ramp, before.adds, before._paid
        self._largest, self._loads = before._largest, before._loads

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

    def begin(
        self,
        rows: Sequence[np.ndarray],
        residuals: Residuals,
        due: np.ndarray | None = None,
        restless: np.ndarray | None = None,
    ) -> None:
        """Steps to rows t (S,), q, q_t, q_tt (S, k) follow.

        due (S,) : which are looked at beside those of here. restless (S,) : which are as the first ones of a run.
        """
        none = np.zeros(len(rows[0]), dtype=bool)
        self._rows, self._residuals, self._found = rows, residuals, []  # None of it: they are not known any more
        self._due, self._restless = (none if which is None else which for which in (due, restless))
        self._motion = self._sizes(np.array(rows[1:]))

    def go_to(self, steps: Steps, part: slice, e: np.ndarray, own: Loads | None = None) -> tuple[Looks, np.ndarray]:
        """Go on to some of the steps, where e, e', e'' (3, S, k) are predicted; return where these are looked at.

        own : loads (S, k) and values of constraints (S, c) that belong to the prediction; None: none.
        """
        self.beside = [self._sizes(e), self._motion[part]]
        rows, sizes = [x[part] for x in self._rows], self._sizes_of_loads(steps)
        self._looks = Looks(rows, e, own, self._known, self._residuals, sizes, self._loads)
        self._looks.ended, self._is_close = self._ended, False
        self._early = (self._count + np.arange(len(e[0])) < DENSE) | self._restless[part]
        self._wanted = self._now_and_then(part)
        return self._looks, self._wanted

    def columns(self) -> Columns:
        """Look at these steps; return what drives r there."""
        self._looks.at(self._wanted)
        if self._early.any():
            self._looks.confirm(self._early, SLIGHT * np.maximum(self._largest[1], self.beside[0].max(axis=0)))
        if self._paid:
            self._look_closely()
        return self._columns()

    def take(self, found: np.ndarray, multipliers: np.ndarray) -> Columns | None:
        """Take e, e', e'', a (S, 4, k, 2) of these and multipliers (S, c, 2), or return what to march instead."""
        sizes = np.array([self._sizes(found[:, :3, :, 0].swapaxes(0, 1)), *self.beside])
        largest = np.maximum(np.maximum.accumulate(sizes, axis=1), self._largest[:, None])
        self._paid = self._matters(largest, PAYS)
        if self._paid and not (self._is_close or self._looks.ended):
            self._look_closely()
            return self._columns()
        if not self.adds and self._begins_to_add(largest[:, -1]):
            return self._columns()
        self._moving, self._known, self._largest = found[-1], self._looks.last, largest[:, -1]
        self._driven = self._looks.end, *(x[-1] for x in self._loads_here())
        self._loads, self._ended = self._looks.largest, self._looks.ended
        self._count, known = self._count + len(found), np.flatnonzero(self._looks.known)
        self._since = len(found) - 1 - known[-1] if known.size else self._since + len(found)
        self._ramp += self.adds * len(found)
        found = found[:, :3].transpose(3, 1, 0, 2)
        self._found.append(Measured(*found, np.full(found.shape[2], LOOKED if self._looks.known.all() else SAMPLED)))
        self.added, self.multipliers = found[1] if self.adds else None, multipliers[..., 1]
        return None

    def _columns(self) -> Columns:
        """R and what is added of it, by what is known."""
        share = _set_in(self._ramp, len(self._looks.known))
        both = np.column_stack([np.ones_like(share), self.adds * share])[:, None]
        return Columns(self._moving, *(-x[..., None] * both for x in self._loads_here()))

    def _loads_here(self) -> list[np.ndarray]:
        """Residuals (S, k) and values (S, c) that drive r.

        Where all of r is added at once, they go on from those before: these were held after the last look, which new
        ones show wrong then, and a jump of what constraints keep zero strikes the mechanism.
        """
        loads = self._looks.all
        if not self._at_once:
            return loads
        t, *driven = self._driven
        left = 1.0 - _set_in(0, len(self._looks.known))[:, None]
        return [x + left * (y - z) for x, y, z in zip(loads, driven, self._looks.known_at(t), strict=True)]

    def _now_and_then(self, part: slice) -> np.ndarray:
        """Where some of the steps are looked at first, (S,)."""
        count = len(self._early)
        looked = self._due[part] | (self._early & (np.arange(count) % CLOSE == 0))
        if not self._at_once:
            looked |= self._grown(*self.beside)
        looked[-1] |= self._early[-1]
        is_calm = self._count and not self.matters(CALM)
        every, last = EVERY * (FARTHER if is_calm else 1), -1 - self._since
        for place in (*np.flatnonzero(looked), count):
            looked[max(last + every, 0) : place : every] = True
            last = place
        return looked

    def _look_closely(self) -> None:
        """Look at all of the steps; or at those that tell the rest, but for what Newton leaves in single ones."""
        self._is_close, whole = True, np.ones(len(self._looks.known), dtype=bool)
        if not self._at_once:
            self._looks.at(whole)
            return
        self._looks.at(np.arange(len(whole))[::-1] % TELL == 0)  # the last, too
        self._looks.confirm(whole)

    def _grown(self, predicted: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """Where the prediction (S, quantities) has grown beyond a power of GROWS for the first time, (S,)."""
        largest = np.maximum.accumulate(np.vstack([self._largest[1], predicted]))
        least = np.maximum(ROUNDING * np.maximum(self._largest[2], motion.max(axis=0)), np.finfo(float).tiny)
        return np.any(np.diff(np.floor(np.log(np.maximum(largest, least)) / np.log(GROWS)), axis=0), axis=1)

    def _sizes_of_loads(self, steps: Steps) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
        """Of loads (S, k) and values of constraints (S, c): sizes of what they move within a step."""
        k, inverse = self._moving.shape[1], steps.inverses[len(steps) // 2]
        return lambda F, g: self._sizes((np.hstack([F, g]) @ inverse[:k].T)[None])

    def matters(self, share: float, of: slice = slice(None)) -> bool:
        """Whether r so far is larger than a share of the prediction, and not what Newton's iteration leaves."""
        return self._matters(self._largest[:, of], share)

    def _matters(self, largest: np.ndarray, share: float) -> bool:
        r, _, motion = largest
        return bool(np.any((self._shares(largest) > share) & (r > NEWTON * motion)))

    def _begins_to_add(self, largest: np.ndarray) -> bool:
        """Begin to add r if that pays, and helps."""
        self.adds = not self._ended and self._matters(largest, PAYS) and bool(np.all(self._shares(largest) < LOST))
        if self.adds and self._at_once:
            self._moving[..., 1], self._ramp = self._moving[..., 0], RAMP
        return self.adds

    def found(self) -> Measured | None:
        """Return what was found since `begin`; None: it did not follow."""
        found = joined(self._found) if self._found else None
        self._rows = self._residuals = self._looks = self._found = None  # memory for the next block, and no cycles
        return found


def _set_in(first: int, count: int) -> np.ndarray:
    """Shares (count,) of what sets in within RAMP steps, after so many of them."""
    share = np.minimum((first + 1 + np.arange(count)) / RAMP, 1.0)
    return share**2 * (3 - 2 * share)


def march_together(steps: Steps, work: dict[Remainder, Columns]) -> None:
    """March columns through the steps, and what is to be marched instead."""
    while work:
        found = zip(work, steps.march(*work.values(), multipliers=True), strict=True)
        again = {one: one.take(*of) for one, of in found}
        work = {one: columns for one, columns in again.items() if columns is not None}
