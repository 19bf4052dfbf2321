"""Whether bounds of a floating body cover the feedback of its mechanism, and why not (theory.md 7)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import AssumptionError
from ...report.scope import COUPLED, FROZEN, UNATTACHED
from ..access.load_functions import remembering_joints
from ..access.mbs_items import FFRF
from ..control.control_functions import find_controls, is_followed
from ..floating.scope_decision import AUTO, Feedback
from ..memory.memory_search import setters_in

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from ...offline.options import BoundOptions
    from ..floating.floating_body import ReducedMatrices
    from ..floating.scope_decision import Wanted

ONLY = "auxiliary modes react with the mechanism only"
SWITCHING = (
    "ConnectorRollingDiscPenalty",
    "ConnectorReevingSystemSprings",
    "JointSliding",
    "JointSliding2D",
    "JointALEMoving2D",
    "JointRollingDisc",
)
SWITCHES = ("useLimitStops", "dynamicFrictionForce", "staticFrictionOffsetForce")  # parameters
PASSIVE = ("stiffness", "damping")  # parameters that take energy away or keep it, if not negative
STATIC_FIRST = "; without initial=, a solve after SolveStatic starts in the equilibrium of the full mechanism"


def feedback_of(
    mbs: Any, wanted: Wanted, model: ReducedMatrices, static: bool, attached: Collection[int], others: str
) -> Feedback:
    """Return whether the feedback of the mechanism can be covered; others: why other bodies do not.

    Raises
    ------
    AssumptionError
        The coupled scope was asked for and its assumptions do not hold.
    """
    without = next(_no_feedback(mbs, wanted, model), "")
    unknown = next(_refusals(mbs, wanted, static, attached, without), "")
    refusal = others or unknown or next(_refusals_of_bounds(mbs, wanted.options), "")
    if refusal and wanted.scope == COUPLED and not static:
        raise AssumptionError(f"scope={COUPLED!r} cannot be had: {refusal}; or pass scope={FROZEN!r}")
    return Feedback(refusal, without, answers=not unknown and not without)


def _refusals(mbs: Any, wanted: Wanted, static: bool, attached: Collection[int], without: str) -> Iterator[str]:
    """Why neither bound nor estimate can cover the feedback of the mechanism."""
    options = wanted.options
    if static:
        yield "a static solve"
    if options.initial is not None or len(options.jumps):
        yield "initial= and jumps= are covered with frozen inputs only" + (
            STATIC_FIRST if options.initial is not None else ""
        )
    names = _asked(options)
    if "energy" not in names and (without or "auxiliary" not in names):
        yield f"none of the estimators {', '.join(names)} has a coupled bound here" + (
            f" ({without})" if without else ", add 'energy' or 'auxiliary' to estimators="
        )
    objects = [mbs.GetObject(i) for i in range(mbs.systemData.NumberOfObjects())]
    yield from _unattached(objects, attached)
    yield from _switching(objects, attached)
    yield from _controlled(mbs)
    if refused := find_controls(mbs).refused:
        yield "; ".join(refused)


def _refusals_of_bounds(mbs: Any, options: BoundOptions) -> Iterator[str]:
    """Why the bound cannot, where the linearised mechanism is there all the same."""
    watched = [out.name for out in options.outputs if out.frame == "global" and options.watches(out.name)]
    if watched:
        yield (
            f"the tolerance on {', '.join(map(repr, watched))} asks for a bound at every step; of what sees the "
            "motion of the frame there is one after the run only, of velocities none: pass report.assess the "
            "tolerance instead, or give one to node_displacement(..., frame='body') or a sensor of DisplacementLocal"
        )
    for i in range(mbs.systemData.NumberOfObjects()):
        item = mbs.GetObject(i)
        if "markerNumbers" in item and any(np.any(np.asarray(item.get(key, 0.0)) < 0) for key in PASSIVE):
            name = f"object {i} ({item['name']}, {item['objectType']})"
            yield f"{name} has negative stiffness or damping: it may do work on the error"
    if active := find_controls(mbs).active:
        yield "; ".join(active)


def _unattached(objects: list[dict], attached: Collection[int]) -> Iterator[str]:
    reduced = {i: item["name"] for i, item in enumerate(objects) if item["objectType"] == FFRF}
    missing = [f"object {i} ({name})" for i, name in reduced.items() if i not in attached]
    if missing:
        named = ", ".join(missing)
        yield f"{UNATTACHED}, so their errors are not known: {named}; attach them all"


def _switching(objects: list[dict], attached: Collection[int]) -> Iterator[str]:
    """Objects that are no ideal joints, linear springs or dampers, nor attached linear bodies: these see t alone."""
    for i, item in enumerate(objects):
        kind, name = item["objectType"], f"object {i} ({item['name']}, {item['objectType']})"
        if "Contact" in kind or kind in SWITCHING or any(item.get(key) for key in SWITCHES):
            yield f"{name} switches, slides, rolls or rubs: a linearised mechanism does not"
        if item.get("velocityLevel"):
            yield f"{name} constrains velocities, not positions: set velocityLevel=False if that is the same motion"
        functions = [key for key in item if _controls(key) and item[key]]
        if functions and not (kind == "GenericODE2" and i in attached) and not is_followed(item):
            yield f"{name} has {', '.join(functions)}: a controller may do work on the error"


def _controlled(mbs: Any) -> Iterator[str]:
    """What else than objects may switch, follow or control."""
    system = mbs.systemData
    if system.DataSize() or mbs.NumberOfGeneralContacts():
        yield "data coordinates of the mbs (contact, friction, hysteresis) switch: a linearised mechanism does not"
    if system.ODE1Size():
        yield "the mbs has ODE1 coordinates (hydraulics, controllers), which may do work on the error"
    if before_steps := mbs.GetPreStepUserFunction():
        yield _of_pre_step(before_steps["function"])
    for i in range(system.NumberOfLoads()):
        load = mbs.GetLoad(i)
        if load.get("bodyFixed"):
            yield f"load {i} ({load['name']}) turns with its body (bodyFixed)"
    if joints := remembering_joints(mbs):
        called = (
            "depend on earlier calls, so they cannot be called away from the run: make them functions of time alone"
        )
        yield f"offsets of {', '.join(joints)} {called}"


def _of_pre_step(function: Callable) -> str:
    name = getattr(function, "__qualname__", type(function).__qualname__)
    calls = ", ".join(sorted(setters_in([function])))
    return (
        f"the PreStep user function {name} {f'calls {calls} and ' if calls else ''}may change the mechanism or its "
        "loads before any step, otherwise with other steps or modes: romerr verify measures that. Covered is a "
        "smooth controller that is the user function of a spring in the joint (springTorqueUserFunction, "
        "springForceUserFunction), which is asked when errors move the mechanism, too"
    )


def _asked(options: BoundOptions) -> list[str]:
    """Estimators that were asked for, of those that a coupled bound is known of if that was left open."""
    asked = options.estimators
    if asked == AUTO:
        return ["energy", "auxiliary"]
    return [asked] if isinstance(asked, str) else list(asked)


def _controls(key: str) -> bool:
    """Whether a parameter is a user function that forces may come from; offsets are motion prescribed over time."""
    return key.endswith("UserFunction") and "graphics" not in key and key != "offsetUserFunction"


def _no_feedback(mbs: Any, wanted: Wanted, model: ReducedMatrices) -> Iterator[str]:
    """Why auxiliary vectors cannot react with the mechanism."""
    if model.frame.size != 7:
        yield f"{ONLY} if frames have Euler parameters, the default (leave out rigidBodyNodeType=)"
    solver = mbs.sys.get("dynamicSolver")
    if solver is not None and not hasattr(solver, "newmarkBeta"):
        yield f"{ONLY} under an implicit solver, which has accelerations: leave out solverType="
    if "auxiliary" not in _asked(wanted.options):
        yield "estimator 'auxiliary' was not asked for, add it to estimators="
