"""two_level: the same scene with n and n + m modes; how the runs differ, and a bound that rests on the finer one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError, RunError, check_count
from ..report import BoundReport
from .monitor import Monitor

MOST = 1_000_000  # modes; the scene itself knows how many its body has
SAME_TIMES = 1e-9  # of the span: solvers add up their steps


@dataclass(frozen=True)
class LevelOutput:
    """One output of the coarse run.

    value : (T, r). difference : (T, r), the fine run's value less this. bound : (T, r) of this run's error: size of
    the difference plus the fine run's own bound.
    """

    name: str
    unit: str
    value: np.ndarray
    difference: np.ndarray
    bound: np.ndarray

    def __str__(self) -> str:
        largest, apart, bound = (np.max(np.abs(x)) for x in (self.value, self.difference, self.bound))
        return (
            f"{self.name}: up to {largest:.4g} {self.unit}, {apart:.3g} {self.unit} from the finer run, "
            f"error at most {bound:.3g} {self.unit}"
        )


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


def two_level(build: Callable[[int], tuple], n: int, m: int) -> TwoLevel:
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
    n = check_count("n", n, MOST, "modes", least=0)
    modes = n, n + check_count("m", m, MOST, "modes")
    coarse, fine = (_solved(build, count) for count in modes)
    t = coarse[0].t
    if any(len(r.t) != len(t) or np.abs(r.t - t).max() > SAME_TIMES * np.ptp(t) for r in (*coarse, *fine)):
        raise InputError(
            "the runs have other instants: build scenes of one step size, with "
            "simulationSettings.timeIntegration.adaptiveStep = False"
        )
    found, finer = _outputs(coarse), _outputs(fine)
    if list(found) != list(finer):
        raise InputError(
            f"outputs of n = {modes[0]} are {list(found)}, of n = {modes[1]} {list(finer)}; give both the same"
        )
    outputs = {name: _level(out, finer[name]) for name, out in found.items()}
    scopes = {scope for report in fine for scope in report.scope.values()}
    return TwoLevel(modes, t, outputs, coarse, fine, ", ".join(sorted(scopes)))


def _level(coarse: Any, fine: Any) -> LevelOutput:
    difference = fine.value - coarse.value
    return LevelOutput(coarse.name, coarse.unit, coarse.value, difference, np.abs(difference) + fine.bound["best"])


def _solved(build: Callable[[int], tuple], n: int) -> tuple[BoundReport, ...]:
    """Build the scene, solve it and return the reports."""
    made = build(n)
    if not isinstance(made, tuple | list) or len(made) != 3:
        raise InputError(f"build({n}) returned {type(made).__name__}; needed: (mbs, monitor, simulationSettings)")
    mbs, monitors, settings = made
    monitors = [monitors] if isinstance(monitors, Monitor) else monitors
    if not isinstance(monitors, Sequence) or not monitors or not all(isinstance(m, Monitor) for m in monitors):
        raise InputError(
            f"build({n}) returned {monitors!r} as its second; needed: what attach returned, or a list of it"
        )
    if not mbs.systemIsConsistent:
        mbs.Assemble()
    finished = mbs.SolveDynamic(settings)
    reports = tuple(monitor.report() for monitor in monitors)  # its own error says more than the solver's
    if not finished or any(report.t[-1] < reports[0].t[-1] for report in reports):
        raise RunError(
            f"the run with n = {n} ended at t = {reports[0].t[-1]:g} s; monitor.runs holds what was bounded"
        )
    return reports


def _outputs(reports: Sequence[BoundReport]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for report in reports:
        for name, out in report.outputs.items():
            if name in found:
                raise InputError(
                    f"output {name!r} is in two monitors; give outputs of different bodies different names"
                )
            found[name] = out
    return found
