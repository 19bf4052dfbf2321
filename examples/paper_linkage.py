"""The suspension linkage as in Ruiner, Fehr, Haasdonk, Eberhard (2012): their constants, bounds and run times.

114 coordinates, reduced to 12, run in Exudyn with DOPRI5. "fast" and "convolution" of the paper are 1e4 times the
error and more; suspension_linkage.py has the bounds of today.

    python examples/paper_linkage.py             the run, its picture, and error against run time (1 minute)
    python examples/paper_linkage.py --full      the stiff reduced models with DOPRI5 too (minutes)
    python examples/paper_linkage.py --figure docs/figures/paper_linkage.png     this picture only
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from examples import error_against_run_time  # first: it sets the number of threads before numpy is loaded
from examples.linkage_scene import END, INPUTS, OUTPUT, Simulation, body, exact_tip, simulate

# isort: split
import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline

import exudyn_romerr as romerr
from exudyn_romerr.report.plots.style import COLOURS

PUBLISHED = {"C1": "4.3492e+04", "C11": "1.0000", "C12": "0.0196", "C2": "6.9151"}
N = 12
INSTANTS = 201  # equally spaced, as in the paper
RATE = 100  # 1/s, of the points of the picture
ESTIMATORS = ("fast", "convolution")
RESULTS = Path(__file__).resolve().parent / "results"


def constants() -> dict[str, float]:
    """Return the four constants of the paper, suprema over all times in closed form."""
    k = body.constants()
    return {"C1": k.C1, "C11": k.C11, "C12": k.C12, "C2": OUTPUT.constant(body)[0]}


def print_constants(values: dict[str, float]) -> None:
    """Print them beside the published ones."""
    units = {"C1": "1/s", "C11": "-", "C12": "s", "C2": "kg^-1/2"}
    print(f"{'constant':<10}{'computed':>12}{'published':>12}   unit")
    for name, value in values.items():
        computed = f"{value:.4e}" if name == "C1" else f"{value:.4f}"
        print(f"{name:<10}{computed:>12}{PUBLISHED[name]:>12}   {units[name]}")


def print_run(run: Simulation) -> None:
    """Print bound, both true errors and effectivity, over all accepted steps."""
    reduction, total = (np.max(np.abs(e)) for e in run.true_errors(np.arange(len(run.report.t))))
    print(f"\n{run.basis.note}: {len(run.report.t) - 1} accepted steps of DOPRI5 in {run.seconds:.2f} s")
    print(f"largest displacement                        {np.max(np.abs(run.output.value)):.4g} m")
    for name in ESTIMATORS:
        bound = np.max(run.output.bound[name])
        label = f"bound of the reduction error, {name}"
        print(f"{label:<43} {bound:.4g} m, effectivity {bound / reduction:.3g}")
    print(f"true reduction error                        {reduction:.4g} m")
    print(
        f"true total error, time integration included {total:.4g} m  ({100 * abs(total / reduction - 1):.2g} % apart)"
    )


def print_equal_times(columns: dict[str, np.ndarray]) -> None:
    """Print the true errors where the paper looks; they miss the start, where the error of this basis is largest."""
    reduction, total = (np.max(np.abs(columns[name])) for name in ("reduction error", "total error"))
    print(f"at {INSTANTS} equal times only: reduction error {reduction:.4g} m, total error {total:.4g} m")


def at_equal_times(run: Simulation) -> dict[str, np.ndarray]:
    """Return output, bounds of its reduction error and true errors at equally spaced times.

    An adaptive integrator's accepted steps lie elsewhere: the output is interpolated by a cubic spline, which at
    steps of 0.1 ms adds less than 1e-12 m; of a bound the larger value of the two steps around counts.
    """
    t, times = run.report.t, np.linspace(0, run.report.t[-1], INSTANTS)
    value = CubicSpline(t, run.output.value[:, 0])(times)
    after = np.clip(np.searchsorted(t, times * (1 - 1e-12)), 1, len(t) - 1)
    bounds = {e: np.maximum(b[after - 1, 0], b[after, 0]) for e, b in run.output.bound.items() if e in ESTIMATORS}
    truth = exact_tip(times)
    return {
        "t": times,
        "value": value,
        **bounds,
        "reduction error": truth - run.exact_reduced_tip(times),
        "total error": truth - value,
    }


def save_table(path: Path, columns: dict[str, np.ndarray]) -> None:
    """Write the values at equal times as comma separated text."""
    header = "t/s," + ",".join(f"{name}/m" for name in list(columns)[1:])
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=header, comments="")


def draw(run: Simulation, path: Path) -> None:
    """Draw the paper's Fig. 5, its band magnified, and bound and error over time below."""
    figure = Figure(figsize=(7.2, 7.2), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(1.15, 1))
    draw_signal(top, run)
    draw_errors(bottom, run)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    print(f"saved {path}")


