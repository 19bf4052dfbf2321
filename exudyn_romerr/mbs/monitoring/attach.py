"""attach: lets monitors watch bodies along the solves of their mbs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...checks import check_choice
from ...errors import InputError
from ...linear.run.prepare import BoundOptions
from ...process.blas_threads import one_thread
from ..access.reduced_body import ReducedBody
from ..floating.floating_body import FloatingBody
from ..floating.scope_decision import ASKABLE
from .body_monitor import MonitoredBody
from .monitor import MechanismMonitor, Monitor
from .requests import checked_tolerance, make_subject, shares
from .step_hook import shared_hook

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...model.outputs import Output


@one_thread()
def attach(
    mbs: Any,
    flex: ReducedBody | FloatingBody | Sequence[ReducedBody | FloatingBody],
    *,
    outputs: Sequence[Output | int | str | tuple] | None = None,
    initial: Any = None,
    jumps: Sequence[float] = (),
    tolerance: dict[str, float] | float | None = None,
    hook: Callable | None = None,
    estimators: Any = "auto",
    residual: str = "orthonormal",
    kernels: str = "certified",
    time: str = "reconstructed",
    auxiliary_modes: int | str = "auto",
    scope: str = "auto",
) -> Monitor | MechanismMonitor:
    """Bound the error of a reduced body in every following solve of its mbs.

    Before or after mbs.Assemble(). The offline work is done here; steps are gathered by a PostStep function
    that all monitors of the mbs share, and that goes on calling the user's own.

    Parameters
    ----------
    mbs : exudyn MainSystem
    flex : ReducedBody or FloatingBody, or a list of them
        From add_reduced_body or floating_body. A list: one monitor and one report for the mechanism.
    outputs : sequence of Output or sensors, by number or name, optional
        Sensors on mesh nodes of a floating body; they give their output its name. Default: all of displacement,
        position or velocity that are there when a solve begins; in a mechanism, beside those in global axes, "NAME in
        the frame" (velocities have a bound there only). Of a list of bodies: sensors, which find their body,
        and (flex, Output); default: all of these, and all sensors on no flexible body that show motion or forces. The
        latter have an estimate and no bound; those of loads and user functions are left out, see the plan.
    initial : None, ((N,), (N,)) or "equilibrium"
        State that the full model starts from. None: the one given to add_reduced_body, else the span of V.
    jumps : sequence of float
        Times in s at which the inputs jump.
    tolerance : dict or float, optional
        Output name -> value in the output's unit (a float if there is one output). The best bound is
        compared with it at every step; when it is exceeded the solve is stopped, and the report says when. Some steps
        are made before they are compared: the solve stops at the step where a bound that rises no faster than before
        exceeds it, up to 16 steps later where one has been close to it for long, up to 128 where one jumps. In a
        mechanism these are the bounds with inputs frozen; the report at the end is the mechanism's.
    hook : callable, optional
        Your PostStep function (mbs, t) -> bool. One that is set before attach is found by itself.
    estimators, residual, kernels, time, auxiliary_modes
        As in evaluate. In a mechanism with a coupled scope "auto" is "auxiliary" alone, auxiliary_modes counts
        vectors made for the body ("auto": 26, and on top those that deform rigid interfaces), and bounds are of the
        reduction error, whatever time says.
    scope : {"auto", "coupled (linearised)", "inputs frozen"}
        What the bound of a body in a mechanism covers. "auto": the feedback of joints, springs and dampers too, where
        that can be had (all flexible bodies attached, nothing that switches), else, and with "inputs frozen", the
        error under the loads, wrenches and frame motion of the reduced simulation. The report says which, and why.
        In the former there are estimates of all outputs, and bounds in the frames of bodies.

    Returns
    -------
    Monitor, or MechanismMonitor of a list of bodies

    Raises
    ------
    InputError
        Unknown names, wrong shapes, a body attached twice, two different PostStep functions, equal names of outputs.
    AssumptionError
        An assumption of the estimator asked for does not hold for this body.

    Notes
    -----
    Does not cover: loads, joints and connectors on a body made by add_reduced_body (refused when a solve begins); a
    static solver called with storeSolver=False, which cannot be told from a dynamic one.
    """
    options = BoundOptions.of(locals())
    if hook is not None and not callable(hook):
        raise InputError(f"hook={hook!r}; needed: a function (mbs, t) -> bool")
    check_choice("scope", scope, ASKABLE)
    if isinstance(flex, list | tuple):
        return _attach_all(mbs, flex, hook, options, scope)
    subject = make_subject(mbs, flex, options, scope, alone=True)
    watch = MonitoredBody(subject, checked_tolerance(tolerance, [out.name for out in subject.outputs]))
    return Monitor(mbs, shared_hook(mbs, hook, watch), watch)


def _attach_all(mbs: Any, flexes: Sequence, hook: Callable | None, options: BoundOptions, scope: str):
    """One monitor of several bodies; where InputError is raised none is attached."""
    asked, sensors = shares(mbs, flexes, options)
    subjects = [
        make_subject(mbs, flex, replace(options, outputs=outputs, tolerance=tolerance or None), scope, alone=False)
        for flex, (outputs, tolerance) in zip(flexes, asked, strict=True)
    ]
    watches = [MonitoredBody(subject, tolerance) for subject, (_, tolerance) in zip(subjects, asked, strict=True)]
    found = shared_hook(mbs, hook, *watches)
    found.sensors = sensors
    return MechanismMonitor(mbs, [Monitor(mbs, found, watch) for watch in watches], sensors)
