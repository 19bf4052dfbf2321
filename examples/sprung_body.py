"""A bar between springs: released from its static equilibrium, shaken, and its output corrected.

    python examples/sprung_body.py [FOLDER]     prints the reports, writes FOLDER/sprung_body.png (20 s)

FOLDER is examples/results if left out. No joint holds the bar: all that acts on it are springs, dampers, its weight
and a force. It hangs at rest first, in the equilibrium of a static solve. The full model starts in its own.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from matplotlib.figure import Figure

import exudyn_romerr as romerr
from exudyn_romerr.report.plots.style import COLOURS, WIDE
from models import floating, mechanisms

STEP = 5e-4  # s
EIGENMODES = 1  # beside 6 static modes
NAME = "middle of the bar"
RESULTS = Path(__file__).resolve().parent / "results"


class Shaker:
    """The force f(t) of mechanisms.sprung_body, off until `on` is set: static solvers call f with t = load factor."""

    on = False

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Return the force in N at time t in s."""
        return mechanisms.shaking_force(t) if self.on else (0.0, 0.0, 0.0)


def built(kind: str, t_end: float) -> tuple[mechanisms.MechanismScene, Shaker]:
    """Return the scene and its shaker; "complete": with all modes."""
    shaker = Shaker()
    return mechanisms.sprung_body(EIGENMODES, kind, h=STEP, t_end=t_end, force=shaker), shaker


def solve(scene: mechanisms.MechanismScene, shaker: Shaker) -> None:
    """Solve for the equilibrium under its weight, and from there on."""
    mbs, settings = scene.mbs, scene.settings
    mbs.Assemble()
    for load in range(mbs.systemData.NumberOfLoads()):
        if mbs.GetLoad(load)["loadType"] == "MassProportional":  # in full from the start, not growing
            mbs.SetLoadParameter(load, "loadVectorUserFunction", 0)
            mbs.SetLoadParameter(load, "loadVector", floating.GRAVITY)
    settings.staticSolver.verboseMode, settings.staticSolver.newton.relativeTolerance = 0, 1e-10
    mbs.SolveStatic(settings, updateInitialValues=True)
    shaker.on = True
    mbs.SolveDynamic(settings)


def simulate(t_end: float) -> tuple[romerr.BoundReport, romerr.BoundReport]:
    """Run the bar with 7 modes; return the reports of the static and of the dynamic solve."""
    scene, shaker = built("RBE3", t_end)
    middle = romerr.node_displacement(NAME, node=mechanisms.MIDDLE, component="z")
    flex = romerr.floating_body(scene.fem, scene.bodies[0])
    monitor = romerr.attach(scene.mbs, flex, outputs=[middle])
    solve(scene, shaker)
    return monitor.report(0), monitor.report()


def with_all_modes(t_end: float) -> np.ndarray:
    """Return instants and the displacement of the middle (T, 2) when no mode is left out."""
    scene, shaker = built("complete", t_end)
    solve(scene, shaker)
    stored = scene.mbs.GetSensorStoredData(scene.sensors["middle 1 local"])[:, [0, 3]]
    return stored[-round(t_end / STEP) - 1 :]  # the static solve stores its steps too


def draw(report: romerr.BoundReport, truth: np.ndarray, path: Path) -> None:
    """Draw the output, the corrected one and the truth; below, the errors of both with their bounds."""
    signal, error = Figure(figsize=(7.2, 7.2), layout="constrained").subplots(2, 1, sharex=True)
    t, out = 1e3 * report.t, report.output(NAME)
    shown = (
        (truth, "-", COLOURS["error"], WIDE, "all modes"),
        (out.value, "-", COLOURS["value"], 1.0, "7 modes"),
        (out.corrected, "--", COLOURS["auxiliary"], 1.5, "7 modes, corrected output"),
    )
    for y, style, colour, width, label in shown:
        signal.plot(t, 1e6 * y, style, color=colour, lw=width, label=label)
    lines = (
        (out.bound["best"], "-", COLOURS["auxiliary"], WIDE, "7 modes: bound"),
        (np.abs(out.error), "-", COLOURS["error"], 1.0, "7 modes: |true error|"),
        (out.corrected_bound, "-", COLOURS["fast"], WIDE, "corrected output: bound"),
        (np.abs(truth - out.corrected), ":", COLOURS["error"], 1.0, "corrected output: |true error|"),
    )
    for y, style, colour, width, label in lines:
        error.semilogy(t, 1e6 * y, style, color=colour, lw=width, label=label)
    signal.set(ylabel="z in the bar's frame / µm", title="Middle of a bar between springs")
    error.set(ylabel="reduction error / µm", xlabel="t / ms")
    signal.legend()
    error.legend(loc="lower right", ncols=2, fontsize="small")
    for axes in (signal, error):
        axes.grid(alpha=0.3)
    signal.figure.savefig(path, dpi=150)


def main(folder: str | Path = RESULTS, t_end: float = 0.06) -> tuple[romerr.BoundReport, romerr.BoundReport]:
    """Print both reports and the true error, save the picture; return the reports."""
    (static, dynamic), truth = simulate(t_end), with_all_modes(t_end)
    out = dynamic.compare(NAME, dynamic.t, truth[:, 1])
    print(static, dynamic, sep="\n")
    left = np.abs(truth[:, 1:] - out.corrected)
    print(
        f"at rest: true error {abs(out.error[0, 0]):.4g} m, bound {out.bound['best'][0, 0]:.4g} m; "
        f"shaken: true error {np.max(np.abs(out.error)):.4g} m, bound {np.max(out.bound['best']):.4g} m; "
        f"of the corrected output {np.max(left):.2g} m, bound {np.max(out.corrected_bound):.2g} m"
    )
    Path(folder).mkdir(parents=True, exist_ok=True)
    draw(dynamic, truth[:, 1:], Path(folder) / "sprung_body.png")
    return static, dynamic


if __name__ == "__main__":
    main(*sys.argv[1:2])
