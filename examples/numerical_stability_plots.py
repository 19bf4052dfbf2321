"""Pictures of examples/numerical_stability.py: the paper's Figs. 6 and 7, and the bounds in all unit systems."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from exudyn_romerr.mbs.studies.parameter_sweep import Failure
from exudyn_romerr.report.plots.style import COLOURS
from models import sensitivity
from models.sensitivity import DECIMAL, UNITS, Level

WAYS = {"direct": "Method 1", "expanded": "Method 2", "orthonormal": "orthonormal factor"}
RESIDUAL_UNIT = "m √kg/s²"  # of |R| in the norm of M^-1
PRECISION = {64: "double", 32: "single"}
INSTANTS = np.linspace(0, sensitivity.END, 201)  # s, where the paper looks
TRUTH_FLOOR = 5e-15  # m, rounding of the closed forms: see examples/linkage_scene.py
# Okabe and Ito; dashes tell levels apart in print
LINES = (("#000000", "-"), ("#0072B2", "--"), ("#009E73", "-."), ("#E69F00", ":"))
LINES += (("#56B4E9", (0, (5, 1, 1, 1, 1, 1))), ("#D55E00", "-"), ("#CC79A7", "--"))
MARKERS = ("o", "s", "^")  # of the unit systems
SHOWN = {"paper": ("fast",), "package": ("fast", "energy", "auxiliary")}
FAILED = 30.0  # m, height of the crosses that stand for no bound at all


def style(n: int) -> dict:
    """Return colour, dashes and label of a level."""
    colour, dashes = LINES[sensitivity.LEVELS.index(n)]
    label = f"n = {n} (full)" if n == sensitivity.LEVELS[-1] else f"n = {n}"
    return {"color": colour, "ls": dashes, "lw": 1.3, "label": label}


def draw_residuals(levels: dict[tuple, Level | Failure], t: np.ndarray, path: Path) -> None:
    """Draw the paper's Fig. 6: residual norms by the three methods, in double and in single precision."""
    figure = Figure(figsize=(10.5, 6.6), layout="constrained")
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    at = np.clip(np.searchsorted(t, INSTANTS * (1 - 1e-9)), 0, len(t) - 1)
    for row, bits in zip(axes, PRECISION, strict=True):
        for ax, (way, name) in zip(row, WAYS.items(), strict=True):
            for (_, _, n), level in of_kind(levels, bits, 0).items():
                ax.semilogy(t[at], positive(level.residual[way][at]), **style(n))
            ax.set_title(f"{name}, {PRECISION[bits]} precision", fontsize=10)
            ax.grid(alpha=0.3)
        row[0].set_ylabel(f"residual norm |R| / ({RESIDUAL_UNIT})")
    for ax in axes[1]:
        ax.set(xlabel="t / s", xlim=(0, sensitivity.END), ylim=(1e-9, 1e5))
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=7)
    figure.savefig(path, dpi=130)


def positive(values: np.ndarray) -> np.ndarray:
    """Return values with zeros left out of a logarithmic picture."""
    return np.where(values > 0, values, np.nan)


def of_kind(levels: dict[tuple, Level | Failure], bits: int, units: int) -> dict[tuple, Level]:
    """Return the levels of one precision and unit system that did not fail."""
    found = {key: level for key, level in levels.items() if key[:2] == (bits, units)}
    return {key: level for key, level in found.items() if not isinstance(level, Failure)}


