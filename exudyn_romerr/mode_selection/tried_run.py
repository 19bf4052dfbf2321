"""TriedRun: one simulation of choose_modes, what decides about its basis, and what keeps it from being enough."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..report.answers import Answer
from ..report.assessment import ANSWERS, PRINTED, TOO_LARGE
from ..report.scope import FROZEN, NOT_CERTIFIED
from ..report.wording import (
    covers_time,
    digits,
    estimate_scope,
    is_known,
    parts_of,
    rounded_up,
    widest_scope,
    with_unit,
)
from .modal_forecast import BOUND, ESTIMATE

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from ..report.assessment import Assessment
    from ..report.report import BoundReport, OutputReport
    from ..report.scope import Doubt
    from .modal_forecast import Forecast

BASIS, STEP, SLACK, INTERFACES = "basis", "step size", "slack", "interfaces"


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
        """Number of modes."""
        return len(self.modes)

    @property
    def bound(self) -> dict[str, float]:
        """The largest bound of every output that has a tolerance."""
        outputs = outputs_of(self.reports)
        return {name: float(np.max(outputs[name].bound["best"])) for name in self.tolerance}

    @property
    def units(self) -> dict[str, str]:
        """Unit of every output."""
        return {name: out.unit for name, out in outputs_of(self.reports).items()}

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
    def is_likely(self) -> bool:
        """Whether the error itself is likely, or proven, to be within the tolerances."""
        return PRINTED[self.assessment.answer] is Answer.ENOUGH

    @property
    def cost(self) -> int:
        """What is to be small: the number of modes."""
        return self.n

    @property
    def assessment(self) -> Assessment:
        """What is known of errors beside their tolerances, of the output that counts most (BoundReport.assess)."""
        made = [
            report.assess(out.name, self.tolerance[out.name])
            for out, report in outputs_and_reports(self.reports)
            if out.name in self.tolerance
        ]
        return min(made, key=lambda one: ANSWERS.index(one.answer))

    @property
    def covers_steps(self) -> bool:
        """Whether the error of the time steps is in what decides."""
        by_estimate, rows = self.by == ESTIMATE, outputs_and_reports(self.reports)
        return all(covers_time(out, report.time) if by_estimate else report.time != "sampled" for out, report in rows)

    @property
    def is_frozen(self) -> bool:
        """Whether what decides holds under the inputs of the run."""
        by_estimate, rows = self.by == ESTIMATE, outputs_and_reports(self.reports)
        covers = (estimate_scope(out, r.scope) if by_estimate else widest_scope(r.scope) for out, r in rows)
        return FROZEN in covers

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
        outputs = outputs_of(self.reports)
        missed = [name for name, x in self.decisive.items() if x > self.tolerance[name]]
        parts = {name: outputs[name].causes if self.by == BOUND else outputs[name].estimate_parts for name in missed}
        if any(np.max(np.abs(parts[name]["time step"])) > self.tolerance[name] for name in missed):
            return STEP
        if any(self.forecast[name].largest_slack > self.tolerance[name] for name in missed):
            return SLACK
        return BASIS if missed else None

    def alone(self) -> list[str]:
        """Return which parts of estimates are above a tolerance alone, half width taken off, that no modes lower."""
        outputs = outputs_of(self.reports)
        found = []
        for name, limit in self.tolerance.items():
            out = outputs[name]
            if not is_known(out):
                continue
            parts, of_steps = parts_of(out), out.uncertainty_parts.get("steps", 0.0)
            for cause, what, half in (
                ("time step", STEP, out.uncertainty),
                ("interfaces", INTERFACES, out.uncertainty - of_steps),
            ):
                if np.max(np.abs(parts.get(cause, 0.0)) - half) > limit:
                    found.append(what)
        return [what for what in (STEP, INTERFACES) if what in found]

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
        allowed = {name: f"(allowed {with_unit(digits(x), self.units[name])})" for name, x in self.tolerance.items()}
        said = [f"{name}{self._said_of(name, self.units[name])} {limit}" for name, limit in allowed.items()]
        found = self.assessment
        # cures are those of the search
        made_by = f", {found.todo.partition(':')[0]}" if found.answer in TOO_LARGE else ""
        return f"{self.basis}: {', '.join(said)}; error within the tolerance: {PRINTED[found.answer].value}{made_by}"

    def _said_of(self, name: str, unit: str) -> str:
        bound = (
            f" <= {with_unit(rounded_up(self.bound[name]), unit)}{f', {NOT_CERTIFIED},' if self.uncertified else ''}"
        )
        return (
            bound
            if self.by == BOUND
            else f" about {with_unit(digits(self.decisive[name]), unit)} or less, bound{bound}"
        )


def outputs_and_reports(reports: Iterable[BoundReport]) -> Iterator[tuple[OutputReport, BoundReport]]:
    """Yield the outputs of all reports, each with the one that it is in."""
    yield from ((out, report) for report in reports for out in report.outputs.values())


def outputs_of(reports: Iterable[BoundReport]) -> dict[str, OutputReport]:
    """Return the outputs of all reports by name; InputError if two monitors have one of the same name."""
    found: dict[str, OutputReport] = {}
    for out, _ in outputs_and_reports(reports):
        if out.name in found:
            raise InputError(f"output {out.name!r} is in two monitors; give outputs of different bodies other names")
        found[out.name] = out
    return found
