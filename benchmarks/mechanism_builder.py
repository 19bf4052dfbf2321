"""A mechanism of random_mechanisms.py as a model of Exudyn, with its own few modes or with all of them.

All modes: those with zero weighted mean motion of the left face, which may warp whether or not the reduced bars keep
faces rigid (RBE2): the truth of interfaces="free", the default.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any
from unittest import mock

import exudyn as exu
import numpy as np
import scipy.sparse.linalg as sla
from exudyn import itemInterface
from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
from exudyn.utilities import InertiaCuboid
from scipy.spatial.transform import Rotation

import exudyn_romerr as romerr
from benchmarks.random_mechanisms import Bar, Link, Mechanism, Shape
from exudyn_romerr.mbs.floating.floating_body import FloatingBody
from models.floating import interface, reduce
from models.hex_bar import hex_bar
from models.mechanisms import settings_to_compare

HELD = {
    "hinge": [1, 1, 1, 1, 1, 0],
    "spherical": [1, 1, 1, 0, 0, 0],
    "cardan": [1, 1, 1, 1, 0, 0],
    "weld": [1] * 6,
    "driven": [1] * 6,
    "guide": [1, 0, 0, 0, 0, 0],
}
CUBE = 0.05, 0.3  # m, and its share of the bar's mass
DRIVEN = 0.1  # rad
SLACK = 5e-3  # s: dampers have this times their spring's stiffness
Vector = tuple[float, float, float]
START = 0  # seed of the vector that Exudyn's eigenvalue solver begins with; its own is another one each time
BACKWARDS = np.diag([-1.0, -1.0, 1.0])
SENSORS = (("tip", "Displacement"), ("middle", "Displacement"), ("tip", "Velocity"))


@dataclass
class Place:
    """Where the chain has come to: a body (or the ground), its axes in space, a point in space; how to mark it."""

    mark: Any
    axes: np.ndarray
    at: np.ndarray


@dataclass
class Scene:
    """The model; of every bar its fem, items and frame's axes; sensors in the frames of the bars."""

    mechanism: Mechanism
    SC: Any
    mbs: Any
    settings: exu.SimulationSettings
    fems: list[FEMinterface] = field(default_factory=list)
    bodies: list[dict[str, int]] = field(default_factory=list)
    sensors: list[dict[str, int]] = field(default_factory=list)

    def flexible(self) -> list[FloatingBody]:
        """The bars, to be attached."""
        ratios = [bar.ratios for bar in self.mechanism.bars]
        parts = zip(self.fems, self.bodies, ratios, strict=True)
        return [romerr.floating_body(fem, items, modal_damping=of) for fem, items, of in parts]

    def solve(self) -> None:
        """Assemble, and solve from the start to the end."""
        self.mbs.Assemble()
        self.mbs.SolveDynamic(self.settings)

    def motion(self) -> dict[str, np.ndarray]:
        """Values (steps + 1, 3) of all sensors after a solve."""
        numbers = {name: number for sensors in self.sensors for name, number in sensors.items()}
        return {name: self.mbs.GetSensorStoredData(number)[:, 1:] for name, number in numbers.items()}


def built(mechanism: Mechanism, complete: bool = False, iterate: float = 1.0, at: Vector = (0.0, 0.0, 0.0)) -> Scene:
    """Build the model; complete: all modes; iterate: factor of Newton's tolerances; at: where the chain begins."""
    SC = exu.SystemContainer()
    settings = settings_to_compare(mechanism.h, mechanism.h * mechanism.steps)
    settings.timeIntegration.generalizedAlpha.spectralRadius = mechanism.rho
    settings.timeIntegration.newton.relativeTolerance *= iterate
    settings.timeIntegration.newton.absoluteTolerance *= iterate
    settings.timeIntegration.adaptiveStep = False  # the steps of two runs are to be the same
    scene = Scene(mechanism, SC, SC.AddSystem(), settings)
    ground = scene.mbs.AddObject(itemInterface.ObjectGround())
    place, axes = _ground(scene, ground, np.array(at)), np.eye(3)
    for bar, links in zip(mechanism.bars, mechanism.links, strict=True):
        axes = axes @ Rotation.from_rotvec(bar.kink).as_matrix()
        if len(links) == 2:
            place = _with_cube(scene, place, links[0], axes, bar.mass)
        place = _with_bar(scene, place, links[-1], axes, complete)
    _end(scene, place, ground, axes)
    for load in mechanism.loads:
        _add_load(scene, load.bar, load.side, load.kind, load.vector, load.shape)
    for flex in scene.flexible():
        if flex.modal_damping is not None:
            romerr.set_modal_damping(scene.mbs, flex)
    return scene


