"""GrowingArray: an array that rows are appended to along a run."""

from __future__ import annotations

import numpy as np


class GrowingArray:
    """An array that grows: rows are kept once, and read without a copy; its room doubles when it is full."""

    def __init__(self) -> None:
        self._held: np.ndarray | None = None
        self._count = 0

    def append(self, rows: np.ndarray) -> None:
        """Add rows (S, ...)."""
        before, self._count = self._count, self._count + len(rows)
        if self._held is None or self._count > len(self._held):
            held = np.empty((max(self._count, 2 * before), *rows.shape[1:]), dtype=rows.dtype)
            if before:
                held[:before] = self._held[:before]
            self._held = held
        self._held[before : self._count] = rows

    def cut(self, count: int) -> None:
        """Forget the rows from `count` on; what was read of them before changes with those that are added then."""
        self._count = min(count, self._count)

    def __len__(self) -> int:
        return self._count

    def read(self) -> np.ndarray:
        """Return all rows, (0,) if there are none, not to be written to; later ones do not show in it."""
        if self._held is None:
            return np.zeros(0)
        rows = self._held[: self._count]
        rows.flags.writeable = False  # a report changed in place would change the run that goes on
        return rows
