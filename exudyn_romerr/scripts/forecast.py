"""How long runs will take: by what the first one took, corrected by those that have ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .child_run import Request, Result

# times the CPU time of a solve, about: known better once the first of the other runs has ended
WITH_VECTORS, WATCHED = 2.5, 3.0


class Forecast:
    """What is left of a number of runs.

    Parameters
    ----------
    seconds : by name, as forecast
    count : runs at a time
    """

    def __init__(self, seconds: Mapping[str, float], count: int):
        self._left, self._count = dict(seconds), count
        self._all, self._forecast, self._taken = sum(seconds.values()), 0.0, 0.0

    def end(self, name: str, elapsed: float) -> None:
        """Take what a run has taken, s: runs beside one another slow each other down, so that others will, too."""
        self._forecast += self._left.pop(name, 0.0)
        self._taken += elapsed

    def left(self, used: Mapping[str, float]) -> float:
        """Return about how many s are left; used : CPU time of those that run, by name."""
        remaining = [max(self._slower * x - used.get(name, 0.0), 0.0) for name, x in self._left.items()]
        return max(max(remaining, default=0.0), sum(remaining) / self._count)

    def share(self, used: Mapping[str, float]) -> float:
        """Return which share of the work is done, 0 to 1."""
        done = self._forecast + sum(min(used.get(name, 0.0) / self._slower, x) for name, x in self._left.items())
        return done / self._all if self._all > 0 else 1.0

    @property
    def _slower(self) -> float:
        """How much longer than forecast those that have ended took."""
        return self._taken / self._forecast if self._forecast > 0 else 1.0


def forecast_of(request: Request, first: Result) -> float:
    """Return about how many s a run takes: Python's start, the script's own work, and its solves."""
    solves = first.facts["solve_seconds"]
    start = max(first.elapsed - solves - first.facts.get("vector_seconds", 0.0), 0.0)
    more = request.steps * (WITH_VECTORS if request.vectors or request.factor > 1 else 1.0)
    return start + solves * more * (WATCHED if request.watch else 1.0)
