"""Names of sensors among the outputs that attach is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...errors import InputError
from ...report.data import IN_THE_FRAME
from ..floating.floating_body import FloatingBody
from ..floating.sensor_outputs import framed_output, is_on

WITHOUT = "romerr.node_displacement({!r}, node=..., component='z')"
OF_NODES = "romerr.mean_displacement({!r}, nodes=...)"
OF_SET = "romerr.mean_displacement({!r}, nodes={}['NodeNumbers'], weights={}['NodeWeights'])"


def without_names(mbs: Any, flexes: Sequence, outputs: Any) -> Any:
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
        return bodies[0], framed_output(mbs, bodies[0], of[0])
    sensors = ", ".join(f"{i} {mbs.GetSensor(i)['name']!r}" for i in range(mbs.systemData.NumberOfSensors()))
    has = f"the mbs has sensors {sensors}" if sensors else "the mbs has no sensors yet, add them before attach"
    raise InputError(f"outputs names {name!r}, and no sensor is called so; {has}; {_instead(flexes, name)}")


def _instead(flexes: Sequence, name: str) -> str:
    """What to write where there is no sensor: of a node set of the fem, or of nodes."""
    for flex in flexes:
        for i, node_set in enumerate(flex.fem.nodeSets if isinstance(flex, FloatingBody) else ()):
            if node_set.get("Name") == name:
                return f"{name!r} is a node set of the fem: pass {OF_SET.format(name, *2 * [f'fem.nodeSets[{i}]'])}"
    return f"without a sensor pass {WITHOUT.format(name)} or {OF_NODES.format(name)}"


def _number(mbs: Any, name: str) -> list[int]:
    """The number of the sensor of that name, in a list, which is empty if there is none."""
    found = [i for i in range(mbs.systemData.NumberOfSensors()) if mbs.GetSensor(i)["name"] == name]
    if len(found) > 1:
        numbers = ", ".join(map(str, found))
        raise InputError(f"outputs names {name!r}, which sensors {numbers} are called: pass the number of one")
    return found