def draw_bounds(paper: dict[tuple, Level | Failure], ours: dict[tuple, Level], t: np.ndarray, path: Path) -> None:
    """Draw the paper's Fig. 7: true errors and bounds at all levels, double precision, m, kg, s."""
    figure = Figure(figsize=(10.5, 6.6), layout="constrained")
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    first = np.flatnonzero(np.diff(np.floor(t / 0.01 + 1e-6), prepend=-1))
    middle = (t[first] + np.append(t[first][1:], t[-1])) / 2
    curves = {
        "true reduction error": (ours, lambda level: level.error),
        "paper's fast bound, Method 1": (paper, lambda level: level.bound["fast"]),
        "paper's convolution bound, Method 1": (paper, lambda level: level.bound["convolution"]),
        "package: energy bound": (ours, lambda level: level.bound["energy"]),
        "package: auxiliary bound": (ours, lambda level: level.bound["auxiliary"]),
    }
    for ax, (title, (levels, values)) in zip(axes.flat, curves.items(), strict=False):
        for (_, _, n), level in of_kind(levels, 64, 0).items():
            largest = np.maximum.reduceat(np.abs(values(level)), first)
            ax.semilogy(middle, positive(largest), **style(n))
        ax.set_title(title, fontsize=10)
        ax.grid(alpha=0.3)
        ax.set(xlim=(0, sensitivity.END), ylim=(1e-17, 1))
        ax.axhline(TRUTH_FLOOR, color="#999999", ls=":", lw=1)
    for ax in axes[:, 0]:
        ax.set_ylabel("tip, largest within 10 ms / m")
    for ax in (*axes[1, :2], axes[0, 2]):
        ax.set_xlabel("t / s")
        ax.tick_params(labelbottom=True)
    handles, labels = axes[0, 1].get_legend_handles_labels()
    handles.append(Line2D([], [], color="#999999", ls=":", label="floor"))
    axes[1, 2].legend(handles, [*labels, "rounding of the truth"], loc="center", fontsize=10)
    axes[1, 2].axis("off")
    figure.savefig(path, dpi=130)


def draw_units(paper: dict[tuple, Level | Failure], ours: dict[tuple, Level], path: Path) -> None:
    """Draw the largest bounds of all levels in three unit systems and two precisions."""
    figure = Figure(figsize=(10.5, 7.2), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    names = list(dict.fromkeys(n for _, _, n in ours))
    signal = np.max(np.abs(sensitivity.exact_tip(INSTANTS)))
    for row, bits in zip(axes, PRECISION, strict=True):
        for ax, (whose, levels) in zip(row, {"paper": paper, "package": ours}.items(), strict=True):
            ax.axhline(signal, color="#000000", ls=":", lw=1.2)
            for units in DECIMAL:
                draw_markers(ax, levels, ours, (bits, units), whose, names)
            if whose == "package":
                ax.axhline(ours[bits, 0, names[0]].round_off, color="#777777", ls="--", lw=1.2)
            way = "the paper's way, all of it in" if whose == "paper" else "the package, input in"
            ax.set_title(f"{way} {PRECISION[bits]} precision", fontsize=10)
            ax.set(yscale="log", xticks=range(len(names)), xticklabels=names)
            ax.grid(alpha=0.3)
        row[0].set_ylabel("tip, maximum over time / m")
    for ax in axes[1]:
        ax.set_xlabel("n, Krylov vectors (114: full)")
    handles = legend_handles()
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=9)
    figure.savefig(path, dpi=130)


def draw_markers(ax, levels: dict, ours: dict, kind: tuple[int, int], whose: str, names: list[int]) -> None:
    """Draw one unit system: its bounds, and the true error beside them."""
    for x, n in enumerate(names):
        level, place = levels[(*kind, n)], x + 0.22 * (kind[1] - 1)
        if isinstance(level, Failure):
            ax.plot(place, FAILED, "x", color="#000000", ms=9, mew=2)
            continue
        for e in SHOWN[whose]:
            ax.plot(place, level.largest(e), MARKERS[kind[1]], color=COLOURS[e], ms=6)
        error = max(ours[(*kind, n)].largest_error, TRUTH_FLOOR)
        ax.plot(place, error, MARKERS[kind[1]], color=COLOURS["error"], mfc="none", ms=6)


def legend_handles() -> list[Line2D]:
    """Return what the colours and markers mean."""
    colours = {f"{e} bound": {"color": COLOURS[e]} for e in SHOWN["package"]}
    colours["true reduction error"] = {"color": COLOURS["error"], "mfc": "none"}
    handles = [Line2D([], [], marker="D", ls="", label=name, **kind) for name, kind in colours.items()]
    for marker, i in zip(MARKERS, DECIMAL, strict=True):
        handles.append(Line2D([], [], marker=marker, ls="", color="#555555", label=f"[{UNITS[i].name}]"))
    handles.append(Line2D([], [], marker="x", ls="", color="#000000", mew=2, label="no bound: failed"))
    handles.append(Line2D([], [], ls=":", color="#000000", label="the displacement itself"))
    handles.append(Line2D([], [], ls="--", color="#777777", label="report's round-off of the input"))
    return handles
