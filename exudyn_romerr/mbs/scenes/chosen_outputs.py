"""Outputs for a scene without sensors: interfaces, and the node of each body that is farthest from them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorMarker, SensorSuperElement

from ...model.outputs import Output, mean_displacement
from ..access.mbs_items import Items
from ..floating.loads_and_joints import MESH_MARKERS, read_interfaces
from ..floating.sensor_outputs import NO_STATE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..floating.floating_body import FloatingBody
    from .found_bodies import FoundBody


def shows_motion(mbs: Any) -> bool:
    """Whether the mbs has a sensor of its state."""
    return any(sensor["sensorType"] not in NO_STATE for sensor in Items(mbs).sensors)


def add_chosen_sensors(mbs: Any, bodies: Sequence[FoundBody]) -> None:
    """Give an mbs without sensors, before it is assembled, those of its bodies' interfaces and farthest nodes."""
    if shows_motion(mbs):
        return
    local = exu.OutputVariableType.DisplacementLocal
    for body in bodies:
        item = mbs.GetObject(body.number)
        x, ends = np.asarray(item["referencePositions"], dtype=float).reshape(-1, 3), []
        for i, marker in enumerate(Items(mbs).markers):
            if marker["markerType"] in MESH_MARKERS and int(marker["bodyNumber"]) == body.number:
                nodes, weights = marker["meshNodeNumbers"], np.asarray(marker["weightingFactors"])
                ends.append(weights @ x[[int(node) for node in nodes]])
                show = exu.OutputVariableType.Displacement
                mbs.AddSensor(SensorMarker(name=f"marker {i} chosen", markerNumber=i, outputVariableType=show))
        far = _farthest(x, ends)
        name = f"{item['name']}, node {far}"
        mbs.AddSensor(
            SensorSuperElement(name=name, bodyNumber=body.number, meshNodeNumber=far, outputVariableType=local)
        )


def _farthest(x: np.ndarray, ends: Sequence[np.ndarray]) -> int:
    """The node of x (nodes, 3) that is farthest from the nearest of some places."""
    ends = ends or [x.mean(axis=0)]
    return int(np.argmax(np.min([np.linalg.norm(x - end, axis=1) for end in ends], axis=0)))


def chosen_outputs(mbs: Any, flex: FloatingBody) -> list[Output]:
    """Return displacements in a body's frame of its interfaces, and of the node that is farthest from them."""
    name = mbs.GetObject(flex.number)["name"] or f"body {flex.number}"
    interfaces = read_interfaces(mbs, flex)
    x = flex.positions
    far = _farthest(x, [motion.weights @ x[motion.nodes] for motion in interfaces.values()])
    shown = [(place, motion.nodes, motion.weights) for place, motion in interfaces.items()]
    return [
        mean_displacement(f"{name}, {place}", nodes=nodes, weights=weights)
        for place, nodes, weights in [*shown, (f"node {far}", [far], None)]
    ]
