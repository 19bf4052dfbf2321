"""KeptEquations: whether Exudyn's equations hold in all stored states, where a user's function may change the mbs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...online.run_messages import CHANGED, changed, unseen
from ...report.scope import Doubt
from ..access.mbs_items import newton_tolerance
from ..access.state_guard import state_kept
from ..derivatives.linearisation import Tangents
from ..derivatives.twin import Place
from ..memory.user_memory import memory_kept
from .stored_residuals import BALANCED, user_functions

TRIED = 8  # rows of a block with the largest residuals, of which the forces are asked for, too
REST = 1e-7  # of the largest force so far: residuals below are rounding, and what Newton's iterations leave at rest
TOLERANCES = 10  # of Newton's relative tolerance may be left at a sample
DRIFT = 100  # times what other constraints have drifted by at rows: more is a constraint that was not active


class KeptEquations:
    """Looks at every step, as a change of parameters may come and go between all others that are looked at.

    One residual a step, in the light copy of the mbs, which is as it was, if it shows what the mbs shows now; and
    what the user's function does to coordinates.

    may_change : whether there is a function that may do so.
    """

    def __init__(self, mbs: Any, may_change: bool):
        self._may_change = may_change
        self._functions = user_functions(mbs) if may_change else []
        self._balanced = BALANCED + TOLERANCES * newton_tolerance(mbs, static=False)
        self._until, self._largest = -np.inf, 0.0
        self._has_broken = self._has_moved = False
        self._notes: list[str] = []

    def compare(self, mbs: Any, t: float, q: np.ndarray, q_t: np.ndarray) -> None:
        """Compare the state that the user's function has left with that before: q, q_t (n,)."""
        if not self._has_moved:
            after = mbs.systemData.GetODE2Coordinates(), mbs.systemData.GetODE2Coordinates_t()
            self._has_moved = not ((after[0] == q).all() and (after[1] == q_t).all())
            self._notes += [changed(MOVED.format(t))] * self._has_moved

    def broken(self, tangents: Tangents, mbs: Any, t: np.ndarray, *states: np.ndarray) -> list[str]:
        """Return once in words what was found, up to rows t (S,) and q, q_t, q_tt, multipliers (S, ...)."""
        rows = np.flatnonzero(t > self._until)  # those before were looked at, when fewer vectors were tried
        if self._may_change and not self._has_broken and rows.size and mbs is not None:
            self._until = float(t[-1])
            doubt = self._found(tangents, mbs, t, states, rows)
            self._has_broken = doubt is not None
            self._notes += [doubt] if self._has_broken else []
        found, self._notes = self._notes, []
        return found

    def _found(self, tangents: Tangents, mbs: Any, t: np.ndarray, states: Sequence, rows: np.ndarray) -> Doubt | None:
        try:
            with memory_kept(mbs, self._functions) as memory, state_kept(mbs.systemData):
                row = None if memory.lost else self._broken(tangents, mbs, t, states, rows)
                row = None if memory.changed else row  # forces that remember tell nothing in another order
        except Exception as error:  # of a user function, in a state that it was called in before
            return unseen(str(error))
        return None if row is None else changed(BROKEN.format(t[row]))

    def _broken(self, tangents: Tangents, mbs: Any, t: np.ndarray, states: Sequence, rows: np.ndarray) -> int | None:
        place = tangents.cheapest(mbs, t[rows[-1]], [x[rows[-1]] for x in states])

        def at(row: int, share: float = 1.0) -> Place:
            q, q_t, q_tt, multipliers = (x[row] for x in states)
            return place.at(t[row], (q, q_t, share * q_tt, share * multipliers))

        left = np.zeros(len(t))
        left[rows] = [np.abs(at(row).residual()).max(initial=0.0) for row in rows]
        self._largest = max(self._largest, np.abs(at(rows[-1], 0.0).residual()).max(initial=0.0))
        large = rows[np.argsort(-left[rows])][:TRIED]
        for row in large[left[large] > REST * self._largest]:
            if left[row] > self._balanced * np.abs(at(row, 0.0).residual()).max():
                return int(row)
        return self._inactive(at, states[-1], rows)

    def _inactive(self, at: Any, multipliers: np.ndarray, rows: np.ndarray) -> int | None:
        """The first of rows where a constraint has no force at all, of those that have some, and does not hold."""
        none = multipliers[rows] == 0
        without = none & ~none.all(axis=0)
        tried = np.flatnonzero(without.any(axis=1))
        for i in tried[np.r_[np.diff(tried) > 1, True]] if tried.size else ():  # the longer, the more it moves
            row, equations = int(rows[i]), at(int(rows[i])).equations
            drift = np.abs(equations.drift(at(row).mbs))
            others = drift[~without[i]].max(initial=0.0)
            if drift[without[i]].max() > DRIFT * max(others, np.finfo(float).eps):
                return row
        return None


MOVED = f"at t = {{:g}} s the PostStep function set coordinates or velocities: {CHANGED}"
BROKEN = f"at t = {{:g}} s Exudyn's equations do not hold in the state of the sample: {CHANGED}"
