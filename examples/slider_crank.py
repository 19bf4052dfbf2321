"""A slider crank with a flexible connecting rod: two runs check a bound, in a closed loop of joints.

    python examples/slider_crank.py [FOLDER]     prints reports, writes FOLDER/slider_crank.png (20 s)

FOLDER is examples/results if left out. The rod has 6 static modes, and 0 or 4 eigenmodes. The coarse run is bounded
by itself, and by way of the fine one (romerr.two_level). The true error is the difference to a run with all modes.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from typing import Any

import exudyn as exu
import numpy as np
from matplotlib.figure import Figure

import exudyn_romerr as romerr
from exudyn_romerr.mbs.studies.two_level import TwoLevel
from exudyn_romerr.report.plots.style import COLOURS, WIDE
from models import mechanisms

COARSE, MORE = 0, 4  # eigenmodes of the coarse run, and how many more the fine one has
NAME = "middle of the rod"
RESULTS = Path(__file__).resolve().parent / "results"


def builder(t_end: float) -> Any:
    """Return build(n), which makes the scene with n eigenmodes and attaches a monitor, for two_level."""

    def build(n: int) -> tuple[exu.MainSystem, Any, exu.SimulationSettings]:
        scene = mechanisms.slider_crank(n, t_end=t_end)
        middle = romerr.node_displacement(NAME, node=mechanisms.MIDDLE, component="z")
        flex = romerr.floating_body(scene.fem, scene.bodies[0])
        return scene.mbs, romerr.attach(scene.mbs, flex, outputs=[middle]), scene.settings

    return build


def with_all_modes(t_end: float) -> np.ndarray:
    """Return instants and the bending of the rod (T, 2) when no mode is left out."""
    scene = mechanisms.slider_crank(kind="complete", t_end=t_end)
    scene.solve()
    return scene.mbs.GetSensorStoredData(scene.sensors["middle 1 local"])[:, [0, 3]]


def draw(levels: TwoLevel, truth: np.ndarray, path: Path) -> None:
    """Draw the bending of the rod and its error in the coarse run, with what bounds it."""
    figure = Figure(figsize=(7.2, 7.2), layout="constrained")
    signal, error = figure.subplots(2, 1, sharex=True)
    coarse, fine, level = levels.coarse[0].output(NAME), levels.fine[0].output(NAME), levels.output(NAME)
    t = 1e3 * levels.t
    shown = (
        (truth, "-", COLOURS["error"], WIDE, "all modes"),
        (coarse.value, "-", COLOURS["value"], 1.0, "no eigenmode"),
        (coarse.corrected, "--", COLOURS["auxiliary"], 1.5, "no eigenmode, corrected output"),
    )
    for y, style, colour, width, label in shown:
        signal.plot(t, 1e6 * y, style, color=colour, lw=width, label=label)
    lines = (
        (coarse.bound["best"], "-", COLOURS["auxiliary"], 5.0, "no eigenmode: bound"),
        (level.bound, "--", COLOURS["convolution"], WIDE, "no eigenmode: bound by two levels"),
        (np.abs(coarse.error), "-", COLOURS["error"], 1.0, "no eigenmode: |true error|"),
        (fine.bound["best"], "-", COLOURS["fast"], WIDE, "4 eigenmodes: bound"),
        (np.abs(fine.error), ":", COLOURS["error"], 1.0, "4 eigenmodes: |true error|"),
    )
    for y, style, colour, width, label in lines:
        error.semilogy(t[1:], 1e6 * y[1:], style, color=colour, lw=width, label=label)
    signal.set(ylabel="bending in the rod's frame / µm", title="Middle of the connecting rod")
    error.set(ylabel="reduction error / µm", xlabel="t / ms", ylim=(1e-7, None))
    signal.legend()
    error.legend(loc="lower right", ncols=2, fontsize="small")
    for axes in (signal, error):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=150)


def main(folder: str | Path = RESULTS, t_end: float = 0.08) -> TwoLevel:
    """Print both runs beside the true error, save the picture; return the two levels."""
    levels, truth = romerr.two_level(builder(t_end), COARSE, MORE), with_all_modes(t_end)
    for report in (levels.coarse[0], levels.fine[0]):
        report.compare(NAME, *truth.T)
    print(levels.coarse[0], levels, sep="\n")
    for n, report in zip(levels.modes, (levels.coarse[0], levels.fine[0]), strict=True):
        out = report.output(NAME)
        left = np.max(np.abs(out.error + out.value - out.corrected))
        print(
            f"{n} eigenmodes: true error {np.max(np.abs(out.error)):.4g} m, bound {np.max(out.bound['best']):.4g} m, "
            f"of the corrected output {left:.2g} m, bound {np.max(out.corrected_bound):.2g} m"
        )
    Path(folder).mkdir(parents=True, exist_ok=True)
    draw(levels, truth[:, 1:], Path(folder) / "slider_crank.png")
    return levels


if __name__ == "__main__":
    main(*sys.argv[1:2])
