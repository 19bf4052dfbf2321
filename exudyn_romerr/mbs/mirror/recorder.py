"""Recorder: rows of a solve, kept by a PostStep function that does nothing else while Exudyn steps."""

from __future__ import annotations

from collections.abc import Callable
from tempfile import TemporaryFile
from typing import Any
from weakref import finalize

import numpy as np

from ...errors import RunError
from ...linear.residual.samples import GrowingArray
from ...mechanism.rows import Rows
from ..access.equations import state_in_place

MOST = 500_000_000  # bytes of rows in memory: more go to a temporary file


class Recorder:
    """PostStep function that calls the user's own one, and keeps the row of every accepted step.

    user : the function that was in its place, or None.
    """

    def __init__(self, mbs: Any, user: Callable | None):
        self.user, self._system = user, mbs.systemData
        self._rows, self._sizes, self._lost = StoredRows(), None, None

    def __call__(self, mbs: Any, t: float) -> Any:
        """Keep a row; return what the user's function returns."""
        row = (t,), *state_in_place(self._system)
        if self._sizes is None:
            self._sizes = len(row[1]), len(row[-1])
        try:
            self._rows.append(np.concatenate(row, dtype=float)[None])
        except (OSError, MemoryError, ValueError) as error:  # the run of the user goes on
            self._lost = error
        return True if self.user is None else self.user(mbs, t)

    def runs(self) -> list[Rows]:
        """Return the rows of each run that was made: a solver that begins again at an earlier time begins a new one.

        One that goes on where it has ended goes on with the accelerations that it finds then.

        Raises
        ------
        RunError
            Rows could not be kept: no memory, no room for a file, or the mbs has other coordinates than at first.
        """
        if self._lost is not None:
            raise RunError(f"rows of the run could not be kept: {self._lost}")
        if self._sizes is None:
            return []
        rows = as_rows(self._rows.all(), *self._sizes)
        t, q, begins, is_kept = rows.t, rows.q, [0], np.ones(len(rows), bool)
        for i in 1 + np.flatnonzero(np.diff(t) <= 0):
            if t[i] == t[i - 1] and np.array_equal(q[i], q[i - 1]):
                is_kept[i - 1] = False
            else:
                begins.append(int(i))
        parts = [slice(a, b) for a, b in zip(begins, [*begins[1:], len(rows)], strict=True)]
        return [rows[part] if is_kept[part].all() else rows[part][is_kept[part]] for part in parts]


def as_rows(stored: np.ndarray, size: int, first_order: int = 0) -> Rows:
    """Return what stands side by side in stored rows (S, .), of an mbs with so many coordinates; see Rows."""
    t, q, v, a, multipliers = np.split(stored, 1 + size * np.arange(4), axis=1)
    if first_order:
        multipliers, x, rates = np.split(multipliers, [-2 * first_order, -first_order], axis=1)
        h = np.diff(t, axis=0)
        steps = h / 2 * (x[1:] + x[:-1]) + h**2 / 12 * (rates[:-1] - rates[1:])
        y = np.concatenate([0.0 * x[:1], np.cumsum(steps, axis=0)])
        q, v, a = (np.hstack(both) for both in ((q, y), (v, x), (a, rates)))
    return Rows(t[:, 0], q, v, a, multipliers)


class StoredRows:
    """Rows (S, width) of numbers, one after the other: in memory, in a temporary file where they are many."""

    def __init__(self) -> None:
        self._held, self._filed, self._file = GrowingArray(), 0, None

    def append(self, rows: np.ndarray) -> None:
        """Add rows (S, width)."""
        if rows.nbytes // max(len(rows), 1) * len(self._held) > MOST:
            self._to_file()
            self._filed += len(self._held)
            self._held.cut(0)
        self._held.append(rows)

    def __len__(self) -> int:
        return self._filed + len(self._held)

    def _to_file(self) -> None:
        if self._file is None:
            self._file = TemporaryFile()
            finalize(self, self._file.close)
        self._held.read().tofile(self._file)

    def all(self) -> np.ndarray:
        """Return all rows (S, width); more of them may be written behind."""
        held = self._held.read()
        if self._file is None:
            return held
        place = self._file.tell()
        self._to_file()
        self._file.flush()
        found = np.memmap(self._file, float, "r", shape=(self._filed + len(held), held.shape[1]))
        self._file.seek(place)
        return found
