"""Run-up of an unbalanced rotor: how a bound grows while the body turns faster and faster.

    python examples/rotor_run_up.py [FOLDER]     prints the bound, writes FOLDER/rotor_run_up.png (5 s)

FOLDER is examples/results if left out. The bound covers the time steps too, under the motion and bearing forces of
this run (scope "inputs frozen"). How these react is covered by bounds as in double_pendulum.py.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from matplotlib.figure import Figure

import exudyn_romerr as romerr
from exudyn_romerr.report.plots.style import COLOURS
from models import floating

STEP = 1e-4  # s
SOFT = 0.05  # s, in which gravity grows; at once, it excites modes that no step resolves: bound 4 times larger
RESULTS = Path(__file__).resolve().parent / "results"


def simulate(t_end: float) -> tuple[romerr.BoundReport, np.ndarray]:
    """Run the rotor up to 80 rad/s; return the report and the angular velocity (T, 3) of its frame in rad/s."""
    scene = floating.rotor(6, h=STEP, t_end=t_end)
    scene.mbs.SetSensorParameter(scene.sensors["rim local"], "name", "rim")
    scene.mbs.SetLoadParameter(0, "loadVectorUserFunction", grown)  # the load that Exudyn made of gravity
    spin = itemInterface.SensorNode(
        nodeNumber=scene.items["nRigidBody"],
        outputVariableType=exu.OutputVariableType.AngularVelocityLocal,
        storeInternal=True,
    )
    speed = scene.mbs.AddSensor(spin)
    flex = romerr.floating_body(scene.fem, scene.items)
    monitor = romerr.attach(scene.mbs, flex, outputs=[scene.sensors["rim local"]], scope="inputs frozen")
    scene.solve()
    return monitor.report(), scene.mbs.GetSensorStoredData(speed)[:, 1:]


def grown(mbs: exu.MainSystem, t: float, gravity: list[float]) -> list[float]:
    """Return gravity at time t, as the user function of its load."""
    return [g * np.sin(np.pi / 2 * min(t / SOFT, 1.0)) ** 2 for g in gravity]


def draw(report: romerr.BoundReport, speed: np.ndarray, path: Path) -> None:
    """Draw the displacement of the rim in the turning frame with its band, the bound, and the speed."""
    figure = Figure(figsize=(7.2, 7.8), layout="constrained")
    rim, error, turning = figure.subplots(3, 1, sharex=True, height_ratios=(1.4, 1, 0.8))
    t, out = report.t, report.output("rim")
    y, band = (1e6 * x[:, 1] for x in (out.value, out.bound["best"]))
    rim.fill_between(t, y - band, y + band, color="#A9DAF5", label="value ± bound")
    rim.plot(t, y, color=COLOURS["value"], lw=0.8, label="reduced model")
    error.semilogy(t[1:], band[1:], color=COLOURS["auxiliary"], lw=2, label="bound of the error")
    turning.plot(t, np.linalg.norm(speed, axis=1), color=COLOURS["convolution"])
    rim.set(ylabel="rim y in the frame / µm", title="Run-up of an unbalanced rotor, scope: inputs frozen")
    error.set(ylabel="error of rim y / µm")
    turning.set(ylabel="speed / (rad/s)", xlabel="t / s")
    rim.legend(loc="lower left")
    error.legend(loc="lower right")
    for axes in (rim, error, turning):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=150)


def main(folder: str | Path = RESULTS, t_end: float = 0.5) -> romerr.BoundReport:
    """Print the report, save the picture; return the report."""
    report, speed = simulate(t_end)
    print(report)
    Path(folder).mkdir(parents=True, exist_ok=True)
    draw(report, speed, Path(folder) / "rotor_run_up.png")
    return report


if __name__ == "__main__":
    main(*sys.argv[1:2])
