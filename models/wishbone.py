"""A quarter car on a double wishbone suspension with a flexible lower control arm, driven over a bump.

Written as a user of Exudyn writes it. Vehicle axes: x forward, y outboard, z up; the origin is between the bushes of
the lower arm. The arm, steel, 5 kg, made by models/make_wishbone.py, is read from models/data: 1621 nodes, 10-node
tetrahedra. Everything else is rigid. All springs and dampers are linear; the tyre never leaves the road by itself.
The car stands still, in the equilibrium of a static solve, when the bump begins at t = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
from exudyn.utilities import InertiaCuboid, RigidBodyInertia

import exudyn_romerr as romerr
from models import solid_bar
from models.floating import DATA, GRAVITY, RAYLEIGH, add_interface_marker, craig_bampton, interface
from models.mechanisms import MechanismScene, join, settings_to_compare

# m, in the position that the mesh has
POINTS = {
    "front": (0.13, 0.0, 0.0),  # bushes of the lower arm, axes along x
    "rear": (-0.16, 0.0, 0.0),
    "ball": (0.0, 0.36, 0.0),  # lower ball joint
    "seat": (-0.015, 0.2, 0.0),  # of the coil spring with its damper, on the lower arm
    "tower": (-0.015, 0.12, 0.4),  # their upper end, at the chassis
    "upper pivot": (-0.01, 0.08, 0.25),
    "upper ball": (-0.01, 0.33, 0.24),
    "rack": (-0.12, 0.03, 0.09),  # tie rod
    "steering arm": (-0.12, 0.36, 0.08),
    "wheel": (0.0, 0.42, 0.11),  # centre
    "chassis": (0.0, -0.4, 0.3),
}
INTERFACES = ("front", "rear", "ball", "seat")  # of the lower arm; the first one holds its frame
SPRUNG_MASS = 350.0  # kg
WHEEL_MASS = 38.0  # kg, with hub, brake and knuckle
UPPER_ARM_MASS = 2.5  # kg
BUSH_STIFFNESS = np.diag([2e6, 1e7, 1e7, 60.0, 1e3, 1e3])  # N/m, Nm/rad
BUSH_DAMPING = np.diag([6e2, 3e3, 3e3, 0.2, 1.0, 1.0])  # Ns/m, Nms/rad
SPRING, DAMPER, PRELOAD = 75e3, 4e3, 6.4e3  # N/m, Ns/m, N in the position of the mesh
TYRE_STIFFNESS, TYRE_DAMPING = 200e3, 300.0  # N/m, Ns/m, vertical
TIE_ROD = 2e7, 1e3  # N/m, Ns/m
WHEEL_LOAD = 3.88e3  # N: the weight of all this
BUMP = (0.05, 0.6)  # m: height and length
SPEED = 4.0  # m/s
RoadFunction = Callable[[float], tuple[float, float]]


def bump(t: float) -> tuple[float, float]:
    """Height in m and slope of the road under the wheel at time t in s: one cosine, from t = 0."""
    (height, length), x = BUMP, SPEED * t
    if not 0 < x < length:
        return 0.0, 0.0
    turn = 2 * np.pi / length
    return height / 2 * (1 - np.cos(turn * x)), height / 2 * turn * np.sin(turn * x)


@dataclass
class QuarterCar(MechanismScene):
    """A MechanismScene whose solve() finds the equilibrium first.

    bodies: items of the lower arm. markers: MarkerSuperElementRigid "front", "rear", "ball", "seat". objects: rigid
    bodies, bushes, joints, springs by name. sensors: displacements "chassis", "wheel", "road" (global), "ball node
    local" (a mesh node at the ball joint, in the frame of the arm, which the front bush holds).
    driving: whether the road is that of the function of time. Static solvers have a time of their own, from 0 to 1.
    """

    driving: bool = False

    def settle(self) -> None:
        """Assemble if that was not done, and solve for the equilibrium at rest; a dynamic solve starts there."""
        if not self.mbs.systemIsConsistent:
            self.mbs.Assemble()
        self.driving = False
        self.mbs.SolveStatic(self.settings, updateInitialValues=True)
        self.driving = True

    def solve(self) -> None:
        """Solve for the equilibrium, and drive over the bump from there on."""
        self.settle()
        self.mbs.SolveDynamic(self.settings)


def load_fem() -> FEMinterface:
    """Return the arm as if just imported from ngsolve, without modes; node sets are those of INTERFACES."""
    fem = FEMinterface()
    with np.load(DATA / "wishbone.npz", allow_pickle=False) as file:
        nodes, tets = file["nodes"], file["tets"].astype(int)
        fem.nodes = {"Position": nodes}
        fem.elements = [{"Name": "NGsolve", "Tet4": tets[:, :4]}]
        fem.surface = [{"Name": "meshSurface", "Trigs": file["triangles"].astype(int)}]
        fem.massMatrix, fem.stiffnessMatrix = (matrix.tocsr() for matrix in solid_bar.matrices(nodes, tets))
        fem.nodeSets = [
            {"Name": name, "NodeNumbers": file[f"{name}_nodes"].astype(int), "NodeWeights": file[f"{name}_weights"]}
            for name in INTERFACES
        ]
    return fem


def reduce(fem: FEMinterface, n: int, kind: str = "RBE3", static: Sequence[str] = INTERFACES) -> None:
    """Compute Craig-Bampton modes, "RBE2" or "RBE3", into fem.modeBasis: n eigenmodes beside static modes.

    static : interfaces; the first one is held, each other one has 6 static modes.
    """
    craig_bampton(fem, static, n, kind)
    romerr.hold_modes(fem, *interface(fem, static[0]))  # Exudyn's RBE3 modes do to 4 digits only


def quarter_car(
    n: int = 4,
    kind: str = "RBE3",
    static: Sequence[str] = INTERFACES,
    h: float = 1e-3,
    t_end: float = 0.2,
    road: RoadFunction = bump,
    damping: tuple[float, float] = RAYLEIGH,
    assemble: bool = False,
) -> QuarterCar:
    """Chassis, guided vertically, both arms, knuckle with wheel, spring and damper, tyre, road.

    n, kind: eigenmodes of the arm beside 18 static modes, "RBE2" or "RBE3"; h, t_end: step and end time in s; road:
    height in m and slope over time, zero for t <= 0; damping of the arm: alpha in 1/s, beta in s. Unless `assemble`,
    solve() assembles; attach a monitor before that.
    """
    fem = load_fem()
    reduce(fem, n, kind, static)
    SC = exu.SystemContainer()
    cms = ObjectFFRFreducedOrderInterface(fem)
    scene = QuarterCar(SC, SC.AddSystem(), fem, cms, _settings(h, t_end))
    _add_bodies(scene, damping)
    _add_joints(scene)
    _add_springs(scene)
    _add_road(scene, road)
    _add_sensors(scene)
    if assemble:
        scene.mbs.Assemble()
    return scene


def _settings(h: float, t_end: float) -> exu.SimulationSettings:
    settings = settings_to_compare(h, t_end)
    newton = settings.staticSolver.newton
    newton.relativeTolerance, newton.absoluteTolerance = 1e-10, 1e-12  # as in the dynamic solve
    settings.staticSolver.verboseMode = 0
    return settings


def _add_bodies(scene: QuarterCar, damping: tuple[float, float]) -> None:
    mbs = scene.mbs
    items = scene.cms.AddObjectFFRFreducedOrder(
        mbs, gravity=GRAVITY, massProportionalDamping=damping[0], stiffnessProportionalDamping=damping[1]
    )
    scene.bodies = (items,)
    for name in INTERFACES:
        scene.markers[name] = add_interface_marker(mbs, items["oFFRFreducedOrder"], *interface(scene.fem, name))
    span = np.linalg.norm(np.subtract(POINTS["upper ball"], POINTS["upper pivot"]))
    middle = np.add(POINTS["upper ball"], POINTS["upper pivot"]) / 2
    inertias = {
        "chassis": (InertiaCuboid(SPRUNG_MASS, [1.0, 1.0, 1.0]), POINTS["chassis"]),
        "wheel": (RigidBodyInertia(WHEEL_MASS, WHEEL_MASS * np.diag([0.024, 0.04, 0.024])), POINTS["wheel"]),
        "upper arm": (InertiaCuboid(UPPER_ARM_MASS / (0.2 * span * 0.03), [0.2, span, 0.03]), middle),
        "road": (InertiaCuboid(1.0, [1.0, 1.0, 1.0]), POINTS["wheel"]),
    }
    for name, (inertia, place) in inertias.items():
        gravity = [0, 0, 0] if name == "road" else GRAVITY
        scene.objects[name] = mbs.CreateRigidBody(referencePosition=[*place], inertia=inertia, gravity=gravity)
    scene.objects["ground"] = mbs.CreateGround()


def _marker(scene: QuarterCar, body: str, point: str) -> int:
    """Add a marker on a rigid body at one of POINTS."""
    number = scene.objects[body]
    of_body = exu.OutputVariableType.Position, [0, 0, 0], exu.ConfigurationType.Reference
    local = np.subtract(POINTS[point], scene.mbs.GetObjectOutputBody(number, *of_body))
    return scene.mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=number, localPosition=local))


def _add_joints(scene: QuarterCar) -> None:
    guide, hinge, ball = [1, 1, 0, 1, 1, 1], [1, 1, 1, 0, 1, 1], [1, 1, 1, 0, 0, 0]
    joints = {
        "guide": (_marker(scene, "ground", "chassis"), _marker(scene, "chassis", "chassis"), guide),
        "upper hinge": (_marker(scene, "chassis", "upper pivot"), _marker(scene, "upper arm", "upper pivot"), hinge),
        "upper ball": (_marker(scene, "upper arm", "upper ball"), _marker(scene, "wheel", "upper ball"), ball),
        "lower ball": (scene.markers["ball"], _marker(scene, "wheel", "ball"), ball),
    }
    for name, (marker0, marker1, axes) in joints.items():
        join(scene, name, marker0, marker1, axes)


def _add_springs(scene: QuarterCar) -> None:
    mbs, objects = scene.mbs, scene.objects
    for name in ("front", "rear"):
        ends = [_marker(scene, "chassis", name), scene.markers[name]]
        bush = itemInterface.RigidBodySpringDamper(markerNumbers=ends, stiffness=BUSH_STIFFNESS, damping=BUSH_DAMPING)
        objects[f"{name} bush"] = mbs.AddObject(bush)
    rods = {
        "spring": (scene.markers["seat"], "chassis", "tower", "seat", (SPRING, DAMPER, PRELOAD)),
        "tie rod": (_marker(scene, "wheel", "steering arm"), "chassis", "rack", "steering arm", (*TIE_ROD, 0.0)),
    }
    for name, (marker, body, end, begin, (stiffness, damping, preload)) in rods.items():
        length = np.linalg.norm(np.subtract(POINTS[end], POINTS[begin]))
        rod = itemInterface.SpringDamper(
            markerNumbers=[marker, _marker(scene, body, end)],
            referenceLength=length + preload / stiffness,
            stiffness=stiffness,
            damping=damping,
        )
        objects[name] = mbs.AddObject(rod)


def _add_road(scene: QuarterCar, road: RoadFunction) -> None:
    """Add the moving road, the tyre, and the horizontal force of the slope.

    The road is a body that a joint moves: an offset over time is no controller, and bounds stay coupled.
    """
    mbs, objects = scene.mbs, scene.objects

    def offset(mbs: Any, t: float, itemNumber: int, parameters: Any) -> list[float]:
        return [0, 0, road(t)[0] if scene.driving else 0, 0, 0, 0]

    def push(mbs: Any, t: float, loadVector: Any) -> list[float]:
        return [-WHEEL_LOAD * road(t)[1] if scene.driving else 0, 0, 0]

    ground, on_road, on_wheel = (_marker(scene, body, "wheel") for body in ("ground", "road", "wheel"))
    guide = itemInterface.GenericJoint(markerNumbers=[ground, on_road], offsetUserFunction=offset)
    tyre = itemInterface.CartesianSpringDamper(
        markerNumbers=[on_road, on_wheel],
        stiffness=[0, 0, TYRE_STIFFNESS],
        damping=[0, 0, TYRE_DAMPING],
        offset=[0, 0, WHEEL_LOAD / TYRE_STIFFNESS],
    )
    objects["bump"], objects["tyre"] = mbs.AddObject(guide), mbs.AddObject(tyre)
    mbs.AddLoad(itemInterface.LoadForceVector(markerNumber=on_wheel, loadVectorUserFunction=push))


def _add_sensors(scene: QuarterCar) -> None:
    kind = {"outputVariableType": exu.OutputVariableType.Displacement, "storeInternal": True}
    for name in ("chassis", "wheel", "road"):
        sensor = itemInterface.SensorBody(bodyNumber=scene.objects[name], **kind)
        scene.sensors[name] = scene.mbs.AddSensor(sensor)
    kind["outputVariableType"] = exu.OutputVariableType.DisplacementLocal
    arm, node = scene.bodies[0]["oFFRFreducedOrder"], interface(scene.fem, "ball")[0][0]
    sensor = itemInterface.SensorSuperElement(bodyNumber=arm, meshNodeNumber=node, **kind)
    scene.sensors["ball node local"] = scene.mbs.AddSensor(sensor)
