"""A blow at the end of a double pendulum: the coupled bound, and what a bound with frozen inputs hides.

    python examples/double_pendulum.py [FOLDER]     prints both, writes FOLDER/double_pendulum.png (20 s)

FOLDER is examples/results if left out. Two flexible bars, hinged to the ground and to each other, with 6 static modes
and 1 eigenmode each. The true error is the difference to a run with all modes and the same time steps.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from matplotlib.figure import Figure

import exudyn_romerr as romerr
from exudyn_romerr.report.plots.style import COLOURS, WIDE
from models import floating, mechanisms

STEP = 2e-4  # s
EIGENMODES = 1  # of each bar, beside 6 static modes
BARS = (1, 2)
FROZEN, COUPLED = "inputs frozen", "coupled (linearised)"
RESULTS = Path(__file__).resolve().parent / "results"


def blow(t: float) -> tuple[float, float, float]:
    """Force in N at the end of the second bar, 10 ms long: 1 kN along the hinges, 3 kN across."""
    size = np.sin(300.0 * t) ** 4 if t < np.pi / 300 else 0.0
    return 0.0, 1e3 * size, 3e3 * size


def simulate(kind: str, scope: str, t_end: float) -> romerr.BoundReport:
    """Run bars with 7 modes ("RBE3") or with all modes ("complete"); one monitor, one report for both bars."""
    scene = mechanisms.double_pendulum(EIGENMODES, kind, h=STEP, t_end=t_end, force=blow)
    node = int(floating.interface(scene.fem, "tip")[0][0])
    flexes = [romerr.floating_body(scene.fem, items) for items in scene.bodies]
    tips = [romerr.node_displacement(f"tip {bar}", node=node, component="y", unit="m") for bar in BARS]
    outputs = list(zip(flexes, tips, strict=True))
    monitor = romerr.attach(scene.mbs, flexes, outputs=outputs, scope=scope, time="sampled")
    scene.solve()
    return monitor.report()


def with_all_modes(t_end: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return instants and the displacement (T,) of both tips along the hinges, in the frames, all modes kept."""
    scene = mechanisms.double_pendulum(kind="complete", h=STEP, t_end=t_end, force=blow)
    scene.solve()
    stored = [scene.mbs.GetSensorStoredData(scene.sensors[f"tip {bar} local"]) for bar in BARS]
    return stored[0][:, 0], [data[:, 2] for data in stored]


def draw(found: dict[str, romerr.BoundReport], path: Path) -> None:
    """Draw the displacement of both tips, and below it the error with both bounds."""
    figure = Figure(figsize=(9.6, 6.6), layout="constrained")
    above, below = figure.subplots(2, 2, sharex=True, sharey="row", height_ratios=(0.8, 1))
    for bar, signal, error in zip(BARS, above, below, strict=True):
        frozen, coupled = (found[scope].output(f"tip {bar}") for scope in (FROZEN, COUPLED))
        t = 1e3 * found[COUPLED].t
        signal.plot(t, 1e6 * coupled.value, color=COLOURS["value"], label="reduced model, 7 modes a bar")
        signal.set(title=f"tip of bar {bar}, along the hinges, in its frame")
        lines = (
            (coupled.bound["best"], "-", COLOURS["auxiliary"], WIDE, f"bound, {COUPLED}"),
            (frozen.bound["best"], "--", COLOURS["convolution"], 1.8, f"bound, {FROZEN}"),
            (np.abs(coupled.error), "-", COLOURS["error"], 1.0, "|true error|: all modes less these"),
        )
        for y, style, colour, width, label in lines:
            error.semilogy(t[1:], 1e6 * y[1:], style, color=colour, lw=width, label=label)
        error.set(xlabel="t / ms", ylim=(1e-6, None))
    above[0].set(ylabel="displacement / µm")
    below[0].set(ylabel="reduction error / µm")
    above[1].legend(loc="upper left")
    below[0].legend(loc="lower right")
    for axes in (*above, *below):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=150)


def main(folder: str | Path = RESULTS, t_end: float = 0.014) -> dict[str, romerr.BoundReport]:
    """Print a report and both bounds beside the true error, save the picture; return the reports of both scopes."""
    found = {scope: simulate("RBE3", scope, t_end) for scope in (COUPLED, FROZEN)}
    t, truth = with_all_modes(t_end)
    for report in found.values():
        for bar, y in zip(BARS, truth, strict=True):
            report.compare(f"tip {bar}", t, y)
    print(found[COUPLED])
    for bar in BARS:
        outs = {scope: report.output(f"tip {bar}") for scope, report in found.items()}
        print(f"tip {bar}: true error up to {np.max(np.abs(outs[COUPLED].error)):.3g} m")
        for scope, out in outs.items():
            ratio = out.effectivity["best"][0]
            print(f"  {scope}: bound {np.max(out.bound['best']):.3g} m, {ratio:.3g} times the error")
    Path(folder).mkdir(parents=True, exist_ok=True)
    draw(found, Path(folder) / "double_pendulum.png")
    return found


if __name__ == "__main__":
    main(*sys.argv[1:2])
