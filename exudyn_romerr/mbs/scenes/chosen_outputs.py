"""Outputs for a scene without sensors: interfaces, and the node of each body that is farthest from them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...model.outputs import Output, mean_displacement, node_displacement
from ..floating.loads_and_joints import read_interfaces
from ..sensors.sensor_dependence import NO_STATE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..floating.floating_body import FloatingBody


def chosen_outputs(mbs: Any, flexes: Sequence[FloatingBody]) -> list[tuple[FloatingBody, Output]] | None:
    """Return (body, output) for all bodies; None where the mbs has sensors that show the motion: these are meant."""
    system = mbs.systemData
    kinds = (mbs.GetSensor(i)["sensorType"] for i in range(system.NumberOfSensors()))
    if any(kind not in NO_STATE for kind in kinds):
        return None
    return [(flex, output) for flex in flexes for output in _of_body(mbs, flex)]


def _of_body(mbs: Any, flex: FloatingBody) -> list[Output]:
    name = mbs.GetObject(flex.number)["name"] or f"body {flex.number}"
    interfaces = read_interfaces(mbs, flex)
    found = [
        mean_displacement(f"{name}, {place}", nodes=motion.nodes.tolist(), weights=motion.weights.tolist())
        for place, motion in interfaces.items()
    ]
    x = flex.positions
    ends = [motion.weights @ x[motion.nodes] for motion in interfaces.values()] or [x.mean(axis=0)]
    far = int(np.argmax(np.min([np.linalg.norm(x - end, axis=1) for end in ends], axis=0)))
    return [*found, node_displacement(f"{name}, node {far}", node=far)]
