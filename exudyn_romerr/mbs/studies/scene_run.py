"""Trial: one simulation of a scene that a user's function builds, with its monitors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, RunError
from ...linear.residual.samples import SAME_TIMES
from ..monitoring.monitor import MechanismMonitor, Monitor

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...report.report import BoundReport


@dataclass(frozen=True)
class Trial:
    """A scene that was built, not solved yet. call : how, for messages."""

    call: str
    mbs: Any
    monitors: tuple[Monitor, ...]
    settings: Any

    def solve(self) -> tuple[BoundReport, ...]:
        """Solve, and return the reports of all monitors; RunError if the end was not reached."""
        if not self.mbs.systemIsConsistent:
            self.mbs.Assemble()
        finished = self.mbs.SolveDynamic(self.settings)
        reports = tuple(monitor.report() for monitor in self.monitors)  # its own error says more than the solver's
        end, reached = self.settings.timeIntegration.endTime, min(report.t[-1] for report in reports)
        if not finished or reached < end - SAME_TIMES * abs(end):
            raise RunError(f"the run of {self.call} ended at t = {reached:g} s; monitor.runs holds what was bounded")
        return reports


def build_trial(build: Callable, *arguments: Any) -> Trial:
    """Call build; InputError unless it returns (mbs, monitor or list of them, simulationSettings)."""
    if not callable(build):
        raise InputError(f"build is a {type(build).__name__}; needed: a function that makes a scene")
    call, made = f"build({', '.join(map(repr, arguments))})", build(*arguments)
    if not isinstance(made, tuple | list) or len(made) != 3:
        raise InputError(f"{call} returned {type(made).__name__}; needed: (mbs, monitor, simulationSettings)")
    mbs, monitors, settings = made
    monitors = monitors.bodies if isinstance(monitors, MechanismMonitor) else monitors
    monitors = [monitors] if isinstance(monitors, Monitor) else monitors
    if not isinstance(monitors, Sequence) or not monitors or not all(isinstance(m, Monitor) for m in monitors):
        kind = type(monitors).__name__
        raise InputError(f"{call} returned a {kind} as its second; needed: what attach returned, or a list of it")
    if not hasattr(settings, "timeIntegration"):
        kind = type(settings).__name__
        raise InputError(f"{call} returned a {kind} as its third; needed: exudyn.SimulationSettings")
    return Trial(call, mbs, tuple(monitors), settings)


def same_times(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two runs have the same instants."""
    return len(one) == len(other) and bool(np.all(np.abs(one - other) <= SAME_TIMES * np.ptp(one)))
