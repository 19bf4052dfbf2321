"""A quarter car over a bump: which modes of the lower control arm are enough, by estimates beside the simulation.

    python examples/wishbone_suspension.py [FOLDER] [--full]     prints a table, writes FOLDER/wishbone*.png

FOLDER is examples/results if left out. Double wishbone suspension with a flexible lower arm of 3369 coordinates; all
modes are too many for a truth, so the truth is a run with 50 modes. --full runs bases with more modes, too, and asks
choose_modes for 1 %, too. The table compares estimates; the report has bounds, too, where modes miss enough to tell.
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import exudyn_romerr as romerr
from exudyn_romerr.report.plots.style import COLOURS, WIDE
from models import floating, wishbone
from models.wishbone import INTERFACES

STEP = 5e-4  # s
NAME = "ball joint"
ROW = 2  # z of x, y, z: the arm bends upwards
TRUTH = {"n": 32, "vectors": 40}
# what the basis holds: (kind, interfaces with static modes, numbers of eigenmodes, of more of them, marker)
BASES = {
    "static modes of bushes only": ("RBE3", INTERFACES[:2], (8, 11, 16), (32, 64), "o"),
    "... of ball joint, too": ("RBE3", INTERFACES[:3], (4, 8), (16,), "s"),
    "... of spring seat, too": ("RBE3", INTERFACES, (0,), (4,), "^"),
    "the same, rigid interfaces": ("RBE2", INTERFACES, (0,), (8,), "D"),
}
SHOWN = ("static modes of bushes only", 8)  # over time and on the arm
PROMISES = (0.01, 0.001)
MOST = 24  # eigenmodes that choose_modes may take
RESULTS = Path(__file__).resolve().parent / "results"


@dataclass
class Case:
    """One run: basis and number n of its eigenmodes, number of all modes, CPU seconds of the drive, report.

    truth : the same output of the truth (T, 3).
    """

    basis: str
    n: int
    modes: int
    seconds: float
    report: romerr.BoundReport
    truth: np.ndarray

    @property
    def output(self) -> Any:
        """Displacement (T, 3) of the ball joint in the frame of the front bush."""
        return self.report.output(NAME)

    @property
    def error(self) -> np.ndarray:
        """True error by modes (T, 3): the truth has the same steps."""
        return self.truth - self.output.value

    @property
    def estimate(self) -> np.ndarray:
        """What is told of that (T, 3)."""
        parts = self.output.estimate_parts
        return parts["basis"] + parts["interfaces"]

    @property
    def largest(self) -> float:
        """Largest displacement in m, over time and directions."""
        return np.max(np.abs(self.output.value))

    @property
    def told(self) -> float:
        """Largest estimate over largest displacement."""
        return np.max(np.abs(self.estimate)) / self.largest

    def __str__(self) -> str:
        error, off = np.max(np.abs(self.error)), np.max(np.abs(self.estimate - self.error))
        return (
            f"{self.basis:<29}{self.modes:6d}{self.seconds:8.1f}{error:12.2e}{100 * error / self.largest:10.4f}"
            f"{100 * self.told:10.4f}{100 * off / error:12.2g}"
        )


HEADER = (
    f"{'':<29}{'':>6}{'run':>8}{'true error':>22}{'estimate':>10}{'it is off by':>14}\n"
    f"{'basis of the lower arm':<29}{'modes':>6}{'CPU s':>8}{'m':>12}{'%':>10}{'%':>10}{'% of error':>12}"
)


def scene_of(basis: str, n: int, t_end: float, bounds: bool = True, vectors: Any = "auto") -> tuple:
    """Return the quarter car with n eigenmodes of the arm, in its equilibrium, and a monitor of its ball joint."""
    kind, static, *_ = BASES[basis]
    scene = wishbone.quarter_car(n, kind, static, h=STEP, t_end=t_end)
    monitor = None
    if bounds:
        nodes, weights = floating.interface(scene.fem, "ball")
        joint = romerr.mean_displacement(NAME, nodes=nodes, weights=weights)
        flex = romerr.floating_body(scene.fem, scene.bodies[0])
        monitor = romerr.attach(scene.mbs, flex, outputs=[joint], auxiliary_modes=vectors)
    scene.settle()
    return scene, monitor


def drive(scene: wishbone.QuarterCar, monitor: Any) -> tuple[romerr.BoundReport, float]:
    """Drive over the bump; return the report and CPU seconds, offline work of the bounds included."""
    begin = process_time()
    scene.mbs.SolveDynamic(scene.settings)
    return monitor.report(), process_time() - begin


def cases(t_end: float, full: bool) -> list[Case]:
    """Run the truth and all bases; print the table."""
    scene, monitor = scene_of("... of spring seat, too", TRUTH["n"], t_end, vectors=TRUTH["vectors"])
    report, seconds = drive(scene, monitor)
    truth = report.output(NAME)
    largest = np.max(np.abs(truth.value))
    missing = truth.estimate_parts["basis"]
    share = 100 * np.max(np.abs(missing)) / largest
    print(f"scope {report.scope['auxiliary']}; {len(report.t) - 1} steps of {1e3 * STEP:g} ms")
    print(f"truth: {18 + TRUTH['n']} modes, {seconds:.1f} s, its own estimate {share:.5f} % of {largest:.3e} m")
    print(HEADER, flush=True)
    found = []
    for basis, (_, static, few, more, _) in BASES.items():
        for n in (*few, *(more if full else ())):
            scene, monitor = scene_of(basis, n, t_end)
            report, seconds = drive(scene, monitor)
            modes = 6 * (len(static) - 1) + n
            found.append(Case(basis, n, modes, seconds, report, truth.value))
            print(found[-1], flush=True)
    return found


def fewest(promise: float, t_end: float) -> romerr.ModeChoice:
    """Return the fewest eigenmodes of the basis SHOWN for a promise: at most four runs, no truth."""

    def build(n: int) -> tuple:
        scene, monitor = scene_of(SHOWN[0], n, t_end)
        return scene.mbs, monitor, scene.settings

    return romerr.choose_modes(build, promise, relative=True, first=SHOWN[1], most=MOST, by="estimate")


def enough(found: list[Case]) -> str:
    """Return in words how many modes are enough, by the estimate."""
    lines = []
    for basis in BASES:
        words = []
        for promise in PROMISES:
            good = [case.modes for case in found if case.basis == basis and case.told <= promise]
            words.append(f"{100 * promise:g} %: " + (f"{min(good)} modes" if good else "none of these"))
        lines.append(f"enough by the estimate, {basis}: " + ", ".join(words))
    return "\n".join(lines)


def draw_time(case: Case, path: Path) -> None:
    """Draw road and ball joint over time; below, true error and estimate."""
    signal, error = Figure(figsize=(7.2, 7.2), layout="constrained").subplots(2, 1, sharex=True)
    t, out = 1e3 * case.report.t, case.output
    signal.plot(t, 1e3 * out.value[:, ROW], color=COLOURS["value"], label=f"ball joint, {case.modes} modes")
    road = [wishbone.bump(x)[0] for x in case.report.t]
    signal.plot(t, 1e2 * np.array(road), ":", color=COLOURS["convolution"], label="height of the road / cm")
    signal.set(ylabel="z in the frame of the front bush / mm")
    signal.set_title("Lower control arm over a bump of 50 mm at 4 m/s")
    shown = 1e6 * np.abs(case.estimate[:, ROW])
    error.semilogy(t, shown, color=COLOURS["auxiliary"], lw=WIDE, label="|estimate of the modes' part|")
    label = f"|true error|: {18 + TRUTH['n']} modes less these"
    error.semilogy(t, 1e6 * np.abs(case.error[:, ROW]), color=COLOURS["error"], lw=1.0, label=label)
    error.set(xlabel="t / ms", ylabel="reduction error of z / µm", ylim=(1e-5, 20))
    for axes in (signal, error):
        axes.grid(alpha=0.3)
        axes.legend(loc="best")
    signal.figure.savefig(path, dpi=150)


def draw_modes(found: list[Case], path: Path) -> None:
    """Draw estimates and errors over the number of modes, and over run time."""
    figure = Figure(figsize=(9.6, 5.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, x in ((left, "modes"), (right, "seconds")):
        for basis, (*_, marker) in BASES.items():
            its = [case for case in found if case.basis == basis]
            place, style = [getattr(case, x) for case in its], {"marker": marker, "ms": 8}
            error = [100 * np.max(np.abs(case.error)) / case.largest for case in its]
            axes.plot(place, [100 * case.told for case in its], color=COLOURS["auxiliary"], **style)
            axes.plot(place, error, ":", color=COLOURS["error"], mfc="none", mew=1.5, **style)
        for promise in PROMISES:
            axes.axhline(100 * promise, color="#999999", lw=1, zorder=0)
        axes.grid(alpha=0.3)
    left.set(xlabel="modes of the arm, static ones included", yscale="log")
    left.set(ylabel="largest reduction error / largest displacement / %")
    right.set(xlabel="CPU time of the drive with its estimates / s")
    right.set_xlim(0, 1.1 * max(case.seconds for case in found))
    grey = [Line2D([], [], ls="", marker=m, ms=8, color="#777777", label=name) for name, (*_, m) in BASES.items()]
    kinds = [
        Line2D([], [], color=COLOURS["auxiliary"], marker="o", label="filled: estimate"),
        Line2D([], [], ls=":", color=COLOURS["error"], marker="o", mfc="none", label="hollow: true error"),
    ]
    figure.legend(handles=[*kinds, *grey], loc="outside lower center", ncols=3)
    figure.savefig(path, dpi=150)


def main(folder: str | Path = RESULTS, t_end: float = 0.2, full: bool = False) -> list[Case]:
    """Print the table, save the pictures; return the runs."""
    found = cases(t_end, full)
    print(enough(found))
    for promise in PROMISES if full else PROMISES[-1:]:
        print(f"choose_modes for {100 * promise:g} %, {SHOWN[0]}: {fewest(promise, t_end)}", flush=True)
    shown = next(case for case in found if (case.basis, case.n) == SHOWN)
    Path(folder).mkdir(parents=True, exist_ok=True)
    draw_time(shown, Path(folder) / "wishbone.png")
    draw_modes(found, Path(folder) / "wishbone_modes.png")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", nargs="?", default=RESULTS)
    parser.add_argument("--full", action="store_true", help="more modes, choose_modes for 1 %%")
    options = parser.parse_args()
    main(options.folder, full=options.full)
