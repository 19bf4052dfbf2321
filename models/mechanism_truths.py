"""Motion of scenes of mechanisms with no mode left out, stored in models/data/mechanism_truths.npz: truths of tests.

They have the integrator and the steps of the reduced runs that they are compared with, and all modes ("complete" in
models/floating.py): a difference is the reduction error.

    python models/mechanism_truths.py      solves all scenes again and writes the file (about 40 s)
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from models import floating, mechanisms

FILE = floating.DATA / "mechanism_truths.npz"
KICK = 0.02  # s


def with_velocities(name: str, n: int, kind: str, **options: Any) -> mechanisms.MechanismScene:
    """Return a scene of models/mechanisms.py with a sensor of the tip's velocity in the frame of each bar."""
    scene = getattr(mechanisms, name)(n, kind, **options)
    tip = int(floating.interface(scene.fem, "tip")[0][0])
    for i, body in enumerate(scene.bodies, start=1):
        sensor = itemInterface.SensorSuperElement(
            bodyNumber=body["oFFRFreducedOrder"],
            meshNodeNumber=tip,
            storeInternal=True,
            outputVariableType=exu.OutputVariableType.VelocityLocal,
        )
        scene.sensors[f"velocity {i} local"] = scene.mbs.AddSensor(sensor)
    return scene


def half_crank(n: int, kind: str = "RBE3", steps: int = 120) -> mechanisms.MechanismScene:
    """Return the slider crank that is at its speed after 60 ms."""
    return mechanisms.slider_crank(n, kind, h=0.06 / steps, t_end=0.06)


def falling(n: int, kind: str = "RBE3") -> floating.FloatingScene:
    """Return the pendulum that falls at once."""
    return floating.pendulum(n, kind, h=1e-4, t_end=0.05)


def kicked(n: int, kind: str = "RBE3") -> floating.FloatingScene:
    """Return the pendulum that is kicked smoothly, sampled so that steps do not matter."""
    return floating.pendulum(n, kind, h=1e-4, t_end=KICK, force=kick)


def kick(t: float) -> tuple[float, float, float]:
    """2 kN along the hinge, and across it, over 20 ms."""
    size = 2e3 * np.sin(np.pi * t / KICK) ** 4
    return 0.0, size, size


SCENES: dict[str, Callable[[int, str], Any]] = {
    "double_pendulum": lambda n, kind: with_velocities("double_pendulum", n, kind),
    "slider_crank": lambda n, kind: with_velocities("slider_crank", n, kind),
    "sprung_body": lambda n, kind: with_velocities("sprung_body", n, kind),
    "half_crank": half_crank,
    "falling": falling,
    "kicked": kicked,
}


def solved(name: str, steps: int | None = None) -> dict[str, np.ndarray]:
    """Solve the full model, only the first steps if asked; return sensor -> values (T, 3) in the frames of bars."""
    scene = SCENES[name](0, "complete")
    if steps is not None:
        time = scene.settings.timeIntegration
        time.endTime, time.numberOfSteps = steps * time.endTime / time.numberOfSteps, steps
    scene.solve()
    return {key: scene.mbs.GetSensorStoredData(k)[:, 1:] for key, k in scene.sensors.items() if "local" in key}


def stored(name: str, path: Path = FILE) -> dict[str, np.ndarray]:
    """Return what was found of a scene when the file was written."""
    with np.load(path, allow_pickle=False) as file:
        keys = [key for key in file.files if key.startswith(f"{name}/")]
        return {key.partition("/")[2]: file[key] for key in keys}


def write(path: Path, names: Iterable[str], solved: Callable[[str], dict[str, np.ndarray]]) -> None:
    """Solve scenes and write a file that `stored` reads."""
    found = {f"{name}/{key}": values for name in names for key, values in solved(name).items()}
    np.savez_compressed(path, **found)
    print(f"written: {path}")


if __name__ == "__main__":
    write(FILE, SCENES, solved)
