"""Outputs made from existing sensors of a floating body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorMarker, SensorSuperElement

from ...errors import InputError
from ...model.outputs import Output, mean_displacement, nodes_output
from ...report.data import IN_THE_FRAME
from ..access.mbs_items import Items, sensor_names
from .loads_and_joints import MESH_MARKERS, read_interfaces

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .floating_body import FloatingBody

QUANTITIES = {
    exu.OutputVariableType.Displacement: ("displacement", "global"),
    exu.OutputVariableType.Position: ("position", "global"),
    exu.OutputVariableType.Velocity: ("velocity", "global"),
    exu.OutputVariableType.DisplacementLocal: ("displacement", "body"),
    exu.OutputVariableType.VelocityLocal: ("velocity", "body"),
}
NO_STATE = {  # types of sensors that show no state of the mbs, and so have no estimate of their error
    "Load": "it shows a load, not the motion",
    "UserFunction": "a user function is not called away from the run",
}
ELSEWHERE = "attach(mbs, [flex]), with a list, estimates other sensors, those of joint forces too"
KNOWN = ", ".join(quantity.name for quantity in QUANTITIES)
NO_SENSOR = (
    f"no sensor of {KNOWN} on a mesh node of the body; add one, or pass "
    "outputs=[romerr.node_displacement('tip', node=..., component='z')] to attach"
)


@dataclass(frozen=True)
class Measured:
    """What a sensor measures: nodes with weights, displacement, position or velocity, in which axes."""

    name: str
    nodes: tuple[int, ...]
    weights: tuple[float, ...] | None
    of: str
    frame: str

    @property
    def key(self) -> tuple:
        """What it measures, whatever its name."""
        return self.nodes, self.weights, self.of, self.frame

    def in_the_frame(self) -> Measured:
        """Return the displacement or velocity of the same nodes in the body's frame."""
        of = "velocity" if self.of == "velocity" else "displacement"
        return replace(self, name=f"{self.name}{IN_THE_FRAME}", of=of, frame="body")

    def output(self) -> Output:
        """Return the output that shows the same."""
        return nodes_output(self.name, self.nodes, self.weights, "xyz", "", self.of, self.frame)


@dataclass(frozen=True)
class BodySensors:
    """Sensors on mesh nodes of a body: those that can be outputs, and (sensor, why not) of the others."""

    measured: tuple[Measured, ...]
    left_out: tuple[tuple[str, str], ...]

    def in_the_frame_too(self) -> BodySensors:
        """Return all, and what the body's frame sees of nodes whose sensors are in global axes, each once."""
        seen = {item.key for item in self.measured}
        framed = {f.key: f for f in (item.in_the_frame() for item in self.measured if item.frame == "global")}
        added = tuple(item for key, item in framed.items() if key not in seen)
        return BodySensors(self.measured + added, self.left_out)


def asked_sensor(mbs: Any, number: int) -> dict[str, Any]:
    """Return a sensor that was asked for by its number; InputError: there is none."""
    if not 0 <= number < (count := mbs.systemData.NumberOfSensors()):
        raise InputError(f"outputs contains sensor {number}; the mbs has {count} sensors")
    return mbs.GetSensor(number)


def body_sensors(mbs: Any, flex: FloatingBody, alone: bool) -> BodySensors:
    """Return what the sensors on the body measure that the mbs has now; alone: nobody estimates those on none."""
    found, left_out, names = [], [], sensor_names(mbs)
    for number, sensor in enumerate(Items(mbs).sensors):
        body = _body_of(mbs, sensor)
        if body is None and alone and sensor["sensorType"] not in NO_STATE:
            left_out.append((f"sensor {sensor['name']!r}", f"on no flexible body: {ELSEWHERE}"))
        elif body == flex.number:
            try:
                found.append(replace(measured(mbs, flex, number), name=names[number]))
            except InputError as error:
                left_out.append(("output", str(error)))
    return BodySensors(tuple(found), tuple(left_out))


