"""KeptEstimate: the estimate of all outputs of a body along a run, where a mechanism answers its errors."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any

import numpy as np

from ..trajectory.estimate import (
    BY_STEPS,
    CAUSES,
    LINEAR,
    LINEAR_STEPS,
    LINEARISED,
    PROVISIONAL,
    RESOLVED,
    RINGING,
    Estimate,
)
from ..trajectory.growing_array import GrowingArray

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from ..trajectory.estimate import TimeStep

    Shown = Callable[[], np.ndarray]  # outputs (S, r) at all instants, as they are shown

REMAINDER = "remainder"
FIRST = 5  # samples: differences of the first steps are one-sided, and there are few of them
FEW = 16  # samples: of runs of 1 to 10 steps that were tried, 21 of 26 rows lay outside without
# what the error by time steps and its checks depend on samples after it for: what they say of these holds before them
AHEAD = PROVISIONAL
# of the prediction: what linear equations leave out, and is larger, is not added, for what it misses itself is larger
# still; corrections of corrections grow then, and nothing is known of the prediction
LOST = 1.0
# An error of phase is 2 A at most, A what rings. Where steps do not resolve it, its estimate x grows like A phi and
# the check like A phi^2 / 2, without end; but then x is 2 A or more, and off by 2 x at most. Where x does not see
# what rings yet, A shows in the output: its fourth differences are 16 A where its sign alternates from step to step;
# 12/16 of them are 2 A or more where that is 1.4 rad a step or more
PHASE_LOST, ALTERNATES, ORDER = 2.0, 12.0, 4


class KeptEstimate:
    """Signed parts of the errors of all outputs as shown, and sizes of what checks them: (S, r) at every instant.

    The last instants may be handed over again, with better values. A half width is the largest size since the start:
    a difference passes zero. That of time steps counts AHEAD instants before, for what begins suddenly is smeared
    backwards. In the first samples of a run differences say less than later: the largest of FIRST samples counts from
    the start, and in a run of no more than FEW the check of steps is as large as what it checks. Elsewhere it is no
    larger than PHASE_LOST times that, and ALTERNATES times what rings from step to step in the outputs.
    Where a check has ended, nothing is known: its half width is inf from there on. What linear equations may have
    missed is handed over as LINEAR_STEPS of the error by time steps, as REMAINDER of what vectors predict. It is
    LINEARISED of the largest of each part beside the former; at least, beside the latter, for what time steps make of
    the vectors' own motion is in no check. Where the share `remainder` is above LOST, what vectors predict is as
    uncertain as it is large.

    rings : outputs (r,), bool, that show what steps do not resolve more than others do: forces of constraints. Where
    the check of steps is above RESOLVED of what it checks, it is as large as that.

    Attributes
    ----------
    remainder : share of the latter in the deformation that vectors predict; None: it was not measured.
    left : a bound (S, r) of what linear equations leave of outputs in global axes that have one; inf elsewhere.
    """

    def __init__(self, rings: np.ndarray | bool = False) -> None:
        self._rings = rings
        self._parts: defaultdict[str, GrowingArray] = defaultdict(GrowingArray)
        self._sizes: defaultdict[str, GrowingArray] = defaultdict(GrowingArray)
        self.remainder: float | None = None
        self.left = GrowingArray()
        self._before: dict[str, np.ndarray] = {}  # largest (r,) of a run that this one goes on from

    def go_on(self, before: KeptEstimate, shown: Shown) -> None:
        """Begin with the half widths that another run ended with; shown : its outputs."""
        if before._parts:
            largest = before._largest() | {RINGING: before._ringing(shown())}
            self._before = {name: sizes[-1] for name, sizes in largest.items()}

    def put(self, parts: Mapping[str, np.ndarray], sizes: Mapping[str, np.ndarray], replaced: int = 0) -> None:
        """Add instants: parts by cause and sizes by check, (S, r) each, the first of them in place of the last."""
        if self.remainder is not None and self.remainder > LOST and "basis" in parts:
            predicted = sum(np.abs(x) for x in parts.values())
            sizes = {**sizes, REMAINDER: np.maximum(sizes.get(REMAINDER, 0.0), predicted)}
        for kept, given in ((self._parts, parts), (self._sizes, sizes)):
            for name, rows in given.items():
                kept[name].cut(len(kept[name]) - replaced)
                kept[name].append(rows)

    def put_time_step(
        self, step: TimeStep, change: Callable[[np.ndarray], np.ndarray], more: np.ndarray | float = 0.0
    ) -> None:
        """Take the error by time steps, which is of first order: what outputs move by in the second one checks it.

        change : what outputs move by (S, r) where coordinates, rates and accelerations move by x (3, S, k). more :
        what is to be added to the estimate.
        """
        there, back = change(step.x), change(-step.x)
        left = [np.abs(change(x - step.x) - back) for x in step.left]
        sizes = {"steps": change(step.x2), LINEAR_STEPS: sum(left, np.abs(there + back) / 2)}
        if step.loads is not None:
            sizes["loads"] = change(step.loads)
        self.put({"time step": (back - there) / 2 + more}, sizes, step.replaced)

    def record(self, index: slice, shown: Shown) -> dict[str, Any]:
        """Return the fields `estimate`, `left` and `remainder` of a RunRecord; shown : outputs."""
        share = {} if self.remainder is None else {"auxiliary": self.remainder}
        left = self.left.read()
        if len(left) and self._parts:  # what these equations may have missed is in no bound of theirs
            count = max(len(left), *map(len, self._parts.values()))
            left = left + self._missed(self._largest(), count)[1][: len(left)]
        return {"estimate": self.read(index, shown), "left": left[index], "remainder": share}

    def read(self, index: slice, shown: Shown) -> Estimate | None:
        """Return the estimate at some of the instants; None if there is none. shown : outputs."""
        if not self._parts:
            return None
        count, largest = max(map(len, self._parts.values())), self._largest()
        parts = {cause: _filled(kept.read(), count, 0.0)[index] for cause, kept in self._parts.items()}
        none = np.zeros_like(next(iter(parts.values())))
        checks = {check: _filled(largest[check], count, np.inf)[index] for check in self._sizes if check != REMAINDER}
        if "steps" in checks:
            steps, checked = checks["steps"], _filled(largest["time step"], count, np.inf)[index]
            is_short = count <= FEW and not self._before
            if not is_short:
                ringing = _filled(self._ringing(shown())[:count], count, np.inf)[index]
                steps = np.minimum(steps, PHASE_LOST * checked + ALTERNATES * ringing)
            is_rough = is_short | self._rings & (steps > RESOLVED * checked)
            checks["steps"] = np.where(is_rough, np.maximum(steps, checked), steps)
        of_steps, predicted = self._missed(largest, count)
        checks[LINEAR] = none + predicted[index]
        if "time step" in self._parts:
            checks[LINEAR_STEPS] = checks.get(LINEAR_STEPS, 0.0) + of_steps[index]
        return Estimate({cause: parts.get(cause, none) for cause in CAUSES}, checks)

    def _missed(self, largest: dict[str, np.ndarray], count: int) -> tuple[np.ndarray | float, np.ndarray]:
        """What linear equations may have missed (S, r) at so many instants: of time steps, of what is predicted."""
        of = {cause: LINEARISED * _filled(largest[cause], count, np.inf) for cause in self._parts}
        steps, predicted = of.pop("time step", 0.0), sum(of.values(), np.zeros((count, 1)))
        if REMAINDER in self._sizes:
            predicted = np.maximum(predicted, _filled(largest[REMAINDER], count, 0.0))
        return steps, predicted

    def _largest(self) -> dict[str, np.ndarray]:
        """Largest sizes (S, r) since the start, of every part and check."""
        found = {}
        for name, kept in (self._parts | self._sizes).items():
            sizes = np.abs(kept.read())
            if name in self._sizes and not self._before:
                sizes[:FIRST] = np.max(sizes[:FIRST], axis=0, initial=0.0)
            found[name] = self._since_start(name, sizes)
        return found

    def _since_start(self, name: str, sizes: np.ndarray) -> np.ndarray:
        """Running maxima (S, r); what is checked of time steps AHEAD."""
        found = np.maximum(np.maximum.accumulate(sizes, axis=0), self._before.get(name, 0.0))
        if name in BY_STEPS and len(found):
            found = found[np.minimum(np.arange(len(found)) + AHEAD, len(found) - 1)]
        return found

    def _ringing(self, shown: np.ndarray) -> np.ndarray:
        """Amplitudes (S, r) of what changes its sign from step to step in outputs (S, r), since the start."""
        if len(shown) <= ORDER:
            return np.full(shown.shape, np.inf)
        sizes = np.abs(np.diff(shown, ORDER, axis=0)) / 2**ORDER
        return self._since_start(RINGING, np.concatenate([np.repeat(sizes[:1], ORDER, axis=0), sizes]))


def _filled(rows: np.ndarray, count: int, value: float) -> np.ndarray:
    """Return a copy of rows (S, r), with more of one value up to so many."""
    return np.concatenate([rows, np.full((count - len(rows), *rows.shape[1:]), value)])
