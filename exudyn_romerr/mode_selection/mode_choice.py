"""ModeChoice: which basis meets a tolerance, and what was tried to find out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..report.report import SAMPLED
from ..report.scope import FROZEN
from ..report.wording import rounded_up, widest_scope
from .modal_forecast import TINY, fewest_modes

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from ..report.report import BoundReport, OutputReport
    from .modal_forecast import Forecast

BASIS, STEP, SLACK = "basis", "step size", "slack"
SECOND_ORDER = 4 / 3  # error of a step over the difference to half the step
CURES = {
    BASIS: "too few modes, or too few kinds of them: raise most=, or keep interfaces free (RBE3)",
    STEP: "the time steps alone make it larger than allowed: halve the step",
    SLACK: "what auxiliary vectors leave is larger than allowed: raise auxiliary_modes=, or let loads grow smoothly",
}


@dataclass(frozen=True)
class TriedRun:
    """One simulation of choose_modes.

    modes, kind : its basis. tolerance : output -> what is allowed. reports : of all monitors. forecast : output ->
    Forecast. picked : modes are any, not the first ones.
    """

    modes: tuple[int, ...]
    kind: str | None
    tolerance: dict[str, float]
    reports: tuple[BoundReport, ...]
    forecast: dict[str, Forecast]
    picked: bool

    @property
    def n(self) -> int:
        """Number of modes."""
        return len(self.modes)

    @property
    def bound(self) -> dict[str, float]:
        """The largest bound of every output that has a tolerance."""
        return self.expected(self.modes)

    @property
    def met(self) -> bool:
        """Whether every bound is within its tolerance."""
        return self.would_meet(self.modes)

    @property
    def excess(self) -> float:
        """The largest bound over its tolerance."""
        return max(x / self.tolerance[name] for name, x in self.bound.items())

    def expected(self, modes: Sequence[int], slack: dict[str, float] | None = None) -> dict[str, float]:
        """Return the largest bounds forecast for other modes, with this run's slack unless another one is given."""
        changed = {name: slack[name] - self.forecast[name].largest_slack if slack else 0.0 for name in self.tolerance}
        return {name: self.forecast[name].bound(modes) + x for name, x in changed.items()}

    def would_meet(self, modes: Sequence[int], slack: dict[str, float] | None = None) -> bool:
        """Whether the forecast for other modes is within the tolerances."""
        return all(x <= self.tolerance[name] for name, x in self.expected(modes, slack).items())

    def limit(self) -> str | None:
        """Return what makes bounds larger than allowed; None if none is."""
        outputs = outputs_of(self.reports)
        missed = [name for name, x in self.bound.items() if x > self.tolerance[name]]
        if any(np.max(outputs[name].causes["time step"]) > self.tolerance[name] for name in missed):
            return STEP
        if any(self.forecast[name].largest_slack > self.tolerance[name] for name in missed):
            return SLACK
        return BASIS if missed else None

    @property
    def basis(self) -> str:
        """The basis in words."""
        modes = f" (modes {', '.join(map(str, self.modes))})" if self.picked else ""
        return f"n = {self.n}{modes}{'' if self.kind is None else f', {self.kind}'}"

    def fewer(self) -> tuple[int, ...]:
        """Return the modes less the last, or, if any may go, less the one whose removal raises the bound least."""
        drops = [tuple(k for k in self.modes if k != j) for j in self.modes] if self.picked else [self.modes[:-1]]
        return min(drops, key=lambda modes: max(self.expected(modes).values()))

    def __str__(self) -> str:
        lines = (f"{name} <= {rounded_up(self.bound[name])} (allowed {x:.3g})" for name, x in self.tolerance.items())
        return f"{self.basis}: {', '.join(lines)}: {'met' if self.met else 'not met'}"


