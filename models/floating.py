"""Steel bodies of solid tetrahedra in a floating frame: a clamped bar, a pendulum, the run-up of an unbalanced rotor.

Written as a user of Exudyn writes it. The bodies, made by models/make_floating_bodies.py, are read from models/data:
"bar" (65 nodes, linear), "bar_fine" (the same mesh, 311 nodes, quadratic), "rotor" (189 nodes, linear). Linear
tetrahedra are far too stiff in bending; as the full model of a reduction they are as good as any.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import exudyn as exu
import numpy as np
import scipy.linalg as la
from exudyn import itemInterface
from exudyn.FEM import FEMinterface, HCBstaticModeSelection, ObjectFFRFreducedOrderInterface
from scipy import sparse

import exudyn_romerr as romerr

DATA = Path(__file__).parent / "data"
GRAVITY = [0.0, 0.0, -9.81]  # m/s^2
RAYLEIGH = (2.0, 1e-5)  # 1/s, s
SPECTRAL_RADIUS = 0.8  # of generalised-alpha: a little numerical damping, for the constraints of the joints
LoadFunction = Callable[[float], tuple[float, float, float]]


@dataclass
class FloatingScene:
    """A model of one reduced flexible body; items, markers and sensors are Exudyn's numbers.

    Markers: MarkerSuperElementRigid "left", "right". Sensors of displacement: "tip" and "tip local" (rotor: "rim",
    "rim local") of one node, global and in the floating frame; "right" of that interface, global.
    """

    SC: Any
    mbs: Any
    fem: FEMinterface
    cms: ObjectFFRFreducedOrderInterface
    items: dict[str, int]
    markers: dict[str, int]
    sensors: dict[str, int]
    settings: exu.SimulationSettings

    def solve(self) -> None:
        """Assemble if that was not done, and solve from the start to the end."""
        if not self.mbs.systemIsConsistent:
            self.mbs.Assemble()
        self.mbs.SolveDynamic(self.settings)


def load_fem(name: str) -> FEMinterface:
    """Return "bar", "bar_fine" or "rotor" as if just imported from ngsolve, without modes.

    Node sets are "left" and "right" (end faces, weights by area) and "tip" or "rim" (one node).
    """
    fem = FEMinterface()
    with np.load(DATA / f"floating_{name}.npz", allow_pickle=False) as file:
        fem.nodes = {"Position": file["nodes"]}
        fem.elements = [{"Name": "NGsolve", "Tet4": file["tets"]}]
        fem.surface = [{"Name": "meshSurface", "Trigs": file["triangles"]}]
        fem.massMatrix, fem.stiffnessMatrix = (_csr(file, matrix) for matrix in ("mass", "stiffness"))
        fem.nodeSets = [
            {"Name": str(key), "NodeNumbers": file[f"{key}_nodes"], "NodeWeights": file[f"{key}_weights"]}
            for key in file["sets"]
        ]
    return fem


def interface(fem: FEMinterface, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the node numbers of a node set and their weights, which sum to 1."""
    found = next(nodes for nodes in fem.nodeSets if nodes["Name"] == name)
    return found["NodeNumbers"], found["NodeWeights"]


def reduce(fem: FEMinterface, n: int | Sequence[int], kind: str = "RBE3") -> None:
    """Compute modes into fem.modeBasis; n: how many eigenmodes, or the numbers (from 0) of those to keep.

    kind : "RBE2", "RBE3": Craig-Bampton with interfaces left (held) and right, 6 static modes and n eigenmodes.
        "free": n eigenmodes of the free body, rigid body modes excluded.
        "complete": all modes with zero weighted mean displacement and rotation of the left interface, whatever n.
    """
    if not isinstance(n, int):
        reduce(fem, max(n, default=-1) + 1, kind)
        romerr.keep_modes(fem, n)
    elif kind == "complete":
        _complete_modes(fem)
    elif kind == "free":
        # dense: the sparse solver factorises the singular K and starts from random numbers
        fem.ComputeEigenmodes(n, excludeRigidBodyModes=6, useSparseSolver=False)
        fem.eigenValues = fem.eigenValues[6 : 6 + n]  # the dense solver leaves all of them
    else:
        craig_bampton(fem, ("left", "right"), n, kind)


