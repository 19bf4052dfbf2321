"""A flexible body in Exudyn, and two lines that tell how wrong its tip displacement is: the clamped bar.

    python examples/clamped_bar.py [FOLDER]     prints the bound, writes FOLDER/clamped_bar.png (10 s)

FOLDER is examples/results if left out. Support and loads do not depend on the bar's deformation: scope "complete".
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

import exudyn_romerr as romerr
from models import floating

STEP = 2e-4  # s
RESULTS = Path(__file__).resolve().parent / "results"


def simulate(kind: str, h: float, t_end: float) -> romerr.BoundReport:
    """Run the bar with 6 static modes and 4 eigenmodes ("RBE3"), or with all its modes ("complete")."""
    scene = floating.clamped_bar(4, kind, h=h, t_end=t_end)
    flex = romerr.floating_body(scene.fem, scene.items)  # line one
    monitor = romerr.attach(scene.mbs, flex, outputs=[tip(scene)])  # line two
    scene.solve()
    return monitor.report()


def tip(scene: floating.FloatingScene) -> romerr.Output:
    """Return the displacement of the tip in the direction of its weight."""
    node = int(floating.interface(scene.fem, "tip")[0][0])
    return romerr.node_displacement("tip z", node=node, component="z", unit="m")


def compare(report: romerr.BoundReport, truth: romerr.BoundReport) -> None:
    """Compare with a truth that is a simulation too, corrected, and say how good that is: it has a bound itself."""
    full = truth.output("tip z")
    report.compare("tip z", truth.t, full.corrected)
    print(report)
    left = np.max(full.corrected_bound)
    print(f"the truth: all modes, a quarter of the step, corrected; itself within {left:.2g} m of the exact solution")


def main(folder: str | Path = RESULTS, t_end: float = 0.04) -> tuple[romerr.BoundReport, romerr.BoundReport]:
    """Print the report with the true error beside it, save its picture; return report and truth."""
    report = simulate("RBE3", STEP, t_end)
    truth = simulate("complete", STEP / 4, t_end)
    compare(report, truth)
    Path(folder).mkdir(parents=True, exist_ok=True)
    report.plot(Path(folder) / "clamped_bar.png")
    return report, truth


if __name__ == "__main__":
    main(*sys.argv[1:2])
