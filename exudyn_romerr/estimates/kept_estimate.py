"""KeptEstimate: the estimate of all outputs of a body along a run, where a mechanism answers its errors."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

from ..estimators.coupled_energy import LINEARISED
from ..trajectory.growing_array import GrowingArray
from .estimate import CAUSES, Estimate

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from .time_step_error import TimeStep

PASSES = "passes"
FIRST = 5  # samples: differences of the first steps are one-sided, and there are few of them
FEW = 16  # samples: of runs of 1 to 10 steps that were tried, 21 of 26 rows lay outside without


class KeptEstimate:
    """Signed parts of the errors of all outputs as shown, and sizes of what checks them: (S, r) at every instant.

    The last instants may be handed over again, with better values. A half width is the largest size since the start:
    a difference passes zero. In the first samples of a run differences say less than later: the largest of FIRST
    samples counts from the start, and in a run of no more than FEW the check of steps is as large as what it checks.
    Where a check has ended, nothing is known: its half width is inf from there on. Of the largest of each part
    LINEARISED is what linear equations may have missed, beside what is handed over as "linearisation", and of what
    residual passes have added, PASSES, as much is left as they are of the whole.
    """

    def __init__(self) -> None:
        self._parts: defaultdict[str, GrowingArray] = defaultdict(GrowingArray)
        self._sizes: defaultdict[str, GrowingArray] = defaultdict(GrowingArray)
        self._before: dict[str, np.ndarray] = {}  # largest (r,) of a run that this one goes on from

    def go_on(self, before: KeptEstimate) -> None:
        """Begin with the half widths that another run ended with."""
        self._before = {name: largest[-1] for name, largest in before._largest().items()}

    def put(self, parts: Mapping[str, np.ndarray], sizes: Mapping[str, np.ndarray], replaced: int = 0) -> None:
        """Add instants: parts by cause and sizes by check, (S, r) each, the first of them in place of the last."""
        for kept, given in ((self._parts, parts), (self._sizes, sizes)):
            for name, rows in given.items():
                kept[name].cut(len(kept[name]) - replaced)
                kept[name].append(rows)

    def put_time_step(self, step: TimeStep, change: Callable[[np.ndarray], np.ndarray]) -> None:
        """Take the error by time steps, which is of first order: what outputs move by in the second one checks it.

        change : what outputs move by (S, r) where coordinates, rates and accelerations move by x (3, S, k).
        """
        there, back = change(step.x), change(-step.x)
        sizes = {"steps": change(step.x2), "linearisation": (there + back) / 2}
        if step.loads is not None:
            sizes["loads"] = change(step.loads)
        self.put({"time step": (back - there) / 2}, sizes, step.replaced)

    def read(self, index: slice) -> Estimate | None:
        """Return the estimate at some of the instants; None if there is none."""
        if not self._parts:
            return None
        count, largest = max(map(len, self._parts.values())), self._largest()
        parts = {cause: _filled(kept.read(), count, 0.0)[index] for cause, kept in self._parts.items()}
        none = np.zeros_like(next(iter(parts.values())))
        half_widths = {check: _filled(largest[check], count, np.inf)[index] for check in self._sizes}
        passes = half_widths.pop(PASSES, none)
        if count <= FEW and not self._before and "steps" in half_widths:
            half_widths["steps"] = np.maximum(half_widths["steps"], _filled(largest["time step"], count, 0.0)[index])
        predicted = sum(_filled(largest[cause], count, np.inf)[index] for cause in self._parts)
        left = passes * np.divide(passes, predicted, out=np.zeros_like(predicted), where=predicted > 0)
        half_widths["linearisation"] = LINEARISED * predicted + half_widths.get("linearisation", 0.0) + left
        return Estimate({cause: parts.get(cause, none) for cause in CAUSES}, half_widths)

    def _largest(self) -> dict[str, np.ndarray]:
        """Largest sizes (S, r) since the start, of every part and check."""
        found = {}
        for name, kept in (self._parts | self._sizes).items():
            sizes = np.abs(kept.read())
            if name in self._sizes and not self._before:
                sizes[:FIRST] = np.max(sizes[:FIRST], axis=0, initial=0.0)
            found[name] = np.maximum(np.maximum.accumulate(sizes, axis=0), self._before.get(name, 0.0))
        return found


def _filled(rows: np.ndarray, count: int, value: float) -> np.ndarray:
    """Return a copy of rows (S, r), with more of one value up to so many."""
    return np.concatenate([rows, np.full((count - len(rows), *rows.shape[1:]), value)])