def draw_signal(ax, run: Simulation) -> None:
    """Draw output and band edges, and an inset at the largest peak where the band can be seen."""
    t, y = run.report.t, 1e3 * run.output.value[:, 0]
    inset = ax.inset_axes((0.59, 0.62, 0.39, 0.35))
    for axes in (ax, inset):
        for name, width in zip(ESTIMATORS, (4.0, 1.5), strict=True):  # nearly equal: the thin line lies on the thick
            band = 1e3 * run.output.bound[name][:, 0]
            axes.plot(t, y + band, color=COLOURS[name], lw=width, label=f"band edges y ± {name} bound")
            axes.plot(t, y - band, color=COLOURS[name], lw=width)
        axes.plot(t, y, "--", color=COLOURS["value"], lw=1, label=f"output y of the reduced model, n = {run.basis.n}")
    peak = np.argmax(y)
    half = 2.5 * 1e3 * run.output.bound["fast"][peak, 0]
    inset.set(xlim=(t[peak] - 2e-3, t[peak] + 2e-3), ylim=(y[peak] - half, y[peak] + half))
    inset.tick_params(labelsize=7)
    ax.indicate_inset_zoom(inset, edgecolor="#555555")
    ax.set(ylabel="displacement of node 20 in z / mm", ylim=(1.15 * y.min(), 2.9 * y.max()))
    ax.legend(loc="upper left", fontsize=8)


def draw_errors(ax, run: Simulation) -> None:
    """Draw bounds and true errors, the largest in each hundredth of a second, logarithmic."""
    t = run.report.t
    shown = np.flatnonzero(np.diff(np.floor(t * RATE), prepend=-1))
    middle = (t[shown] + np.append(t[shown][1:], t[-1])) / 2

    def largest(values: np.ndarray) -> np.ndarray:
        return np.maximum.reduceat(np.abs(values), shown)

    for name, width in zip(ESTIMATORS, (4.0, 1.5), strict=True):
        bound = largest(run.output.bound[name][:, 0])
        ax.plot(middle, bound, color=COLOURS[name], lw=width, label=f"{name} bound of the reduction error")
    reduction, total = run.true_errors(np.arange(len(t)))
    ax.plot(middle, largest(total), ":", color="#000000", label="true total error (Exudyn's result)")
    ax.plot(middle, largest(reduction), "-", color=COLOURS["error"], label="true reduction error")
    ax.set(xlabel="t / s", ylabel="largest error within 10 ms / m", yscale="log", xlim=(0, t[-1]))
    ax.grid(alpha=0.3)
    ax.legend(loc="center right", fontsize=8)


def main(arguments: list[str] | None = None, end: float = END) -> Simulation:
    """Do the main job; return the run with 12 Krylov vectors."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--full", action="store_true", help="stiff reduced models with DOPRI5 too")
    parser.add_argument("--output", type=Path, default=RESULTS, help="directory of pictures and tables")
    parser.add_argument("--figure", type=Path, help="write the picture of the run to this file, and nothing else")
    options = parser.parse_args(arguments)
    print_constants(constants())
    run = simulate(romerr.krylov_basis(body, INPUTS, N), end)
    print_run(run)
    print_equal_times(at_equal_times(run))
    draw(run, options.figure or options.output / "paper_linkage.png")
    if options.figure is None:
        save_table(options.output / "paper_linkage.csv", at_equal_times(run))
        error_against_run_time.sweep(options.output, options.full, end)
    return run


if __name__ == "__main__":
    main()
