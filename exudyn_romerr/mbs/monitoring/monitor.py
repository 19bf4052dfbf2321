"""Monitor and MechanismMonitor: bounds of one body, or of several, beside an Exudyn simulation."""

from __future__ import annotations

from numbers import Integral
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorUserFunction

from ...checks import check_choice
from ...errors import InputError, RunError
from ...process.blas_threads import one_thread
from ...report.mechanism_report import joined, joined_plan
from ..access.mbs_items import sensor_names
from ..access.solvers import note_end, on_purpose
from ..floating.moving_subject import MovingSubject
from ..floating.sensor_outputs import other_sensors
from ..mirror.sensors import planned_sensors
from .mechanism_run import BodyRun

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...linear.run.run import Run
    from ...model.outputs import Output
    from ...report.data import Plan
    from ...report.mechanism_report import MechanismReport
    from ...report.report import BoundReport
    from ..access.reduced_body import LinearSubject
    from .body_monitor import MonitoredBody
    from .step_hook import StepHook

UNNAMED = "there are no outputs, or they are not known before a solve begins; pass outputs= to attach"
NOT_TOLD = "the linearised mechanism, which tells how it moves, is not to be had; the bodies' scope says why"
TO_PRINT = "print(monitor.plan) after mbs.Assemble(), print(monitor.report()) after a solve"


class Monitor:
    """Bounds of one body along every solve of its mbs; made by attach.

    Attributes
    ----------
    runs : tuple of Run or BodyRun
        One per solve, oldest first, up to the last accepted step. Never raises: what was bounded stays
        reachable here when report() refuses. Each has report() and messages.
    plan
        What is computed, what is left out and why; print it.
    """

    def __init__(self, mbs: Any, hook: StepHook, watch: MonitoredBody):
        self._mbs, self._hook, self._watch = mbs, hook, watch

    def __repr__(self) -> str:
        return f"<Monitor of one body; {TO_PRINT}>"

    @property
    def subject(self) -> LinearSubject | MovingSubject:
        """The body as the solves see it."""
        return self._watch.subject

    @property
    def runs(self) -> tuple[Run | BodyRun, ...]:
        """All runs so far."""
        self._hook.finish(self._mbs)
        return tuple(self._watch.runs)

    @property
    def plan(self) -> Any:
        """The plan, once the mbs is assembled.

        Raises
        ------
        RunError
            mbs.Assemble() was not called yet, or the hook was replaced.
        AssumptionError
            Something beside the prescribed inputs acts on the body.
        """
        return self._planned()[0]

    @one_thread()
    def _planned(self) -> tuple[Plan, bool]:
        """The plan, and whether the linearised mechanism would tell."""
        self._require_hook()
        if not self._mbs.systemIsConsistent:
            raise RunError("plan was asked before mbs.Assemble(); call it first")
        self._hook.finish(self._mbs)  # what was stored so far belongs to what was read before
        offline = self.subject.read(self._mbs, False, self._hook.why_not_told(self._mbs, is_static=True))
        return (self.subject.told_plan(), True) if offline is None else (offline.plan, False)

    def bound_sensor(self, output: str, /, **options: Any) -> SensorUserFunction:
        """Return a sensor of the bound of one output, for mbs.AddSensor before mbs.Assemble().

        Its values are output(...).bound["best"] of the report, one for each row, at the times that Exudyn writes
        sensors (simulationSettings.solution.sensors.writePeriod), of the very step. They are inf where the report
        has no bound: before its first instant, and after its last.

        Parameters
        ----------
        output : str
            Its name.
        **options
            Of exudyn's SensorUserFunction: fileName, writeToFile, name, storeInternal (here: True) ...

        Raises
        ------
        InputError
            No output has that name.

        Notes
        -----
        Steps are evaluated whenever sensors are written, in smaller blocks than without. In a mechanism these are
        bounds of scope "inputs frozen": what the report has there is known when the run has ended. Numbers cannot say
        that they are not certified, or hold with inputs frozen: a line is printed then, once a run. The report has
        the last word.
        """
        _, out = _named([self], output)
        self.subject.is_live = True
        given = {"name": f"bound of {output}", "storeInternal": True, **options}
        return SensorUserFunction(sensorUserFunction=self._live_bound(out, given["name"]), **given)

    def _live_bound(self, out: Output, sensor: str) -> Callable:
        """The user function of a sensor of a bound.

        Exudyn writes sensors after PostStep, so that this step's row is among those stored. What holds for its
        numbers, which they cannot say, is printed once a run, and when more is known.
        """
        hook, watch, heard = self._hook, self._watch, (0, 0)
        rows = len(out.labels) or (1 if callable(out.rows) else len(np.atleast_2d(out.rows)))  # as far as is known

        def bound(mbs: Any, t: float, sensorNumbers: Any, factors: Any, configuration: Any) -> list[float]:
            nonlocal rows, heard
            hook.evaluate_now()
            found = watch.bounds_at(t).get(out.name)
            if found is None:  # before the first step, which is how Exudyn asks for the size, or bounds have ended
                return [np.inf] * rows
            rows, now = len(found), (len(watch.runs), len(watch.run.doubts()))
            if now != heard and (said := watch.what_numbers_cannot_say()):
                exu.Print(f"exudyn_romerr at t = {t:g}: {sensor!r}: {said}")
            heard = now
            return found.tolist()

        return bound

    @one_thread()
    def report(self, i: int = -1) -> BoundReport:
        """Return the bounds of run i (default: the last), also while it is running.

        Raises
        ------
        RunError
            No run yet, or the hook was replaced by a PostStep function set after attach.
        InputError
            i is not one of the runs.
        Exception
            Whatever stopped the evaluation in the last solve, with its own type.
        """
        self._require_hook()
        runs = self.runs
        if self._watch.error is not None and (i == -1 or not runs):
            raise self._watch.error
        if not runs:
            raise RunError("report was asked before a run; call mbs.SolveDynamic() after attach")
        if not isinstance(i, Integral) or not -len(runs) <= i < len(runs):
            raise InputError(f"i={i!r} is not a run; allowed: {-len(runs)}..{len(runs) - 1}")
        report = runs[i].report()
        if runs[i] is runs[-1]:
            note_end(report, on_purpose(self._mbs.sys.get("dynamicSolver")))
        return report

    def _require_hook(self) -> None:
        if not self._hook.is_in_charge(self._mbs):
            raise RunError(
                "a PostStep function set after attach replaced the monitor's (or mbs.Reset() removed it), so "
                "steps are missing: set yours first, or pass hook=yours to attach. monitor.runs holds what was "
                "bounded until then"
            )


