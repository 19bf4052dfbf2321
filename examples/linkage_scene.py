"""The stabiliser linkage in Exudyn with its bounds beside it: what the examples of it and their tests share."""

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small products: more threads only wait for one another

import exudyn as exu
import numpy as np

import exudyn_romerr as romerr
from models import exact, linkage

OMEGA = 2 * np.pi * linkage.FREQUENCY  # rad/s, of the force
TOLERANCE = 1e-12  # of DOPRI5: looser, and noise of the highest reduced modes enters the residual
END = 2.0  # s
# What the closed-form full and reduced solutions still differ by where both describe the same motion (84 of 114
# coordinates), in m: a reduction error below cannot be seen. Processors without 80-bit numbers lose three digits.
TRUTH_FLOOR = 5e-15 if np.finfo(exact.EXTENDED).eps < 1e-18 else 5e-12

body, INPUTS, OUTPUT = linkage.build()
truth = exact.full_solution(body, INPUTS, linkage.AMPLITUDE, OMEGA)


@dataclass
class Simulation:
    """One reduced simulation: its report, wall time in s, reduced basis and its exact solution."""

    basis: romerr.Basis
    report: romerr.BoundReport
    seconds: float
    solution: exact.ForcedModes

    @property
    def output(self) -> romerr.OutputReport:
        """The tip's displacement."""
        return self.report.output(OUTPUT.name)

    def sampled_at(self, count: int) -> np.ndarray:
        """Return up to count of the accepted steps, evenly spread, the last one included."""
        return np.unique(np.linspace(0, len(self.report.t) - 1, count).astype(int))

    def true_errors(self, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (reduction error, total error) of the tip at some accepted steps, in m."""
        t = self.report.t[steps]
        y = exact_tip(t)
        return y - self.exact_reduced_tip(t), y - self.output.value[steps, 0]

    def exact_reduced_tip(self, t: np.ndarray) -> np.ndarray:
        """Return the tip's displacement of the reduced model without any time error."""
        return self.solution.output(OUTPUT.resolve(body) @ self.basis.V, t)[:, 0]


def exact_tip(t: np.ndarray) -> np.ndarray:
    """Return the tip's displacement of the full model, closed form."""
    return truth.output(OUTPUT.resolve(body), t)[:, 0]


def simulate(basis: romerr.Basis, end: float = END, step: float | None = None) -> Simulation:
    """Run Exudyn with the bounds beside it: DOPRI5, or generalised-alpha if a step (s) is given."""
    mbs = exu.SystemContainer().AddSystem()
    flex = romerr.add_reduced_body(mbs, body, basis, inputs=INPUTS, input_function=linkage.force)
    monitor = romerr.attach(mbs, flex, outputs=[OUTPUT], time="sampled", estimators=("fast", "convolution"))
    mbs.Assemble()
    solver = exu.DynamicSolverType.DOPRI5 if step is None else exu.DynamicSolverType.GeneralizedAlpha
    exu.config.printToConsole = (
        False  # DOPRI5 prints a warning of the memory that a load function in Python allocates
    )
    begin = time.perf_counter()
    mbs.SolveDynamic(settings(end, step), solverType=solver)
    seconds = time.perf_counter() - begin
    exu.config.printToConsole = True
    solution = exact.reduced_solution(body, basis, INPUTS, linkage.AMPLITUDE, OMEGA)
    return Simulation(basis, monitor.report(), seconds, solution)


def settings(end: float, step: float | None) -> exu.SimulationSettings:
    """Return settings for 0..end s: adaptive steps up to 10 ms, or steps of a given length."""
    simulationSettings = exu.SimulationSettings()
    timeIntegration = simulationSettings.timeIntegration
    timeIntegration.endTime = end
    timeIntegration.numberOfSteps = round(end / (step or 0.01))
    timeIntegration.automaticStepSize = step is None
    timeIntegration.absoluteTolerance = timeIntegration.relativeTolerance = TOLERANCE
    timeIntegration.verboseMode = 0
    simulationSettings.solution.file.write = False
    return simulationSettings
