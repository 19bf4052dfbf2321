"""Compare romerr tune with a full scan: what it finds, in how much of the time.

    python benchmarks/tune.py [--checkout CHECKOUT] [--docs]    writes the table into docs/measured.md

CHECKOUT is a work tree of github.com/jgerstmayr/EXUDYN, of which one script is a case, too; that needs ngsolve.
The scan runs the script with every number of modes and every step of a grid, in processes of their own, bare. Truth:
twelve more modes than the most of these, Richardson's of an eighth and a sixteenth of the script's step. As in tune,
a curve through values at steps has to show what is between them. What rigid interfaces make is in no run of the scan:
scripts have RBE3 modes, or a tolerance far above it.
"""

import argparse
import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from scipy.interpolate import CubicSpline

import exudyn_romerr as romerr
from benchmarks import exudyn_examples, page
from exudyn_romerr.report.answers import tolerances_of
from exudyn_romerr.report.data import extents
from exudyn_romerr.report.verdict_text import aligned
from exudyn_romerr.scripts.child_run import Request, Result, run_child

STEPS = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 3 / 4, 1, 1.5, 2)  # times as many as the script's
FINER = 8  # times the script's steps, and twice that: of the truth
MORE = 12  # modes: of the truth
ALIKE = 1.05  # times the CPU time: what two runs of one pair differ by
CASES = (  # script, its arguments, tolerance, most modes of the scan
    ("benchmarks/tune_scene.py", ("slider_crank",), "1%", 6),
    ("benchmarks/tune_scene.py", ("double_pendulum",), "0.05%", 4),
    ("examples/hinged_arm.py", (), "10%", 2),
    ("benchmarks/tune_scene.py", ("pendulum",), "2%", 4),
)
EXUDYNS = ("Examples/NGsolveCraigBampton.py", (), "0.1%", 8)
HEAD = (
    "script",
    "within",
    "scan: modes, steps",
    "runs",
    "CPU s",
    "tune: modes, steps",
    "runs",
    "CPU s",
    "true error",
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
    """That of fewest modes of the runs within the tolerance that take hardly more than the fastest; None: none is."""
    enough = [run for run in runs if run.ratio <= 1]
    least = ALIKE * min((run.seconds for run in enough), default=0.0)
    return min((run for run in enough if run.seconds <= least), key=lambda run: run.modes, default=None)


def main(arguments=None) -> list[tuple]:
    """Compare, print a line a case; return (scanned, found, tuning) of each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, nargs="*", default=range(len(CASES)), help="numbers of these")
    parser.add_argument("--checkout", type=Path, help="work tree of Exudyn's repository: one of its scripts, too")
    parser.add_argument("--short", action="store_true", help="a small grid")
    parser.add_argument(
        "--script", nargs=3, metavar=("FILE", "TOLERANCE", "MODES"), help="another one, in its folder"
    )
    parser.add_argument("--steps", type=float, nargs="+", default=STEPS, help="times the script's: those of the scan")
    parser.add_argument("--verbose", action="store_true", help="all runs, too")
    parser.add_argument("--docs", action="store_true", help=f"write the table into {page.PAGE.name}")
    given = parser.parse_args(arguments)
    cases = [(str(page.ROOT / script), *of) for script, *of in (CASES[k] for k in given.cases)]
    if given.script:
        script, tolerance, most = given.script
        cases = [(os.path.abspath(script), (), tolerance, int(most))]
    grid = (range(1, 3), (1 / 2, 1)) if given.short else (None, given.steps)
    found, lines, home = [], [HEAD], os.getcwd()
    with tempfile.TemporaryDirectory() as place:
        if given.checkout:
            script, *of = EXUDYNS
            exudyn_examples.put(given.checkout / exudyn_examples.ROOT / script, folder := Path(place) / "script")
            cases.append((str(folder / Path(script).name), *of))
        for case in cases:
            # a script of Exudyn's writes beside itself
            os.chdir(Path(case[0]).parent if case[0].startswith(place) else home)
            found.append(compared(*case, *grid))
            lines.append(line_of(*case[:3], *found[-1]))
            print("  ".join(lines[-1]), flush=True)
            if given.verbose:
                runs, _, tuned, _ = found[-1]
                print(tuned, *runs, sep="\n", flush=True)
        os.chdir(home)
    table = "\n".join(aligned(lines))
    print(f"\n{table}")
    if given.docs:
        page.put("tune", table)
    return found


def compared(script, own, tolerance, most, modes, times) -> tuple:
    """Scan and tune a script: runs of the scan, the cheapest within the tolerance, Tuning, true error of its pair."""
    tuned = romerr.tune(script, own, tolerance=tolerance)
    truth = Truth(Request("scan", script, os.getcwd(), own), most, tolerance)
    runs = [truth.run(n, round(x * truth.count)) for n in modes or range(1, most + 1) for x in times]
    pair = tuned.closest.pair
    return runs, cheapest(runs), tuned, truth.run(pair.numbers[-1], pair.steps).ratio


def line_of(script, own, tolerance, runs, best, tuned, true) -> list[str]:
    """The line of a script in the table."""
    pair, seconds = tuned.closest.pair, sum(run.all_seconds for run in runs)
    return [
        " ".join((Path(script).stem, *own)),
        tolerance,
        "none" if best is None else f"{best.modes}, {best.steps}",
        *(str(len(runs)), f"{seconds:.0f}"),
        f"{pair.numbers[-1]}, {pair.steps}, {tuned.answer.value}",
        *(str(len(tuned.runs)), f"{tuned.all_seconds:.0f}"),
        f"{100 * true:.0f} % of that",
    ]


if __name__ == "__main__":
    main()
