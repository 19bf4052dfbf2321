"""Flexible bars in mechanisms: a double pendulum, a slider crank, a bar on springs.

Written as a user of Exudyn writes it. The bar, 0.4 m along x, 0.04 m in y, 0.06 m in z, is "bar" of
models/floating.py; all bars of a scene have the same modes. kind="complete" is the full model: all modes that leave
the mean motion of the left face zero, so that faces may warp, whether or not the reduced bar keeps them rigid (RBE2).
All that acts starts smoothly. A load applied at once would ring at the bar's 600 Hz and above, and a difference of
two runs would be what the time steps make of that, not what the missing modes do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
from exudyn.utilities import InertiaCuboid, RigidBodyInertia

from models.floating import (
    GRAVITY,
    RAYLEIGH,
    LoadFunction,
    add_interface_marker,
    interface,
    load_fem,
    reduce,
    solver_settings,
)

MIDDLE = 43  # node of the bar at half its length, on the same edge as the node "tip"
HINGE = [1, 1, 1, 1, 0, 1]  # free: rotation about y
GRAVITY_RAMP = 0.02  # s
CRANK_RADIUS = 0.1  # m
CRANK_INERTIA = 0.3  # kg m^2, about the shaft, with a flywheel
PISTON_MASS = 2.0  # kg


def swaying_force(t: float) -> tuple[float, float, float]:
    """Force in N at the end of the double pendulum, along its hinges."""
    return 0.0, 1e3 * np.sin(25.0 * t) ** 6, 0.0


def shaking_force(t: float) -> tuple[float, float, float]:
    """Force in N at the end of the bar on springs: across the bar, in y and z out of step."""
    return 0.0, 4e3 * np.sin(60.0 * t) ** 4, 6e3 * np.sin(80.0 * t) ** 4


@dataclass
class MechanismScene:
    """A model of one or two flexible bars, numbered from 1; all numbers are Exudyn's.

    bodies: items of each bar. markers: MarkerSuperElementRigid "left 1", "right 1", ... objects: rigid bodies, joints
    and springs by name. sensors: displacement of two nodes of each bar, "tip 1", "middle 1" (global), "tip 1 local",
    "middle 1 local" (in the floating frame), ...
    """

    SC: Any
    mbs: Any
    fem: FEMinterface
    cms: ObjectFFRFreducedOrderInterface
    settings: exu.SimulationSettings
    bodies: tuple[dict[str, int], ...] = ()
    markers: dict[str, int] = field(default_factory=dict)
    objects: dict[str, int] = field(default_factory=dict)
    sensors: dict[str, int] = field(default_factory=dict)

    def solve(self) -> None:
        """Assemble if that was not done, and solve from the start to the end."""
        if not self.mbs.systemIsConsistent:
            self.mbs.Assemble()
        self.mbs.SolveDynamic(self.settings)


def double_pendulum(
    n: int | Sequence[int] = 4,
    kind: str = "RBE3",
    h: float = 2e-3,
    t_end: float = 0.3,
    force: LoadFunction = swaying_force,
    damping: tuple[float, float] = RAYLEIGH,
    assemble: bool = False,
) -> MechanismScene:
    """Two bars in a row along x that fall from rest, hinged (axis y) to the ground and to each other.

    n, kind: modes of the bars, see floating.reduce; h, t_end: step and end time in s; force: f(t) in N at the right
    face of the last bar, global axes; damping: alpha in 1/s, beta in s. Unless `assemble`, solve() assembles; attach
    a monitor before that.
    """
    scene = _scene((n, kind), (h, t_end))
    left, right = _faces(scene.fem)
    _add_bar(scene, damping)
    _add_bar(scene, damping, position=right - left)
    join(scene, "hinge 1", _ground_marker(scene.mbs, left), scene.markers["left 1"], HINGE)
    join(scene, "hinge 2", scene.markers["right 1"], scene.markers["left 2"], HINGE)
    return _finished(scene, itemInterface.LoadForceVector, scene.markers["right 2"], force, assemble)


def slider_crank(
    n: int | Sequence[int] = 4,
    kind: str = "RBE3",
    h: float = 5e-4,
    t_end: float = 0.12,
    speed: float = 200.0,
    damping: tuple[float, float] = RAYLEIGH,
    assemble: bool = False,
) -> MechanismScene:
    """Rigid crank, the bar as connecting rod, rigid piston; driven from rest at the dead centre.

    A torque on the crank brings it to about `speed` in rad/s at t_end. The shaft, the crank pin (hinges, axis y) and
    the guide of the piston (along x) hold five motions each; the piston pin closes the loop and holds x and z only:
    no constraint is redundant. Other parameters as in double_pendulum.
    """
    scene = _scene((n, kind), (h, t_end))
    mbs, (pin, wrist) = scene.mbs, _faces(scene.fem)
    _add_bar(scene, damping)
    shaft = pin - [CRANK_RADIUS, 0, 0]
    inertia = RigidBodyInertia(mass=10.0, inertiaTensor=CRANK_INERTIA * np.diag([0.5, 1.0, 0.5]))
    crank = scene.objects["crank"] = mbs.CreateRigidBody(referencePosition=shaft, inertia=inertia)
    block = InertiaCuboid(density=PISTON_MASS / 0.08**3, sideLengths=[0.08, 0.08, 0.08])
    piston = scene.objects["piston"] = mbs.CreateRigidBody(referencePosition=wrist, inertia=block)
    at_shaft, at_pin = (_body_marker(mbs, crank, [x, 0, 0]) for x in (0, CRANK_RADIUS))
    at_wrist = _body_marker(mbs, piston)
    join(scene, "shaft", _ground_marker(mbs, shaft), at_shaft, HINGE)
    join(scene, "crank pin", at_pin, scene.markers["left 1"], HINGE)
    join(scene, "guide", _ground_marker(mbs, wrist), at_wrist, [0, 1, 1, 1, 1, 1])
    join(scene, "piston pin", at_wrist, scene.markers["right 1"], [1, 0, 1, 0, 0, 0])
    # On the average of a turn 2/3 of the rod's mass and 1/2 of the piston's move with the crank pin.
    moved = 2 / 3 * scene.cms.totalMass + PISTON_MASS / 2
    mean = (CRANK_INERTIA + moved * CRANK_RADIUS**2) * speed / t_end

    def torque(t: float) -> tuple[float, float, float]:
        return 0.0, mean * (1 - np.cos(np.pi * t / t_end)), 0.0

    return _finished(scene, itemInterface.LoadTorqueVector, at_shaft, torque, assemble)


def sprung_body(
    n: int | Sequence[int] = 4,
    kind: str = "RBE3",
    h: float = 1e-3,
    t_end: float = 0.1,
    force: LoadFunction = shaking_force,
    damping: tuple[float, float] = RAYLEIGH,
    assemble: bool = False,
) -> MechanismScene:
    """One bar between springs and dampers, without joints, shaken at its right face.

    Its left face hangs on springs against displacement and rotation, its right face on springs against displacement.
    Parameters as in double_pendulum.
    """
    scene = _scene((n, kind), (h, t_end))
    mbs, (left, right) = scene.mbs, _faces(scene.fem)
    _add_bar(scene, damping)
    scene.objects["left spring"] = mbs.AddObject(
        itemInterface.RigidBodySpringDamper(
            markerNumbers=[_ground_marker(mbs, left), scene.markers["left 1"]],
            stiffness=np.diag([2e5, 1e5, 1e5, 2e3, 2e3, 2e3]),  # N/m, Nm
            damping=np.diag([2e2, 2e2, 2e2, 2.0, 2.0, 2.0]),  # Ns/m, Nms
        )
    )
    scene.objects["right spring"] = mbs.AddObject(
        itemInterface.CartesianSpringDamper(
            markerNumbers=[_ground_marker(mbs, right), scene.markers["right 1"]],
            stiffness=[2e5, 1e5, 1e5],
            damping=[2e2, 2e2, 2e2],
        )
    )
    return _finished(scene, itemInterface.LoadForceVector, scene.markers["right 1"], force, assemble)


def _scene(modes: tuple, times: tuple) -> MechanismScene:
    """Return an empty scene and the modes of its bars."""
    fem = load_fem("bar")
    reduce(fem, *modes)
    SC = exu.SystemContainer()
    return MechanismScene(SC, SC.AddSystem(), fem, ObjectFFRFreducedOrderInterface(fem), settings_to_compare(*times))


def settings_to_compare(h: float, t_end: float) -> exu.SimulationSettings:
    """Return settings of a dynamic solve that iterates far enough for runs to be compared."""
    settings = solver_settings(h, t_end)
    newton = settings.timeIntegration.newton
    # Two runs are compared: iterate further than the default tolerances, 1e-8 and 1e-10.
    newton.relativeTolerance, newton.absoluteTolerance = 1e-10, 1e-12
    # A Jacobian of 190 modes takes as long as 50 iterations: keep it while the residual shrinks at all.
    newton.modifiedNewtonContractivity, newton.maxModifiedNewtonIterations, newton.maxIterations = 0.9, 25, 50
    return settings


def _faces(fem: FEMinterface) -> list[np.ndarray]:
    """Return the centres of the left and the right face."""
    positions = fem.GetNodePositionsAsArray()
    return [weights @ positions[nodes] for nodes, weights in (interface(fem, side) for side in ("left", "right"))]


def _add_bar(scene: MechanismScene, damping: tuple, position: Any = (0, 0, 0)) -> None:
    """Add the next bar, markers of its interfaces, gravity and sensors."""
    mbs, number = scene.mbs, len(scene.bodies) + 1
    items = scene.cms.AddObjectFFRFreducedOrder(
        mbs,
        positionRef=position,
        gravity=[0, 0, 0],
        massProportionalDamping=damping[0],
        stiffnessProportionalDamping=damping[1],
    )
    scene.bodies += (items,)
    flexible = items["oFFRFreducedOrder"]
    for side in ("left", "right"):
        scene.markers[f"{side} {number}"] = add_interface_marker(mbs, flexible, *interface(scene.fem, side))
    mass = mbs.AddMarker(itemInterface.MarkerBodyMass(bodyNumber=flexible))
    mbs.AddLoad(itemInterface.LoadMassProportional(markerNumber=mass, loadVectorUserFunction=_gravity))
    for probe, node in (("tip", interface(scene.fem, "tip")[0][0]), ("middle", MIDDLE)):
        at_node = {"bodyNumber": flexible, "meshNodeNumber": node, "storeInternal": True}
        for suffix, kind in (("", "Displacement"), (" local", "DisplacementLocal")):
            variable = getattr(exu.OutputVariableType, kind)
            sensor = mbs.AddSensor(itemInterface.SensorSuperElement(outputVariableType=variable, **at_node))
            scene.sensors[f"{probe} {number}{suffix}"] = sensor


def _gravity(mbs: Any, t: float, loadVector: Any) -> list[float]:
    return [float(np.sin(np.pi / 2 * min(t / GRAVITY_RAMP, 1.0)) ** 4) * g for g in GRAVITY]


def _ground_marker(mbs: Any, position: np.ndarray) -> int:
    return _body_marker(mbs, mbs.AddObject(itemInterface.ObjectGround(referencePosition=position)))


def _body_marker(mbs: Any, body: int, position: Any = (0, 0, 0)) -> int:
    return mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=body, localPosition=position))


def join(scene: MechanismScene, name: str, marker0: int, marker1: int, axes: list[int]) -> None:
    joint = itemInterface.GenericJoint(markerNumbers=[marker0, marker1], constrainedAxes=axes)
    scene.objects[name] = scene.mbs.AddObject(joint)


def _finished(
    scene: MechanismScene, load: type, marker: int, function: LoadFunction, assemble: bool
) -> MechanismScene:
    """Add a force or torque f(t) in global axes; assemble if asked to."""
    item = load(markerNumber=marker, loadVectorUserFunction=lambda mbs, t, loadVector: function(t))
    scene.mbs.AddLoad(item)
    if assemble:
        scene.mbs.Assemble()
    return scene
