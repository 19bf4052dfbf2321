"""Recorder: rows of a solve, kept by a PostStep function that does nothing else while Exudyn steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...mechanism.samples import Rows


class Recorder:
    """PostStep function that calls the user's own one, and keeps the row of every accepted step.

    user : the function that was in its place, or None.
    """

    def __init__(self, mbs: Any, user: Callable | None):
        self.user, self._kept = user, []
        of = mbs.systemData
        self._readers = of.GetODE2Coordinates, of.GetODE2Coordinates_t, of.GetODE2Coordinates_tt, of.GetAECoordinates

    def __call__(self, mbs: Any, t: float) -> Any:
        """Keep a row; return what the user's function returns."""
        q, v, a, lam = self._readers
        self._kept.append((t, q(), v(), a(), lam()))
        return True if self.user is None else self.user(mbs, t)

    def runs(self) -> list[Rows]:
        """Return the rows of each run that was made: a solver that begins again at an earlier time begins a new one.

        One that goes on where it has ended goes on with the accelerations that it finds then.
        """
        found: list[list[tuple]] = []
        for row in self._kept:
            if not found or row[0] <= found[-1][-1][0]:
                before = found[-1][-1] if found else None
                if before is not None and row[0] == before[0] and np.array_equal(row[1], before[1]):
                    found[-1].pop()
                else:
                    found.append([])
            found[-1].append(row)
        return [Rows(*(np.array(x) for x in zip(*run, strict=True))) for run in found]
