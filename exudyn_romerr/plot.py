"""Pictures of a report. Matplotlib is imported when the first one is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import os

    from .report import BoundReport, OutputReport

# Okabe and Ito: told apart by the colour-blind, and by line style in print
COLOURS = {
    "value": "#000000",
    "error": "#D55E00",
    "state-space": "#999999",
    "fast": "#56B4E9",
    "convolution": "#0072B2",
    "output-kernel": "#E69F00",
    "energy": "#CC79A7",
    "auxiliary": "#009E73",
    "static": "#009E73",
}
STYLES = {
    "state-space": ":",
    "fast": "--",
    "convolution": "-",
    "output-kernel": (0, (5, 1, 1, 1, 1, 1)),
    "energy": "-.",
    "auxiliary": "-",
    "static": "-",
}

WIDE, THIN = 2.5, 1.0  # a sharp bound lies on the true error: the wide line shows on both sides of the thin one


def plot_report(report: BoundReport, path: str | os.PathLike | None = None, outputs: list[str] | None = None) -> Any:
    """Draw for every output row: the signal with its band on top, bound and true error (semilog) below.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure  # not pyplot: no window, no global list of figures

    shown = [report.output(name) for name in (outputs or report.outputs)]
    rows = [(out, i) for out in shown for i in range(out.value.shape[1])]
    figure = Figure(figsize=(6.4 * max(len(rows), 1), 6.4), layout="constrained")
    axes = figure.subplots(2, max(len(rows), 1), squeeze=False, sharex=True)
    for (out, i), (top, bottom) in zip(rows, axes.T, strict=True):
        _draw_signal(top, report, out, i)
        _draw_bounds(bottom, report, out, i)
    if path is not None:
        figure.savefig(path, dpi=150)
    return figure


def _draw_signal(ax, report: BoundReport, out: OutputReport, i: int) -> None:
    value, bound = out.value[:, i], out.bound["best"][:, i]
    ax.fill_between(
        report.t, value - bound, value + bound, color=COLOURS["fast"], alpha=0.4, linewidth=0, label="value ± bound"
    )
    ax.plot(report.t, value, color=COLOURS["value"], label="reduced model")
    if out.error is not None:
        ax.plot(report.t, value + out.error[:, i], ":", color=COLOURS["error"], label="truth")
    row = f", row {i + 1}" if out.value.shape[1] > 1 else ""
    ax.set(ylabel=f"{out.name}{row} / {out.unit}", title=f"{out.name}{row}: reduced model with its error bound")
    ax.legend()


def _draw_bounds(ax, report: BoundReport, out: OutputReport, i: int) -> None:
    for name in (name for name in out.bound if name != "best"):
        _semilog(ax, report.t, out.bound[name][:, i], STYLES[name], COLOURS[name], f"bound '{name}'", WIDE)
    if out.error is not None:
        _semilog(ax, report.t, np.abs(out.error[:, i]), "-", COLOURS["error"], "|true error|", THIN)
    kind = "error" if report.time == "reconstructed" else "reduction error"
    ax.set(xlabel="t / s", ylabel=f"{kind} of {out.name} / {out.unit}", yscale="log")
    ax.grid(which="major", alpha=0.3)
    ax.legend(loc="best")


def _semilog(ax, t, y, style: str, colour: str, label: str, width: float) -> None:
    # a log axis has no place for zeros (the first sample, often): they are left out, not moved
    ax.plot(t, np.where(y > 0, y, np.nan), linestyle=style, color=colour, label=label, linewidth=width)
