"""A loader crane as users of Exudyn write it: flexible boom, rigid stick, two cylinders, a payload on a rope.

The boom of models/boom_mesh.py is hinged to the ground, the stick to its tip; all hinges are along y. Pressures of
the cylinders are coordinates of first order; a PreStep function opens their valves by what their lengths lack. The
crane begins at rest: distances hold it in a static solve, and their forces give the first pressures.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import ObjectFFRFreducedOrderInterface
from exudyn.utilities import RigidBodyInertia

from models.boom_mesh import MOUNTS, boom_fem
from models.floating import GRAVITY, craig_bampton, interface, solver_settings
from models.mechanisms import HINGE, MechanismScene, join

HINGED = ("hinge", "tip")  # mounts of hinges, which turn things; cylinders pull and push
DAMPING = 1e-4  # s, stiffness-proportional
BASE = np.array([0.3, 0.0, -0.9])  # m, where the first cylinder stands
STICK, STICK_LENGTH = 120.0, 1.6  # kg, m
SLOPE = np.array([0.8, 0.0, -0.6])  # of the stick
LEVER = np.array([-0.2, 0.0, 0.3])  # m, from the stick's hinge to where the second cylinder pulls
PAYLOAD, ROPE = 500.0, 1.5  # kg, m
ROPE_STIFFNESS, ROPE_DAMPING = 2e5, 500.0  # N/m, Ns/m
CYLINDERS = {"first": (7.9e-3, 5.0e-3), "second": (5.0e-3, 3.5e-3)}  # m^2 at head and rod
MOVES = {"first": 0.1, "second": -0.06}  # m, by which they get longer
MOVE = 1.0  # s
BULK, HOSE, DAMPER = 1.2e9, 2e-3, 2e4  # N/m^2, m^3, Ns/m
SUPPLY, TANK, IDLE = 2.5e7, 1e5, 2e6  # N/m^2; IDLE: of the chamber that holds no load
FLOW = 5e-7  # m^3/s at the root of 1 N/m^2
GAIN = 15.0  # 1/m


def boom(n: int = 8, h: float = 2e-3, t_end: float = 1.5, interfaces: Sequence[str] = HINGED) -> MechanismScene:
    """Return the crane; its solve() is a static one and a dynamic one.

    n : eigenmodes beside static ones of interfaces, RBE3; h, t_end : step, that of the controller too, and end time
    in s; interfaces : mounts that have static modes. objects: "stick", "payload", "rope", cylinders "first" and
    "second", their pressures, what holds them at first. sensors: displacements "tip" of the boom, "payload", and
    "tip in the boom" in its frame; "pressures first", "pressures second".
    """
    fem = boom_fem()
    craig_bampton(fem, interfaces, n, "RBE3")
    SC = exu.SystemContainer()
    scene = _Boom(SC, SC.AddSystem(), fem, ObjectFFRFreducedOrderInterface(fem), solver_settings(h, t_end))
    places = _add_boom(scene)
    places |= {"base": BASE, "lever": places["tip"] + LEVER, "end": places["tip"] + STICK_LENGTH * SLOPE}
    _add_stick(scene, places)
    _add_ground(scene, places)
    join(scene, "hinge", scene.markers["ground"], scene.markers["hinge"], HINGE)
    join(scene, "hinge of the stick", scene.markers["tip"], scene.markers["stick"], HINGE)
    _add_payload(scene, places["end"])
    for name, ends in (("first", ("base", "lug")), ("second", ("bracket", "lever"))):
        _add_cylinder(scene, name, ends, float(np.linalg.norm(places[ends[1]] - places[ends[0]])))
    _add_sensors(scene)
    newton = scene.settings.timeIntegration.newton
    newton.numericalDifferentiation.minimumCoordinateSize = 1  # pressures are large
    newton.relativeTolerance, newton.absoluteTolerance = 1e-8, 1e-6
    scene.settings.staticSolver.verboseMode = 0
    scene.mbs.Assemble()
    return scene


class _Boom(MechanismScene):
    """Begins with a static solve."""

    def solve(self) -> None:
        """Find the equilibrium, give the cylinders the pressures that hold it, and solve."""
        mbs, settings = self.mbs, self.settings
        mbs.SolveStatic(settings, updateInitialValues=True)  # pressures stay what they are
        pressures = mbs.systemData.GetODE1Coordinates(exu.ConfigurationType.Initial)
        for i, (name, areas) in enumerate(CYLINDERS.items()):
            held = self.objects[f"{name} held"]
            push = float(np.ravel(mbs.GetObjectOutput(held, exu.OutputVariableType.Force))[0])
            chamber = 0 if push > 0 else 1
            pressures[2 * i + chamber] += abs(push) / areas[chamber]  # beside what both hold in the static solve
            mbs.SetObjectParameter(held, "activeConnector", False)
        mbs.systemData.SetODE1Coordinates(pressures, exu.ConfigurationType.Initial)
        mbs.SetPreStepUserFunction(controller({name: self.objects[name] for name in CYLINDERS}))
        mbs.SolveDynamic(settings)


def controller(cylinders: dict[str, int]) -> Any:
    """Return a PreStep function that opens valves of cylinders by what lengths lack of those that are wanted."""

    def control(mbs: Any, t: float) -> bool:
        s = min(t / MOVE, 1.0)
        for name, cylinder in cylinders.items():
            item = mbs.GetObject(cylinder)
            moved = MOVES[name] * (s - np.sin(2 * np.pi * s) / (2 * np.pi))
            wanted = item["offsetLength"] + item["strokeLength"] / 2 + moved
            opening = GAIN * (wanted - mbs.GetObjectOutput(cylinder, exu.OutputVariableType.Distance))
            mbs.SetObjectParameter(cylinder, "valveOpening0", opening)
            mbs.SetObjectParameter(cylinder, "valveOpening1", -opening)
        return True

    return control


def _add_boom(scene: MechanismScene) -> dict[str, np.ndarray]:
    """The flexible body, with a marker at each mount; return where these are."""
    mbs, positions, places = scene.mbs, scene.fem.GetNodePositionsAsArray(), {}
    items = scene.cms.AddObjectFFRFreducedOrder(mbs, gravity=GRAVITY, stiffnessProportionalDamping=DAMPING)
    scene.bodies = (items,)
    rigid, moved = itemInterface.MarkerSuperElementRigid, itemInterface.MarkerSuperElementPosition
    for name in MOUNTS:
        nodes, weights = interface(scene.fem, name)
        on_mesh = {"meshNodeNumbers": nodes, "weightingFactors": weights}
        marker = (rigid if name in HINGED else moved)(bodyNumber=items["oFFRFreducedOrder"], **on_mesh)
        places[name], scene.markers[name] = weights @ positions[nodes], mbs.AddMarker(marker)
    return places


def _add_stick(scene: MechanismScene, places: dict[str, np.ndarray]) -> None:
    """A thin rod, with a marker where each thing is mounted."""
    way = STICK_LENGTH * SLOPE
    tensor = STICK / 12 * (way @ way * np.eye(3) - np.outer(way, way)) + 0.5 * np.eye(3)
    inertia = RigidBodyInertia(mass=STICK, com=[0, 0, 0], inertiaTensor=tensor)
    middle = places["tip"] + way / 2
    body = scene.mbs.CreateRigidBody(name="stick", referencePosition=middle, inertia=inertia, gravity=GRAVITY)
    scene.objects["stick"] = body
    for name, place in (("stick", "tip"), ("lever", "lever"), ("end", "end")):
        marker = itemInterface.MarkerBodyRigid(bodyNumber=body, localPosition=places[place] - middle)
        scene.markers[name] = scene.mbs.AddMarker(marker)


def _add_ground(scene: MechanismScene, places: dict[str, np.ndarray]) -> None:
    for name, place in (("ground", "hinge"), ("base", "base")):
        body = scene.mbs.AddObject(itemInterface.ObjectGround(referencePosition=places[place]))
        scene.markers[name] = scene.mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=body))


def _add_payload(scene: MechanismScene, end: np.ndarray) -> None:
    """A mass below the stick's end; the rope is stretched by its weight from the start."""
    mbs = scene.mbs
    place = end - np.array([0.0, 0.0, ROPE])
    scene.objects["payload"] = mbs.CreateMassPoint(
        name="payload", referencePosition=place, mass=PAYLOAD, gravity=GRAVITY
    )
    scene.markers["payload"] = mbs.AddMarker(itemInterface.MarkerBodyPosition(bodyNumber=scene.objects["payload"]))
    scene.objects["rope"] = mbs.AddObject(
        itemInterface.SpringDamper(
            markerNumbers=[scene.markers["end"], scene.markers["payload"]],
            referenceLength=ROPE + PAYLOAD * GRAVITY[2] / ROPE_STIFFNESS,
            stiffness=ROPE_STIFFNESS,
            damping=ROPE_DAMPING,
        )
    )


