"""What bounds cost beside a simulation: the linkage reduced to 12 coordinates, generalised-alpha, steps of 1 ms.

Paired runs in one process, variants in turn (A B C A B C ...), so that a machine that changes its speed changes it
for all; ratios are taken pair by pair. Offline work (attach) is timed apart.

    python benchmarks/online_linkage.py [--end 10] [--pairs 25]
"""

import argparse
import os
import sys
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine threads wait for one another

import exudyn as exu
import numpy as np

import exudyn_romerr as romerr
from models import linkage

N = 12
STEP = 1e-3  # s


class Variant:
    """The linkage in an mbs of its own, to be solved again and again; with what runs beside it."""

    def __init__(self, end: float):
        self.mbs = exu.SystemContainer().AddSystem()
        body, inputs, self.output = linkage.build()
        basis = romerr.krylov_basis(body, inputs, N)
        self.flex = romerr.add_reduced_body(self.mbs, body, basis, inputs=inputs, input_function=linkage.force)
        self.settings = exu.SimulationSettings()
        self.settings.timeIntegration.endTime = end
        self.settings.timeIntegration.numberOfSteps = self.steps = round(end / STEP)
        self.settings.timeIntegration.verboseMode = 0
        self.settings.solution.file.write = False
        begin = perf_counter()
        self.prepare()
        self.offline = perf_counter() - begin
        self.mbs.Assemble()

    def prepare(self) -> None:
        """Add what runs beside the simulation: nothing here."""

    def finish(self) -> None:
        """Do what is left to do when the solver has returned."""

    def seconds(self) -> float:
        """Solve once; return wall time in s, finish() included."""
        begin = perf_counter()
        self.mbs.SolveDynamic(self.settings)
        self.finish()
        return perf_counter() - begin


class Bare(Variant):
    """Simulation alone."""

    label = "without bounds"


class Storing(Variant):
    """Three state reads and storing, the least that any hook must do."""

    label = "three state reads and storing only"

    def prepare(self) -> None:
        """Set a PostStep function that stores the state."""
        rows = np.empty((3, self.steps + 1, N))
        system = self.mbs.systemData

        def store(mbs, t):
            i = round(t / STEP)
            rows[0, i] = system.GetODE2Coordinates()
            rows[1, i] = system.GetODE2Coordinates_t()
            rows[2, i] = system.GetODE2Coordinates_tt()
            return True

        self.mbs.SetPostStepUserFunction(store)


class Bounds(Variant):
    """Fast and convolution bounds and one output; the report is asked for at the end."""

    label = "fast + convolution, sampled"
    options = {"time": "sampled", "estimators": ("fast", "convolution")}  # noqa: RUF012
    limit = 2.0  # of the median ratio of run times with and without bounds: what the project promises

    def prepare(self) -> None:
        """Attach the monitor."""
        self.monitor = romerr.attach(self.mbs, self.flex, outputs=[self.output], **self.options)

    def finish(self) -> None:
        """Ask for the report: it evaluates the last block."""
        self.report = self.monitor.report()


class SharpBounds(Bounds):
    """Energy and 40 auxiliary modes, time integration covered."""

    label = "energy + auxiliary 40, reconstructed"
    options = {"estimators": ("energy", "auxiliary"), "auxiliary_modes": 40}  # noqa: RUF012
    limit = 4.0


def measure(end: float, pairs: int) -> tuple[list[Variant], np.ndarray]:
    """Return the variants and their run times in s, (pairs, variants); one round before is not counted."""
    variants = [Bare(end), Storing(end), Bounds(end), SharpBounds(end)]
    rounds = [[variant.seconds() for variant in variants] for _ in range(1 + pairs)]
    return variants, np.array(rounds[1:])


def ratios(times: np.ndarray) -> np.ndarray:
    """Return the run times over those of the first variant, pair by pair."""
    return times / times[:, :1]


def print_table(variants: list[Variant], times: np.ndarray) -> None:
    """Print step times and ratios."""
    print(f"{variants[0].steps} steps of {1e3 * STEP:g} ms, {len(times)} rounds, n = {N}")
    print(f"{'variant':<38}{'us a step':>10}{'ratio, median':>15}{'quartiles':>14}")
    for variant, t, ratio in zip(variants, times.T, ratios(times).T, strict=True):
        low, middle, high = np.percentile(ratio, (25, 50, 75))
        print(f"{variant.label:<38}{1e6 * np.median(t) / variant.steps:10.2f}{middle:15.3f}{low:8.2f}..{high:.2f}")
    for variant, middle in zip(variants[2:], np.median(ratios(times), axis=0)[2:], strict=True):
        kept = "kept" if middle <= variant.limit else "NOT KEPT"
        print(f"{variant.label}: offline {1e3 * variant.offline:.3g} ms; promised at most {variant.limit:g}: {kept}")


def main(arguments: list[str] | None = None) -> tuple[list[Variant], np.ndarray]:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--end", type=float, default=10.0, help="simulated time in s")
    parser.add_argument("--pairs", type=int, default=25)
    options = parser.parse_args(arguments)
    variants, times = measure(options.end, options.pairs)
    print_table(variants, times)
    return variants, times


if __name__ == "__main__":
    main()
