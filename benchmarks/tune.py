"""Compare romerr tune with a full scan: what it finds, in how much of the time: python benchmarks/tune.py.

The scan runs the script with every number of modes and every step of a grid, in processes of their own, bare. Truth:
twelve more modes than the most of these, Richardson's of an eighth and a sixteenth of the script's step. As in tune,
a curve through values at steps has to show what is between them. What rigid interfaces make is in no run of the scan:
scripts have RBE3 modes, or a tolerance far above it.
"""

import argparse
import os
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

import exudyn_romerr as romerr
from exudyn_romerr.report.answers import tolerances_of
from exudyn_romerr.report.data import extents
from exudyn_romerr.scripts.child_run import Request, Result, run_child

ROOT = Path(__file__).resolve().parents[1]
STEPS = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 3 / 4, 1, 1.5, 2)  # times as many as the script's
FINER = 8  # times the script's steps, and twice that: of the truth
MORE = 12  # modes: of the truth
CASES = (  # script, its arguments, tolerance, most modes of the scan
    ("benchmarks/tune_scene.py", ("slider_crank",), "1%", 6),
    ("benchmarks/tune_scene.py", ("double_pendulum",), "0.05%", 4),
    ("examples/hinged_arm.py", (), "10%", 2),
    ("benchmarks/tune_scene.py", ("pendulum",), "1%", 4),
)


class Scanned(NamedTuple):
    """A run of the scan: modes, steps, CPU time of its solves and of all of it, worst error over its tolerance."""

    modes: int
    steps: int
    seconds: float
    all_seconds: float
    ratio: float


class Truth:
    """What sensors of a script show with many modes and short steps, and errors of its other runs."""

    def __init__(self, plain: Request, most: int, tolerance: str):
        self._plain, self._tolerances = plain, tolerances_of(tolerance)
        self.own = _ran(plain)
        self.numbers = len(self.own.facts["calls"])
        self.count = int(self.own.solves[-1]["count"])
        many = replace(plain, numbers=(most + MORE,) * self.numbers)
        self._coarse, self._fine = (_ran(replace(many, steps=k * FINER)).solves for k in (1, 2))

    def run(self, modes: int, steps: float) -> Scanned:
        """Run with a pair, and compare."""
        run = _ran(replace(self._plain, numbers=(modes,) * self.numbers, steps=steps / self.count))
        ratios = [self._ratio(run.solves[i], i, j) for i, x in enumerate(run.solves) for j in range(len(x["names"]))]
        return Scanned(modes, round(steps), run.facts["solve_seconds"], run.seconds, max(ratios))

    def _ratio(self, solve: dict, i: int, j: int) -> float:
        coarse, fine, own = (x["data"][j] for x in (self._coarse[i], self._fine[i], solve))
        truth = fine[::2, 1:] + (fine[::2, 1:] - coarse[:, 1:]) / 3
        extent = extents(truth, solve["shows"][j] == "Position").max()
        if not extent:
            return 0.0
        at_steps = CubicSpline(coarse[:, 0], truth)(own[:, 0])
        between = CubicSpline(own[:, 0], at_steps)(coarse[:, 0]) - truth  # a curve through values at steps
        error = max(np.abs(own[:, 1:] - at_steps).max(), np.abs(between).max())
        return float(error / self._tolerances.limit(solve["names"][j], extent).size)


def _ran(request: Request) -> Result:
    result = run_child(request)
    if result.failure:
        raise RuntimeError(result.failure)
    return result


def cheapest(runs: list[Scanned]) -> Scanned | None:
    """The cheapest run of the scan that is within the tolerance; None: none is."""
    return min((run for run in runs if run.ratio <= 1), key=lambda run: run.seconds, default=None)


def main(arguments=None) -> list[tuple]:
    """Compare, print a line a case; return (scanned, found, tuning) of each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, nargs="+", default=range(len(CASES)), help="numbers of these")
    parser.add_argument("--short", action="store_true", help="a small grid")
    parser.add_argument(
        "--script", nargs=3, metavar=("FILE", "TOLERANCE", "MODES"), help="another one, in its folder"
    )
    parser.add_argument("--steps", type=float, nargs="+", default=STEPS, help="times the script's: those of the scan")
    parser.add_argument("--verbose", action="store_true", help="all runs, too")
    given = parser.parse_args(arguments)
    print("script, tolerance | scan: modes, steps, runs, CPU s | tune: the same, answer | true error of its pair")
    found = []
    cases = [CASES[k] for k in given.cases]
    if given.script:
        script, tolerance, most = given.script
        cases = [(os.path.abspath(script), (), tolerance, int(most))]
    for script, own, tolerance, most in cases:
        path = str(ROOT / script)
        tuned = romerr.tune(path, own, tolerance=tolerance)
        truth = Truth(Request("scan", path, os.getcwd(), own), most, tolerance)
        modes, times = (range(1, 3), (1 / 2, 1)) if given.short else (range(1, most + 1), given.steps)
        runs = [truth.run(n, round(x * truth.count)) for n in modes for x in times]
        best, pair = cheapest(runs), tuned.closest.pair
        of_scan = "none" if best is None else f"{best.modes}, {best.steps}"
        true = truth.run(pair.numbers[-1], pair.steps).ratio
        print(
            f"{Path(script).stem} {' '.join(own)} {tolerance} | {of_scan}, {len(runs)}, "
            f"{sum(run.all_seconds for run in runs):.0f} | {pair.numbers[-1]}, {pair.steps}, {len(tuned.runs)}, "
            f"{tuned.all_seconds:.0f}, {tuned.answer.value} | {100 * true:.0f} % of the tolerance",
            flush=True,
        )
        if given.verbose:
            print(tuned, *runs, sep="\n")
        found.append((runs, best, tuned, true))
    return found


if __name__ == "__main__":
    main()
