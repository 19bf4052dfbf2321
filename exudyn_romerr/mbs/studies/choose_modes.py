"""choose_modes: the smallest basis whose bound meets a tolerance, found with few simulations."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...checks import check_choice, check_count
from ...errors import InputError
from ...mode_selection.modal_forecast import BOUND, BY, Ladder, fewest_modes, forecasts
from ...mode_selection.mode_choice import (
    SECOND_ORDER,
    STEP,
    ModeChoice,
    TriedRun,
    fewest_hoped,
    fewest_without_slack,
    outputs_of,
    stricter_tolerances,
)
from ...mode_selection.search import cheapest, search
from ...progress import progress
from ..monitoring.attach import checked_tolerance
from .two_level import Trial, build_trial, same_times

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from ..monitoring.monitor import Monitor

FIRST = 4  # modes
RUNS = 4  # simulations at most; 4, 8, 16, 32 modes compared by eye take as many
MOST_MODES = 1000  # modes of a basis


def choose_modes(
    build: Callable[..., tuple],
    tolerance: Mapping[str, float] | float,
    *,
    relative: bool = False,
    pick: bool = False,
    kinds: Sequence[str] = (),
    first: int | None = None,
    most: int = 32,
    by: str = BOUND,
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
        Tolerances are shares of the largest value of the output; a float is the share for every output.
    pick : bool
        Take any of the modes, not the first n: build is called with the numbers (0 .. most - 1) of those to keep, in
        ascending order, instead of n. keep_modes(fem, numbers) keeps them.
    kinds : sequence of str
        Kinds of bases to choose from, such as ("RBE2", "RBE3"); of equal n the first one.
    first, most : int
        Modes of the first simulation (default: 4), and how many there may be.
    by : "bound" or "estimate"
        What decides. "estimate": max_t (|estimate| + uncertainty) <= tolerance, no proof; `.met` stays with bounds.

    Returns
    -------
    ModeChoice
        Its .n, .modes, .kind and .met; print it.

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
    most = check_count("most", most, MOST_MODES, "modes")
    first = check_count("first", min(FIRST, most) if first is None else first, most, "modes, up to most", least=0)
    check_choice("by", by, BY)
    study = _Study(build, (tolerance, relative), pick, _checked_kinds(kinds), most, by)
    firsts = [(tuple(range(first)), kind) for kind in study.kinds]
    bar = partial(progress, text="choose_modes: further simulations", total=RUNS - len(firsts))
    return study.choice(*search(study.run, firsts, study.next_basis, RUNS, bar))


def _checked_kinds(kinds: Any) -> tuple:
    is_list = isinstance(kinds, list | tuple) and len(kinds) < RUNS
    if not is_list or len({kind for kind in kinds if isinstance(kind, str)}) != len(kinds):
        raise InputError(f"kinds={kinds!r}; needed: up to {RUNS - 1} different names, such as ('RBE2', 'RBE3')")
    return tuple(kinds) or (None,)


class _Study:
    """Makes runs, and tells which one is next."""

    def __init__(self, build: Callable, tolerance: tuple[Any, bool], pick: bool, kinds: tuple, most: int, by: str):
        self._build, (self._tolerance, self._relative), self._pick, self._by = build, tolerance, pick, by
        self.kinds, self._all = kinds, tuple(range(most))
        self._ladders = {kind: self._made_ladders(kind) for kind in kinds}

    def _trial(self, modes: tuple[int, ...], kind: str | None) -> Trial:
        basis = modes if self._pick else len(modes)
        return build_trial(self._build, *((basis,) if kind is None else (basis, kind)))

    def _made_ladders(self, kind: str | None) -> list[Ladder]:
        trial = self._trial(self._all, kind)
        names = [out.name for monitor in trial.monitors for out in monitor.subject.outputs]
        if len(set(names)) < len(names):
            raise InputError(f"outputs of {trial.call} are {names}; give those of different bodies different names")
        self._limits = checked_tolerance(self._tolerance, names, for_each=self._relative)
        if not self._limits:
            raise InputError(f"tolerance={self._tolerance!r}; needed: a number or a dict, for some of {names}")
        return [Ladder(*monitor.subject.modes(trial.mbs), len(self._all)) for monitor in trial.monitors]

    def run(self, basis: tuple[tuple[int, ...], str | None]) -> TriedRun:
        """Simulate with some modes."""
        modes, kind = basis
        trial, ladders = self._trial(modes, kind), self._ladders[kind]
        for monitor, ladder in zip(trial.monitors, ladders, strict=True):
            _check_trial(trial, monitor, ladder, len(modes))
            monitor.subject.add(ladder.internal_outputs(monitor.subject.outputs))
        reports, forecast = trial.solve(), {}
        for monitor, report, ladder in zip(trial.monitors, reports, ladders, strict=True):
            forecast |= forecasts(report, monitor.runs[-1].internal(), monitor.subject.body, ladder, modes, self._by)
        outputs = outputs_of(reports)
        scale = {name: float(np.max(np.abs(outputs[name].value))) if self._relative else 1.0 for name in self._limits}
        if 0 in scale.values():
            zero = [name for name, size in scale.items() if not size]
            raise InputError(f"output {zero[0]!r} stays zero; relative=True has nothing to refer to, leave it out")
        tolerance = {name: limit * scale[name] for name, limit in self._limits.items()}
        for name, limit in tolerance.items():
            outputs[name].tolerance = limit  # what the advice of its report is about
        return TriedRun(modes, kind, tolerance, reports, forecast, self._pick, self._by)

    def next_basis(self, tried: Sequence[TriedRun]) -> tuple[tuple[int, ...], str | None] | None:
        """Return the smallest basis that may be enough and was not tried; None if there is none."""
        of = {kind: [run for run in tried if run.kind == kind] for kind in self.kinds}
        best, hopeful = cheapest(tried), {kind: self._hopeful(runs) for kind, runs in of.items()}
        known = {(run.modes, run.kind) for run in tried}
        wanted = [
            (modes, kind) for kind, modes in hopeful.items() if modes is not None and (modes, kind) not in known
        ]
        if best is None and not wanted and _closest(tried).limit() != STEP:
            wanted = [(self._all, kind) for kind in self.kinds if (self._all, kind) not in known]
        smallest = min(wanted, key=lambda basis: len(basis[0]), default=None)
        return None if smallest is None or (best is not None and best.n <= len(smallest[0])) else smallest

    def _hopeful(self, runs: Sequence[TriedRun]) -> tuple[int, ...] | None:
        """Fewest modes forecast to be enough: any, or the first ones, more than what failed, fewer than what met.

        What auxiliary vectors leave shrinks with more modes: where it is too much in the first run, it is left out.
        """
        met = cheapest(runs)
        latest = met or runs[-1]
        if self._pick:
            enough = fewest_modes(latest.forecast, stricter_tolerances(latest, runs))
            return fewest_without_slack(latest) if enough is None and len(runs) == 1 else enough
        below = len(self._all) + 1 if met is None else met.n
        missed = (run.n for run in runs if not (run.is_enough and run.is_likely) and run.n < below)
        above = max(missed, default=self._least(latest.kind) - 1)
        first = [self._all[:n] for n in range(above + 1, below)]
        known = fewest_hoped(latest, runs, first)
        if known is None and len(runs) == 1:
            none = dict.fromkeys(latest.tolerance, 0.0)
            known = next((modes for modes in first if latest.would_meet(modes, none)), None)
        return known

    def _least(self, kind: str | None) -> int:
        """The smallest n: there is no body without modes."""
        return int(any(not ladder.always for ladder in self._ladders[kind]))

    def choice(self, tried: Sequence[TriedRun], failed: tuple | None) -> ModeChoice:
        """Return what was found; failed : the basis whose run failed, and its error."""
        chosen = cheapest(tried) or _closest(tried)
        left = len(tried) < RUNS and chosen.is_enough and not chosen.covers_steps
        if failed is not None:
            (modes, _), error = failed
            failed = f"{len(modes)} modes: {type(error).__name__}: {error}"
        return ModeChoice(chosen, tuple(tried), self._step_error(chosen) if left else None, failed)

    def _step_error(self, chosen: TriedRun) -> dict[str, float] | None:
        """Estimate the error of the time steps from a run with half of them; None if the solver chooses its steps."""
        trial = self._trial(chosen.modes, chosen.kind)
        integration = trial.settings.timeIntegration
        integration.numberOfSteps *= 2
        try:
            halved = trial.solve()
        finally:  # the same settings may be those of every scene that build makes
            integration.numberOfSteps //= 2
        if not same_times(chosen.reports[0].t, halved[0].t[::2]):
            return None
        coarse, fine = outputs_of(chosen.reports), outputs_of(halved)
        return {
            name: SECOND_ORDER * float(np.max(np.abs(fine[name].value[::2] - coarse[name].value)))
            for name in chosen.tolerance
        }


def _closest(tried: Sequence[TriedRun]) -> TriedRun:
    return min(tried, key=lambda run: run.excess)


def _check_trial(trial: Trial, monitor: Monitor, ladder: Ladder, n: int) -> None:
    """InputError unless the body has as many modes as the ladder says, and has not moved yet."""
    found, wanted = monitor.subject.modes(trial.mbs)[0].shape[1], ladder.always + n
    if found != wanted:
        raise InputError(
            f"a body of {trial.call} has {found} modes, needed {wanted}: one more for each n, "
            f"{ladder.always} with n = 0"
        )
    if any(not run.is_static for run in monitor.runs):
        raise InputError(
            f"{trial.call} made a dynamic solve after attach, whose error would not be carried over; leave it to "
            "choose_modes, or make it before attach"
        )
