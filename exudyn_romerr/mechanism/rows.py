"""Rows of a run, and other arrays over them that are cut all at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


class Samples:
    """Arrays over rows, and lists of such arrays, as fields; x[part] is the same of some of the rows."""

    def __getitem__(self, part: Any) -> Any:
        cut = ([y[part] for y in x] if isinstance(x, list) else x[part] for x in vars(self).values())
        return type(self)(*cut)


@dataclass(frozen=True)
class Rows(Samples):
    """Accepted steps of one solve, in the coordinates of the mbs.

    t (S,) s; q, v, a (S, n_q) : coordinates without reference values, rates, accelerations; multipliers (S, all).
    Coordinates of first order (ODE1) are rates: of further coordinates, the last ones, on which nothing depends.
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    multipliers: np.ndarray

    def __len__(self) -> int:
        return len(self.t)

    def row(self, i: int) -> tuple:
        """Return t, q, v, a, multipliers of one row."""
        return self.t[i], self.q[i], self.v[i], self.a[i], self.multipliers[i]