class MechanismMonitor:
    """Bounds and estimates of several bodies of one mbs, and estimates of its other sensors; made by attach.

    Attributes
    ----------
    bodies : tuple of Monitor
        One per body, in the order that attach was given.
    """

    def __init__(self, mbs: Any, bodies: Sequence[Monitor], sensors: Sequence[int] | None):
        self._mbs, self.bodies, self._sensors = mbs, tuple(bodies), sensors

    def __repr__(self) -> str:
        count = f"{len(self.bodies)} bod{'y' if len(self.bodies) == 1 else 'ies'}"
        return f"<MechanismMonitor of {count}; {TO_PRINT}>"

    @property
    def runs(self) -> tuple[tuple[Run | BodyRun, ...], ...]:
        """All runs so far, oldest first: of each one run for every body."""
        return tuple(zip(*(body.runs for body in self.bodies), strict=False))

    @property
    def plan(self) -> Plan:
        """What is computed, what is left out and why, of all bodies and sensors; raises as Monitor.plan does."""
        plans, told = zip(*(body._planned() for body in self.bodies), strict=True)
        if not any(told):
            return joined_plan(plans, [], [(name, NOT_TOLD) for name in self._names()])
        return joined_plan(plans, *planned_sensors(self._mbs, self._numbers()))

    def bound_sensor(self, output: str, /, **options: Any) -> SensorUserFunction:
        """Return a sensor of the bound of one output of a body; see Monitor.bound_sensor."""
        return _named(self.bodies, output)[0].bound_sensor(output, **options)

    @one_thread()
    def report(self, i: int = -1) -> MechanismReport:
        """Return the bounds and estimates of run i (default: the last), also while it is running.

        Raises
        ------
        InputError
            Two outputs have one name; i is not one of the runs.
        RunError, Exception
            As Monitor.report, of the first body that has none.
        """
        reports = [body.report(i) for body in self.bodies]
        runs = (body.runs[i] for body in self.bodies)
        told = next((run.of.told() for run in runs if isinstance(run, BodyRun)), None)
        if told is None:
            return joined(reports, [], [(name, NOT_TOLD) for name in self._names()])
        return joined(reports, told.sensors, [])

    def _numbers(self) -> list[int]:
        """Sensors that are on none of the bodies."""
        subjects = [body.subject for body in self.bodies]
        return other_sensors(
            self._mbs, [one.flex for one in subjects if isinstance(one, MovingSubject)], self._sensors
        )

    def _names(self) -> list[str]:
        names = sensor_names(self._mbs)
        return [names[number] for number in self._numbers()]


def _named(bodies: Sequence[Monitor], output: str) -> tuple[Monitor, Output]:
    """The body that has an output of that name, and the output; InputError if there is none."""
    known = {out.name: (body, out) for body in bodies for out in body.subject.outputs}
    if not known:
        raise InputError(f"bound_sensor({output!r}): {UNNAMED}")
    check_choice("output", output, known)
    return known[output]