def craig_bampton(fem: FEMinterface, names: Sequence[str], n: int, kind: str) -> None:
    """Compute "RBE2" or "RBE3" modes of some node sets, the first one held, and n eigenmodes into fem.modeBasis."""
    nodes, weights = zip(*(interface(fem, name) for name in names), strict=True)
    mode = HCBstaticModeSelection[kind]
    fem.ComputeHurtyCraigBamptonModes(nodes, n, computationMode=mode, boundaryNodesWeights=weights)


def ramped_force(t: float) -> tuple[float, float, float]:
    """Force in N at the tip of the clamped bar: 200 N in y and z, from zero within 10 ms, two frequencies."""
    size = 200.0 * np.sin(np.pi / 2 * min(t / 0.01, 1.0)) ** 2
    return 0.0, size * np.sin(400.0 * t), size * np.sin(900.0 * t)


def out_of_plane_force(t: float) -> tuple[float, float, float]:
    """Force in N at the tip of the pendulum, along its hinge."""
    return 0.0, 200.0 * np.sin(60.0 * t), 0.0


def clamped_bar(
    n: int | Sequence[int] = 4,
    kind: str = "RBE3",
    body: str = "bar",
    h: float = 1e-4,
    t_end: float = 0.05,
    force: LoadFunction = ramped_force,
    damping: tuple[float, float] = RAYLEIGH,
    assemble: bool = False,
) -> FloatingScene:
    """Bar along x, welded to the ground by the mean motion of its left face, loaded at its right face; gravity.

    n, kind: modes, see reduce; body: "bar" or "bar_fine"; h, t_end: step and end time in s; force: f(t) in N, global
    axes; damping: alpha in 1/s, beta in s. Unless `assemble`, solve() assembles; attach a monitor before that.
    """
    scene = _body_alone(body, "tip", (n, kind), damping, (h, t_end))
    _add_joint(scene, "left", [1, 1, 1, 1, 1, 1])
    return _loaded(scene, itemInterface.LoadForceVector, "right", force, assemble)


def pendulum(
    n: int | Sequence[int] = 4,
    kind: str = "RBE3",
    body: str = "bar",
    h: float = 1e-3,
    t_end: float = 0.3,
    force: LoadFunction = out_of_plane_force,
    damping: tuple[float, float] = RAYLEIGH,
    assemble: bool = False,
) -> FloatingScene:
    """Bar along x that falls from rest about a hinge (axis y) at its left face; parameters as in clamped_bar."""
    scene = _body_alone(body, "tip", (n, kind), damping, (h, t_end))
    _add_joint(scene, "left", [1, 1, 1, 1, 0, 1])  # free: rotation about y
    return _loaded(scene, itemInterface.LoadForceVector, "right", force, assemble)


def rotor(
    n: int | Sequence[int] = 6,
    kind: str = "RBE3",
    h: float = 5e-4,
    t_end: float = 0.5,
    speed: float = 80.0,
    damping: tuple[float, float] = RAYLEIGH,
    assemble: bool = False,
) -> FloatingScene:
    """Shaft along x, its disc unbalanced, driven from rest to `speed` in rad/s at t_end by a torque at its left face.

    It stays far below its lowest bending frequency, 555 rad/s. Other parameters as in clamped_bar.
    """
    scene = _body_alone("rotor", "rim", (n, kind), damping, (h, t_end))
    _add_joint(scene, "left", [1, 1, 1, 0, 0, 0])
    _add_joint(scene, "right", [0, 1, 1, 0, 0, 0])
    mean = scene.cms.inertiaLocal[0, 0] * speed / t_end

    def torque(t: float) -> tuple[float, float, float]:
        return mean * (1 - np.cos(np.pi * t / t_end)), 0.0, 0.0

    return _loaded(scene, itemInterface.LoadTorqueVector, "left", torque, assemble)


def _csr(file: Any, name: str) -> sparse.csr_matrix:
    return sparse.csr_matrix(tuple(file[f"{name}_{part}"] for part in ("data", "indices", "indptr")))