@dataclass(frozen=True)
class ModeChoice:
    """What choose_modes found.

    chosen : the run with the smallest basis that meets the tolerance, or, if none does, the one that came closest.
    tried : all runs, in their order. step_error : output -> error of the time steps, estimated from a run with half
    of them; None if bounds cover the steps, or no run was left. failed : what ended the search, if a run failed.
    """

    chosen: TriedRun
    tried: tuple[TriedRun, ...]
    step_error: dict[str, float] | None
    failed: str | None

    @property
    def met(self) -> bool:
        """Whether the bounds of the chosen basis are within the tolerances."""
        return self.chosen.met

    @property
    def n(self) -> int:
        """Number of modes of the chosen basis."""
        return self.chosen.n

    @property
    def modes(self) -> tuple[int, ...]:
        """Which modes these are, numbered from 0 in the order of the largest basis."""
        return self.chosen.modes

    @property
    def kind(self) -> str | None:
        """Kind of the chosen basis."""
        return self.chosen.kind

    @property
    def reports(self) -> tuple[BoundReport, ...]:
        """Reports of the chosen run, one a monitor."""
        return self.chosen.reports

    @property
    def limit(self) -> str | None:
        """What keeps the error above the tolerance: "basis", "step size", "slack" (of auxiliary vectors), or None.

        "step size" also where the bound is met, which does not cover the steps, and the estimate is not.
        """
        errors = self.step_error or {}
        too_long = any(error > self.chosen.tolerance[name] for name, error in errors.items())
        return STEP if self.met and too_long else self.chosen.limit()

    def __str__(self) -> str:
        scopes = {scope for report in self.reports for scope in report.scope.values()}
        is_frozen = any(widest_scope(report.scope) == FROZEN for report in self.reports)
        frozen = ", inputs frozen (the mechanism's answer is not covered)" if is_frozen else ""
        verdict = f"is enough{frozen}" if self.met else "came closest, and is not enough"
        lines = [f"{self.chosen.basis} {verdict}; scope of the bounds: {', '.join(sorted(scopes))}"]
        lines += [f"  run {i}: {run}" for i, run in enumerate(self.tried, start=1)]
        lines += [f"  {self._smaller()}"] if self.met else [f"  {CURES[self.limit]}"]
        if self.failed is not None:
            lines.append(f"  not tried further, for a run failed: {self.failed}")
        if self.step_error is not None:
            errors = ", ".join(f"{name} {x:.3g}" for name, x in self.step_error.items())
            cure = "; too long" if self.limit == STEP else ""
            lines.append(f"  error of the time steps, estimated from a run with half of them: {errors}{cure}")
        elif self.reports[0].time == "sampled":
            lines.append(f"  {SAMPLED}")
        return "\n".join(lines)

    def _smaller(self) -> str:
        """Return why no smaller basis was chosen."""
        if not self.n:
            return "no smaller basis: n = 0"
        modes = self.chosen.fewer()
        name = f"modes {', '.join(map(str, modes))}" if self.chosen.picked else f"n = {len(modes)}"
        if any((run.modes, run.kind) == (modes, self.kind) for run in self.tried):
            return f"{name}: not enough, was tried"
        worst = ", ".join(f"{output} <= {x:.3g}" for output, x in self.chosen.expected(modes).items())
        verdict = "may be enough too, but was not tried" if self.chosen.would_meet(modes) else "not enough"
        return f"{name}: {verdict}, by a forecast: {worst}"


def smallest_basis(runs: Iterable[TriedRun]) -> TriedRun | None:
    """Return the run with the fewest modes that met its tolerances; of several kinds the first."""
    return min((run for run in runs if run.met), key=lambda run: run.n, default=None)


def outputs_of(reports: Iterable[BoundReport]) -> dict[str, OutputReport]:
    """Return the outputs of all reports by name; InputError if two monitors have one of the same name."""
    found: dict[str, OutputReport] = {}
    for report in reports:
        for name, out in report.outputs.items():
            if name in found:
                raise InputError(
                    f"output {name!r} is in two monitors; give outputs of different bodies different names"
                )
            found[name] = out
    return found


def slack_between(runs: Sequence[TriedRun], n: int) -> dict[str, float]:
    """Slack of every output with n modes, between those of the runs on a straight line in the logarithm."""
    known = sorted(runs, key=lambda run: run.n)
    sizes = {name: [np.log(run.forecast[name].largest_slack + TINY) for run in known] for name in runs[0].tolerance}
    return {name: float(np.exp(np.interp(n, [run.n for run in known], size))) for name, size in sizes.items()}


def stricter_tolerances(latest: TriedRun, runs: Sequence[TriedRun]) -> dict[str, float]:
    """Tolerances for forecasts of a run, less by what they were too low by for runs that failed."""
    tolerance = dict(latest.tolerance)
    for run in runs:
        for name, x in latest.expected(run.modes).items() if not run.met else ():
            tolerance[name] = min(tolerance[name], latest.tolerance[name] * x / max(run.bound[name], TINY))
    return tolerance


def fewest_without_slack(run: TriedRun) -> tuple[int, ...] | None:
    """Fewest modes forecast to be enough, whichever they are, if auxiliary vectors left nothing."""
    bare = {name: replace(forecast, slack=0 * forecast.slack) for name, forecast in run.forecast.items()}
    return fewest_modes(bare, run.tolerance)
