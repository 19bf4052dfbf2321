"""StoredResiduals: what Exudyn's equations leave in states that are set, at and between samples of a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...errors import RunError
from ...estimates.local_errors import NODES, STANDS_OUT, filled, seldom, standing_out, told, weights_of, within
from ...online.run_messages import CHANGED
from ..access.load_functions import load_functions, loads_with_functions, user_functions
from ..access.state_guard import state_kept
from ..derivatives.linearisation import Tangents
from ..derivatives.twin import Place
from ..memory.user_memory import memory_kept

BALANCED = 1e-3  # of the largest force: what may be left at a sample, where Newton's iterations have ended
# of the largest local error of a velocity: a residual that moves it by more is looked at closer. Each velocity by
# itself: where modes ring unresolved, their local errors hide those of a load that switches and moves the body
MATTERS = 0.1
SEEN = 1e-2  # of the local errors of all: those of single velocities below count as such
OFF = 0.01  # of the same: by how much residuals may be off at steps that are not looked at
TRIED = 8  # steps with the largest residuals in the middle: whether the equations hold where they end
FEW = 32  # steps: all of them are looked at
INNER = slice(1, -1)  # the others may be at the ends of a run, where cubics through samples are one-sided
ROUGH = 1e-6  # of a load: less of its second differences is nothing
QUARTERS, MIDDLE = (0.25, 0.75), 0.5
# Boole's rule less Simpson's, of residuals at quarter, middle, three quarters; both have 0 at the ends
CLOSER = np.array([32 / 90, 12 / 90 - 2 / 3, 32 / 90]) / (2 / 3)  # 2/3: what at_samples multiplies by
# steps that are looked at once more, each at a share of its own that no fraction tells: what repeats itself with a
# quarter of the step is the same at quarters, middle and ends
PROBED, GOLDEN = 16, (np.sqrt(5) - 1) / 2


class StoredResiduals:
    """Residuals M q'' + G^T l - f of an mbs between the samples of a run.

    The run goes on as it was, bit for bit: states are set back, and what user functions keep.

    Attributes
    ----------
    failure : why there are no residuals between samples; empty if there are. in_a_copy : whether a light copy of the
    mbs may be asked, if there is one. was_changed : whether that is why.
    """

    def __init__(self, tangents: Tangents, mbs: Any):
        self._tangents, self._functions = tangents, user_functions(mbs)
        self._loads = loads_with_functions(mbs)
        # functions of loads are looked at by themselves; what others do between samples shows in residuals only
        self._all = len(self._functions) > sum(len(load_functions(mbs.GetLoad(i))) for i in self._loads)
        self.failure, self.in_a_copy, self.was_changed = "", True, False
        self._place: Place | None = None  # where residuals are asked for, in a block

    def between(
        self, mbs: Any, rows: Sequence[np.ndarray], first: int, dv: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | tuple[None, None]:
        """Return r (S, n) in the middle of the steps from `first` on, and what is uncertain of it.

        rows : t (W,), q, q_t, q_tt, multipliers (W, ...) of samples. dv (W - 1, n) : local errors of velocities,
        beside which residuals matter or not. None, None: see failure.
        """
        if self.failure or mbs is None:
            self.failure = self.failure or GONE
            return None, None
        try:
            with memory_kept(mbs, self._functions) as memory, state_kept(mbs.systemData):
                if memory.lost:
                    raise RunError(HOLDS.format(memory.lost))
                self._check(mbs, rows, dv, np.array([len(rows[0]) - 1]))
                self._place = self._cheapest(mbs, rows)
                found = self._between(mbs, rows, first, dv)
                self.failure = MEMORY if memory.changed else ""
        except Exception as error:  # of a user function, or of a state that cannot be
            self.failure = FAILED.format(error)
        finally:
            self._place = None
        return (None, None) if self.failure else found

    def _cheapest(self, mbs: Any, rows: Sequence[np.ndarray]) -> Place:
        """The light copy if it shows what the mbs shows at another time than the run is at, in a step; or the mbs."""
        t, *states = (x[-NODES:] for x in rows)
        now, state = (t[-2] + t[-1]) / 2, [x[0] for x in within(t, states, MIDDLE, slice(-1, None))]
        if not self.in_a_copy:
            return Place(self._tangents.equations, mbs)
        found = self._tangents.without_inertia(mbs, now, state, len(rows[0]))
        self.in_a_copy = found.mbs is not mbs or self._tangents.light(mbs).mbs is mbs
        return found

    def _between(self, mbs: Any, rows: Sequence, first: int, dv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The middle of the steps; where that matters, their quarters too.

        Where residuals are smooth, at some of the steps, with cubics between.
        """
        t, light = rows[0][first:], np.sqrt(self._tangents.readings[-1].masses)
        known = np.maximum(np.abs(dv * light).max(axis=0), SEEN * self._largest(dv))
        known[known == 0] = np.inf  # where nothing moves at all, residuals are not compared with anything
        looked = self._looked(mbs, t, np.abs(dv[first:]) * light / known)
        moves, t = np.diff(t)[:, None] / (light * known), (t[:-1] + t[1:]) / 2  # residuals, in sizes of local errors
        r = np.zeros((len(t), len(light)))
        look = lambda share, steps: self._at(mbs, rows, share, first + steps)  # noqa: E731
        r[looked] = look(MIDDLE, np.flatnonzero(looked))
        closer = looked.copy()
        if not looked.all():
            closer |= told(t, r, looked, lambda steps: look(MIDDLE, steps), moves, OFF) > MATTERS
            r[INNER] = filled(t[INNER], r[INNER], looked[INNER])
        sizes = (moves * np.abs(r)).max(axis=1)
        uncertain, matter = np.zeros_like(r), np.flatnonzero(closer & (sizes > MATTERS))
        if matter.size:
            largest = matter[np.argsort(-sizes[matter])[:TRIED]]  # where an mbs that was changed for a while shows
            self._check(mbs, rows, dv, first + largest + 1)
            both = look(np.repeat(QUARTERS, len(matter)), np.tile(matter, 2))
            quarter, last = np.split(both, 2)
            uncertain[matter] = np.tensordot(CLOSER, [quarter, r[matter], last], axes=1)
            uncertain[INNER] = filled(t[INNER], uncertain[INNER], closer[INNER])
        return r, uncertain + self._hidden(look, r, np.isin(np.arange(len(r)), matter), moves)

    def _hidden(self, look: Callable, r: np.ndarray, closer: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """The largest residuals (n,) that what was looked at does not tell of, where they matter; 0: none.

        closer : steps (S,) that were looked at at their quarters, too: a quartic tells the rest there, elsewhere a
        parabola.
        """
        steps = np.unique(np.linspace(0, len(r) - 1, PROBED).astype(int))
        share = (GOLDEN * (1 + np.arange(len(steps)))) % 1
        nodes = np.array([0.0, QUARTERS[0], MIDDLE, QUARTERS[1], 1.0])
        inner = [look(QUARTERS[0], steps), r[steps], look(QUARTERS[1], steps)]
        weights = weights_of(np.tile(nodes, (len(steps), 1)), share)[:, 1:-1].T[..., None]  # 0 at the ends
        there, quartic = look(share, steps), sum(w * x for w, x in zip(weights, inner, strict=True))
        bent = np.maximum(*(np.abs(x - 0.75 * inner[1]) for x in inner[::2]))
        off = np.maximum(np.abs(there - (4 * share * (1 - share))[:, None] * inner[1]), bent)
        # what rings within a step shows at the quarters, too: there a parabola through the middle is as far off
        of_quartic = np.abs(there - quartic)
        off = np.where(closer[steps, None], np.where(of_quartic > STANDS_OUT * bent, of_quartic, 0.0), off)
        return np.where(moves[steps] * off > MATTERS, off, 0.0).max(axis=0)

    def _looked(self, mbs: Any, t: np.ndarray, local: np.ndarray) -> np.ndarray:
        """Which steps (S,) between times t (S + 1,) are looked at first: some, and those that differ from these.

        local : local errors of velocities (S, n), of the largest.
        """
        S = len(local)
        if self._all or S <= FEW:
            return np.ones(S, dtype=bool)
        looked = np.pad(seldom(S - 2), 1, constant_values=True)
        system, loads = mbs.systemData, [np.zeros((S, 1))]
        for i in self._loads:
            values = []
            for now in ((t[:-1] + t[1:]) / 2).tolist():
                system.SetTime(now)
                values.append(mbs.GetLoadValues(i))
            loads.append(np.reshape(values, (S, -1)))
        loads = np.hstack(loads)
        bends = np.abs(np.diff(loads, 2, axis=0))
        bends = np.concatenate([bends[:1], bends, bends[-1:]])
        rough = standing_out(bends, looked, ROUGH * np.abs(loads).max(axis=0))
        return looked | rough | standing_out(local, looked, MATTERS)

    def _speed(self, force: np.ndarray) -> np.ndarray:
        """What forces (S, n) change in unit time, of the size of velocities in the mass norm."""
        return np.linalg.norm(force / np.sqrt(self._tangents.readings[-1].masses), axis=1)

    def _largest(self, dv: np.ndarray) -> float:
        return float(np.linalg.norm(dv * np.sqrt(self._tangents.readings[-1].masses), axis=1).max())

    def _at(self, mbs: Any, rows: Sequence, share: float | np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Residuals (S, n) within steps (S,), at a share of each."""
        t, *states = rows
        now = t[steps] + share * (t[steps + 1] - t[steps])
        return self._asked(mbs).residuals(now, within(t, states, share, steps))

    def _asked(self, mbs: Any) -> Place:
        return self._place or Place(self._tangents.equations, mbs)

    def _check(self, mbs: Any, rows: Sequence[np.ndarray], dv: np.ndarray, at: np.ndarray) -> None:
        """RunError if the equations of samples are not these: something acts on one that its state does not tell."""
        t, *states = (x[at] for x in rows)
        still = [x * keeps for x, keeps in zip(states, (1, 1, 0, 0), strict=True)]
        left, forces = (self._asked(mbs).residuals(t, x) for x in (states, still))
        moved = (t - rows[0][at - 1]) * self._speed(left)
        off = np.abs(left).max(axis=1) > BALANCED * np.abs(forces).max(axis=1)
        off &= moved > MATTERS * self._largest(dv)
        self.was_changed = bool(off.any())
        if self.was_changed:
            raise RunError(UNTRUE.format(t[off][0], CHANGED))


UNTRUE = "at t = {:g} s Exudyn's equations do not hold in the state of the sample: {}"
GONE = "the mbs is gone"
MEMORY = "a user function keeps something from call to call"
HOLDS = "a user function can reach what no call away from the run could put back: {}"
FAILED = "{}"
