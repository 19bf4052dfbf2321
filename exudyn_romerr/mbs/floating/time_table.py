"""TimeTable: values of a function of time that are asked for again and again, at the same times."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


class TimeTable:
    """Keeps values at the times that were asked for."""

    def __init__(self) -> None:
        self._t, self._values = np.empty(0), np.empty(0)
        self._newest: tuple[np.ndarray, np.ndarray] | None = None  # put in order when others are asked for

    def at(self, t: np.ndarray, f: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Return values (S, p) at times t (S,); f: at ascending times (T,), none of them twice, (T, p)."""
        ascending = bool((t[1:] > t[:-1]).all())
        times, again = (t, slice(None)) if ascending else np.unique(t, return_inverse=True)
        if self._newest is not None:
            if np.array_equal(self._newest[0], times):
                return self._newest[1][again].copy()
            self._put_in_order()
        if not self._t.size:
            self._t, self._values = times.copy(), f(times)
            return self._values[again].copy()
        at = np.minimum(np.searchsorted(self._t, times), len(self._t) - 1)
        missing = times[self._t[at] != times]
        if missing.size:
            self._newest = missing, f(missing)  # may fail
            if missing.size == times.size:
                return self._newest[1][again].copy()
            self._put_in_order()
            at = np.searchsorted(self._t, times)
        return self._values[at][again]

    def _put_in_order(self) -> None:
        (t, values), self._newest = self._newest, None
        self._t = np.concatenate([self._t, t])
        order = np.argsort(self._t)
        self._t, self._values = self._t[order], np.concatenate([self._values, values])[order]
