"""Existing sensors of a floating body as outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np

from ..errors import InputError
from ..outputs import Output, nodes_output
from .actions import MESH_MARKERS

if TYPE_CHECKING:
    from .floating import FloatingBody

UNITS = {"velocity": "m/s"}
QUANTITIES = {
    exu.OutputVariableType.Displacement: ("displacement", "global"),
    exu.OutputVariableType.Position: ("position", "global"),
    exu.OutputVariableType.Velocity: ("velocity", "global"),
    exu.OutputVariableType.DisplacementLocal: ("displacement", "body"),
    exu.OutputVariableType.VelocityLocal: ("velocity", "body"),
}


def sensor_output(mbs: Any, flex: FloatingBody, number: int) -> Output:
    """Return what a sensor measures of the body, under the sensor's name.

    Raises
    ------
    InputError
        No such sensor; one on another body; a quantity that no bound is known for.
    """
    if not 0 <= number < mbs.systemData.NumberOfSensors():
        raise InputError(f"outputs contains sensor {number}; the mbs has {mbs.systemData.NumberOfSensors()} sensors")
    sensor = mbs.GetSensor(number)
    nodes, weights = _nodes(mbs, flex, number, sensor)
    kind = sensor["outputVariableType"]
    if kind not in QUANTITIES:
        raise InputError(
            f"sensor {number} ({sensor['name']}) measures {kind.name}; bounds are known for "
            f"{', '.join(quantity.name for quantity in QUANTITIES)}; for stress and strain pass "
            "romerr.node_stress(name, node=..., fem=fem, material=...) or romerr.node_strain(name, node=..., fem=fem)"
        )
    of, frame = QUANTITIES[kind]
    return nodes_output(sensor["name"], nodes, weights, "xyz", UNITS.get(of, "m"), of, frame)


def _nodes(mbs: Any, flex: FloatingBody, number: int, sensor: dict) -> tuple[list[int], list[float] | None]:
    """Nodes and weights that the sensor sees."""
    if sensor["sensorType"] == "SuperElement" and int(sensor["bodyNumber"]) == flex.number:
        return [int(sensor["meshNodeNumber"])], None
    if sensor["sensorType"] == "Marker":
        marker = mbs.GetMarker(int(sensor["markerNumber"]))
        if np.any(marker.get("offset", 0.0)):
            raise InputError(f"sensor {number} ({sensor['name']}) is on a marker with an offset; use one without")
        if marker["markerType"] in MESH_MARKERS and int(marker["bodyNumber"]) == flex.number:
            return list(marker["meshNodeNumbers"]), list(marker["weightingFactors"])
    on = f"object {sensor['bodyNumber']}" if "bodyNumber" in sensor else "something else"
    raise InputError(
        f"sensor {number} ({sensor['name']}), of type {sensor['sensorType']!r}, is on {on}; allowed: "
        f"SensorSuperElement and SensorMarker on mesh nodes of object {flex.number}"
    )
