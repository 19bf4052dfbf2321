"""The error by time steps of a mechanism without flexible bodies, beside its run.

Monitors need a flexible body; this goes the way that they go, with none. For benchmarks: nothing of it is public.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from exudyn_romerr.estimates.mechanism_feedback import Feedback
from exudyn_romerr.mbs.access.state_guard import current_state, state_kept, state_set
from exudyn_romerr.mbs.coupled.feedback_runs import Reaction
from exudyn_romerr.mbs.derivatives.linearisation import Tangents
from exudyn_romerr.mbs.mechanism.kept_equations import KeptEquations
from exudyn_romerr.mbs.mechanism.late_readings import LateReadings
from exudyn_romerr.mbs.mechanism.step_errors import StepErrors
from exudyn_romerr.mbs.mechanism.stored_residuals import StoredResiduals
from exudyn_romerr.online.coupled_runs import FirstSteps
from exudyn_romerr.trajectory.scheme import Scheme


class Estimated(NamedTuple):
    """Signed estimate of truth less computed, (T, r), its half width, and its only part."""

    estimate: np.ndarray
    uncertainty: np.ndarray

    @property
    def estimate_parts(self) -> dict[str, np.ndarray]:
        """By cause."""
        return {"time step": self.estimate}


class Recorder:
    """A PostStep function that keeps samples of a solve, and reads tangents."""

    def __init__(self, mbs: Any):
        self._mbs, self._left = mbs, 0
        self._samples: list[tuple] = []
        mbs.SetPostStepUserFunction(self)

    def __call__(self, mbs: Any, t: float) -> bool:
        if not self._samples:
            solver = mbs.sys["dynamicSolver"]
            self._scheme = Scheme(solver.alphaM, solver.alphaF, solver.newmarkBeta, solver.newmarkGamma)
            self._tangents = Tangents(mbs)
        if not self._left:
            self._left = self._tangents.read(mbs, t)
        self._left -= 1
        self._samples.append((t, *current_state(mbs.systemData)))
        return True

    def outputs(self, sensors: dict[str, int]) -> dict[str, Estimated]:
        """Return the estimates of sensors at all samples, none of them further back than the first is."""
        t, *states = (np.array(column) for column in zip(*self._samples, strict=True))
        LateReadings(self._tangents, self._mbs, t, states).read()
        residuals, equations = StoredResiduals(self._tangents, self._mbs), KeptEquations(self._mbs, may_change=False)
        steps = StepErrors(self._tangents, residuals, False, equations)
        reaction = Reaction([], Feedback(self._scheme), FirstSteps(None), self._tangents, steps)
        reaction.open((t[:1], *(x[:1] for x in states)), None)
        reaction.advance((t[1:], *(x[1:] for x in states)), self._mbs)
        found = reaction.time_step
        checks = [found.x2] + ([] if found.loads is None else [found.loads])
        here = self._shown(sensors, t, states, None)
        base, right, *checked = (self._shown(sensors, t, states, dx) for dx in (0 * found.x, found.x, *checks))
        return {
            name: Estimated(
                right[name] - y,
                sum(np.maximum.accumulate(np.abs(moved[name] - base[name])) for moved in checked),
            )
            for name, y in here.items()
        }

    def _shown(self, sensors: dict[str, int], t: np.ndarray, states: list[np.ndarray], dx: Any) -> dict:
        """What sensors show in all states; dx (3, T - 1, n): moved back but for the first, where forces balance."""
        if dx is not None:
            moved = [np.vstack([x[:1], x[1:] - d]) for x, d in zip(states, dx, strict=False)]
            states = [*moved, states[-1]]
        found: dict[str, list] = {name: [] for name in sensors}
        if dx is not None:
            with state_kept(self._mbs.systemData):
                balanced = self._tangents.equations.balanced
                t, *states = balanced(self._mbs, [t, *states], self._tangents.independent)
        for time, *state in zip(t, *states, strict=True):
            with state_set(self._mbs.systemData, time, state):
                for name, number in sensors.items():
                    found[name].append(self._mbs.GetSensorValues(number))
        return {name: np.array(values) for name, values in found.items()}