def _add_cylinder(scene: MechanismScene, name: str, ends: tuple[str, str], length: float) -> None:
    """A cylinder at half its stroke between two markers, and the distance that holds them at first."""
    mbs, markers = scene.mbs, [scene.markers[end] for end in ends]
    node = itemInterface.NodeGenericODE1(
        referenceCoordinates=[0, 0], initialCoordinates=[IDLE, IDLE], numberOfODE1Coordinates=2
    )
    scene.objects[f"{name} pressures"] = node = mbs.AddNode(node)
    stroke, (head, rod) = 0.5 * length, CYLINDERS[name]
    scene.objects[name] = mbs.AddObject(
        itemInterface.HydraulicActuatorSimple(
            name=name,
            markerNumbers=markers,
            nodeNumbers=[node],
            offsetLength=length - stroke / 2,
            strokeLength=stroke,
            chamberCrossSection0=head,
            chamberCrossSection1=rod,
            hoseVolume0=HOSE,
            hoseVolume1=HOSE,
            oilBulkModulus=BULK,
            actuatorDamping=DAMPER,
            nominalFlow=FLOW,
            systemPressure=SUPPLY,
            tankPressure=TANK,
            useChamberVolumeChange=True,
        )
    )
    scene.objects[f"{name} held"] = mbs.AddObject(
        itemInterface.DistanceConstraint(markerNumbers=markers, distance=length)
    )


