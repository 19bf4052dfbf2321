"""Error against run time of reduced stabiliser linkages: the paper's Table 1 with errors and bounds beside it.

Two errors, never to be mixed up: the reduction error (both models solved in closed form), which the bounds cover, and
the total error of Exudyn's result, time integration included, which bounds from sampled residuals do not cover.

    python examples/error_against_run_time.py [--full]
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

# first: it sets the number of threads before numpy is loaded
from examples.linkage_scene import END, INPUTS, OUTPUT, TRUTH_FLOOR, Simulation, body, simulate

# isort: split
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

import exudyn_romerr as romerr
from exudyn_romerr.report.plots.style import COLOURS
from models import exact, linkage

STIFF = (30, 36, 84)  # Krylov vectors with rates of 4e5 to 1.5e6 1/s: DOPRI5 needs 260 000 steps and more
STEP = 1e-4  # s, of generalised-alpha in their place
BAND = (0.0, 2000.0)  # rad/s, of the Gramian
LABEL = {"fontsize": 8, "zorder": 1, "bbox": {"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1}}
COMPARED = 10_000  # accepted steps looked at for the true errors, and timed online
HEADER = (
    f"{'':<38}{'run time / s':>12}{'online / s':>18}"
    f"{'reduction error / m: true, and its bounds':>44}{'total error / m':>17}\n"
    f"{'basis':<12}{'solver':<18}{'steps':>8}{'with bounds':>12}{'fast':>9}{'convol.':>9}"
    f"  {'true':>10}{'fast':>9}{'convol.':>9}{'effectivity':>14}{'(not bounded)':>17}"
)


@dataclass(frozen=True)
class Row:
    """One line of the table; times in s, errors in m, maxima over time.

    seconds: Exudyn's run with the bounds beside it; online: what one estimator takes for all its steps, timed apart.
    """

    basis: str
    step: float | None
    steps: int
    seconds: float
    online: dict[str, float]
    reduction: float
    bound: dict[str, float]
    total: float
    time_error: float

    def __str__(self) -> str:
        solver = "DOPRI5" if self.step is None else f"gen-alpha {self.step:g} s"
        seen = self.reduction > TRUTH_FLOOR
        error = f"{self.reduction:.2g}" if seen else f"<{TRUTH_FLOOR:g}"
        effectivity = f"{'' if seen else '>'}{self.bound['convolution'] / max(self.reduction, TRUTH_FLOOR):.1e}"
        return (
            f"{self.basis:<12}{solver:<18}{self.steps:8d}{self.seconds:12.2f}"
            f"{self.online['fast']:9.4f}{self.online['convolution']:9.4f}  {error:>10}"
            f"{self.bound['fast']:9.2g}{self.bound['convolution']:9.2g}{effectivity:>14}{self.total:17.2g}"
        )

    @property
    def remark(self) -> str:
        """What the reader must know of this line; empty if the reduction error is what Exudyn's result shows."""
        reduction = max(self.reduction, TRUTH_FLOOR)
        if self.time_error < reduction:
            return ""
        if self.step is None:
            return (
                f"{self.basis}: time and rounding errors of DOPRI5, {self.time_error:.1g} m, hide the reduction error"
            )
        needed = self.step * np.sqrt(reduction / self.time_error)  # second order
        return (
            f"{self.basis}: the time error of generalised-alpha, {self.time_error:.1g} m, hides the reduction error; "
            f"it would need {END / needed:.0e} steps of {needed:.0e} s: none affordable (--full: DOPRI5)"
        )


def cases(full: bool) -> list[tuple[str, romerr.Basis, float | None]]:
    """Return (label, basis, step of generalised-alpha or None for DOPRI5) of all lines."""
    chosen = [(f"Krylov {n}", krylov(n), STEP if n in STIFF else None) for n in (6, 12, 24, *STIFF)]
    chosen.append(("modal 12", romerr.modal_basis(body, 12), None))
    chosen.append(("Gramian 12", romerr.gramian_basis(body, INPUTS, 12, band=BAND), None))
    return chosen + ([(f"Krylov {n}", krylov(n), None) for n in STIFF] if full else [])


def krylov(n: int) -> romerr.Basis:
    """Return the Krylov basis of n vectors at shift 0."""
    return romerr.krylov_basis(body, INPUTS, n)


def row(label: str, basis: romerr.Basis, step: float | None, end: float = END) -> Row:
    """Run one reduced model and measure it."""
    run = simulate(basis, end, step)
    reduction, total = run.true_errors(run.sampled_at(COMPARED))
    names = ("fast", "convolution")
    return Row(
        basis=label,
        step=step,
        steps=len(run.report.t) - 1,
        seconds=run.seconds,
        online={e: online_seconds(run, e) for e in names},
        reduction=np.max(np.abs(reduction)),
        bound={e: np.max(run.output.bound[e]) for e in names},
        total=np.max(np.abs(total)),
        time_error=np.max(np.abs(total - reduction)),
    )


