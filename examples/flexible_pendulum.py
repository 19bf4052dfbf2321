"""A falling flexible pendulum: bounds in a moving frame, with inputs frozen and with the hinge's reaction.

    python examples/flexible_pendulum.py [FOLDER]     prints bounds, also those of the solution file (15 s)

The picture is FOLDER/flexible_pendulum.png; FOLDER is examples/results if left out.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from matplotlib.figure import Figure

import exudyn_romerr as romerr
from exudyn_romerr.report.plots.style import COLOURS
from models import floating

STEP = 1e-4  # s: a quarter of a radian of the first elastic mode; with 1 ms the bound is 240 times as large
RESULTS = Path(__file__).resolve().parent / "results"
FROZEN = """"inputs frozen": bounds hold for the full bar under the frame motion, loads and hinge forces of this run.
In the pendulum these react to the bar's deformation; the coupled bound covers that to first order. The reduction
error in the bar's frame (difference to a run with all modes), and its bounds:"""


def simulate(path: Path, t_end: float) -> tuple[romerr.BoundReport, romerr.BoundReport]:
    """Run the pendulum, inputs frozen; return the report made alongside, and that of the solution file."""
    scene = floating.pendulum(4, h=STEP, t_end=t_end)
    for name, number in scene.sensors.items():
        scene.mbs.SetSensorParameter(number, "name", name)  # outputs take the names of their sensors
    file = scene.settings.solution.file
    file.write, file.name, file.writePeriod, file.binary = True, str(path), 0, True  # every step, all digits
    flex = romerr.floating_body(scene.fem, scene.items)
    outputs = [scene.sensors["tip"], scene.sensors["tip local"]]  # in global axes, and in those of the bar's frame
    monitor = romerr.attach(scene.mbs, flex, outputs=outputs, scope="inputs frozen")
    scene.solve()
    return monitor.report(), romerr.evaluate_file(scene.mbs, flex, path, outputs=outputs)


def coupled_bound(t_end: float) -> np.ndarray:
    """Return the bound (T, 3) that covers the hinge's reaction; of outputs in the bar's frame only."""
    scene = floating.pendulum(4, h=STEP, t_end=t_end)
    scene.mbs.SetSensorParameter(scene.sensors["tip local"], "name", "tip local")
    flex = romerr.floating_body(scene.fem, scene.items)
    monitor = romerr.attach(scene.mbs, flex, outputs=[scene.sensors["tip local"]], scope="coupled (linearised)")
    scene.solve()
    return monitor.report().output("tip local").bound["best"]


def with_all_modes(t_end: float) -> np.ndarray:
    """Return the displacement of the tip in the frame (T, 3) when no mode of the bar is left out."""
    scene = floating.pendulum(kind="complete", h=STEP, t_end=t_end)
    scene.solve()
    return scene.mbs.GetSensorStoredData(scene.sensors["tip local"])[:, 1:]


def draw(report: romerr.BoundReport, coupled: np.ndarray, left_out: np.ndarray, path: Path) -> None:
    """Draw the fall of the tip, its deflection in the frame with the band, and what freezing the inputs hides."""
    fall, deflection, basis = Figure(figsize=(7.2, 7.8), layout="constrained").subplots(3, 1, sharex=True)
    t, local = report.t, report.output("tip local")
    y, band, reduction = (x[:, 2] for x in (local.value, local.bound["best"], local.reduction_bound["best"]))
    fall.plot(t, 1e3 * report.output("tip").value[:, 2], color=COLOURS["value"], label="reduced model")
    deflection.fill_between(t, 1e6 * (y - band), 1e6 * (y + band), color="#A9DAF5", label="value ± bound")
    deflection.plot(t, 1e6 * y, color=COLOURS["value"], lw=1, label="reduced model")
    basis.semilogy(t[1:], coupled[1:, 2], color=COLOURS["auxiliary"], lw=2.5, label="bound, coupled (linearised)")
    basis.semilogy(t[1:], reduction[1:], "--", color=COLOURS["convolution"], lw=1.5, label="bound, inputs frozen")
    basis.semilogy(t[1:], left_out[1:, 2], color=COLOURS["error"], lw=1, label="difference to all modes")
    names = "tip z, global / mm", "tip z in frame / µm", "reduction error of it / m"
    for axes, label in zip((fall, deflection, basis), names, strict=True):
        axes.set(ylabel=label, xlabel="t / s" if axes is basis else None)
        axes.legend()
    fall.figure.savefig(path, dpi=150)


def main(folder: str | Path = RESULTS, t_end: float = 0.05) -> tuple[romerr.BoundReport, romerr.BoundReport]:
    """Print the report and what its scope leaves out, save the picture; return both reports."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as scratch:
        report, from_file = simulate(Path(scratch) / "flexible_pendulum.sol", t_end)
    local, again = (r.output("tip local") for r in (report, from_file))
    left_out, coupled = np.abs(with_all_modes(t_end) - local.value), coupled_bound(t_end)
    print(report, FROZEN, sep="\n")
    for axis, *sizes in zip("xyz", left_out.T, local.reduction_bound["best"].T, coupled.T, strict=True):
        error, frozen, bound = (size.max() for size in sizes)
        print(f"  {axis}: {error:.3g} m; inputs frozen {frozen:.3g} m, coupled {bound:.3g} m")
    print(f"bounds of the file differ by {np.abs(local.bound['best'] - again.bound['best']).max():.1g} m")
    draw(report, coupled, left_out, Path(folder) / "flexible_pendulum.png")
    return report, from_file


if __name__ == "__main__":
    main(*sys.argv[1:2])
