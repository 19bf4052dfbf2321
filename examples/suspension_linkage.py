"""Reduced stabiliser linkage of a car's front suspension in Exudyn, and two lines that tell how wrong its tip is.

    python examples/suspension_linkage.py [FOLDER]     prints the report, writes FOLDER/suspension_linkage.png

FOLDER is examples/results if left out. The body is that of Ruiner, Fehr, Haasdonk, Eberhard (2012); their own bounds
of it are in paper_linkage.py.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exudyn as exu
import numpy as np

import exudyn_romerr as romerr
from models import exact, linkage


def simulate(steps: int = 400) -> romerr.BoundReport:
    """Run 2 s of the suspension linkage with 12 of its 114 coordinates."""
    body, inputs, tip = linkage.build()
    basis = romerr.krylov_basis(body, inputs, 12)
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    flex = romerr.add_reduced_body(mbs, body, basis, inputs=inputs, input_function=linkage.force)
    monitor = romerr.attach(mbs, flex, outputs=[tip])  # line one
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime = 2
    settings.timeIntegration.numberOfSteps = steps
    settings.solution.file.write = False
    mbs.SolveDynamic(settings)
    return monitor.report()  # line two


RESULTS = Path(__file__).resolve().parent / "results"


def main(folder: str | Path = RESULTS, steps: int = 400) -> romerr.BoundReport:
    """Print the report, with the true error beside it, and save its picture."""
    report = simulate(steps)
    body, inputs, tip = linkage.build()
    truth = exact.full_solution(body, inputs, linkage.AMPLITUDE, 2 * np.pi * linkage.FREQUENCY)
    report.compare("tip z", report.t, truth.output(tip.resolve(body), report.t))
    print(report)
    Path(folder).mkdir(parents=True, exist_ok=True)
    report.plot(Path(folder) / "suspension_linkage.png")
    print(f"saved {Path(folder) / 'suspension_linkage.png'}")
    return report


if __name__ == "__main__":
    main(*sys.argv[1:2])
