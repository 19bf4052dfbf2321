"""Scenes that estimates of the whole error are measured on: those of other models, and three more.

A scene is made by (n, kind, h): eigenmodes of its bodies, "RBE3" or "complete" (all modes), step in s. It has an mbs,
settings, sensors by name and solve().
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import ObjectFFRFreducedOrderInterface

import exudyn_romerr as romerr
from models import driven_bar, driven_truth, floating, mechanisms, wishbone
from models.floating import GRAVITY, interface
from models.hex_bar import hex_bar

SOFT_BAR = {"elements": 8, "size": (1.0, 0.04, 0.05), "material": (2e9, 2000.0, 0.3)}  # its first mode: 90 rad/s
SOFT_DAMPING = (0.0, 2e-4)  # alpha in 1/s, beta in s
RIGID_BAR = (0.5, 0.04, 0.06)  # m
FORCES = (
    "crank pin ForceLocal",
    "crank pin TorqueLocal",
    "piston pin ForceLocal",
    "guide ForceLocal",
    "shaft ForceLocal",
)
MANY = 64  # eigenmodes of the arm of 3369 coordinates, whose complete basis is out of reach


@dataclass
class RigidScene:
    """A model without flexible bodies."""

    SC: Any
    mbs: Any
    settings: exu.SimulationSettings
    sensors: dict[str, int] = field(default_factory=dict)
    bodies: tuple[dict[str, int], ...] = ()
    fem: Any = None
    solve = mechanisms.MechanismScene.solve


@dataclass
class LinearScene(RigidScene):
    """A linear body whose supports are in its matrices; sensors show what `outputs` does."""

    flex: Any = None
    outputs: tuple[romerr.Output, ...] = ()


@dataclass(frozen=True)
class EstimateScene:
    """make: (n, kind, h) -> scene; h, t_end in s and n of the reduced runs; full: (n, kind) of the truth.

    local, turned, rigid, forces : names of sensors that are compared, in the frames of flexible bodies and in global
    axes, on rigid bodies, and of joints. finer : steps of the truth in one of the reduced runs.
    """

    make: Callable[[int, str, float], Any]
    h: float
    t_end: float
    n: tuple[int, ...]
    local: tuple[str, ...]
    turned: tuple[str, ...] = ()
    full: tuple[int, str] = (0, "complete")
    finer: tuple[int, int, int] = (8, 16, 32)
    rigid: tuple[str, ...] = ()
    forces: tuple[str, ...] = ()

    @property
    def sensors(self) -> tuple[str, ...]:
        """All of them."""
        return self.local + self.turned + self.rigid + self.forces


def slider_crank(n: int, kind: str, h: float, t_end: float, speed: float = 200.0) -> mechanisms.MechanismScene:
    """The slider crank of models/mechanisms.py with sensors of its piston and of the forces in its joints."""
    scene = mechanisms.slider_crank(n, kind, h, t_end, speed=speed)
    _show_rigid(scene, scene.objects["piston"], "piston", [0, 0, 0])
    for name in FORCES:
        _show_joint(scene, scene.objects[name.rsplit(" ", maxsplit=1)[0]], name)
    return scene


def hinged_bar(n: int, kind: str, h: float, t_end: float) -> mechanisms.MechanismScene:
    """A long soft bar along x, hinged (axis y) at its left face; gravity acts at once."""
    fem = hex_bar(**SOFT_BAR)
    floating.reduce(fem, n, kind)
    SC = exu.SystemContainer()
    cms, settings = ObjectFFRFreducedOrderInterface(fem), mechanisms.settings_to_compare(h, t_end)
    scene = mechanisms.MechanismScene(SC, SC.AddSystem(), fem, cms, settings)
    items = cms.AddObjectFFRFreducedOrder(
        scene.mbs,
        gravity=GRAVITY,
        massProportionalDamping=SOFT_DAMPING[0],
        stiffnessProportionalDamping=SOFT_DAMPING[1],
    )
    scene.bodies = (items,)
    nodes, weights = interface(fem, "left")
    flexible, place = items["oFFRFreducedOrder"], weights @ fem.GetNodePositionsAsArray()[nodes]
    ground = scene.mbs.CreateGround(referencePosition=place)
    left = floating.add_interface_marker(scene.mbs, flexible, nodes, weights)
    at_ground = scene.mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=ground))
    mechanisms.join(scene, "hinge", at_ground, left, mechanisms.HINGE)
    for name in ("tip", "middle"):
        _show_node(scene, flexible, int(interface(fem, name)[0][0]), name)
    _show_joint(scene, scene.objects["hinge"], "hinge ForceLocal")
    return scene


def linear_bar(n: int, kind: str, h: float, t_end: float) -> LinearScene:
    """The bar of models/floating.py as a linear body: all nodes of its left face fixed, a force at its right face."""
    fem = floating.load_fem("bar")
    fixed = [3 * node + axis for node in interface(fem, "left")[0] for axis in range(3)]
    body = romerr.ElasticBody.from_fem(fem, rayleigh=floating.RAYLEIGH, fixed=fixed)
    nodes, weights = interface(fem, "right")
    inputs = np.zeros((body.N, 3))
    for axis in range(3):
        inputs[3 * nodes + axis, axis] = weights
    basis = romerr.modal_basis(body, body.free.size if kind == "complete" else n)
    SC = exu.SystemContainer()
    scene = LinearScene(SC, SC.AddSystem(), floating.solver_settings(h, t_end), fem=fem)
    force = floating.ramped_force
    scene.flex = romerr.add_reduced_body(scene.mbs, body, basis, inputs=inputs, input_function=force)
    tip, node = int(interface(fem, "tip")[0][0]), scene.flex.items["nGenericODE2"]
    places = {"tip local": tip, "middle local": mechanisms.MIDDLE}
    scene.outputs = tuple(romerr.node_displacement(name, node=place, unit="m") for name, place in places.items())
    for out in scene.outputs:
        rows = out.resolve(body) @ basis.V
        sensor = itemInterface.SensorUserFunction(
            storeInternal=True,
            sensorUserFunction=lambda mbs, t, numbers, factors, configuration, rows=rows: list(
                rows @ mbs.GetNodeOutput(node, exu.OutputVariableType.Coordinates, configuration)
            ),
        )
        scene.sensors[out.name] = scene.mbs.AddSensor(sensor)
    return scene


def driven(n: int, kind: str, h: float, t_end: float) -> mechanisms.MechanismScene:
    """The bar of models/driven_bar.py, its left face turned: "turns" of models/driven_truth.py."""
    motion = driven_truth.offsets("turns")
    scene = driven_bar.driven(lambda t: motion(t)[0], lambda t: motion(t)[1], n=n, kind=kind, h=h, t_end=t_end)
    scene.bodies = (scene.items,)
    return scene


def clamped_bar(n: int, kind: str, h: float, t_end: float) -> floating.FloatingScene:
    """The bar of examples/clamped_bar.py, welded to the ground."""
    scene = floating.clamped_bar(n, kind, h=h, t_end=t_end)
    scene.bodies = (scene.items,)
    return scene


def quarter_car(n: int, kind: str, h: float, t_end: float) -> wishbone.QuarterCar:
    """The quarter car of models/wishbone.py with a sensor of the arm's ball joint."""
    scene = wishbone.quarter_car(n, kind, h=h, t_end=t_end)
    sensor = itemInterface.SensorMarker(
        markerNumber=scene.markers["ball"],
        outputVariableType=exu.OutputVariableType.Displacement,
        storeInternal=True,
    )
    scene.sensors["ball joint"] = scene.mbs.AddSensor(sensor)
    return scene


