"""SteadyGains: whether springs with a user function stay smooth and passive along a run, as bounds need them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np

from ...report.scope import Doubt, Reason
from ..access.state_guard import set_state, state_kept
from ..memory.user_memory import memory_kept
from .control_functions import Spring, are_passive, find_controls

JUMP = 0.5  # of a gain's largest value: a saturation that begins changes it by all of it
LOOKED = 32  # steps within that: what linear equations leave out is looked for once in as many
GROWTH = 0.01  # of a stiffness, by time alone: more does work on the error
ROUGH = 0.25  # of what the gains at both ends of a step move a force by: it may miss the mean of them by less
ROUNDING = 1e-9  # of the largest force
FAILS = "fails beside a motion that it was asked for: {}"
WORKS = "has negative, or coupled, stiffness or damping, which may do work on the error"
KEEPS = (
    "gives another force for the same motion and time than before: it keeps something, and may do work on the error"
)
GROWS = "gets stiffer with time, which does work on the error"
JUMPS = "jumps or bends within a few steps, as where it saturates, or rubs: a linearised mechanism does not"


class _Along:
    """A spring along the run: time, motion (2, k), gains (2, k, k), force (k,) of the last row; largest so far."""

    def __init__(self, spring: Spring):
        self.spring = spring
        self._last: tuple[float, np.ndarray, np.ndarray, np.ndarray] | None = None
        self._lately: deque[np.ndarray] = deque(maxlen=LOOKED)
        self._grown, self._largest = 0.0, np.zeros(3)

    def follow(self, mbs: Any, t: float) -> str:
        """Go on to the current state at time t; return what is wrong there, if something is."""
        motion = self.spring.motion(mbs)
        gains, force = self.spring.gains(mbs, t, motion), self.spring.force(mbs, t, motion)
        sizes = *np.abs(gains).max(axis=(1, 2)), np.abs(force).max()
        self._largest = np.maximum(self._largest, sizes)
        wrong = "" if are_passive(gains) else WORKS
        if self._last is not None and not wrong:
            wrong = self._changes(mbs, t, motion, gains)
        self._last = t, motion, gains, force
        self._lately.append(gains)
        return wrong

    def remembers(self, mbs: Any) -> bool:
        """Whether the force at the row that was looked at last is another one, after further steps of the run."""
        if self._last is None:
            return False
        t, motion, _, force = self._last
        return not np.array_equal(self.spring.force(mbs, t, motion), force)

    def _changes(self, mbs: Any, t: float, motion: np.ndarray, gains: np.ndarray) -> str:
        """What is wrong with how gains and force have changed since the last row, if something is."""
        t_before, before, gains_before, _ = self._last
        later = self.spring.gains(mbs, t, before)
        rise = later[0] - gains_before[0]
        self._grown += max(np.linalg.eigvalsh((rise + rise.T) / 2)[-1], 0.0)
        if self._grown > GROWTH * self._largest[0]:
            return GROWS
        # at either time alone one end is off the path where a set point moves, and may be beyond a limit
        rough = self._is_rough(mbs, t, (before, motion), (later, gains)) and self._is_rough(
            mbs, t_before, (before, motion), (gains_before, self.spring.gains(mbs, t_before, motion))
        )
        since = np.abs(gains - self._lately).max(axis=(0, 2, 3))
        return JUMPS if rough or np.any(since > JUMP * self._largest[:2]) else ""

    def _is_rough(self, mbs: Any, t: float, ends: Sequence[np.ndarray], gains: Sequence[np.ndarray]) -> bool:
        """Whether gains (2, k, k) at both ends (2, k) do not tell how the force changes from one to the other."""
        moves = [np.einsum("akl,al->k", x, ends[1] - ends[0]) for x in gains]
        first, last = (self.spring.force(mbs, t, x) for x in ends)
        off = np.abs(last - first - (moves[0] + moves[1]) / 2).max()
        return bool(off > ROUGH * np.abs(moves).max() + ROUNDING * self._largest[2])


class SteadyGains:
    """Looks at the springs of an mbs whose forces are user functions, at every step."""

    def __init__(self, mbs: Any):
        self._springs = [_Along(spring) for spring in find_controls(mbs).springs]

    def look(self, watches: Sequence[Any], mbs: Any, t: np.ndarray, *states: np.ndarray) -> None:
        """Let watches note what is wrong, once of each spring, in rows t (S,), q, q_t, q_tt, multipliers (S, ...)."""
        if not (self._springs and watches) or mbs is None:
            return
        functions = [along.spring.function for along in self._springs]
        with memory_kept(mbs, functions), state_kept(mbs.systemData):
            found = list(self._found(mbs, list(zip(t.tolist(), *states, strict=True))))
        gone = {along for along, _ in found}
        self._springs = [along for along in self._springs if along not in gone]
        for (_, doubt), watch in product(found, watches):
            watch.note(doubt)

    def _found(self, mbs: Any, rows: Sequence[tuple]) -> Iterator[tuple[_Along, Doubt]]:
        seen: set[_Along] = set()
        for i, (t, *state) in enumerate(rows):
            set_state(mbs.systemData, t, state)
            for along in self._springs:
                wrong = "" if along in seen else _wrong(along, mbs, t, first=i == 0)
                if wrong:
                    seen.add(along)
                    yield along, Reason.CONTROLLER.doubt(said=f"at t = {t:g} s {along.spring.name} {wrong}")


def _wrong(along: _Along, mbs: Any, t: float, first: bool) -> str:
    """What is wrong at time t, the first one since steps of the run were made."""
    try:
        return KEEPS if first and along.remembers(mbs) else along.follow(mbs, t)
    except Exception as error:  # of the user's function
        return FAILS.format(error)
