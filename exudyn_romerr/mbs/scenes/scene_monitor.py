"""The monitor of all reduced bodies that a script's mbs has when a solve begins."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from ...offline.options import BoundOptions
from ...process.blas_threads import one_thread
from ..access.mbs_items import sensor_name
from ..floating.floating_body import floating_body
from ..monitoring.attach import attach
from ..monitoring.monitor import MechanismMonitor, Monitor
from ..monitoring.requests import make_subject
from ..monitoring.step_hook import StepHook, slot_function
from .chosen_outputs import chosen_outputs
from .found_bodies import NO_FEM

if TYPE_CHECKING:
    from collections.abc import MutableMapping, Sequence

    from ...judgement.solve import Solve
    from ..floating.floating_body import FloatingBody
    from .found_bodies import FoundBody

ATTACHED_BY_SCRIPT = "the script attaches monitors of its own; the answer is theirs"


class Asked(NamedTuple):
    """What a monitor of ours was made for: numbers of all bodies; why some are not watched; chosen outputs or not."""

    numbers: tuple[int, ...]
    refused: tuple[tuple[str, str], ...]
    chosen: bool


@one_thread()
def scene_monitor(mbs: Any, bodies: Sequence[FoundBody], asked: MutableMapping[Any, Asked], solve: Solve) -> Any:
    """Return a monitor of the bodies: the one of the solve before, if these are the same, or a new one.

    Parameters
    ----------
    mbs : exudyn MainSystem
    bodies : those that it has now
    asked : what was asked for each mbs before; an entry is made or replaced
    solve : is told of sensors, bodies that are not watched, and why

    Returns
    -------
    Monitor, MechanismMonitor, or None where no body can be watched.
    """
    solve.sensors = [sensor_name(mbs, i) for i in range(mbs.systemData.NumberOfSensors())]
    numbers, before = tuple(body.number for body in bodies), asked.get(mbs)
    hook = getattr(slot_function(mbs), "hook", None)
    if isinstance(hook, StepHook) and hook.watches:
        if before is None:
            solve.notes.append(ATTACHED_BY_SCRIPT)
            return _monitor_of(mbs, hook)
        if before.numbers == numbers:
            solve.refused, solve.chosen = list(before.refused), before.chosen
            return _monitor_of(mbs, hook)
        mbs.SetPostStepUserFunction(hook.user or 0)
    flexes, solve.refused = _readable(mbs, bodies)
    outputs = chosen_outputs(mbs, flexes)
    solve.chosen = outputs is not None
    asked[mbs] = Asked(numbers, tuple(solve.refused), solve.chosen)
    if not flexes:
        return None
    monitor = attach(mbs, flexes, outputs=outputs)
    slot_function(mbs).hook.is_silent = True  # the answer says it: nothing of ours is printed into a script's output
    return monitor


def _monitor_of(mbs: Any, hook: StepHook) -> Monitor | MechanismMonitor:
    monitors = [Monitor(mbs, hook, watch) for watch in hook.watches]
    return MechanismMonitor(mbs, monitors, hook.sensors[-1]) if hook.sensors else monitors[0]


def _readable(mbs: Any, bodies: Sequence[FoundBody]) -> tuple[list[FloatingBody], list[tuple[str, str]]]:
    """Return the bodies that can be read, and (which, why not) of the others."""
    found = [(body, _flex_or_reason(mbs, body)) for body in bodies]
    refused = [(_named(mbs, body), why) for body, why in found if isinstance(why, str)]
    return [flex for _, flex in found if not isinstance(flex, str)], refused


def _flex_or_reason(mbs: Any, body: FoundBody) -> FloatingBody | str:
    """Return the body as attach wants it, or why it cannot be read."""
    if body.fem is None:
        return NO_FEM
    try:
        flex = floating_body(body.fem, body.items(mbs))
        make_subject(mbs, flex, BoundOptions(outputs=[]), "auto", alone=False)
    except Exception as error:  # whatever it is: the other bodies, and the script, go on
        return str(error)
    return flex


def _named(mbs: Any, body: FoundBody) -> str:
    name = mbs.GetObject(body.number)["name"]
    return f"body {body.number}{name and f' ({name})'}"
