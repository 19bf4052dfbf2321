"""Picture of rivals.py: a marker for each way, filled for bounds, hollow for estimates, a cross for measurements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

if TYPE_CHECKING:
    from benchmarks.rivals import Claim

BOUND, ESTIMATE, MEASURED = "bound", "estimate", "measured"
LOOKS = {  # way: kind, colour, marker, label
    "our bound": (BOUND, "#009E73", "o", "bound, ours"),
    "paper (25)": (BOUND, "#0072B2", "D", "bound, paper (25)"),
    "paper (26)": (BOUND, "#56B4E9", "s", "bound, paper (26)"),
    "paper (11)": (BOUND, "#999999", "^", "bound, paper (11)"),
    "our estimate": (ESTIMATE, "#5D3A9B", "o", "estimate, ours"),
    "effective mass": (ESTIMATE, "#E69F00", "v", "estimate, by lacking effective mass"),
    "frequencies": (ESTIMATE, "#882255", "D", "estimate, by true frequencies"),
    "2 n modes, h/2": (MEASURED, "#D55E00", "x", "measured: 2 n modes, half the step"),
}
SIZES = {BOUND: 6.5, ESTIMATE: 4.5, MEASURED: 6}  # our bound and our estimate lie on each other
LEAST, MOST = 1e-4, 1e10  # smaller and larger ratios are drawn there
EDGE = 5.0  # times: from these to the axes' ends


def draw(claims: list[Claim], path: Path) -> None:
    """Draw told over true against CPU time over the bare run."""
    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.subplots()
    axes.axhspan(LEAST / EDGE, 1, color="#000000", alpha=0.07, lw=0)
    axes.axhline(1, color="black", lw=1)
    for way, (kind, colour, marker, label) in LOOKS.items():
        of = [claim for claim in claims if claim.way == way]
        face = colour if kind == BOUND else "none"
        ratios = np.clip([claim.told / claim.true for claim in of], LEAST, MOST)
        costs = [claim.cost for claim in of]
        axes.plot(
            costs, ratios, marker, color=colour, mfc=face, ms=SIZES[kind], mew=1.2, alpha=0.8, label=label, ls=""
        )
    axes.set(xscale="log", yscale="log", xlabel="CPU time to the answer / bare run", ylabel="told error / true error")
    axes.set_ylim(LEAST / EDGE, MOST * EDGE)
    for x, y, note in ((0.99, 0.2, "told less than the truth"), (0.25, MOST, "and more"), (0.25, LEAST, "and less")):
        axes.text(x, y, note, ha="right", va="center", transform=axes.get_yaxis_transform())
    axes.xaxis.set(major_locator=LogLocator(subs=(1, 2, 5)), major_formatter="{x:g}", minor_locator=NullLocator())
    axes.grid(alpha=0.3, which="major")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
