"""Picture of mode_rules.py."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from exudyn_romerr.report.plots.style import COLOURS

LEAST = 1e-6  # of the largest value: smaller errors are drawn here


def draw(errors: dict[str, list[float]], allowed: float, path: Path) -> None:
    """Draw all errors of every rule over the largest value, and what is allowed."""
    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.subplots()
    shift = np.random.default_rng(0)
    for i, of in enumerate(errors.values()):
        found = np.maximum(np.array(of)[np.isfinite(of)], LEAST)
        y = i + shift.uniform(-0.25, 0.25, len(found))
        is_enough = found <= allowed
        for which, colour, marker in ((is_enough, COLOURS["value"], "o"), (~is_enough, COLOURS["error"], "x")):
            label = ("within 1 %" if which is is_enough else "too large") if i == 0 else None
            axes.plot(100 * found[which], y[which], marker, color=colour, ms=4, mfc="none", label=label)
    axes.axvline(100 * allowed, color="black", lw=1, ls="--", label="asked for")
    axes.set(xscale="log", xlabel="true error / largest value / %", ylim=(len(errors) - 0.5, -0.5))
    axes.set_yticks(range(len(errors)), errors)
    axes.grid(alpha=0.3, axis="x")
    axes.legend(loc="upper center", ncols=3, bbox_to_anchor=(0.5, 1.09), frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