def all_modes(bar: Bar) -> np.ndarray:
    """Angular frequencies of all modes of a bar in rad/s."""
    return np.sqrt(_fem(bar, complete=True).eigenValues)


def _fem(bar: Bar, complete: bool) -> FEMinterface:
    fem = hex_bar(bar.elements, bar.size, bar.material, bar.shifts)
    start = np.random.default_rng(START).standard_normal(3 * fem.NumberOfNodes())
    with mock.patch.object(sla, "eigsh", partial(_eigsh, sla.eigsh, start)):
        reduce(fem, 0 if complete else bar.n, "complete" if complete else bar.kind)
    if bar.kind == "RBE3" and not complete:
        romerr.hold_modes(fem, *interface(fem, "left"))
    return fem


def _eigsh(eigsh: Any, start: np.ndarray, A: Any, **options: Any) -> Any:
    return eigsh(A, v0=start[: A.shape[0]], **options)


def _ground(scene: Scene, ground: int, at: np.ndarray) -> Place:
    return Place(lambda turn, here: _body_marker(scene, ground, turn, here), np.eye(3), at)


def _body_marker(scene: Scene, body: int, turn: np.ndarray, position: np.ndarray) -> int:
    marker = itemInterface.MarkerBodyRigid(bodyNumber=body, localHT=_transformation(turn, position))
    return scene.mbs.AddMarker(marker)


def _transformation(turn: np.ndarray, position: np.ndarray) -> np.ndarray:
    return np.block([[turn, np.reshape(position, (3, 1))], [np.zeros(3), 1.0]])


def _face(scene: Scene, number: int, side: str, turn: np.ndarray | None = None) -> int:
    """A marker of an end of a bar."""
    nodes, weights = interface(scene.fems[number], side)
    marker = itemInterface.MarkerSuperElementRigid(
        bodyNumber=scene.bodies[number]["oFFRFreducedOrder"],
        meshNodeNumbers=nodes,
        weightingFactors=weights,
        localHT=None if turn is None else _transformation(turn, np.zeros(3)),
    )
    return scene.mbs.AddMarker(marker)


def _with_bar(scene: Scene, place: Place, link: Link, axes: np.ndarray, complete: bool) -> Place:
    """Add the next bar, joined to where the chain has come to; return its other end."""
    mechanism, number = scene.mechanism, len(scene.bodies)
    bar = mechanism.bars[number]
    fem = _fem(bar, complete)
    scene.fems.append(fem)
    ends = ("right", "left") if bar.reversed else ("left", "right")
    frame = axes @ BACKWARDS if bar.reversed else axes
    enter, leave = (frame @ _centre(fem, side) for side in ends)
    scene.bodies.append(
        ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(
            scene.mbs,
            positionRef=place.at - enter,
            rotationMatrixRef=frame,
            massProportionalDamping=bar.damping[0],
            stiffnessProportionalDamping=bar.damping[1],
        )
    )
    _add_gravity(scene, number)
    _add_sensors(scene, number)
    here = Place(lambda turn, _: _face(scene, number, ends[0], turn), frame, place.at)
    _join(scene, link, place, here)
    return Place(lambda turn, _: _face(scene, number, ends[1], turn), frame, place.at - enter + leave)


def _centre(fem: FEMinterface, side: str) -> np.ndarray:
    nodes, weights = interface(fem, side)
    return weights @ fem.GetNodePositionsAsArray()[nodes]


def _with_cube(scene: Scene, place: Place, link: Link, axes: np.ndarray, mass: float) -> Place:
    """Add a rigid cube, joined to where the chain has come to; return its other side."""
    side, share = CUBE
    cube = InertiaCuboid(density=share * mass / side**3, sideLengths=[side] * 3)
    half = axes @ [side / 2, 0, 0]
    body = scene.mbs.CreateRigidBody(referencePosition=place.at + half, referenceRotationMatrix=axes, inertia=cube)
    near, far = ([x, 0, 0] for x in (-side / 2, side / 2))
    _join(scene, link, place, Place(lambda turn, _: _body_marker(scene, body, turn, near), axes, place.at))
    return Place(lambda turn, _: _body_marker(scene, body, turn, far), axes, place.at + 2 * half)


