"""two_level: the same scene with n and n + m modes; how the runs differ, and a bound that rests on the finer one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...checks import check_choice, check_count
from ...errors import InputError, RunError
from ...linear.residual.samples import SAME_TIMES
from ...mode_selection.modal_forecast import BOUND, BY, ESTIMATE
from ...mode_selection.mode_choice import outputs_of
from ...report.causes import RESOLVED
from ...report.scope import COUPLED, FROZEN
from ...report.wording import (
    NOT_THE_MECHANISM,
    at_most,
    digits,
    error_kind,
    estimated_kind,
    rounded_up,
    widest_scope,
    with_unit,
)
from ..monitoring.monitor import MechanismMonitor, Monitor

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...report.report import BoundReport
    from ...report.scope import Doubt


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


NO_LIMIT = 1_000_000  # modes; the scene itself knows how many its body has


@dataclass(frozen=True)
class LevelOutput:
    """One output of the coarse run.

    value : (T, r). difference : (T, r), the fine run's value less this. bound : (T, r) of this run's error: size of
    the difference plus the fine run's own bound. scope : of that. estimate : (T, r) of this run's error: the
    difference plus the fine run's own estimate; uncertainty : (T, r), that one's; None if the fine run has none. by :
    what is printed, "bound" or "estimate" beside it. kinds : what bound and estimate are of, "error" or "reduction
    error". uncertified : why the bound, the fine run's, is not certified, see BoundReport.
    """

    name: str
    unit: str
    value: np.ndarray
    difference: np.ndarray
    bound: np.ndarray
    scope: str
    estimate: np.ndarray | None
    uncertainty: np.ndarray | None
    by: str
    kinds: tuple[str, str]
    uncertified: tuple[Doubt, ...] = ()

    def __str__(self) -> str:
        largest, apart, bound = (np.max(np.abs(x)) for x in (self.value, self.difference, self.bound))
        size, difference = with_unit(digits(largest, 4), self.unit), with_unit(digits(apart), self.unit)
        text = f"{self.name}: up to {size}, {difference} from the finer run"
        said_of_bound = at_most(self, with_unit(rounded_up(bound), self.unit))
        most = f"{', to first order,' if self.scope == COUPLED else ''} {said_of_bound}"
        said = f"{self.kinds[0]}{most}"
        if self.by == ESTIMATE:
            said = f"{self.kinds[1]} {self._about()}, {said if len(set(self.kinds)) > 1 else most.lstrip(', ')}"
        if self.scope == FROZEN:
            return f"{text}; if the finer run's inputs were the truth's, {said} ({NOT_THE_MECHANISM})"
        return f"{text}, {said}"

    def _about(self) -> str:
        """How wrong the coarse run is, as far as the finer run's estimate can tell."""
        if self.estimate is None:
            return "not estimated"
        size, half = (np.max(np.abs(x)) for x in (self.estimate, self.uncertainty))
        if half > RESOLVED * size:
            most = digits(np.max(np.abs(self.estimate) + self.uncertainty), 2)
            return f"about {with_unit(most, self.unit)} or less"
        return f"about {digits(size)} +- {with_unit(rounded_up(half, 1), self.unit)}"


@dataclass(frozen=True)
class TwoLevel:
    """Two runs of a scene.

    t : (T,) s. outputs : name -> LevelOutput. coarse, fine : the reports of all monitors. scope : what the bounds
    cover, that of the fine run.
    """

    modes: tuple[int, int]
    t: np.ndarray
    outputs: dict[str, LevelOutput]
    coarse: tuple[BoundReport, ...]
    fine: tuple[BoundReport, ...]
    scope: str

    def output(self, name: str) -> LevelOutput:
        """Return the output of that name; InputError lists the known ones."""
        if name not in self.outputs:
            raise InputError(f"output {name!r} is unknown; known: {', '.join(map(repr, self.outputs))}")
        return self.outputs[name]

    def __str__(self) -> str:
        head = f"runs with n = {self.modes[0]} and n = {self.modes[1]}; scope of the finer run's bound: {self.scope}"
        return "\n".join([head, *map(str, self.outputs.values())])


def two_level(build: Callable[[int], tuple], n: int, m: int, *, by: str = BOUND) -> TwoLevel:
    """Run a scene with n and with n + m modes, and bound the coarse run by way of the fine one.

        |true - coarse| <= |fine - coarse| + bound of the fine run

    The difference holds the feedback of joints, whatever the scope of the bounds; so it also checks them.

    Parameters
    ----------
    build : callable
        n -> (mbs, monitor, simulationSettings): the scene with n modes a body; monitor, or a list, from attach.
        Outputs have the same names in both, and differ from monitor to monitor.
    n, m : int
        Modes of the coarse run, and how many more the fine one has.
    by : "bound" or "estimate"
        What is printed: the bound alone, or beside it what the coarse run's error is about: fine - coarse + estimate
        of the fine run, within about that one's uncertainty; no proof.

    Returns
    -------
    TwoLevel

    Raises
    ------
    InputError
        build returned something else; outputs or times of the two runs differ.
    RunError
        A solve failed, or a run ended early.

    Notes
    -----
    Source: docs/theory.md, mechanisms. Does not cover: more than the scope of the fine run's bound says.
    """
    check_choice("by", by, BY)
    n = check_count("n", n, NO_LIMIT, "modes", least=0)
    modes = n, n + check_count("m", m, NO_LIMIT, "modes")
    coarse, fine = (build_trial(build, count).solve() for count in modes)
    t = coarse[0].t
    if not all(same_times(report.t, t) for report in (*coarse, *fine)):
        raise InputError(
            "the runs have other instants: build scenes of one step size, with "
            "simulationSettings.timeIntegration.adaptiveStep = False"
        )
    found, finer = outputs_of(coarse), outputs_of(fine)
    if list(found) != list(finer):
        raise InputError(
            f"outputs of n = {modes[0]} are {list(found)}, of n = {modes[1]} {list(finer)}; give both the same"
        )
    covers = {name: (widest_scope(report.scope), report.time) for report in fine for name in report.outputs}
    outputs = {name: _level(out, finer[name], *covers[name], by) for name, out in found.items()}
    scopes = {scope for report in fine for scope in report.scope.values()}
    return TwoLevel(modes, t, outputs, coarse, fine, ", ".join(sorted(scopes)))


def _level(coarse: Any, fine: Any, scope: str, time: str, by: str) -> LevelOutput:
    difference = fine.value - coarse.value
    bound = np.abs(difference) + fine.bound["best"]
    estimate = None if fine.estimate is None else difference + fine.estimate
    known = (coarse.name, coarse.unit, coarse.value, difference, bound, scope)
    kinds = error_kind(time), estimated_kind(fine, time)
    return LevelOutput(*known, estimate, fine.uncertainty, by, kinds, fine.uncertified)
