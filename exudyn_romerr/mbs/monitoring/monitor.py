"""attach and Monitor: bounds beside an Exudyn simulation."""

from __future__ import annotations

from numbers import Integral
from typing import TYPE_CHECKING, Any

from ...checks import check_choice
from ...errors import InputError, RunError
from ...offline.options import BoundOptions
from ..floating.scope_decision import ASKABLE
from .body_monitor import Watch
from .live_output import sensor_of
from .requests import UNNAMED, checked_tolerance, make_subject
from .step_hook import StepHook, shared_hook

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from exudyn.itemInterface import SensorUserFunction

    from ...model.outputs import Output
    from ...online.run import Run
    from ...online.static_run import StaticRun
    from ...report.report import BoundReport
    from ..access.linear_adapter import LinearSubject
    from ..access.reduced_body import ReducedBody
    from ..floating.floating_body import FloatingBody
    from .floating_adapter import MovingSubject


class Monitor:
    """Bounds of one body along every solve of its mbs; made by attach.

    Attributes
    ----------
    runs : tuple of Run or StaticRun
        One per solve, oldest first, up to the last accepted step. Never raises: what was bounded stays
        reachable here when report() refuses. Each has report() and messages.
    plan
        What is computed, what is left out and why; print it.
    """

    def __init__(self, mbs: Any, hook: StepHook, watch: Watch):
        self._mbs, self._hook, self._watch = mbs, hook, watch

    @property
    def subject(self) -> LinearSubject | MovingSubject:
        """The body as the solves see it."""
        return self._watch.subject

    @property
    def runs(self) -> tuple[Run | StaticRun, ...]:
        """All runs so far."""
        self._hook.flush()
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
        self._require_hook()
        if not self._mbs.systemIsConsistent:
            raise RunError("plan was asked before mbs.Assemble(); call it first")
        self._hook.flush()  # what was stored so far belongs to what was read before
        return self._hook.read(self._mbs, self._watch).plan

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
        Steps are evaluated whenever sensors are written, in smaller blocks than without.
        """
        outputs = {out.name: out for out in self._watch.subject.outputs}
        if not outputs:
            raise InputError(f"bound_sensor({output!r}): {UNNAMED}")
        check_choice("output", output, outputs)
        return sensor_of(self._hook.look, self._watch, outputs[output], options)

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
        return runs[i].report()

    def _require_hook(self) -> None:
        if not self._hook.is_in_charge(self._mbs):
            raise RunError(
                "a PostStep function set after attach replaced the monitor's (or mbs.Reset() removed it), so "
                "steps are missing: set yours first, or pass hook=yours to attach. monitor.runs holds what was "
                "bounded until then"
            )


def attach(
    mbs: Any,
    flex: ReducedBody | FloatingBody,
    *,
    outputs: Sequence[Output | int] | None = None,
    initial: Any = None,
    jumps: Sequence[float] = (),
    tolerance: dict[str, float] | float | None = None,
    hook: Callable | None = None,
    estimators: Any = "auto",
    residual: str = "orthonormal",
    kernels: str = "certified",
    time: str = "reconstructed",
    auxiliary_modes: int | str = "auto",
    midpoint_residual: bool = True,
    scope: str = "auto",
) -> Monitor:
    """Bound the error of a reduced body in every following solve of its mbs.

    Before or after mbs.Assemble(). The offline work is done here; steps are gathered by a PostStep function
    that all monitors of the mbs share, and that goes on calling the user's own.

    Parameters
    ----------
    mbs : exudyn MainSystem
    flex : ReducedBody or FloatingBody
        From add_reduced_body or floating_body.
    outputs : sequence of Output or sensor numbers, optional
        Sensors on mesh nodes of a floating body; they give their output its name. Default: all of displacement,
        position or velocity that are there when a solve begins; in a mechanism, beside those in global axes, "NAME in
        the frame", which have a bound.
    initial : None, ((N,), (N,)) or "equilibrium"
        State that the full model starts from. None: the one given to add_reduced_body, else the span of V.
    jumps : sequence of float
        Times in s at which the inputs jump.
    tolerance : dict or float, optional
        Output name -> value in the output's unit (a float if there is one output). The best bound is
        compared with it at every step; when it is exceeded the solve is stopped, and the report says when. One on an
        output in global axes of a mechanism asks for the scope "inputs frozen", which alone has a bound for it.
    hook : callable, optional
        Your PostStep function (mbs, t) -> bool. One that is set before attach is found by itself.
    estimators, residual, kernels, time, auxiliary_modes
        As in evaluate. In a mechanism with a coupled scope "auto" is "auxiliary" alone, auxiliary_modes counts
        vectors made for the body ("auto": 20), and bounds are of the reduction error, whatever time says.
    midpoint_residual : bool
        Whether the estimate of the error by time steps in a mechanism takes into account what loads do between
        samples: Exudyn's equations are evaluated in the middle of every step.
    scope : {"auto", "coupled (linearised)", "inputs frozen"}
        What the bound of a body in a mechanism covers. "auto": the feedback of joints, springs and dampers too, where
        that can be had (all flexible bodies attached, nothing that switches), else, and with "inputs frozen", the
        error under the loads, wrenches and frame motion of the reduced simulation. The report says which, and why.
        Outputs in global axes have a bound in the latter, in the former an estimate of their error.

    Returns
    -------
    Monitor

    Raises
    ------
    InputError
        Unknown names, wrong shapes, a body attached twice, two different PostStep functions.
    AssumptionError
        An assumption of the estimator asked for does not hold for this body.

    Notes
    -----
    Does not cover: loads, joints and connectors on a body made by add_reduced_body (refused when a solve begins); a
    static solver called with storeSolver=False, which cannot be told from a dynamic one.
    """
    if hook is not None and not callable(hook):
        raise InputError(f"hook={hook!r}; needed: a function (mbs, t) -> bool")
    options = BoundOptions(
        outputs=outputs,
        initial=initial,
        jumps=jumps,
        estimators=estimators,
        residual=residual,
        kernels=kernels,
        time=time,
        auxiliary_modes=auxiliary_modes,
        midpoint_residual=midpoint_residual,
        tolerance=tolerance,
    )
    check_choice("scope", scope, ASKABLE)
    if not isinstance(midpoint_residual, bool):
        raise InputError(f"midpoint_residual={midpoint_residual!r}; needed: True or False")
    subject = make_subject(mbs, flex, options, scope)
    watch = Watch(subject, checked_tolerance(tolerance, [out.name for out in subject.outputs]))
    return Monitor(mbs, shared_hook(mbs, hook, watch), watch)