def _join(scene: Scene, link: Link, one: Place, other: Place) -> None:
    if link.kind == "none":
        return
    markers = [place.mark(place.axes.T @ link.axes, place.at) for place in (one, other)]
    if link.kind in HELD:
        joint = itemInterface.GenericJoint(markerNumbers=markers, constrainedAxes=HELD[link.kind])
        if link.kind == "driven":
            joint.offsetUserFunction = _driving(scene.mechanism)
        scene.mbs.AddObject(joint)
    turning = link.stiffness * link.length**2
    springs = np.diag([link.stiffness] * 3 + [turning] * 3) if link.kind == "bushing" else np.zeros((6, 6))
    if link.kind == "bushing" or (link.damped and link.kind == "hinge"):
        springs[5, 5] = turning
        damper = itemInterface.RigidBodySpringDamper
        scene.mbs.AddObject(damper(markerNumbers=markers, stiffness=springs, damping=SLACK * springs))


def _driving(mechanism: Mechanism) -> Any:
    """Rotation about the joint's first axis over time; it begins as the first load does, but smoothly."""
    shape = mechanism.loads[0].shape
    begin = shape.begin if "late" in shape.kind else 0.0

    def offset(mbs: Any, t: float, itemNumber: int, parameters: Any) -> list[float]:
        return [0.0, 0.0, 0.0, DRIVEN * float(np.sin(0.3 * shape.omega * max(t - begin, 0.0)) ** 4), 0.0, 0.0]

    return offset


def _end(scene: Scene, place: Place, ground: int, axes: np.ndarray) -> None:
    """Add what holds the end of the chain, or hangs on it."""
    mechanism, link = scene.mechanism, scene.mechanism.last
    if mechanism.end == "cube":
        _with_cube(scene, place, link, axes, mechanism.bars[-1].mass)
    elif mechanism.end == "guide":
        _join(scene, Link("guide", link.axes, 0.0, 0.0, False), _ground(scene, ground, place.at), place)
    elif mechanism.end in ("springs", "rope"):
        away = axes @ [0.0, link.length, 0.0] if mechanism.end == "rope" else np.zeros(3)
        markers = [_body_marker(scene, ground, np.eye(3), place.at + away), place.mark(np.eye(3), place.at)]
        k = link.stiffness
        if mechanism.end == "rope":
            length = {"referenceLength": link.length}
            spring = itemInterface.SpringDamper(markerNumbers=markers, stiffness=k, damping=SLACK * k, **length)
        else:
            factors = {"stiffness": [k] * 3, "damping": [SLACK * k] * 3}
            spring = itemInterface.CartesianSpringDamper(markerNumbers=markers, **factors)
        scene.mbs.AddObject(spring)


def _add_load(scene: Scene, number: int, side: str, kind: str, vector: np.ndarray, shape: Shape) -> None:
    load = itemInterface.LoadForceVector if kind == "force" else itemInterface.LoadTorqueVector
    function = {"loadVectorUserFunction": lambda mbs, t, loadVector: [shape.at(t) * x for x in vector]}
    scene.mbs.AddLoad(load(markerNumber=_face(scene, number, side), **function))


def _add_gravity(scene: Scene, number: int) -> None:
    vector, shape = scene.mechanism.gravity
    if shape.kind == "none":
        return
    marker = scene.mbs.AddMarker(itemInterface.MarkerBodyMass(bodyNumber=scene.bodies[number]["oFFRFreducedOrder"]))
    function = {"loadVectorUserFunction": lambda mbs, t, loadVector: [shape.at(t) * x for x in vector]}
    scene.mbs.AddLoad(itemInterface.LoadMassProportional(markerNumber=marker, **function))


def _add_sensors(scene: Scene, number: int) -> None:
    """Displacements in the frame at the tip and the middle of every bar; the velocity of the first one's tip."""
    sensors = {}
    for node, of in SENSORS if number == 0 else SENSORS[:2]:
        name = f"{node} {number + 1}" if of == "Displacement" else f"{node} {number + 1} velocity"
        sensor = itemInterface.SensorSuperElement(
            name=name,
            bodyNumber=scene.bodies[number]["oFFRFreducedOrder"],
            meshNodeNumber=interface(scene.fems[number], node)[0][0],
            outputVariableType=getattr(exu.OutputVariableType, f"{of}Local"),
            storeInternal=True,
        )
        sensors[name] = scene.mbs.AddSensor(sensor)
    scene.sensors.append(sensors)
