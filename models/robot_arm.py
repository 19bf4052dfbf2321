"""A robot arm as users of Exudyn write it: hub, flexible link, payload, a PD controller in a PreStep function.

The controller sets the motor's torque once a step, by sensors at the step's begin and the set point at its end, the
time that Exudyn gives it. So the step moves the payload by millimetres, where missing modes move it by nanometres
(tests/mbs/control/test_prestep_robot.py). Called once in a millisecond it is stable with shorter steps, too.
"""

from __future__ import annotations

from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import ObjectFFRFreducedOrderInterface
from exudyn.utilities import InertiaCuboid, InertiaCylinder

from models.floating import add_interface_marker, craig_bampton, interface, solver_settings
from models.hex_bar import hex_bar
from models.mechanisms import MechanismScene, join

SIZE = (0.6, 0.03, 0.04)  # m, of the link
ALUMINIUM = (7e10, 2700.0, 0.33)  # N/m^2, kg/m^3, Poisson's ratio
DAMPING = 1e-4  # s, stiffness-proportional
TURN, MOVE = np.pi / 2, 0.4  # rad, s: a quarter of a turn, after which the arm has to stand
P, D = 3000.0, 60.0  # Nm/rad, Nms/rad
WELD, HINGE = [1, 1, 1, 1, 1, 1], [1, 1, 1, 1, 1, 0]  # the hinge's axis is z


def set_point(t: float) -> tuple[float, float, float]:
    """Angle, rate and acceleration that are wanted, in rad and s: a cycloid."""
    s, w = min(t / MOVE, 1.0), 2 * np.pi
    speed = TURN / MOVE
    return TURN * (s - np.sin(w * s) / w), speed * (1 - np.cos(w * s)), speed * w / MOVE * np.sin(w * s)


def robot_arm(n: int = 8, kind: str = "RBE3", h: float = 1e-3, t_end: float = 0.5) -> MechanismScene:
    """Return the arm, at rest along x, which its motor turns by a quarter about z.

    n, kind : eigenmodes beside the static ones, see floating.craig_bampton; h, t_end : step, that of the controller
    too, and end time in s. objects: "hub", "payload", "motor shaft", welds. sensors: "tip", position of a mesh node;
    "tip in the link", its displacement in the link's frame; "payload", position; "angle", "rate" of the hub.
    """
    fem = hex_bar(8, SIZE, ALUMINIUM)
    craig_bampton(fem, ("left", "right"), n, kind)
    SC = exu.SystemContainer()
    scene = MechanismScene(SC, SC.AddSystem(), fem, ObjectFFRFreducedOrderInterface(fem), solver_settings(h, t_end))
    mbs = scene.mbs
    scene.bodies = (scene.cms.AddObjectFFRFreducedOrder(mbs, stiffnessProportionalDamping=DAMPING),)
    rigid = {"hub": InertiaCylinder(7800.0, 0.06, 0.1, axis=2), "payload": InertiaCuboid(7800.0, [0.07] * 3)}
    for (name, inertia), side in zip(rigid.items(), ("left", "right"), strict=True):
        _add_rigid(scene, name, inertia, side)
    ground = mbs.CreateGround(referencePosition=_centre(fem, "left"))
    scene.markers["ground"] = mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=ground))
    join(scene, "motor shaft", scene.markers["ground"], scene.markers["hub"], HINGE)
    _add_sensors(scene)
    _add_controller(scene, _inertia(rigid))
    return scene


def _centre(fem: Any, side: str) -> np.ndarray:
    nodes, weights = interface(fem, side)
    return weights @ fem.GetNodePositionsAsArray()[nodes]


def _add_rigid(scene: MechanismScene, name: str, inertia: Any, side: str) -> None:
    """Weld a rigid body to a face of the link."""
    mbs, link = scene.mbs, scene.bodies[0]["oFFRFreducedOrder"]
    body = mbs.CreateRigidBody(name=name, referencePosition=_centre(scene.fem, side), inertia=inertia)
    scene.objects[name] = body
    scene.markers[name] = mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=body))
    scene.markers[side] = add_interface_marker(mbs, link, *interface(scene.fem, side))
    join(scene, f"weld of the {name}", scene.markers[name], scene.markers[side], WELD)


def _inertia(rigid: dict[str, Any]) -> float:
    """Moment of inertia in kg m^2 about the shaft of all that turns, the link as a thin rod: for the feed forward."""
    length, mass = SIZE[0], ALUMINIUM[1] * np.prod(SIZE)
    turned = sum(inertia.GetInertia6D()[2] for inertia in rigid.values())
    return float(turned + rigid["payload"].Mass() * length**2 + mass * length**2 / 3)


def _add_sensors(scene: MechanismScene) -> None:
    shows, link = exu.OutputVariableType, scene.bodies[0]["oFFRFreducedOrder"]
    node = int(interface(scene.fem, "tip")[0][0])
    of_node, of_body = itemInterface.SensorSuperElement, itemInterface.SensorBody
    at_tip = {"bodyNumber": link, "meshNodeNumber": node}
    for name, kind, variable, place in (
        ("tip", of_node, shows.Position, at_tip),
        ("tip in the link", of_node, shows.DisplacementLocal, at_tip),
        ("payload", of_body, shows.Position, {"bodyNumber": scene.objects["payload"]}),
        ("angle", of_body, shows.Rotation, {"bodyNumber": scene.objects["hub"]}),
        ("rate", of_body, shows.AngularVelocity, {"bodyNumber": scene.objects["hub"]}),
    ):
        sensor = kind(name=name, outputVariableType=variable, storeInternal=True, **place)
        scene.sensors[name] = scene.mbs.AddSensor(sensor)


def _add_controller(scene: MechanismScene, inertia: float) -> None:
    """Add the motor's torque, and the function that sets it before every step."""
    motor = scene.mbs.AddLoad(
        itemInterface.LoadTorqueVector(name="motor", markerNumber=scene.markers["hub"], loadVector=[0, 0, 0])
    )

    def controller(mbs: Any, t: float) -> bool:
        angle, rate, acceleration = set_point(t)
        found, found_rate = (mbs.GetSensorValues(scene.sensors[name])[2] for name in ("angle", "rate"))
        torque = inertia * acceleration + P * (angle - found) + D * (rate - found_rate)
        mbs.SetLoadParameter(motor, "loadVector", [0.0, 0.0, torque])
        return True

    scene.mbs.SetPreStepUserFunction(controller)
