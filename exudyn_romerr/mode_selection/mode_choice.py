"""ModeChoice: which basis meets a tolerance; TriedRun: the simulations that were made to find out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..report.answers import Answer
from ..report.assessment import ANSWERS, PRINTED, TOO_LARGE
from ..report.scope import FROZEN, NOT_CERTIFIED, cures_of
from ..report.wording import (
    NOT_THE_MECHANISM,
    SAMPLED,
    covers_time,
    digits,
    estimate_scope,
    is_known,
    not_certified,
    parts_of,
    rounded_up,
    widest_scope,
    with_unit,
)
from .modal_forecast import BOUND, ESTIMATE, TINY, fewest_modes

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from ..report.assessment import Assessment
    from ..report.report import BoundReport, OutputReport
    from ..report.scope import Doubt
    from .modal_forecast import Forecast

SECOND_ORDER = 4 / 3  # error of a step over the difference to half the step
BASIS, STEP, SLACK, INTERFACES = "basis", "step size", "slack", "interfaces"
CURES = {
    BASIS: "too few modes, or too few kinds of them: raise most=, or keep interfaces free (RBE3)",
    INTERFACES: "rigid (RBE2) interfaces alone make it larger than allowed: take RBE3 modes, or "
    "floating_body(..., interfaces='rigid') if they are rigid in reality",
    STEP: "the time steps alone make it larger than allowed: halve the step",
    SLACK: "what auxiliary vectors leave is larger than allowed: let loads grow smoothly, or raise auxiliary_modes=",
}
WITHIN = "error within the tolerance"


@dataclass(frozen=True)
class TriedRun:
    """One simulation of choose_modes.

    modes, kind : its basis. tolerance : output -> what is allowed. reports : of all monitors. forecast : output ->
    Forecast. picked : modes are any, not the first ones. by : "bound" or "estimate", what decides.
    """

    modes: tuple[int, ...]
    kind: str | None
    tolerance: dict[str, float]
    reports: tuple[BoundReport, ...]
    forecast: dict[str, Forecast]
    picked: bool
    by: str = BOUND

    @property
    def n(self) -> int:
        """Number of modes: what is to be small."""
        return len(self.modes)

    cost = n

    @cached_property
    def outputs(self) -> dict[str, OutputReport]:
        """Of all reports."""
        return outputs_of(self.reports)

    @property
    def bound(self) -> dict[str, float]:
        """The largest bound of every output that has a tolerance."""
        return {name: float(np.max(self.outputs[name].bound["best"])) for name in self.tolerance}

    @property
    def decisive(self) -> dict[str, float]:
        """What decides: the largest bound of every output, or the largest sum of |estimate| and half width."""
        return self.expected(self.modes)

    @property
    def met(self) -> bool:
        """Whether every bound is within its tolerance."""
        return all(x <= self.tolerance[name] for name, x in self.bound.items())

    @property
    def uncertified(self) -> tuple[Doubt, ...]:
        """Why bounds of the run are not certified."""
        return tuple(dict.fromkeys(doubt for report in self.reports for doubt in report.uncertified))

    @property
    def is_enough(self) -> bool:
        """Whether everything that decides is within its tolerance."""
        return self.would_meet(self.modes)

    @property
    def answer(self) -> Answer:
        """Whether the error itself is within the tolerances."""
        return PRINTED[self.assessment.answer]

    @property
    def is_likely(self) -> bool:
        """Whether the error itself is likely, or proven, to be within the tolerances."""
        return self.answer is Answer.ENOUGH

    @cached_property
    def assessment(self) -> Assessment:
        """What is known of errors beside their tolerances, of the output that counts most (BoundReport.assess)."""
        owners = {name: report for report in self.reports for name in report.outputs}
        made = [owners[name].assess(name, self.tolerance[name]) for name in owners if name in self.tolerance]
        return min(made, key=lambda one: ANSWERS.index(one.answer))

    @property
    def covers_steps(self) -> bool:
        """Whether the error of the time steps is in what decides."""
        if self.by == BOUND:
            return all(report.time != "sampled" or not report.outputs for report in self.reports)
        return all(covers_time(out, report.time) for report in self.reports for out in report.outputs.values())

    @property
    def is_frozen(self) -> bool:
        """Whether what decides holds under the inputs of the run."""
        if self.by == BOUND:
            return any(widest_scope(report.scope) == FROZEN for report in self.reports if report.outputs)
        outputs = ((out, report.scope) for report in self.reports for out in report.outputs.values())
        return any(estimate_scope(*one) == FROZEN for one in outputs)

    @property
    def excess(self) -> float:
        """What decides over its tolerance, the largest of all outputs."""
        return max(x / self.tolerance[name] for name, x in self.decisive.items())

    def expected(self, modes: Sequence[int], slack: dict[str, float] | None = None) -> dict[str, float]:
        """Return what decides as forecast for other modes, with this run's slack unless another one is given."""
        changed = {name: slack[name] - self.forecast[name].largest_slack if slack else 0.0 for name in self.tolerance}
        return {name: self.forecast[name].bound(modes) + x for name, x in changed.items()}

    def would_meet(self, modes: Sequence[int], slack: dict[str, float] | None = None) -> bool:
        """Whether the forecast for other modes is within the tolerances."""
        return all(x <= self.tolerance[name] for name, x in self.expected(modes, slack).items())

    def limit(self) -> str | None:
        """Return what makes bounds, or estimates, larger than allowed; None if none is."""
        missed = {name: self.outputs[name] for name, x in self.decisive.items() if x > self.tolerance[name]}
        parts = {name: out.causes if self.by == BOUND else out.estimate_parts for name, out in missed.items()}
        if any(np.max(np.abs(of["time step"])) > self.tolerance[name] for name, of in parts.items()):
            return STEP
        if any(self.forecast[name].largest_slack > self.tolerance[name] for name in missed):
            return SLACK
        return BASIS if missed else None

    def alone(self) -> list[str]:
        """Return which parts of estimates are above a tolerance alone, half width taken off, that no modes lower."""
        known = {name: self.outputs[name] for name in self.tolerance if is_known(self.outputs[name])}
        found = []
        for cause, what, beside in (("time step", STEP, ""), ("interfaces", INTERFACES, "steps")):
            halves = {name: out.uncertainty - out.uncertainty_parts.get(beside, 0.0) for name, out in known.items()}
            sizes = {name: np.abs(parts_of(out).get(cause, 0.0)) for name, out in known.items()}
            if any(np.max(sizes[name] - halves[name]) > self.tolerance[name] for name in known):
                found.append(what)
        return found

    def in_words(self, sizes: dict[str, float], word: str = "<=") -> dict[str, str]:
        """Return sizes of outputs with their units."""
        return {name: f"{word} {with_unit(digits(x), self.outputs[name].unit)}" for name, x in sizes.items()}

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
        allowed, about = (
            self.in_words(x, word) for x, word in ((self.tolerance, "allowed"), (self.decisive, "about"))
        )
        doubt = f", {NOT_CERTIFIED}," if self.uncertified else ""
        said = []
        for name, bound in self.bound.items():
            most = f"<= {with_unit(rounded_up(bound), self.outputs[name].unit)}{doubt}"
            beside = "" if self.by == BOUND else f"{about[name]} or less, bound "
            said.append(f"{name} {beside}{most} ({allowed[name]})")
        found = self.assessment
        # cures are those of the search
        made_by = f", {found.todo.partition(':')[0]}" if found.answer in TOO_LARGE else ""
        return f"{self.basis}: {', '.join(said)}; {WITHIN}: {self.answer.value}{made_by}"


