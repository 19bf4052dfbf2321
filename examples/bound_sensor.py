"""Bounds in Exudyn's own ways: a sensor of the bound, the estimate beside it, and a band on a plot of PlotSensor.

    python examples/bound_sensor.py [FOLDER]     writes FOLDER/bound_sensor.png

FOLDER is examples/results if left out. A steel bar, clamped to the ground and shaken at its end, with 4 eigenmodes.
"""

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

import exudyn_romerr as romerr
from models import floating

RESULTS = Path(__file__).resolve().parent / "results"
Z = 2  # component of the displacement


def simulate(h: float = 4e-4, t_end: float = 0.02) -> tuple[Any, dict[str, int], romerr.BoundReport]:
    """Solve with a bound sensor; return mbs, sensors, report."""
    scene = floating.clamped_bar(4, h=h, t_end=t_end)
    mbs, sTip = scene.mbs, scene.sensors["tip"]
    mbs.SetSensorParameter(sTip, "name", "tip")
    flex = romerr.floating_body(scene.fem, scene.items)
    monitor = romerr.attach(mbs, flex, outputs=[sTip])
    sBound = mbs.AddSensor(monitor.bound_sensor("tip"))
    mbs.Assemble()
    scene.settings.solution.sensors.writePeriod = h  # both sensors, at every step
    mbs.SolveDynamic(scene.settings)
    return mbs, {"tip": sTip, "bound": sBound}, monitor.report()


def plot(mbs: Any, sensors: dict[str, int], report: romerr.BoundReport) -> Any:
    """Draw the tip with its band, and its bound with the estimate beside it, with PlotSensor; return the figure."""
    style = {"fontSize": 10, "majorTicksX": 5, "sizeInches": [7, 3.2], "components": [Z]}
    signal = mbs.PlotSensor(sensors["tip"], labels="tip z", yLabel="tip z / m", subPlot=[1, 2, 1], **style)
    options = {"labels": "its error bound", "newFigure": False, "logScaleY": True, "colors": ["#0072B2"], **style}
    bound = mbs.PlotSensor(sensors["bound"], yLabel="error of tip z / m", subPlot=[1, 2, 2], **options)
    size = np.abs(report.output("tip").estimate[:, Z])
    bound[2].plot(report.t, np.where(size > 0, size, np.nan), "--", color="#000000", label="its error, estimated")
    romerr.add_bands(signal, report, "tip", components=Z)  # last: it makes one legend of all
    return signal[2].figure


def main(folder: str | Path = RESULTS, h: float = 4e-4, t_end: float = 0.02) -> np.ndarray:
    """Solve, save the picture, print and return the sensor's data: rows of t and the bounds of x, y, z."""
    mbs, sensors, report = simulate(h, t_end)
    Path(folder).mkdir(parents=True, exist_ok=True)
    plot(mbs, sensors, report).savefig(Path(folder) / "bound_sensor.png", dpi=150)
    data = mbs.GetSensorStoredData(sensors["bound"])
    about, most = np.abs(report.output("tip").estimate[:, Z]).max(), data[:, 1 + Z].max()
    print(f"tip z is wrong by about {about:.3g} m, says the report, and by at most {most:.3g} m, says its sensor")
    return data


if __name__ == "__main__":
    main(*sys.argv[1:2])