def numbered_row(parameters: dict) -> Row:
    """Run one of the cases and print its line."""
    data = parameters["functionData"]
    line = row(*cases(data["full"])[parameters["case"]], data["end"])
    print(line, flush=True)
    return line


def online_seconds(run: Simulation, estimator: str, repeats: int = 3) -> float:
    """Return the time to evaluate one estimator at all accepted steps, offline part taken off, median of several.

    Measured on the first steps where there are many, and scaled: the work is proportional to the number of steps.
    """
    t = run.report.t[:COMPARED]
    trajectory = exact.reduced_trajectory(run.solution, t, linkage.AMPLITUDE)
    first = exact.reduced_trajectory(run.solution, t[:1], linkage.AMPLITUDE)

    def seconds(samples: romerr.Trajectory) -> float:
        begin = perf_counter()
        romerr.evaluate(
            body, run.basis, samples, inputs=INPUTS, outputs=[OUTPUT], estimators=(estimator,), time="sampled"
        )
        return perf_counter() - begin

    # in pairs, because the machine's speed drifts
    difference = median(seconds(trajectory) - seconds(first) for _ in range(repeats))
    return difference * len(run.report.t) / len(t)


def table(rows: list[Row]) -> str:
    """Return the table with its remarks."""
    remarks = [f"* {line.remark}" for line in rows if line.remark]
    return "\n".join([HEADER, *map(str, rows), *remarks])


def draw(rows: list[Row], path: Path) -> None:
    """Draw errors and bound against run time, log-log."""
    figure = Figure(figsize=(7.2, 4.8), layout="constrained")
    ax = figure.subplots()
    ax.set(xscale="log", yscale="log", xlabel="run time of Exudyn with the bounds beside it / s")
    ax.set(ylabel="largest error of node 20 in z / m", ylim=(1e-15, 1e7))
    series = (
        ("convolution bound of the reduction error", "s", COLOURS["convolution"], lambda r: r.bound["convolution"]),
        ("true total error (Exudyn's result)", "x", "#000000", lambda r: r.total),
        ("true reduction error", "o", COLOURS["error"], lambda r: max(r.reduction, TRUTH_FLOOR)),
    )
    for label, marker, colour, value in series:
        hollow = {} if marker == "x" else {"markerfacecolor": "none"}
        points = np.array([(r.seconds, value(r)) for r in rows]).T
        ax.plot(*points, marker, ms=8, color=colour, label=label, **hollow)
    slow = np.array([(r.seconds, r.bound["convolution"]) for r in rows if r.step is not None]).reshape(-1, 2).T
    ax.plot(*slow, "s", ms=8, color=COLOURS["convolution"], label="(filled: time step by generalised-alpha)")
    for r in rows:
        ax.plot([r.seconds] * 2, [max(r.reduction, TRUTH_FLOOR), r.bound["convolution"]], color="#cccccc", zorder=0)
        at = (r.seconds, r.bound["convolution"])
        side, offset = ("right", -8) if r.step is None else ("left", 8)
        ax.annotate(r.basis, at, (offset, 0), textcoords="offset points", ha=side, va="center", **LABEL)
    ax.axhline(TRUTH_FLOOR, color="#999999", ls=":", label="rounding of the closed-form truth")
    ax.xaxis.set(major_locator=LogLocator(subs=(1, 2, 5)), major_formatter="{x:g}", minor_locator=NullLocator())
    ax.margins(x=0.22)
    ax.grid(alpha=0.3)
    ax.legend(fontsize=8, ncols=2, loc="upper right")
    figure.savefig(path, dpi=150)


def sweep(output: Path, full: bool = False, end: float = END) -> list[Row]:
    """Print the table, save it and its picture to the directory output; return the lines."""
    output.mkdir(parents=True, exist_ok=True)
    print(f"\n{HEADER}", flush=True)
    numbers = {"case": list(range(len(cases(full))))}  # serially: the run times count
    rows = romerr.sweep(numbered_row, numbers, parameterFunctionData={"full": full, "end": end}).complete()
    print("\n".join(f"* {line.remark}" for line in rows if line.remark))
    (output / "error_against_run_time.txt").write_text(table(rows) + "\n", encoding="utf-8")
    draw(rows, output / "error_against_run_time.png")
    print(f"saved {output / 'error_against_run_time.png'} and .txt")
    return rows


def main(arguments: list[str] | None = None, end: float = END) -> list[Row]:
    """Run the sweep."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--full", action="store_true", help="the stiff models with DOPRI5 too (minutes)")
    parser.add_argument("--output", type=Path, default=Path(__file__).resolve().parent / "results")
    options = parser.parse_args(arguments)
    return sweep(options.output, options.full, end)


if __name__ == "__main__":
    main()
