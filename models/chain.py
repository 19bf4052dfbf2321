"""A chain of two bars and a rigid cube on spherical joints or hinges, without gravity, that loads set in motion.

The bars are those of hex_bar, 60 coordinates each, so that a run with all modes takes a second. kind="complete" of
`chain` is the full model. Loads act on the joint between the
bars, and as a torque on the right end of the first one; `after`: how long everything rests before they begin. SCENES
are those of which make_chain_truth.py stores what all modes make.
"""

from __future__ import annotations

from collections.abc import Callable

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import ObjectFFRFreducedOrderInterface
from exudyn.utilities import InertiaCuboid

from models.floating import RAYLEIGH, add_interface_marker, interface, reduce
from models.hex_bar import hex_bar
from models.mechanisms import MechanismScene, _body_marker, _ground_marker, join, settings_to_compare

SIZE = (0.4, 0.03, 0.04)  # m, of hex_bar
CUBE = (0.5, 0.05)  # kg, m
SPHERICAL = [1, 1, 1, 0, 0, 0]
HINGE = [1, 1, 1, 1, 0, 1]  # free: rotation about y
Vector = tuple[float, float, float]


def swinging_loads(t: float) -> tuple[Vector, Vector]:
    """Force in N on the middle joint, torque in Nm on the right end of the first bar; both are zero before t = 0."""
    t = max(t, 0.0)
    force, twist = 10.0 * np.sin(30.0 * t) ** 2, np.sin(30.0 * t) ** 2
    return (0.0, force, 20.0 * np.sin(40.0 * t) ** 2), (0.1 * twist, 0.0, 0.05 * twist)


def pulse(t: float) -> tuple[Vector, Vector]:
    """The same kind of loads for 8 ms."""
    size = np.sin(np.pi * min(max(t / 0.008, 0.0), 1.0)) ** 2
    return (0.0, 50.0 * size, 100.0 * size), (size, 0.0, 0.5 * size)


LATE = 0.128  # s: so many steps of 1 ms, and tangents were read every 64 once
SCENES = {
    "at once": {"t_end": 0.06},
    "late": {"after": LATE, "t_end": 0.19},
    "late, times 10": {"after": LATE, "t_end": 0.19, "factor": 10.0},
    "hinges, late, times 10": {"after": LATE, "t_end": 0.19, "factor": 10.0, "axes": HINGE},
    "pulse": {"after": 0.1, "t_end": 0.16, "loads": pulse},
}


def chain(
    n: int = 0,
    kind: str = "RBE3",
    axes: list[int] = SPHERICAL,
    loads: Callable[[float], tuple[Vector, Vector]] = swinging_loads,
    factor: float = 1.0,
    after: float = 0.0,
    h: float = 1e-3,
    t_end: float = 0.1,
) -> MechanismScene:
    """Ground, joint, bar 1, joint, bar 2, joint, cube. n, kind: modes, see floating.reduce; after, h, t_end in s.

    axes: of each joint, those constrained. loads: t -> force and torque, times `factor`.
    """
    fem = hex_bar()
    reduce(fem, n, kind)
    SC = exu.SystemContainer()
    settings = settings_to_compare(h, t_end)
    scene = MechanismScene(SC, SC.AddSystem(), fem, ObjectFFRFreducedOrderInterface(fem), settings)
    mbs = scene.mbs
    begin = np.array([0.0, SIZE[1] / 2, SIZE[2] / 2])
    joint = np.array([SIZE[0], 0.0, 0.0])
    for i in range(2):
        _add_bar(scene, i * joint)
    cube = InertiaCuboid(density=CUBE[0] / CUBE[1] ** 3, sideLengths=[CUBE[1]] * 3)
    scene.objects["cube"] = mbs.CreateRigidBody(
        referencePosition=begin + 2 * joint + [CUBE[1] / 2, 0, 0], inertia=cube
    )
    at_cube = _body_marker(mbs, scene.objects["cube"], [-CUBE[1] / 2, 0, 0])
    markers = [_ground_marker(mbs, begin), *(scene.markers[f"{s} {i}"] for i in (1, 2) for s in ("left", "right"))]
    markers.append(at_cube)
    for i in range(3):
        join(scene, f"joint {i + 1}", markers[2 * i], markers[2 * i + 1], axes)
    for which, load, marker in (
        (0, itemInterface.LoadForceVector, scene.markers["left 2"]),
        (1, itemInterface.LoadTorqueVector, scene.markers["right 1"]),
    ):
        mbs.AddLoad(load(markerNumber=marker, loadVectorUserFunction=_load(loads, which, factor, after)))
    return scene


def _load(loads: Callable, which: int, factor: float, after: float) -> Callable:
    return lambda mbs, t, loadVector: list(factor * np.array(loads(t - after)[which]))


def _add_bar(scene: MechanismScene, position: np.ndarray) -> None:
    """Add the next bar, markers of its interfaces, sensors of two nodes in its frame."""
    mbs, number = scene.mbs, len(scene.bodies) + 1
    alpha, beta = RAYLEIGH
    items = scene.cms.AddObjectFFRFreducedOrder(
        mbs,
        positionRef=position,
        gravity=[0, 0, 0],
        massProportionalDamping=alpha,
        stiffnessProportionalDamping=beta,
    )
    scene.bodies += (items,)
    flexible = items["oFFRFreducedOrder"]
    for side in ("left", "right"):
        scene.markers[f"{side} {number}"] = add_interface_marker(mbs, flexible, *interface(scene.fem, side))
    for probe in ("tip", "middle"):
        name = f"{probe} {number} local"
        sensor = itemInterface.SensorSuperElement(
            name=name,
            bodyNumber=flexible,
            meshNodeNumber=interface(scene.fem, probe)[0][0],
            outputVariableType=exu.OutputVariableType.DisplacementLocal,
            storeInternal=True,
        )
        scene.sensors[name] = mbs.AddSensor(sensor)
