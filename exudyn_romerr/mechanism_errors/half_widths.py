"""Half widths: how far sizes of estimates may be off, from largest values over time of what checks change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

SHARE = 0.03  # of the estimate: what no check below sees
ACROSS = 0.01  # of the largest component of the same sensor: what directions are off by


class Largest:
    """Largest values over time (R,) of estimates (T, R), block after block, by name."""

    def __init__(self) -> None:
        self._most: dict[str, np.ndarray] = {}

    def add(self, **values: np.ndarray) -> None:
        """Take values (T, R) of a block."""
        for name, y in values.items():
            now = np.abs(y).max(axis=0, initial=0.0)
            self._most[name] = np.maximum(self._most.get(name, now), now)

    def __getitem__(self, name: str) -> np.ndarray:
        return self._most[name]


def unchecked(most: np.ndarray, sensors: Sequence[slice]) -> np.ndarray:
    """Return what no check sees of largest estimates (R,); sensors : rows of each."""
    found = SHARE * most
    for rows in sensors:
        found[rows] += ACROSS * most[rows].max()
    return found


@dataclass
class CauseEstimate:
    """The signed error (T, R) by one cause, and by check its half width (R,)."""

    over_time: np.ndarray
    half_widths: dict[str, np.ndarray] = field(default_factory=dict)


def tail(last: np.ndarray, before: np.ndarray, thirds: int = 1) -> np.ndarray:
    """Return what further vectors would add to the last third of them: a geometric series, at most the last.

    before : what one third, or two, before the last make; thirds : how many.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = last / before
        if thirds == 2:  # last / before = r^2 / (1 + r)
            share = (share + np.sqrt(share**2 + 4 * share)) / 2
        series = last * share / (1 - share)
    return np.where(share < 0.5, series, last)
