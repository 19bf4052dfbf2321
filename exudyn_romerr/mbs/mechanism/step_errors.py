"""StepErrors: the time-step error of a mechanism, from the rows of its run and what Exudyn says between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...estimates.march import Steps
from ...estimates.mechanism_feedback import GROWN
from ...estimates.time_step_error import TimeStep, TimeStepError
from ..access.linearisation import Tangents
from .stored_residuals import StoredResiduals

INCREMENTS = "no estimate of the error by time steps: rotations of Lie group nodes have no rates that are velocities"
LEFT_OUT = "what loads do between samples is left out of the error by time steps: {}"
LOST = "the estimate of the error by time steps ends before t = {:g} s: it has grown beyond all numbers"


class StepErrors:
    """Errors by time steps along a run; where they end, the run and its bounds go on.

    residuals : of states between samples, None: they are left out. holds_rates : whether the solver keeps the rates
    of constraints zero and lets their positions drift (index 2).

    Attributes
    ----------
    found : errors at the samples of the last call of open or finish; None where there are none. notes : what is to be
    said of them, once.
    """

    def __init__(self, tangents: Tangents, residuals: StoredResiduals | None, holds_rates: bool):
        self._tangents, self._residuals, self._holds_rates = tangents, residuals, holds_rates
        self._error: TimeStepError | None = None
        self.found: TimeStep | None = None
        self.notes: list[str] = []

    def open(self, size: int, rows: Sequence[np.ndarray], before: StepErrors | None) -> None:
        """Begin with the first of rows t (1,), q, q_t, q_tt, multipliers, or go on from the run before."""
        if not self._tangents.differentiable.all():
            self.notes.append(INCREMENTS)
            return
        goes_on = before is not None and before._error is not None
        self._error = before._error if goes_on else TimeStepError(size, loads=self._residuals is not None)
        self.found = self._error.open(rows)

    def begin(self, mbs: Any, rows: Sequence[np.ndarray]) -> None:
        """Take rows that follow; steps are to go through."""
        error = self._error
        if error is None:
            return
        drifts = self._holds_rates and mbs is not None
        error.add(rows, self._tangents.drifts(mbs, rows) if drifts else None)
        r = uncertain = None
        if self._residuals is not None:
            r, uncertain = self._residuals.between(mbs, error.rows, error.first, error.defects[1])
            if self._residuals.failure:
                self.notes.append(LEFT_OUT.format(self._residuals.failure))
        error.begin(r, uncertain)

    def go(self, steps: Steps) -> None:
        """Go through the next steps."""
        if self._error is not None:
            self._error.go(steps)

    def finish(self) -> None:
        """All steps were gone through."""
        if self._error is None:
            return
        t, self.found = self._error.rows[0][self._error.first], self._error.found()
        largest = max(np.abs(x).max(initial=0.0) for x in self.found[:3] if x is not None)
        if not largest < GROWN:  # or nan
            self.notes.append(LOST.format(t))
            self._error = self.found = None