def _complete_modes(fem: FEMinterface) -> None:
    """Put all eigenmodes with C_0 q = 0, M-orthonormal, into fem.modeBasis."""
    C = _mean_motion(fem.GetNodePositionsAsArray(), *interface(fem, "left"))
    Z = la.qr(C.T)[0][:, len(C) :]
    K, M = (Z.T @ (matrix @ Z) for matrix in (fem.stiffnessMatrix, fem.massMatrix))
    fem.eigenValues, modes = la.eigh(K, M)
    fem.modeBasis = {"matrix": Z @ modes, "type": "NormalModes"}


def _mean_motion(positions: np.ndarray, nodes: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return C_0 (6, 3 nodes): sum w_i u_i and sum w_i (x_i - x_mean) x u_i."""
    arms = positions[nodes] - weights @ positions[nodes]
    C = np.zeros((6, *positions.shape))
    for axis, unit in enumerate(np.eye(3)):
        C[axis, nodes, axis] = weights
        C[3 + axis, nodes] = weights[:, None] * np.cross(unit, arms)  # e . (arm x u) = (e x arm) . u
    return C.reshape(6, -1)


def _body_alone(body: str, probe: str, modes: tuple, damping: tuple, times: tuple) -> FloatingScene:
    """Return a scene of the body with gravity, markers of its interfaces and sensors."""
    fem = load_fem(body)
    reduce(fem, *modes)
    cms = ObjectFFRFreducedOrderInterface(fem)
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    items = cms.AddObjectFFRFreducedOrder(
        mbs, gravity=GRAVITY, massProportionalDamping=damping[0], stiffnessProportionalDamping=damping[1]
    )
    flexible = items["oFFRFreducedOrder"]
    markers = {side: add_interface_marker(mbs, flexible, *interface(fem, side)) for side in ("left", "right")}
    sensors = _add_sensors(mbs, flexible, probe, interface(fem, probe)[0][0], markers["right"])
    return FloatingScene(SC, mbs, fem, cms, items, markers, sensors, solver_settings(*times))


def add_interface_marker(mbs: Any, flexible: int, nodes: np.ndarray, weights: np.ndarray) -> int:
    marker = itemInterface.MarkerSuperElementRigid
    return mbs.AddMarker(marker(bodyNumber=flexible, meshNodeNumbers=nodes, weightingFactors=weights))


def _add_sensors(mbs: Any, flexible: int, probe: str, node: int, right: int) -> dict[str, int]:
    u, uLocal = exu.OutputVariableType.Displacement, exu.OutputVariableType.DisplacementLocal
    at_node = {"bodyNumber": flexible, "meshNodeNumber": node, "storeInternal": True}
    sensors = {
        probe: itemInterface.SensorSuperElement(outputVariableType=u, **at_node),
        f"{probe} local": itemInterface.SensorSuperElement(outputVariableType=uLocal, **at_node),
        "right": itemInterface.SensorMarker(markerNumber=right, outputVariableType=u, storeInternal=True),
    }
    return {name: mbs.AddSensor(sensor) for name, sensor in sensors.items()}


def _add_joint(scene: FloatingScene, side: str, axes: list[int]) -> None:
    """Join an interface to the ground at its mean position."""
    nodes, weights = interface(scene.fem, side)
    position = weights @ scene.fem.GetNodePositionsAsArray()[nodes]
    ground = scene.mbs.AddObject(itemInterface.ObjectGround(referencePosition=position))
    marker = scene.mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=ground))
    scene.mbs.AddObject(itemInterface.GenericJoint(markerNumbers=[marker, scene.markers[side]], constrainedAxes=axes))


def _loaded(scene: FloatingScene, load: type, side: str, function: LoadFunction, assemble: bool) -> FloatingScene:
    """Add a force or torque f(t) in global axes; assemble if asked to."""
    item = load(markerNumber=scene.markers[side], loadVectorUserFunction=lambda mbs, t, loadVector: function(t))
    scene.mbs.AddLoad(item)
    if assemble:
        scene.mbs.Assemble()
    return scene


def solver_settings(h: float, t_end: float) -> exu.SimulationSettings:
    simulationSettings = exu.SimulationSettings()
    timeIntegration = simulationSettings.timeIntegration
    timeIntegration.numberOfSteps = round(t_end / h)
    timeIntegration.endTime = t_end
    timeIntegration.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    timeIntegration.verboseMode = 0
    simulationSettings.solution.file.write = False
    simulationSettings.solution.sensors.writePeriod = h
    return simulationSettings