def _add_sensors(scene: MechanismScene) -> None:
    shows, objects, of_node = exu.OutputVariableType, scene.objects, itemInterface.SensorNode
    of_mesh, boom = itemInterface.SensorSuperElement, scene.bodies[0]["oFFRFreducedOrder"]
    tip = {"bodyNumber": boom, "meshNodeNumber": int(interface(scene.fem, "tip")[0][0])}
    for name, kind, variable, of in (
        ("tip", of_mesh, shows.Displacement, tip),
        ("tip in the boom", of_mesh, shows.DisplacementLocal, tip),
        ("payload", itemInterface.SensorBody, shows.Displacement, {"bodyNumber": objects["payload"]}),
        ("pressures first", of_node, shows.Coordinates, {"nodeNumber": objects["first pressures"]}),
        ("pressures second", of_node, shows.Coordinates, {"nodeNumber": objects["second pressures"]}),
    ):
        sensor = kind(name=name, outputVariableType=variable, storeInternal=True, **of)
        scene.sensors[name] = scene.mbs.AddSensor(sensor)


def outline(scene: MechanismScene) -> tuple[np.ndarray, np.ndarray]:
    """Return x and z of all lines of a side view, where the crane is now; nan between lines."""
    mbs, boom, where = scene.mbs, scene.bodies[0]["oFFRFreducedOrder"], exu.OutputVariableType.Position
    nodes = np.arange(len(scene.fem.GetNodePositionsAsArray())).reshape(-1, 4, 4)[:, 0]  # of the side
    side = np.array([[mbs.GetObjectOutputSuperElement(boom, where, n) for n in row] for row in nodes.tolist()])
    at = {name: mbs.GetMarkerOutput(marker, where) for name, marker in scene.markers.items()}
    pairs = ("base", "lug"), ("bracket", "lever"), ("lever", "stick"), ("stick", "end"), ("end", "payload")
    lines = [*side, *side.swapaxes(0, 1), *([at[a], at[b]] for a, b in pairs)]
    gap = np.full((1, 3), np.nan)
    points = np.concatenate([part for line in lines for part in (line, gap)])
    return points[:, 0], points[:, 2]
