"""A plastic bar of models/hex_bar.py, 60 coordinates: few enough for all its modes in Exudyn and exact truths.

The left face may be driven: a joint with all axes locked whose offsets are functions of time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import ObjectFFRFreducedOrderInterface

from models import floating
from models.floating import FloatingScene
from models.hex_bar import hex_bar

if TYPE_CHECKING:
    from collections.abc import Callable


def bar(
    n: int = 4, kind: str = "RBE3", h: float = 1e-3, t_end: float = 0.04, gravity: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> FloatingScene:
    """Return the bar alone, nothing holds it; n, kind: modes, see floating.reduce; Rayleigh damping 2, 1e-5.

    Sensors, of a corner at the far end: "displacement", "position", "velocity" (global axes), "displacement local",
    "velocity local" (in the floating frame).
    """
    fem = hex_bar()
    floating.reduce(fem, n, kind)
    cms = ObjectFFRFreducedOrderInterface(fem)
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    alpha, beta = floating.RAYLEIGH
    items = cms.AddObjectFFRFreducedOrder(
        mbs, gravity=list(gravity), massProportionalDamping=alpha, stiffnessProportionalDamping=beta
    )
    flexible = items["oFFRFreducedOrder"]
    markers = {
        side: floating.add_interface_marker(mbs, flexible, *floating.interface(fem, side))
        for side in ("left", "right")
    }
    sensors = _add_sensors(mbs, flexible, len(fem.nodes["Position"]) - 1)
    return FloatingScene(SC, mbs, fem, cms, items, markers, sensors, floating.solver_settings(h, t_end))


def driven(motion: Callable, rate: Callable | None = None, back: bool = False, **options: Any) -> FloatingScene:
    """Return the bar, its left face welded to the ground but for offsets motion(t) (6,), with rates rate(t).

    back : the ground has the joint's second marker. options: those of bar.
    """
    scene = bar(**options)
    nodes, weights = floating.interface(scene.fem, "left")
    position = weights @ scene.fem.GetNodePositionsAsArray()[nodes]
    ground = scene.mbs.AddObject(itemInterface.ObjectGround(referencePosition=position))
    marker = scene.mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=ground))
    functions = {"offsetUserFunction": lambda mbs, t, i, parameters: list(motion(t))}
    if rate is not None:
        functions["offsetUserFunction_t"] = lambda mbs, t, i, parameters: list(rate(t))
    markers = [marker, scene.markers["left"]]
    scene.mbs.AddObject(itemInterface.GenericJoint(markerNumbers=markers[::-1] if back else markers, **functions))
    return scene


def spinning(share: float, **options: Any) -> FloatingScene:
    """Return the bar, hinged (axis y) at its left face, spinning at a share of its first frequency if clamped there.

    options: those of bar. It begins undeformed: centrifugal forces act at once.
    """
    scene = bar(**options)
    nodes, weights = floating.interface(scene.fem, "left")
    hinge = weights @ scene.fem.GetNodePositionsAsArray()[nodes]
    floating._add_joint(scene, "left", [1, 1, 1, 1, 0, 1])
    w = np.array([0.0, share * first_frequency(), 0.0])
    rates = [*-np.cross(w, hinge), 0.0, *(w / 2)]  # of the origin, and of Euler parameters
    scene.mbs.SetNodeParameter(scene.items["nRigidBody"], "initialVelocities", rates)
    return scene


def first_frequency() -> float:
    """Return the first frequency in rad/s of the bar whose left face has no mean motion."""
    fem = hex_bar()
    floating.reduce(fem, 0, "complete")
    return float(np.sqrt(fem.eigenValues[0]))


def _add_sensors(mbs: Any, flexible: int, node: int) -> dict[str, int]:
    kinds = exu.OutputVariableType
    shown = {
        "displacement": kinds.Displacement,
        "position": kinds.Position,
        "velocity": kinds.Velocity,
        "displacement local": kinds.DisplacementLocal,
        "velocity local": kinds.VelocityLocal,
    }
    sensor = itemInterface.SensorSuperElement
    return {
        name: mbs.AddSensor(
            sensor(bodyNumber=flexible, meshNodeNumber=node, storeInternal=True, outputVariableType=kind, name=name)
        )
        for name, kind in shown.items()
    }
