"""ToleranceCheck: compares bounds with tolerances at every step of a run, some steps at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...report.wording import not_certified

if TYPE_CHECKING:
    from ...linear.run.run import Run

# Steps that may be made before they are compared, as their evaluation one by one takes as long as tens of steps of
# the simulation: so many that a bound which rises twice as fast as it ever did among those before stays below its
# tolerance; but not fewer than FEWEST on the average, nor more than MOST
FEWEST, MOST = 16, 128
TINY = np.finfo(float).tiny


class ToleranceCheck:
    """The bounds of one run beside their tolerances, output -> what it is to stay below.

    room : number of steps that may be made before they are compared, inf if there are no tolerances.
    """

    def __init__(self, limits: dict[str, float]):
        self._limits, self._compared, self._calls = limits, 0, 0
        self._last: dict[str, float] = {}  # share that each bound had of its tolerance at the last step compared
        self.room = 1 if limits else np.inf

    def exceeded(self, run: Run) -> list[str]:
        """Return in words which bounds were above their tolerance at any of the steps since the last call."""
        t = run.times[self._compared :]
        if not t.size or not self._limits:
            return []
        self._compared, self._calls = self._compared + len(t), self._calls + 1
        best = run.best_of_last(len(t))
        shares = {name: np.max(best[name], axis=1, initial=0.0) / limit for name, limit in self._limits.items()}
        above = [(name, share) for name, share in shares.items() if not np.all(share <= 1)]
        condition = not_certified(run.doubts()) if above else ""
        found = [f"{self._in_words(*one, t)}{condition and f' ({condition})'}" for one in above]
        self.room = 1 if found else self._next_room(shares)
        self._last = {name: share[-1] for name, share in shares.items()}
        return found

    def _next_room(self, shares: dict[str, np.ndarray]) -> int:
        fewest = 1 if self._calls < FEWEST + self._compared / FEWEST else FEWEST
        left = min(self._steps_left(self._last.get(name, 0.0), share) for name, share in shares.items())
        return int(np.clip(left, fewest, max(fewest, min(2 * self.room, MOST))))

    def _steps_left(self, before: float, share: np.ndarray) -> float:
        """How many steps a bound needs to reach its tolerance, of which it had such shares (S,), twice as fast."""
        return (1 - share[-1]) / max(2 * np.diff(share, prepend=before).max(), TINY)

    def _in_words(self, name: str, share: np.ndarray, t: np.ndarray) -> str:
        i, limit = int(np.argmin(share <= 1)), self._limits[name]
        since = f" at t = {t[i]:g}" if i < len(t) - 1 else ""
        return f"tolerance on {name!r} exceeded{since}, {share[i] * limit:.3g} > {limit:g}"