def _show_rigid(scene: Any, body: int, name: str, place: Any) -> None:
    """Add a sensor of the displacement of a point of a rigid body."""
    sensor = itemInterface.SensorBody(
        name=name,
        bodyNumber=body,
        localPosition=list(place),
        outputVariableType=exu.OutputVariableType.Displacement,
        storeInternal=True,
    )
    scene.sensors[name] = scene.mbs.AddSensor(sensor)


def _show_joint(scene: Any, joint: int, name: str) -> None:
    """Add a sensor of what a joint's forces are; the last word of its name says in which axes."""
    sensor = itemInterface.SensorObject(
        name=name,
        objectNumber=joint,
        outputVariableType=getattr(exu.OutputVariableType, name.split()[-1]),
        storeInternal=True,
    )
    scene.sensors[name] = scene.mbs.AddSensor(sensor)


def _show_node(scene: Any, flexible: int, node: int, name: str) -> None:
    """Add sensors of a mesh node's displacement: in global axes, and in the frame."""
    for suffix, kind in (("", "Displacement"), (" local", "DisplacementLocal")):
        sensor = itemInterface.SensorSuperElement(
            bodyNumber=flexible,
            meshNodeNumber=node,
            outputVariableType=getattr(exu.OutputVariableType, kind),
            storeInternal=True,
        )
        scene.sensors[f"{name}{suffix}"] = scene.mbs.AddSensor(sensor)


