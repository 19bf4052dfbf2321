"""TimeStepError: what the time steps of a simulation make wrong, from its samples and its linearised equations.

Computed minus exact, e of all coordinates, answers to the local errors dq, dv of the steps (local_errors.py):

    M e'' + D e' + K e + G^T l = (2/3) mean(r) ,   C e = g     at every sample,
    e and e' moved by dq + (h/2) dv and by dv on the way to the next; r: the residual in the middle of a step.

Marched with the run's own generalised-alpha; for steps that vary, too. Steps of one size share dq and dv with their
neighbours, which is as good as loads made of their differences. The same of e itself, unshared, gives the error of e.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..trajectory.estimate import PROVISIONAL, TimeStep
from .columns import Columns
from .local_errors import defects, shared
from .march import Steps

LAG = 3  # steps that x2 stays behind x, which it depends on


class TimeStepError:
    """Fed with samples in blocks: open, then for every block add, begin, columns and take (of its
    steps, in parts), found.

    size : number of coordinates, those of the simulation first; others have no samples, but take part. loads :
    whether it is asked for what loads make uncertain. rows : t (W,), q, v, a (W, n) and what else is given with them,
    of all samples that are needed still, with those added. defects : dq, dv (W - 1, n) of the steps between them.
    first : number among these of the last sample whose error is settled; residuals are needed in steps from it on.
    """

    def __init__(self, size: int, loads: bool = False):
        self.size = size
        # e, e', e'', algorithmic a (W, 4, size, columns) at the samples: of x and what loads make uncertain, of x2
        self._x, self._x2 = np.zeros((1, 4, size, 1 + loads)), np.zeros((1, 4, size, 1))
        self._force = np.zeros((1, size, 1 + loads))  # at samples

    def open(self, rows: Sequence[np.ndarray]) -> TimeStep:
        """Begin with one sample, or go on from the last one: rows t (1,), q, v, a (1, n), ..."""
        self.rows, self.first, self._recent = tuple(np.array(x) for x in rows), 0, None
        self._x, self._x2, self._values = self._x[-1:], self._x2[-1:], None
        self._opened, self._pushed = self._x[0].copy(), self._force[-1]
        return self._result(0, 0)

    def add(self, rows: Sequence[np.ndarray], values: np.ndarray | None = None) -> None:
        """Take samples t (S,), q, v, a (S, n), ... that follow, and what constraints are there (S, c), if not 0."""
        self._replaced = len(self.rows[0]) - 1 - self.first
        self.rows = tuple(np.concatenate(pair) for pair in zip(self.rows, rows, strict=True))
        if values is not None:
            known = np.zeros((len(self.rows[0]), values.shape[1]))
            known[-len(values) :] = values
            if self._values is not None:
                known[: -len(values)] = self._values
            self._values = known
        self.defects = defects(*self.rows[:4])

    def begin(self, r: np.ndarray | None = None, uncertain: np.ndarray | None = None) -> None:
        """Begin to march: residuals r (S, n) in the middle of the steps from `first` on, and their uncertainty."""
        t = self.rows[0]
        W, columns = len(t), self._x.shape[-1]
        self._shared = [shared(np.diff(t), d) for d in self.defects]
        self._force = np.zeros((W, self.size, columns))
        for column, load in enumerate((r, uncertain)[:columns]):
            if load is not None:
                self._force[self.first :, : load.shape[1], column] = at_samples(np.diff(t)[self.first :], load)
        self._x, self._x2 = (_longer(of, self.first + 1, W) for of in (self._x, self._x2))
        self._at = self._at2 = self.first
        recent, self._recent = self._recent, None
        if recent is not None:
            self.take(recent, *recent.march(self.columns(recent)))

    def columns(self, steps: Steps) -> Columns:
        """Right-hand sides of the next of the steps."""
        i = slice(self._at + 1, self._at + 1 + len(steps))  # samples
        if self._at == self.first and self._opened is not None:
            self._x[self._at] = self._opened
            self._x[self._at, 2:] += steps.pushed(self._force[self._at] - self._pushed)
        # the second column is 0 as long as loads are certain
        columns = 1 + bool(self._force[..., 1:].any() or self._x[self._at, ..., 1:].any())
        kicks = self._kicks(self._shared, self._at, len(steps), columns)
        values = None
        if self._values is not None:
            values = np.zeros((*self._values[i].shape, columns))
            values[..., 0] = self._values[i]
        return Columns(self._x[self._at, ..., :columns], self._force[i, :, :columns], values, kicks)

    def take(self, steps: Steps, found: np.ndarray) -> None:
        """Take e, e', e'' and algorithmic a (S, 4, size, columns) at the samples of these steps."""
        self._x[self._at + 1 : self._at + 1 + len(steps), ..., : found.shape[-1]] = found
        waiting = self._waiting()
        self._at += len(steps)
        self._go_second(LAG, *waiting, steps)
        recent = steps[-PROVISIONAL:].kept()
        self._recent = recent if self._recent is None else (self._recent + recent)[-PROVISIONAL:]

    def _waiting(self) -> list[Steps]:
        """The steps that x2 is behind x."""
        count = self._at - self._at2
        return [self._recent[len(self._recent) - count :]] if count else []

    def newest(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Return x, x', x'' (3, S, size), loads (S, size) and values of constraints (S, c) of the last samples."""
        i = slice(self._at + 1 - count, self._at + 1)
        values = None if self._values is None else self._values[i]
        return self._x[i, :3, :, 0].swapaxes(0, 1), self._force[i, :, 0], values

    def found(self) -> TimeStep:
        """Return the errors at the samples that were added, and better ones at some before."""
        self._go_second(0, *self._waiting())
        found = self._result(self.first + 1, self._replaced)
        last = len(self.rows[0]) - 1
        settled = max(self.first, last - PROVISIONAL)
        kept = max(settled - 2, 0)
        self.rows = tuple(x[kept:] for x in self.rows)
        self._x, self._x2, self.first = self._x[kept:], self._x2[kept:], settled - kept
        self._values = None if self._values is None else self._values[kept:]
        self._opened = None if settled else self._opened
        return found

    def _go_second(self, lag: int, *parts: Steps) -> None:
        """Let x2 follow x through steps, up to `lag` before where that is."""
        count = sum(map(len, parts)) - lag
        if count <= 0:
            return
        before = max(self._at2 - 1, 0)
        around = slice(before, self._at + 1)
        found = defects(self.rows[0][around], *self._x[around, :3, :, 0].swapaxes(0, 1))
        for of, known in zip(found, self.defects, strict=True):
            of[:, : known.shape[1]] -= known[before : self._at]
        kicks = self._kicks(found, self._at2, count, 1, before)
        for part in parts:
            steps = part[:count]
            here, kicks, at = kicks[:, : len(steps)], kicks[:, len(steps) :], self._at2
            self._at2, count = at + len(steps), count - len(steps)
            if len(steps):
                self._x2[at + 1 : self._at2 + 1] = steps.march(Columns(self._x2[at], kicks=here))[0]

    def _kicks(self, local: Sequence[np.ndarray], at: int, count: int, columns: int, first: int = 0) -> np.ndarray:
        """What local errors move e and e' by (2, S, size, columns) in so many steps from sample `at` on.

        Only in the first column. first : sample that the steps of these errors begin at.
        """
        h = np.diff(self.rows[0][at : at + count + 1])[:, None]
        dq, dv = (x[at - first : at - first + count] for x in local)
        kicks = np.zeros((2, len(dq), self.size, columns))
        kicks[0, :, : dq.shape[1], 0], kicks[1, :, : dv.shape[1], 0] = dq + h / 2 * dv, dv
        return kicks

    def _result(self, first: int, replaced: int) -> TimeStep:
        """What is known from a sample on."""
        x, x2 = (of[first:, :3].transpose(3, 1, 0, 2) for of in (self._x, self._x2))
        return TimeStep(x[0], x2[0], x[1] if len(x) > 1 else None, replaced)


def at_samples(h: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Return the loads (S + 1, n) at samples that act as a residual does, r (S, n) in the middle of steps h (S,).

    It is 0 at the samples, where the equations of motion hold: over a step its mean is 2/3 of r.
    """
    impulse = 2 / 3 * h[:, None] * r
    within = (impulse[:-1] + impulse[1:]) / (h[:-1] + h[1:])[:, None]
    return np.vstack([impulse[:1] / h[0], within, impulse[-1:] / h[-1]])


def _longer(x: np.ndarray, known: int, length: int) -> np.ndarray:
    found = np.zeros((length, *x.shape[1:]))
    found[:known] = x[:known]
    return found
