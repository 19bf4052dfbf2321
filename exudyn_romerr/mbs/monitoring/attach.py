"""attach: lets monitors watch bodies along the solves of their mbs."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from numbers import Integral, Real
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np
from numpy.typing import ArrayLike

from ...checks import check_choice, check_count, check_type
from ...errors import InputError
from ...linear.residual.kernels import KERNELS
from ...linear.residual.problem import checked_outputs
from ...linear.residual.residual import RESIDUALS
from ...linear.run.prepare import TIMES, BoundOptions, checked_names
from ...model.outputs import Output
from ...process.blas_threads import one_thread
from ...report.data import IN_THE_FRAME
from ...report.mechanism_report import check_names
from ..access.mbs_items import Items
from ..access.reduced_body import LinearSubject, ReducedBody
from ..floating.built_in import as_built_in
from ..floating.floating_body import FloatingBody, read_object
from ..floating.moving_subject import ASKABLE, MovingSubject
from ..floating.reference_search import require_still_interface
from ..floating.sensor_outputs import asked_sensor, is_on, measured
from .body_monitor import MonitoredBody
from .monitor import UNNAMED, MechanismMonitor, Monitor
from .step_hook import shared_hook

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence


def make_subject(
    mbs: Any, flex: ReducedBody | FloatingBody, options: BoundOptions, scope: str, alone: bool
) -> LinearSubject | MovingSubject:
    """Return the body as a watch sees it; sensors among the outputs are replaced by outputs.

    alone : whether its monitor is of no mechanism, which would have the sensors on no flexible body, too.
    """
    if isinstance(flex, FloatingBody):
        return MovingSubject(flex, _of_floating(mbs, flex, options), scope, alone)
    if not isinstance(flex, ReducedBody):
        raise InputError(f"flex is a {type(flex).__name__}; needed: what add_reduced_body or floating_body returned")
    if flex.mbs is not mbs:
        raise InputError("flex was added to another mbs than the one passed to attach; pass flex.mbs")
    return _linear(flex, options)


def shares(mbs: Any, flexes: Sequence, options: BoundOptions) -> tuple[list[tuple], list[int] | None]:
    """Return (outputs, tolerance) of every body, and the sensors that are on none; None: all that the mbs has."""
    if not flexes:
        raise InputError("flex is an empty list; needed: at least one body")
    _check_once(flexes)
    asked, others = [None if isinstance(flex, FloatingBody) else [] for flex in flexes], None
    names: list[list[str]] = [[] for _ in flexes]
    if options.outputs is not None:
        asked, others, places = [[] for _ in flexes], [], []
        for i, out, name in _entries(mbs, flexes, options.outputs):
            (others if i is None else asked[i]).append(out)
            places.append(("a sensor on no flexible body" if i is None else f"flex[{i}]", name))
            if i is not None:
                names[i].append(name)
        check_names(places)
    known = checked_tolerance(options.tolerance, [name for of in names for name in of])
    return [(out, {k: v for k, v in known.items() if k in of}) for out, of in zip(asked, names, strict=True)], others


def _check_once(flexes: Sequence) -> None:
    """InputError if two of a list are the same object of the mbs."""
    places: dict[int, int] = {}
    for i, flex in enumerate(flexes):
        number = flex.number if isinstance(flex, FloatingBody) else getattr(flex, "items", {}).get("oGenericODE2")
        if number is not None and places.setdefault(int(number), i) != i:
            raise InputError(f"flex[{places[number]}] and flex[{i}] are the same body, object {number}; list it once")


def _entries(mbs: Any, flexes: Sequence, outputs: Any) -> Iterator[tuple[int | None, Any, str]]:
    """Number of the body, None: none, output or sensor number, and its name, of every entry of outputs."""
    if not isinstance(outputs, list | tuple | str):
        raise InputError(f"outputs is a {type(outputs).__name__}; needed: a list of sensors and (flex, output)")
    for out in _without_names(mbs, flexes, outputs):
        if isinstance(out, Integral | exu.SensorIndex):
            sensor = asked_sensor(mbs, int(out))
            on = (i for i, f in enumerate(flexes) if isinstance(f, FloatingBody) and is_on(mbs, f, sensor))
            yield next(on, None), int(out), sensor["name"]
        elif isinstance(out, tuple) and len(out) == 2 and any(out[0] is flex for flex in flexes):
            check_type("an output of (flex, output)", out[1], Output)
            yield next(i for i, flex in enumerate(flexes) if flex is out[0]), out[1], out[1].name
        else:
            raise InputError(
                f"an entry of outputs is a {type(out).__name__}; of several bodies: a sensor's number or name, or "
                "(flex, output) with one of the bodies"
            )


def _linear(flex: ReducedBody, options: BoundOptions) -> LinearSubject:
    """Everything is known already: the offline work is done now."""
    outputs = options.outputs
    for out in [outputs] if isinstance(outputs, str) else outputs if isinstance(outputs, list | tuple) else ():
        if isinstance(out, Integral | exu.SensorIndex | str):
            found = repr(out) if isinstance(out, str) else f"sensor {int(out)}"
            name = out if isinstance(out, str) else "tip"
            raise InputError(
                f"outputs contains {found}; a sensor on NodeGenericODE2 shows reduced coordinates, no output of the "
                f"full model: pass romerr.Output({name!r}, rows) or romerr.node_displacement({name!r}, node=..., "
                "component='z') instead"
            )
    if outputs is None:
        raise InputError(
            "outputs is missing: sensors cannot tell what to bound of a body made by add_reduced_body; pass "
            "outputs=[romerr.node_displacement('tip', node=..., component='z')], romerr.Output(name, rows), or []"
        )
    initial = flex.initial if options.initial is None else options.initial
    return LinearSubject(flex, replace(options, initial=initial))


def _of_floating(mbs: Any, flex: FloatingBody, options: BoundOptions) -> BoundOptions:
    """Options with outputs for sensors; joints and loads may still be added: what is known now is checked now."""
    model = read_object(as_built_in(mbs, [flex]), flex)
    if flex.interfaces == "rigid":
        require_still_interface(flex, model.V)
    outputs = _without_names(mbs, [flex], options.outputs)
    if isinstance(outputs, list | tuple):
        outputs = [out[1] if isinstance(out, tuple) and len(out) == 2 and out[0] is flex else out for out in outputs]
        sensors = [isinstance(out, Integral | exu.SensorIndex) for out in outputs]
        outputs = [measured(mbs, flex, int(o)).output() if s else o for o, s in zip(outputs, sensors, strict=True)]
    outputs = outputs if outputs is None else checked_outputs(outputs)
    mesh = SimpleNamespace(positions=flex.positions, N=flex.positions.size, dofs_per_node=3)
    for out in outputs or ():
        with suppress(AttributeError):  # a user's own function of the body, which is not known yet
            out.resolve(mesh)
    for name, known in (("residual", RESIDUALS), ("kernels", KERNELS), ("time", TIMES)):
        check_choice(name, getattr(options, name), known)
    if options.auxiliary_modes != "auto":
        check_count("auxiliary_modes", options.auxiliary_modes, flex.positions.size, "coordinates; or 'auto'")
    asked = options.estimators
    if not isinstance(asked, str) or asked != "auto":
        checked_names(asked)
    return replace(options, outputs=outputs)


def _without_names(mbs: Any, flexes: Sequence, outputs: Any) -> Any:
    """Return outputs with the number of the sensor, or (body, output), in place of each name; a name alone is a list.

    What the report calls "NAME in the frame" is known, too.

    Raises
    ------
    InputError
        No sensor has that name, or several have.
    """
    outputs = [outputs] if isinstance(outputs, str) else outputs
    if not isinstance(outputs, list | tuple):
        return outputs
    return [_meant(mbs, flexes, out) if isinstance(out, str) else out for out in outputs]


def _meant(mbs: Any, flexes: Sequence, name: str) -> Any:
    if found := _number(mbs, name):
        return found[0]
    of = _number(mbs, name.removesuffix(IN_THE_FRAME)) if name.endswith(IN_THE_FRAME) else []
    sensor = mbs.GetSensor(of[0]) if of else None
    bodies = [flex for flex in flexes if sensor and isinstance(flex, FloatingBody) and is_on(mbs, flex, sensor)]
    if bodies:
        return bodies[0], measured(mbs, bodies[0], of[0]).in_the_frame().output()
    sensors = ", ".join(f"{i} {sensor['name']!r}" for i, sensor in enumerate(Items(mbs).sensors))
    has = f"the mbs has sensors {sensors}" if sensors else "the mbs has no sensors yet, add them before attach"
    raise InputError(f"outputs names {name!r}, and no sensor is called so; {has}; {_instead(flexes, name)}")


def _instead(flexes: Sequence, name: str) -> str:
    """What to write where there is no sensor: of a node set of the fem, or of nodes."""
    for flex in flexes:
        for i, node_set in enumerate(flex.fem.nodeSets if isinstance(flex, FloatingBody) else ()):
            if node_set.get("Name") == name:
                of = f"nodes=fem.nodeSets[{i}]['NodeNumbers'], weights=fem.nodeSets[{i}]['NodeWeights']"
                return f"{name!r} is a node set of the fem: pass romerr.mean_displacement({name!r}, {of})"
    return (
        f"without a sensor pass romerr.node_displacement({name!r}, node=..., component='z') or "
        f"romerr.mean_displacement({name!r}, nodes=...)"
    )


def _number(mbs: Any, name: str) -> list[int]:
    """The number of the sensor of that name, in a list, which is empty if there is none."""
    found = [i for i, sensor in enumerate(Items(mbs).sensors) if sensor["name"] == name]
    if len(found) > 1:
        numbers = ", ".join(map(str, found))
        raise InputError(f"outputs names {name!r}, which sensors {numbers} are called: pass the number of one")
    return found


def checked_tolerance(tolerance: Any, names: Sequence[str], for_each: bool = False) -> dict[str, float]:
    """Return output -> tolerance, empty if there is none; InputError unless they are positive, of known outputs.

    for_each: one number is meant for every output, as a share of its own size is.
    """
    if tolerance is None:
        return {}
    if not names:
        raise InputError(f"tolerance={tolerance!r}: {UNNAMED}")
    if isinstance(tolerance, Real):
        if len(names) != 1 and not for_each:
            raise InputError(f"tolerance={tolerance!r} for {len(names)} outputs; pass a dict name -> value")
        tolerance = dict.fromkeys(names, tolerance)
    if not isinstance(tolerance, dict):
        raise InputError(f"tolerance={tolerance!r}; needed: a dict name -> value (or a float if one output)")
    for name, limit in tolerance.items():
        if name not in names:
            raise InputError(f"tolerance names {name!r}; allowed: {', '.join(map(repr, names))}")
        if not isinstance(limit, Real) or not 0 < limit < np.inf:
            raise InputError(f"tolerance[{name!r}]={limit!r}; needed: a positive finite number")
    return {name: float(limit) for name, limit in tolerance.items()}


@one_thread()
def attach(
    mbs: Any,
    flex: ReducedBody | FloatingBody | Sequence[ReducedBody | FloatingBody],
    *,
    outputs: Sequence[Output | int | str | tuple] | None = None,
    initial: Any = None,
    jumps: ArrayLike = (),
    tolerance: Mapping[str, float] | float | None = None,
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