def _timed(make: Callable, t_end: float) -> Callable[[int, str, float], Any]:
    return lambda n, kind, h: make(n, kind, h, t_end)


WISHBONE = ("ball node local",), ("ball joint",), (MANY, "RBE3")
BOTH = ("tip 1", "middle 1", "tip 2", "middle 2")
SCENES = {
    "slider_crank": EstimateScene(
        _timed(slider_crank, 0.12),
        5e-4,
        0.12,
        (4,),
        ("tip 1 local", "middle 1 local"),
        ("tip 1", "middle 1"),
        rigid=("piston",),
        forces=FORCES,
    ),
    "slider_crank_fine": EstimateScene(  # steps that resolve every mode of the reduced mechanism
        lambda n, kind, h: slider_crank(n, kind, h, 0.01, speed=40.0),
        1.25e-5,
        0.01,
        (0,),
        (),
        finer=(2, 4, 8),
        forces=("crank pin ForceLocal", "piston pin ForceLocal", "shaft ForceLocal"),
    ),
    "sprung_body": EstimateScene(
        _timed(mechanisms.sprung_body, 0.1), 1e-3, 0.1, (4,), ("tip 1 local", "middle 1 local"), BOTH[:2]
    ),
    "double_pendulum": EstimateScene(
        _timed(mechanisms.double_pendulum, 0.3), 2e-3, 0.3, (4,), tuple(f"{name} local" for name in BOTH), BOTH
    ),
    "hinged_bar": EstimateScene(
        _timed(hinged_bar, 0.1),
        5e-4,
        0.1,
        (2, 8),
        ("tip local", "middle local"),
        ("tip", "middle"),
        forces=("hinge ForceLocal",),
    ),
    "hinged_bar_fine": EstimateScene(
        _timed(hinged_bar, 0.05),
        1.25e-4,
        0.05,
        (2,),
        ("tip local", "middle local"),
        ("tip", "middle"),
        finer=(2, 4, 8),
    ),
    "clamped_bar": EstimateScene(_timed(clamped_bar, 0.04), 2e-4, 0.04, (4,), ("tip local",), ("tip", "right")),
    "linear_bar": EstimateScene(_timed(linear_bar, 0.04), 2e-4, 0.04, (4,), ("tip local", "middle local")),
    "driven_bar": EstimateScene(_timed(driven, 0.04), 1e-3, 0.04, (4,), ("displacement local",), ("displacement",)),
    "wishbone": EstimateScene(_timed(quarter_car, 0.2), 1e-3, 0.2, (4,), *WISHBONE, rigid=("wheel",)),
    "wishbone_fine": EstimateScene(_timed(quarter_car, 0.2), 5e-4, 0.2, (4,), *WISHBONE, (4, 8, 16), ("wheel",)),
}
