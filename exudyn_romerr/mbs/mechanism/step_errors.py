"""StepErrors: the time-step error of a mechanism, from the rows of its run and what Exudyn says between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...errors import AssumptionError
from ...estimates.columns import Columns
from ...estimates.march import Steps
from ...estimates.mechanism_feedback import GROWN
from ...estimates.time_step_error import TimeStepError
from ...online.run_messages import OTHER_INDEX, changed
from ...trajectory.estimate import TimeStep
from ..derivatives.linearisation import Tangents
from .kept_equations import KeptEquations
from .stored_residuals import StoredResiduals

INCREMENTS = "no estimate of the error by time steps: rotations of Lie group nodes have no rates that are velocities"
LEFT_OUT = "what loads do between samples is left out of the error by time steps: {}"
DRIFTS = (
    "constraints hold at the level of velocities (index 2): what drifts, on flexible interfaces however short the "
    "steps are, is in the part by time steps; what the full body drifts by beside that is in the bound to first "
    "order, but not in that of 'energy'; without useIndex2Constraints there is none"
)
LOST = "the estimate of the error by time steps ends at t = {:g} s: {}"
TOO_LARGE = "it has grown beyond all numbers"


class StepErrors:
    """Errors by time steps along a run; where they end, the run and its bounds go on.

    residuals : of states between samples, None: they are left out. holds_rates : whether the solver keeps the rates
    of constraints zero and lets their positions drift (index 2). equations : whether they hold all along.

    Attributes
    ----------
    found : errors at the samples of the last call of open or finish; None where there are none. notes : what is to be
    said of them, once.
    """

    def __init__(
        self,
        tangents: Tangents,
        residuals: StoredResiduals | None,
        holds_rates: bool,
        equations: KeptEquations,
    ):
        self._tangents, self._residuals, self.holds_rates = tangents, residuals, holds_rates
        self._equations = equations
        self._error: TimeStepError | None = None
        self.found: TimeStep | None = None
        self.notes: list[str] = []

    def open(self, size: int, rows: Sequence[np.ndarray], before: StepErrors | None) -> None:
        """Begin with the first of rows t (1,), q, q_t, q_tt, multipliers, or go on from the run before."""
        if self.holds_rates and before is not None and not before.holds_rates:
            self.notes.append(OTHER_INDEX)
        if not self._tangents.differentiable.all():
            self.notes.append(INCREMENTS)
            return
        if self.holds_rates:
            self.notes.append(DRIFTS)
        goes_on = before is not None and before._error is not None
        self._error = before._error if goes_on else TimeStepError(size, loads=self._residuals is not None)
        self.found = self._error.open(rows)

    def begin(self, mbs: Any, rows: Sequence[np.ndarray]) -> None:
        """Take rows that follow; steps are to go through."""
        self.notes += self._equations.broken(self._tangents, mbs, *rows)
        self._do(lambda error: self._begin(error, mbs, rows))

    def _begin(self, error: TimeStepError, mbs: Any, rows: Sequence[np.ndarray]) -> None:
        drifts = self.holds_rates and mbs is not None
        error.add(rows, self._tangents.drifts(mbs, rows) if drifts else None)
        error.begin(*self._between(mbs, error))

    def _between(self, mbs: Any, error: TimeStepError) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Residuals between the samples, and how uncertain they are."""
        if self._residuals is None:
            return None, None
        found = self._residuals.between(mbs, error.rows, error.first, error.defects[1])
        if self._residuals.failure:
            note = LEFT_OUT.format(self._residuals.failure)
            self.notes.append(changed(note) if self._residuals.was_changed else note)
            self._residuals = None
        return found

    def columns(self, steps: Steps) -> Columns | None:
        """Right-hand sides in the next of the steps."""
        return self._do(lambda error: error.columns(steps))

    def take(self, steps: Steps, found: np.ndarray, multipliers: np.ndarray) -> None:
        """Take what these come to; multipliers of steps ring, and are left out."""
        self._do(lambda error: error.take(steps, found))

    def newest(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray | None] | None:
        """See TimeStepError; None: there is none."""
        return self._do(lambda error: error.newest(count))

    def drift(self, count: int) -> np.ndarray | None:
        """What constraints have drifted by at the last samples (count, c); None: it is not known, or they do not."""
        newest = self.newest(count)
        return None if newest is None else newest[2]

    def finish(self) -> None:
        """All steps were gone through."""
        self._do(self._finish)

    def _finish(self, error: TimeStepError) -> None:
        self.found = error.found()
        largest = max(np.abs(x).max(initial=0.0) for x in self.found[:3] if x is not None)
        if not largest < GROWN:  # or nan
            raise AssumptionError(TOO_LARGE)

    def _do(self, work: Callable[[TimeStepError], Columns | None]) -> Columns | None:
        """What fails ends the estimate, and nothing else."""
        if self._error is None:
            return None
        try:
            return work(self._error)
        except Exception as failure:
            self.notes.append(LOST.format(self._error.rows[0][-1], failure))
            self._error = self.found = None
            return None
