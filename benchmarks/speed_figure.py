"""Picture of benchmarks/speed.py: ratios of run time, and how costs grow."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from benchmarks import growth
from benchmarks.pairs import Ratio
from exudyn_romerr.report.plots.style import COLOURS

KIND_COLOURS = (COLOURS["convolution"], COLOURS["auxiliary"])


def draw(ratios: dict[str, list[Ratio]], grown: growth.Growth, path: Path) -> None:
    """Draw four panels."""
    figure = Figure(figsize=(10, 9.4), layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.5, 1))
    _draw_ratios(top.subplots(), ratios)
    counts, outputs, sizes = bottom.subplots(1, 3)
    _draw_online(counts, grown.counts, "modes n (one output)")
    _draw_online(outputs, grown.outputs, f"outputs (n = {growth.BASIS})")
    outputs.get_legend().remove()
    _draw_sizes(sizes, grown.sizes)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)


def _draw_ratios(axes, ratios: dict[str, list[Ratio]]) -> None:
    rows = [(title, row) for title, found in ratios.items() for row in found[1:]]
    place = np.arange(len(rows))[::-1]
    middle = np.array([row.middle for _, row in rows])
    spread = np.array([(row.middle - row.low, row.high - row.middle) for _, row in rows]).T
    axes.errorbar(middle, place, xerr=spread, fmt="o", color=KIND_COLOURS[1], label="median and quartiles", capsize=3)
    limits = [(row.variant.limit, at) for (_, row), at in zip(rows, place, strict=True)]
    points = np.array([point for point in limits if point[0] is not None]).T
    axes.plot(*points, "|", color=COLOURS["error"], ms=14, mew=2, ls="", label="at most")
    axes.axvline(1, color="#999999", lw=1)
    axes.set_yticks(place, [f"{title}: {row.variant.label}" for title, row in rows], fontsize=6)
    axes.set(xlabel="CPU time of a run with bounds / without", xscale="log")
    axes.xaxis.set(
        major_locator=LogLocator(subs=(1, 1.5, 2, 3, 4)), major_formatter="{x:g}", minor_formatter=NullFormatter()
    )
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)


def _draw_online(axes, rows: dict[int, tuple], label: str) -> None:
    x, (bare, paper, sharp) = list(rows), np.array(list(rows.values())).T
    axes.loglog(x, bare, "--", color=COLOURS["value"], marker="s", ms=4, label="Exudyn's step alone")
    for values, name, colour, marker in zip((paper, sharp), growth.KINDS, KIND_COLOURS, "^o", strict=True):
        axes.loglog(x, values, color=colour, marker=marker, ms=5, label=f"+ {name}")
    axes.set(xlabel=label, ylabel="CPU time of a step / µs")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=6)


def _draw_sizes(axes, sizes: list[dict]) -> None:
    styles = (("body", "checks, factors of M and K", "o"), ("modes", "12 modes", "^"), ("attach", "attach", "s"))
    for (name, label, marker), colour in zip(styles, ("#000000", *KIND_COLOURS), strict=True):
        points = [(size["N"], size[name]) for size in sizes if name in size]
        axes.loglog(*zip(*points, strict=True), color=colour, marker=marker, ms=5, label=label)
    axes.set(xlabel="coordinates N", ylabel="offline time / s")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=6)
