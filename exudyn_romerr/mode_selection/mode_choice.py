"""ModeChoice: which basis meets a tolerance, and what was tried to find out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..report.assessment import PRINTED
from ..report.scope import NOT_CERTIFIED, cures_of
from ..report.wording import NOT_THE_MECHANISM, SAMPLED, digits, not_certified, with_unit
from .modal_forecast import ESTIMATE, TINY, fewest_modes
from .tried_run import BASIS, INTERFACES, SLACK, STEP, TriedRun

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..report.report import BoundReport
    from ..report.scope import Doubt

SECOND_ORDER = 4 / 3  # error of a step over the difference to half the step
CURES = {
    BASIS: "too few modes, or too few kinds of them: raise most=, or keep interfaces free (RBE3)",
    INTERFACES: "rigid (RBE2) interfaces alone make it larger than allowed: take RBE3 modes, or "
    "floating_body(..., interfaces='rigid') if they are rigid in reality",
    STEP: "the time steps alone make it larger than allowed: halve the step",
    SLACK: "what auxiliary vectors leave is larger than allowed: let loads grow smoothly, or raise auxiliary_modes=",
}


@dataclass(frozen=True)
class ModeChoice:
    """What choose_modes found.

    chosen : the run with the smallest basis that is enough, by its bounds or (by="estimate") estimates, or, if none
    is, the one that came closest. tried : all runs, in their order. step_error : output -> error of the time steps,
    estimated from a run with half of them; None if what decides covers the steps, or no run was left. failed : what
    ended the search, if a run failed.
    """

    chosen: TriedRun
    tried: tuple[TriedRun, ...]
    step_error: dict[str, float] | None
    failed: str | None

    @property
    def met(self) -> bool:
        """Whether the bounds of the chosen basis are within the tolerances, certified or not (see uncertified)."""
        return self.chosen.met

    @property
    def uncertified(self) -> tuple[Doubt, ...]:
        """Why no bound of the chosen basis is certified, see BoundReport; `met` says nothing then that is proved."""
        return self.chosen.uncertified

    @property
    def answer(self) -> str:
        """Whether the chosen basis is enough, as BoundReport.assess says: "proven", "likely", ... "disproven"."""
        return self.chosen.assessment.answer

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
        """What keeps the error above the tolerance: "basis", "interfaces", "step size", "slack", or None.

        "slack" is what auxiliary vectors leave. "step size" also where the bound is met, which does not cover the
        steps, and their error is larger: step_error, or, without, their part of the estimate.
        """
        return next(iter(self._limits()), None)

    def _limits(self) -> list[str]:
        """Return what has to be changed, each for itself."""
        if self.chosen.is_enough and self.step_error is not None:
            return [STEP] if any(x > self.chosen.tolerance[name] for name, x in self.step_error.items()) else []
        alone, limit = self.chosen.alone(), self.chosen.limit()
        if self.chosen.is_enough:
            return [what for what in alone if what == STEP and not self.chosen.covers_steps]
        return alone + [BASIS] * (INTERFACES not in alone) if limit == BASIS else [limit]

    def __str__(self) -> str:
        scopes = {scope for report in self.reports for scope in report.scope.values()}
        frozen = f", inputs frozen ({NOT_THE_MECHANISM})" if self.chosen.is_frozen else ""
        closest = "" if self.chosen.is_enough else "came closest, "
        doubts = not_certified(self.chosen.uncertified)
        bounds = f"its bounds{doubts and f' ({doubts})'} are {'' if self.met else 'not '}within the tolerance{frozen}"
        answer = f"{closest}error within the tolerance: {PRINTED[self.answer].value}"
        lines = [f"{self.chosen.basis}: {answer}; {bounds}; their scope: {', '.join(sorted(scopes))}"]
        lines += [f"  run {i}: {run}" for i, run in enumerate(self.tried, start=1)]
        found = self.chosen.assessment
        if self.chosen.is_enough:
            lines += [f"  {found}", f"  {self._smaller()}"]
        else:  # cures of the search, which knows more than one run does
            cures = [cures_of(self.uncertified), *(CURES[limit] for limit in self._limits())]
            lines.append(f"  {found.said}: {'; '.join(filter(None, cures))}")
        if self.failed is not None:
            lines.append(f"  not tried further, for a run failed: {self.failed}")
        if self.step_error is not None:
            errors = ", ".join(
                f"{name} {with_unit(digits(x), self.chosen.units[name])}" for name, x in self.step_error.items()
            )
            cure = "; too long" if self.limit == STEP else ""
            lines.append(f"  error of the time steps, estimated from a run with half of them: {errors}{cure}")
        elif not self.chosen.covers_steps:
            lines.append(f"  {SAMPLED}")
        return "\n".join(lines)

    def _smaller(self) -> str:
        """Return why no smaller basis was chosen."""
        if not self.n:
            return "no smaller basis: n = 0"
        modes = self.chosen.fewer()
        name = f"modes {', '.join(map(str, modes))}" if self.chosen.picked else f"n = {len(modes)}"
        for run in self.tried:
            if (run.modes, run.kind) == (modes, self.kind):
                return f"{name}: error within the tolerance: {PRINTED[run.assessment.answer].value}, was tried"
        expected, units = self.chosen.expected(modes), self.chosen.units
        worst = ", ".join(f"{output} <= {with_unit(digits(x), units[output])}" for output, x in expected.items())
        certain = f" ({NOT_CERTIFIED})" if self.chosen.uncertified else ""
        decides = "estimates" if self.chosen.by == ESTIMATE else f"bounds{certain}"
        place = "within the tolerance, too" if self.chosen.would_meet(modes) else "above it"
        return f"{name}: not tried; its {decides} would be {place}, by a forecast: {worst}"


def slack_between(runs: Sequence[TriedRun], n: int) -> dict[str, float]:
    """Slack of every output with n modes, between those of the runs on a straight line in the logarithm."""
    known = sorted(runs, key=lambda run: run.n)
    sizes = {name: [np.log(run.forecast[name].largest_slack + TINY) for run in known] for name in runs[0].tolerance}
    return {name: float(np.exp(np.interp(n, [run.n for run in known], size))) for name, size in sizes.items()}


def stricter_tolerances(latest: TriedRun, runs: Sequence[TriedRun]) -> dict[str, float]:
    """Tolerances for forecasts of a run, less by what they were too low by for runs that failed."""
    tolerance = dict(latest.tolerance)
    for run in runs:
        for name, x in latest.expected(run.modes).items() if not run.is_enough else ():
            tolerance[name] = min(tolerance[name], latest.tolerance[name] * x / max(run.decisive[name], TINY))
    return tolerance


def fewest_hoped(
    latest: TriedRun, runs: Sequence[TriedRun], first: Sequence[tuple[int, ...]]
) -> tuple[int, ...] | None:
    """Return the fewest modes of `first`, in ascending number, that latest forecasts to be enough.

    Where its forecasts were too low for later of the runs, others are lowered by as much. One that missed by much
    leaves nearly nothing that way: what is left is halved where that asks for fewer modes.
    """
    expected = [latest.expected(modes, slack_between(runs, len(modes))) for modes in first]
    lowered = stricter_tolerances(latest, runs[runs.index(latest) :])

    def fewest(limits: dict[str, float], start: int) -> tuple[int, ...] | None:
        rest = zip(first[start:], expected[start:], strict=True)
        return next((modes for modes, x in rest if all(x[name] <= limits[name] for name in limits)), None)

    middle = max(len(first) - 1, 0) // 2
    found = [fewest(lowered, 0), fewest(latest.tolerance, middle)]
    return min((modes for modes in found if modes is not None), key=len, default=None)


def fewest_without_slack(run: TriedRun) -> tuple[int, ...] | None:
    """Fewest modes forecast to be enough, whichever they are, if auxiliary vectors left nothing."""
    bare = {name: replace(forecast, slack=0 * forecast.slack) for name, forecast in run.forecast.items()}
    return fewest_modes(bare, run.tolerance)