def measured(mbs: Any, flex: FloatingBody, number: int) -> Measured:
    """Return what a sensor measures of the body, under the sensor's name.

    Raises
    ------
    InputError
        No such sensor; one on another body; a quantity that no bound is known for.
    """
    sensor = asked_sensor(mbs, number)
    which, kind = f"sensor {number} ({sensor['name']})", sensor.get("outputVariableType")
    if not is_on(mbs, flex, sensor):
        on = f"object {sensor['bodyNumber']}" if "bodyNumber" in sensor else "something else"
        raise InputError(
            f"{which}, of type {sensor['sensorType']!r}, is on {on}; allowed: "
            f"SensorSuperElement and SensorMarker on mesh nodes of object {flex.number}; {ELSEWHERE}"
        )
    nodes, weights = (sensor.get("meshNodeNumber"),), None
    if sensor["sensorType"] == "Marker":
        marker = mbs.GetMarker(int(sensor["markerNumber"]))
        if np.any(marker.get("offset", 0.0)):
            raise InputError(f"{which} is on a marker with an offset; use one without")
        nodes, weights = marker["meshNodeNumbers"], tuple(map(float, marker["weightingFactors"]))
    if kind not in QUANTITIES:
        raise InputError(
            f"{which} measures {kind.name}; bounds are known for {KNOWN}; for stress and "
            "strain pass romerr.node_stress(name, node=..., fem=fem, material=...) or "
            "romerr.node_strain(name, node=..., fem=fem)"
        )
    return Measured(sensor["name"], tuple(map(int, nodes)), weights, *QUANTITIES[kind])


def other_sensors(mbs: Any, flexes: Sequence[FloatingBody], asked: Sequence[int] | None) -> list[int]:
    """Return which sensors of those asked for, None: of all, show no output of floating bodies, nor a linear body."""
    items = Items(mbs)
    linear = [item for item in items.objects if item["objectType"] == "GenericODE2"]
    nodes = {int(node) for item in linear for node in item["nodeNumbers"]}
    return [
        number
        for number in (range(len(items.sensors)) if asked is None else asked)
        if all(measured_of(mbs, flex, number) is None for flex in flexes)
        and int(items.sensors[number].get("nodeNumber", -1)) not in nodes
    ]


def measured_of(mbs: Any, flex: FloatingBody, number: int) -> Measured | None:
    """Return what a sensor measures of the body; None: nothing, or nothing of its mesh nodes that has a name here."""
    try:
        return measured(mbs, flex, number)
    except InputError:
        return None


def is_on(mbs: Any, flex: FloatingBody, sensor: dict) -> bool:
    """Whether it sees mesh nodes of the body."""
    return _body_of(mbs, sensor) == flex.number


def _body_of(mbs: Any, sensor: dict) -> int | None:
    """The flexible body whose mesh nodes it sees; None: it sees none."""
    if sensor["sensorType"] == "Marker":
        sensor = mbs.GetMarker(int(sensor["markerNumber"]))
        return int(sensor["bodyNumber"]) if sensor["markerType"] in MESH_MARKERS else None
    return int(sensor["bodyNumber"]) if sensor["sensorType"] == "SuperElement" else None


def shows_motion(mbs: Any) -> bool:
    """Whether the mbs has a sensor of its state."""
    return any(sensor["sensorType"] not in NO_STATE for sensor in Items(mbs).sensors)


def add_chosen_sensors(mbs: Any, bodies: Sequence[int]) -> None:
    """Give an mbs without sensors, before it is assembled, those of its bodies' interfaces and farthest nodes."""
    if shows_motion(mbs):
        return
    local = exu.OutputVariableType.DisplacementLocal
    for body in bodies:
        item = mbs.GetObject(body)
        x, ends = np.asarray(item["referencePositions"], dtype=float).reshape(-1, 3), []
        for i, marker in enumerate(Items(mbs).markers):
            if marker["markerType"] in MESH_MARKERS and int(marker["bodyNumber"]) == body:
                nodes, weights = marker["meshNodeNumbers"], np.asarray(marker["weightingFactors"])
                ends.append(weights @ x[[int(node) for node in nodes]])
                show = exu.OutputVariableType.Displacement
                mbs.AddSensor(SensorMarker(name=f"marker {i} chosen", markerNumber=i, outputVariableType=show))
        far = _farthest(x, ends)
        name = f"{item['name']}, node {far}"
        mbs.AddSensor(SensorSuperElement(name=name, bodyNumber=body, meshNodeNumber=far, outputVariableType=local))


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