def outputs_of(reports: Iterable[BoundReport]) -> dict[str, OutputReport]:
    """Return the outputs of all reports by name; InputError if two monitors have one of the same name."""
    found: dict[str, OutputReport] = {}
    for name, out in (pair for report in reports for pair in report.outputs.items()):
        if name in found:
            raise InputError(f"output {name!r} is in two monitors; give outputs of different bodies other names")
        found[name] = out
    return found


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
        chosen, found = self.chosen, self.chosen.assessment
        scopes = sorted({scope for report in self.reports for scope in report.scope.values()})
        frozen = f", inputs frozen ({NOT_THE_MECHANISM})" if chosen.is_frozen else ""
        closest = "" if chosen.is_enough else "came closest, "
        doubts = not_certified(chosen.uncertified)
        bounds = f"its bounds{doubts and f' ({doubts})'} are {'' if self.met else 'not '}within the tolerance{frozen}"
        answer = f"{closest}{WITHIN}: {chosen.answer.value}"
        lines = [f"{chosen.basis}: {answer}; {bounds}; their scope: {', '.join(scopes)}"]
        lines += [f"  run {i}: {run}" for i, run in enumerate(self.tried, start=1)]
        if chosen.is_enough:
            lines += [f"  {found}", f"  {self._smaller()}"]
        else:  # cures of the search, which knows more than one run does
            cures = [cures_of(self.uncertified), *(CURES[limit] for limit in self._limits())]
            lines.append(f"  {found.said}: {'; '.join(filter(None, cures))}")
        if self.failed is not None:
            lines.append(f"  not tried further, for a run failed: {self.failed}")
        if self.step_error is not None:
            errors = ", ".join(f"{name}{x}" for name, x in chosen.in_words(self.step_error, "").items())
            cure = "; too long" if self.limit == STEP else ""
            lines.append(f"  error of the time steps, estimated from a run with half of them: {errors}{cure}")
        elif not chosen.covers_steps:
            lines.append(f"  {SAMPLED}")
        return "\n".join(lines)

    def _smaller(self) -> str:
        """Return why no smaller basis was chosen."""
        chosen = self.chosen
        if not chosen.n:
            return "no smaller basis: n = 0"
        modes = chosen.fewer()
        name = f"modes {', '.join(map(str, modes))}" if chosen.picked else f"n = {len(modes)}"
        for run in self.tried:
            if (run.modes, run.kind) == (modes, chosen.kind):
                return f"{name}: {WITHIN}: {run.answer.value}, was tried"
        worst = ", ".join(f"{output} {x}" for output, x in chosen.in_words(chosen.expected(modes)).items())
        certain = f" ({NOT_CERTIFIED})" if chosen.uncertified else ""
        decides = "estimates" if chosen.by == ESTIMATE else f"bounds{certain}"
        place = "within the tolerance, too" if chosen.would_meet(modes) else "above it"
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
    lowered = stricter_tolerances(latest, runs[runs.index(latest) :])
    middle = max(len(first) - 1, 0) // 2
    for i, modes in enumerate(first):
        expected = latest.expected(modes, slack_between(runs, len(modes)))
        for limits in (lowered, latest.tolerance) if i >= middle else (lowered,):
            if all(expected[name] <= limit for name, limit in limits.items()):
                return modes
    return None


def fewest_without_slack(run: TriedRun) -> tuple[int, ...] | None:
    """Fewest modes forecast to be enough, whichever they are, if auxiliary vectors left nothing."""
    bare = {name: replace(forecast, slack=0 * forecast.slack) for name, forecast in run.forecast.items()}
    return fewest_modes(bare, run.tolerance)
