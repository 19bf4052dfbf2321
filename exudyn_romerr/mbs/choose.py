"""choose_modes: the smallest basis whose bound meets a tolerance, found with few simulations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..choice import SECOND_ORDER, STEP, ModeChoice, TriedRun, smallest_basis
from ..errors import InputError, check_count
from ..forecast import Ladder, forecasts
from ..report import outputs_of
from .monitor import checked_tolerance
from .trial import Trial, build_trial, same_times

if TYPE_CHECKING:
    from collections.abc import Callable

    from .monitor import Monitor

RUNS = 4  # simulations at most; 4, 8, 16, 32 modes compared by eye take as many
MOST = 1000  # modes of a basis
TINY = np.finfo(float).tiny


def choose_modes(
    build: Callable[..., tuple],
    tolerance: dict[str, float] | float,
    *,
    relative: bool = False,
    kinds: Sequence[str] = (),
    first: int = 4,
    most: int = 32,
) -> ModeChoice:
    """Find the smallest basis with max_t bound(t) <= tolerance for every output, in at most four simulations.

    The auxiliary vectors of a run hold the error of its basis. Their content in each further mode tells what the
    bound would be with more modes, or fewer; the basis forecast to be enough is run next, and its own bound decides.

    Parameters
    ----------
    build : callable
        n -> (mbs, monitor, simulationSettings): the scene with n modes a body beside those that it always has;
        monitor, or a list, from attach. With kinds: build(n, kind). A static solve before the dynamic one belongs
        into build, after attach. It is called once more a kind, with n = most, to see the modes; that scene is not
        solved.
    tolerance : dict or float
        Output name -> largest bound allowed, in the output's unit (a float if there is one output).
    relative : bool
        Tolerances are shares of the largest value of the output.
    kinds : sequence of str
        Kinds of bases to choose from, such as ("RBE2", "RBE3"); of equal n the first one.
    first, most : int
        Modes of the first simulation, and how many there may be.

    Returns
    -------
    ModeChoice
        Its .n, .kind and .met; print it.

    Raises
    ------
    InputError
        build returned something else; unknown outputs; monitors without estimator "auxiliary".
    RunError
        A solve failed.

    Notes
    -----
    Source: docs/theory.md, section 9. Does not cover: more than the scope of the bounds says. That fewer modes are
    not enough is a forecast, unless they were tried. Bounds of a mechanism leave out the error of the time steps: it
    is estimated by halving them, if one of the four simulations is left.
    """
    most = check_count("most", most, MOST, "modes")
    first = check_count("first", first, most, "modes, up to most", least=0)
    search = _Search(build, tolerance, relative, _checked_kinds(kinds), most)
    for kind in search.kinds:
        search.run(first, kind)
    while len(search.tried) < RUNS and (wanted := search.next_basis()) is not None:
        search.run(*wanted)
    return search.choice()


def _checked_kinds(kinds: Any) -> tuple:
    if not isinstance(kinds, list | tuple) or len(set(kinds)) != len(kinds) or len(kinds) >= RUNS:
        raise InputError(f"kinds={kinds!r}; needed: up to {RUNS - 1} different names, such as ('RBE2', 'RBE3')")
    return tuple(kinds) or (None,)


class _Search:
    """The runs so far, and which one is next."""

    def __init__(self, build: Callable, tolerance: Any, relative: bool, kinds: tuple, most: int):
        self._build, self._tolerance, self._relative = build, tolerance, relative
        self.kinds, self._most = kinds, most
        self.tried: list[TriedRun] = []
        self._ladders = {kind: self._made_ladders(kind) for kind in kinds}

    def _trial(self, n: int, kind: str | None) -> Trial:
        return build_trial(self._build, *((n,) if kind is None else (n, kind)))

    def _made_ladders(self, kind: str | None) -> list[Ladder]:
        trial = self._trial(self._most, kind)
        names = [out.name for monitor in trial.monitors for out in monitor.subject.outputs]
        self._limits = checked_tolerance(self._tolerance, names)
        if not self._limits:
            raise InputError(f"tolerance={self._tolerance!r}; needed: a number or a dict, for some of {names}")
        return [Ladder(*monitor.subject.modes(trial.mbs), self._most) for monitor in trial.monitors]

    def run(self, n: int, kind: str | None) -> None:
        """Simulate with n modes."""
        trial, ladders = self._trial(n, kind), self._ladders[kind]
        for monitor, ladder in zip(trial.monitors, ladders, strict=True):
            _check_modes(trial, monitor, ladder, n)
            monitor.subject.add(ladder.onlookers(monitor.subject.outputs))
        reports, forecast = trial.solve(), {}
        for monitor, report, ladder in zip(trial.monitors, reports, ladders, strict=True):
            forecast |= forecasts(report, monitor.runs[-1], monitor.subject.body, ladder, n)
        outputs = outputs_of(reports)
        scale = {name: np.max(np.abs(outputs[name].value)) if self._relative else 1.0 for name in self._limits}
        tolerance = {name: float(limit * scale[name]) for name, limit in self._limits.items()}
        self.tried.append(TriedRun(n, kind, tolerance, reports, forecast))

    def next_basis(self) -> tuple[int, str | None] | None:
        """Return the smallest basis that may be enough and was not tried; None if there is none."""
        best, hopeful = smallest_basis(self.tried), {kind: self._hopeful(kind) for kind in self.kinds}
        if best is None and not any(hopeful.values()):
            if self._closest().limit() == STEP:
                return None
            # forecasts from far below are too high: what auxiliary vectors leave shrinks with more modes
            hopeful = {kind: [self._most] * (self._runs(kind)[-1].n < self._most) for kind in self.kinds}
        wanted = [(n[0], kind) for kind, n in hopeful.items() if n]
        smallest = min(wanted, key=lambda basis: basis[0], default=None)
        return None if smallest is None or (best is not None and best.n <= smallest[0]) else smallest

    def _hopeful(self, kind: str | None) -> list[int]:
        """Numbers of modes forecast to be enough, more than what failed and fewer than what met."""
        runs = self._runs(kind)
        met = smallest_basis(runs)
        below = self._most + 1 if met is None else met.n
        above = max((run.n for run in runs if not run.met and run.n < below), default=-1)
        return [n for n in range(above + 1, below) if (met or runs[-1]).would_meet(n, _slack(runs, n))]

    def _runs(self, kind: str | None) -> list[TriedRun]:
        return [run for run in self.tried if run.kind == kind]

    def _closest(self) -> TriedRun:
        return min(self.tried, key=lambda run: run.excess)

    def choice(self) -> ModeChoice:
        """Return what was found."""
        chosen = smallest_basis(self.tried) or self._closest()
        left = len(self.tried) < RUNS and chosen.met and chosen.reports[0].time == "sampled"
        return ModeChoice(chosen, tuple(self.tried), self._step_error(chosen) if left else None)

    def _step_error(self, chosen: TriedRun) -> dict[str, float] | None:
        """Estimate the error of the time steps from a run with half of them; None if the solver chooses its steps."""
        trial = self._trial(chosen.n, chosen.kind)
        trial.settings.timeIntegration.numberOfSteps *= 2
        halved = trial.solve()
        if not same_times(chosen.reports[0].t, halved[0].t[::2]):
            return None
        coarse, fine = outputs_of(chosen.reports), outputs_of(halved)
        return {
            name: SECOND_ORDER * float(np.max(np.abs(fine[name].value[::2] - coarse[name].value)))
            for name in chosen.tolerance
        }


def _slack(runs: Sequence[TriedRun], n: int) -> dict[str, float]:
    """Slack of every output with n modes, between those of the runs on a straight line in the logarithm."""
    known = sorted((run.n, run.forecast) for run in runs)
    return {
        name: float(np.exp(np.interp(n, [m for m, _ in known], [np.log(f[name].slack + TINY) for _, f in known])))
        for name in runs[0].tolerance
    }


def _check_modes(trial: Trial, monitor: Monitor, ladder: Ladder, n: int) -> None:
    """InputError unless the body has as many modes as the ladder says."""
    found, wanted = monitor.subject.modes(trial.mbs)[0].shape[1], ladder.always + n
    if found != wanted:
        raise InputError(
            f"a body of {trial.call} has {found} modes, needed {wanted}: one more for each n, "
            f"{ladder.always} with n = 0"
        )
