"""A flexible arm on a hinge, whose motor is a PD controller with feed forward: it follows a set point over time.

The bar of models/mechanisms.py, hinged (axis y) to the ground at its left face. Controllers are written as users of
Exudyn write them: as the user function of a spring between ground and arm, which is given angle and rate; or as that
of a load, which looks at sensors. models/data/controlled_arm.npz has the truths of tests, all modes.

    python models/controlled_arm.py      solves all scenes again and writes the file (about 15 s)
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

from models import floating, mechanisms
from models.mechanism_truths import stored, write

FILE = floating.DATA / "controlled_arm.npz"
STEP, STEPS = 1e-3, 60  # s
TURN = 0.3  # rad, of the set point
LENGTH = 0.4  # m, of the arm
ALONG_Y = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
Control = Callable[[float, float, float], float]  # torque in Nm against an angle and its rate, at a time


def set_point(t: float) -> tuple[float, float]:
    """Angle in rad and rate in rad/s, smooth: a cycloid over 4/5 of the run."""
    T = 0.8 * STEP * STEPS
    s = min(t / T, 1.0)
    return TURN * (s - np.sin(2 * np.pi * s) / (2 * np.pi)), TURN / T * (1 - np.cos(2 * np.pi * s))


def pd(P: float, D: float, limit: float = np.inf) -> Control:
    """Gains in Nm/rad and Nms/rad; limit of the torque in Nm."""

    def control(t: float, angle: float, rate: float) -> float:
        wanted, wanted_rate = set_point(t)
        return float(np.clip(P * (angle - wanted) + D * (rate - wanted_rate), -limit, limit))

    return control


def arm(n: int = 1, kind: str = "RBE3", steps: int = STEPS, h: float = STEP) -> mechanisms.MechanismScene:
    """Return the arm without its motor; n, kind: modes, see floating.reduce; h : step in s."""
    scene = mechanisms._scene((n, kind), (h, steps * h))
    mechanisms._add_bar(scene, floating.RAYLEIGH)
    left, _ = mechanisms._faces(scene.fem)
    scene.markers["ground"] = mechanisms._ground_marker(scene.mbs, left)
    mechanisms.join(scene, "hinge", scene.markers["ground"], scene.markers["left 1"], mechanisms.HINGE)
    for name, number in scene.sensors.items():
        scene.mbs.SetSensorParameter(number, "name", name)
    return scene


def add_spring(scene: mechanisms.MechanismScene, control: Control) -> int:
    """Add the motor as a spring between ground and arm, which is given angle and rate."""
    turned = []
    for name in ("ground", "left 1"):
        marker = scene.mbs.GetMarker(scene.markers[name])
        item = {key: value for key, value in marker.items() if key != "name" and key[0] != "V"}
        turned.append(scene.mbs.AddMarker(item | {"localHT": ALONG_Y}))

    def torque(mbs, t, number, angle, rate, stiffness, damping, offset):
        return control(t, angle, rate)

    return scene.mbs.AddObject(
        itemInterface.TorsionalSpringDamper(name="motor", markerNumbers=turned, springTorqueUserFunction=torque)
    )


def add_load(scene: mechanisms.MechanismScene, control: Control, at_node: bool, mbs: Any = None) -> int:
    """Add the motor as a torque on the arm, by sensors of its end, or of a node within it; by what they show in mbs.

    mbs : None: the one that the function is given.
    """
    motion, of = [], exu.OutputVariableType
    for kind in (of.Displacement, of.Velocity):
        if at_node:
            place = {"bodyNumber": scene.bodies[0]["oFFRFreducedOrder"], "meshNodeNumber": mechanisms.MIDDLE}
            sensor = itemInterface.SensorSuperElement(outputVariableType=kind, **place)
        else:
            sensor = itemInterface.SensorMarker(markerNumber=scene.markers["right 1"], outputVariableType=kind)
        motion.append(scene.mbs.AddSensor(sensor))
    arm_length, own = LENGTH / 2 if at_node else LENGTH, mbs

    def torque(mbs, t, vector):
        angle, rate = (-(own or mbs).GetSensorValues(sensor)[2] / arm_length for sensor in motion)
        return [0.0, -control(t, angle, rate), 0.0]

    return scene.mbs.AddLoad(
        itemInterface.LoadTorqueVector(
            name="motor", markerNumber=scene.markers["left 1"], loadVectorUserFunction=torque
        )
    )


MOTORS: dict[str, Callable[[mechanisms.MechanismScene], int]] = {
    "spring": lambda scene: add_spring(scene, pd(2e3, 20.0)),
    "stiff spring": lambda scene: add_spring(scene, pd(2e6, 1e3)),
    "undamped spring": lambda scene: add_spring(scene, pd(2e3, 0.0)),
    "load": lambda scene: add_load(scene, pd(2e3, 20.0), at_node=False),
    "load by a node": lambda scene: add_load(scene, pd(1e4, 100.0), at_node=True),
}


def controlled(name: str, n: int = 1, kind: str = "RBE3", **options: Any) -> mechanisms.MechanismScene:
    """Return the arm with one of the motors; other parameters as in arm."""
    scene = arm(n, kind, **options)
    MOTORS[name](scene)
    return scene


def solved(name: str, steps: int = STEPS) -> dict[str, np.ndarray]:
    """Solve the full model; return sensor -> values (T, 3)."""
    scene = controlled(name, 0, "complete", steps=steps)
    scene.solve()
    return {key: scene.mbs.GetSensorStoredData(number)[:, 1:] for key, number in scene.sensors.items()}


def truth(name: str) -> dict[str, np.ndarray]:
    """Return what was found when the file was written."""
    return stored(name, FILE)


if __name__ == "__main__":
    write(FILE, MOTORS, solved)
