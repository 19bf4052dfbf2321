"""What mechanisms of full bodies show, stored in models/data/output_truths.npz: truths of estimates of outputs.

Scenes of models/mechanisms.py with all modes ("complete" in models/floating.py), with the integrator and the steps of
the reduced runs that they are compared with: a difference is the reduction error. Global axes and frames' axes.

    python models/output_truths.py      solves all scenes and writes the file (about 2 minutes)
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import KirchhoffMaterial

import exudyn_romerr as romerr
from models import floating, mechanism_truths, mechanisms

FILE = floating.DATA / "output_truths.npz"
STEEL = KirchhoffMaterial(2.1e11, 0.3)  # any will do: truth and estimate are of the same strains
SCENES: dict[str, Callable[..., mechanisms.MechanismScene]] = {
    "slider_crank": lambda n, kind="RBE3": mechanisms.slider_crank(n, kind, h=5e-4, t_end=0.06),
    "double_pendulum": lambda n, kind="RBE3": mechanisms.double_pendulum(n, kind, h=2e-3, t_end=0.2),
    "sprung_body": lambda n, kind="RBE3": mechanisms.sprung_body(n, kind, h=1e-3, t_end=0.1),
}
SHOWN = {  # by sensors
    "displacement": "Displacement",
    "position": "Position",
    "velocity": "Velocity",
    "displacement in the frame": "DisplacementLocal",
    "velocity in the frame": "VelocityLocal",
}


def outputs(scene: mechanisms.MechanismScene) -> list[romerr.Output]:
    """Return outputs of one bar: of its tip, and rotation and stress, which the truth has of its modes."""
    tip = int(floating.interface(scene.fem, "tip")[0][0])
    of_tip = romerr.model.outputs.nodes_output
    moving = [
        of_tip(name, [tip], None, "xyz", "m", name.partition(" ")[0], "body" if "frame" in name else "global")
        for name in SHOWN
    ]
    return [*moving, *of_modes(scene)]


def of_modes(scene: mechanisms.MechanismScene) -> list[romerr.Output]:
    """Return outputs that no sensor shows: rotation of the right face, stress at mid-length."""
    nodes, weights = floating.interface(scene.fem, "right")
    return [
        romerr.mean_rotation("rotation", nodes=nodes, weights=weights),
        romerr.node_stress("stress", node=mechanisms.MIDDLE, fem=scene.fem, material=STEEL, component="xx"),
    ]


def solved(name: str, steps: int | None = None) -> dict[str, np.ndarray]:
    """Solve the full model, only the first steps if asked; return "output of bar i" -> values (T, r)."""
    scene = SCENES[name](0, "complete")
    if steps is not None:
        time = scene.settings.timeIntegration
        time.endTime, time.numberOfSteps = steps * time.endTime / time.numberOfSteps, steps
    tip = int(floating.interface(scene.fem, "tip")[0][0])
    numbers, modal = {}, {}
    for i, items in enumerate(scene.bodies, start=1):
        at = {"bodyNumber": items["oFFRFreducedOrder"], "meshNodeNumber": tip, "storeInternal": True}
        for what, kind in SHOWN.items():
            variable = getattr(exu.OutputVariableType, kind)
            sensor = itemInterface.SensorSuperElement(outputVariableType=variable, **at)
            numbers[f"{what} of bar {i}"] = scene.mbs.AddSensor(sensor)
        modal[i] = scene.mbs.AddSensor(
            itemInterface.SensorNode(
                nodeNumber=items["nGenericODE2"],
                outputVariableType=exu.OutputVariableType.Coordinates,
                storeInternal=True,
            )
        )
    scene.solve()
    found = {key: scene.mbs.GetSensorStoredData(k)[:, 1:] for key, k in numbers.items()}
    for i, k in modal.items():
        body, q = _Mesh(scene.fem), scene.mbs.GetSensorStoredData(k)[:, 1:]
        for out in of_modes(scene):
            found[f"{out.name} of bar {i}"] = q @ (out.resolve(body) @ scene.fem.modeBasis["matrix"]).T
    return found


class _Mesh:
    """What outputs are made of."""

    def __init__(self, fem: Any):
        self.positions, self.dofs_per_node = fem.GetNodePositionsAsArray(), 3
        self.N = 3 * len(self.positions)


def stored(name: str) -> dict[str, np.ndarray]:
    """Return what `solved` found when the file was written."""
    return mechanism_truths.stored(name, FILE)


if __name__ == "__main__":
    mechanism_truths.write(FILE, SCENES, solved)
