"""A solve of a script whose mbs has reduced bodies: its rows are kept while it runs, and told when it has ended."""

from __future__ import annotations

from collections.abc import MutableMapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from ...errors import AssumptionError
from ...process.blas_threads import one_thread
from ...report.verdicts import until, until_begun, until_load
from ..access.mbs_items import sensor_names, slot_function
from ..access.solvers import SAME_TIME, holds_rates, scheme_from
from ..floating.floating_body import floating_body
from ..floating.reference_search import seen_body
from ..floating.sensor_outputs import chosen_outputs, shows_motion
from ..mirror.pre_step import parameters
from ..mirror.recorder import Recorder
from ..mirror.told_solve import Asked, Ended, told_solve
from .found_bodies import NO_FEM

if TYPE_CHECKING:
    import numpy as np

    from ...report.judgement import Solve
    from ...report.report import BoundReport
    from ..access.solvers import EndedBy
    from ..floating.floating_body import FloatingBody
    from ..monitoring.monitor import MechanismMonitor, Monitor
    from .found_bodies import FoundBody

RIGID = "interfaces that modes make rigid are taken to be so in reality (--interfaces rigid)"
REJECTED = (
    "Newton failed {} times and Exudyn began the step anew, from which errors may come that are in no number: "
    "newton.useModifiedNewton = False, adaptiveStep = False or shorter steps cure that"
)
SAME_LENGTH = 1e-6  # of a step: what differs by less is rounding of times
ATTACHED_BY_SCRIPT = "the script attaches monitors of its own; the answer is theirs"


def _vary(steps: np.ndarray) -> bool:
    """Whether lengths of steps do: then errors of steps were 200 times as large as told where Newton had failed."""
    return bool(len(steps)) and float(steps.max() - steps.min()) > SAME_LENGTH * float(steps.max())


def monitor_of_script(mbs: Any) -> Monitor | MechanismMonitor | None:
    """Return what the script has attached to the mbs itself, or None."""
    hook = getattr(slot_function(mbs), "hook", None)
    if hook is None:
        return None
    from ..monitoring.monitor import MechanismMonitor, Monitor  # here, for few scripts attach any
    from ..monitoring.step_hook import StepHook

    if not isinstance(hook, StepHook) or not hook.watches:
        return None
    monitors = [Monitor(mbs, hook, watch) for watch in hook.watches]
    alone = len(monitors) == 1 and hook.sensors == []
    return monitors[0] if alone else MechanismMonitor(mbs, monitors, hook.sensors)


class RecordedSolve:
    """Keeps rows from the moment it is made; `reports` puts back the user's PostStep function and tells them.

    solve : is told of sensors, bodies that cannot be read and why. ended : of each mbs how its solve before ended.
    settings : of the solver. interfaces : of the full model, see floating_body; "rigid": where modes make them so.
    """

    def __init__(
        self,
        mbs: Any,
        bodies: Sequence[FoundBody],
        solve: Solve,
        ended: MutableMapping[Any, Ended],
        settings: Any,
        interfaces: str = "free",
    ):
        self._mbs, self._bodies, self._solve, self._interfaces = mbs, bodies, solve, interfaces
        self._ended, self._holds_rates = ended, holds_rates(settings)
        solve.sensors, solve.chosen = sensor_names(mbs), not shows_motion(mbs)
        self._recorder, self._begun = Recorder(mbs, slot_function(mbs)), parameters(mbs)
        mbs.SetPostStepUserFunction(self._recorder)

    def close(self) -> None:
        """Put back the user's PostStep function."""
        if slot_function(self._mbs) is self._recorder:
            self._mbs.SetPostStepUserFunction(self._recorder.user or 0)

    @one_thread()
    def reports(self, solver: Any, ending: EndedBy) -> list[BoundReport]:
        """Return a report of each run that the solver has made; ending : what ended it.

        Raises
        ------
        RomErrError
            Nothing can be told, and why.
        """
        runs, solve = self._recorder.runs(), self._solve
        is_static = solve.kind == "static"
        before = self._ended.pop(self._mbs, None)
        if runs:
            self._ended[self._mbs] = Ended(runs[-1].q[-1], runs[-1].v[-1])  # where nothing is known
        elif ending.why:
            solve.until = until_begun(ending.why)
        end = _planned_end(solver, runs[-1].t[-1]) if runs else None
        if end is not None and ending.why:
            last = runs[-1].t[-1]
            solve.until = until_load(last, ending.why) if is_static else until(last, end, ending.why)
        solve.flexes, solve.refused = flexes, refused = _readable(self._mbs, self._bodies, self._interfaces)
        if refused:
            raise AssumptionError("; ".join(f"{which}: {why}" for which, why in refused))
        chosen = [chosen_outputs(self._mbs, flex) if solve.chosen else () for flex in flexes]
        of_solver, further = (scheme_from(solver), is_static), [body.further for body in self._bodies]
        asked = Asked(
            *(flexes, chosen, *of_solver), holds_rates=self._holds_rates, begun=self._begun, further=further
        )
        messages = [RIGID] if any(flex.interfaces == "rigid" for flex in flexes) else []
        if rejected := getattr(solver.it, "rejectedModifiedNewtonSteps", 0):
            if any(_vary(rows.t[1:] - rows.t[:-1]) for rows in runs):
                raise AssumptionError(REJECTED.format(rejected))
            messages.append(REJECTED.format(rejected))
        solve.notes += messages
        found = []
        for i, rows in enumerate(runs):
            told, before = told_solve(self._mbs, asked, rows, before, end if i == len(runs) - 1 else None)
            self._ended[self._mbs] = before
            solve.content = told.content
            basis = [one.known.basis for one in before.bodies]
            found.append(told.of_mechanism(basis, messages))
        return found


def _planned_end(solver: Any, last: float) -> float | None:
    """Where a run was to go to, s, if it ended before."""
    end = float(solver.it.endTime)
    return None if last >= end - SAME_TIME * abs(end) else end


def _readable(
    mbs: Any, bodies: Sequence[FoundBody], interfaces: str
) -> tuple[list[FloatingBody], list[tuple[str, str]]]:
    """Return the bodies that can be read, and (which, why not) of the others."""
    found, refused = [_flex_or_reason(mbs, body, interfaces) for body in bodies], []
    for body, why in zip(bodies, found, strict=True):
        if isinstance(why, str):
            name = mbs.GetObject(body.number)["name"]
            refused.append((f"body {body.number}{name and f' ({name})'}", why))
    return [flex for flex in found if not isinstance(flex, str)], refused


def _flex_or_reason(mbs: Any, body: FoundBody, interfaces: str) -> FloatingBody | str:
    if body.fem is None:
        return NO_FEM
    try:
        if interfaces == "rigid":
            flex = floating_body(body.fem, body.items(mbs), interfaces=interfaces)
            with suppress(AssumptionError):  # its modes leave interfaces free
                seen_body(mbs, flex)
                return flex
        return floating_body(body.fem, body.items(mbs))
    except Exception as error:  # whatever it is: the answer says it
        return str(error)
