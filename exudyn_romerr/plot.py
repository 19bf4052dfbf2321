"""Pictures of a report. Matplotlib is imported when the first one is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError

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

COLUMNS = 2  # of outputs side by side: what fits a page
WIDE, THIN = 2.5, 1.0  # a sharp bound lies on the true error: the wide line shows on both sides of the thin one


def plot_report(report: BoundReport, path: str | os.PathLike | None = None, outputs: list[str] | None = None) -> Any:
    """Draw for every output row: the signal with its band on top, bound and true error (semilog) below.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure  # not pyplot: no window, no global list of figures

    names = [outputs] if isinstance(outputs, str) else outputs or list(report.outputs)
    rows = [(report.output(name), i) for name in names for i in range(report.output(name).value.shape[1])]
    if not rows:
        raise InputError("the report has no outputs to plot; pass outputs= to attach or evaluate")
    columns = min(COLUMNS, len(rows))
    bands = -(-len(rows) // columns)
    figure = Figure(figsize=(6.4 * columns, 6.4 * bands), layout="constrained")
    axes = figure.subplots(2 * bands, columns, squeeze=False)
    for place, (out, i) in enumerate(rows):
        band, column = divmod(place, columns)
        top, bottom = axes[2 * band, column], axes[2 * band + 1, column]
        top.sharex(bottom)
        _draw_signal(top, report, out, i)
        _draw_bounds(bottom, report, out, i)
    for place in range(len(rows), bands * columns):
        for axis in axes[2 * (place // columns) :, place % columns]:
            axis.remove()
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
    name = _name(out, i)
    ax.set(ylabel=f"{name} / {out.unit}", title=f"{name}: reduced model with its error bound")
    ax.legend()


def _draw_bounds(ax, report: BoundReport, out: OutputReport, i: int) -> None:
    for name in (name for name in out.bound if name != "best"):
        _semilog(ax, report.t, out.bound[name][:, i], STYLES[name], COLOURS[name], f"bound '{name}'", WIDE)
    if out.error is not None:
        _semilog(ax, report.t, np.abs(out.error[:, i]), "-", COLOURS["error"], "|true error|", THIN)
    kind = "reduction error" if report.time == "sampled" else "error"
    axis = "load factor" if report.time == "static" else "t / s"
    ax.set(xlabel=axis, ylabel=f"{kind} of {_name(out, i)} / {out.unit}", yscale="log")
    ax.grid(which="major", alpha=0.3)
    ax.legend(loc="best")


def _name(out: OutputReport, i: int) -> str:
    return f"{out.name}, row {i + 1}" if out.value.shape[1] > 1 else out.name


def _semilog(ax, t, y, style: str, colour: str, label: str, width: float) -> None:
    # a log axis has no place for zeros (the first sample, often): they are left out, not moved
    ax.plot(t, np.where(y > 0, y, np.nan), linestyle=style, color=colour, label=label, linewidth=width)
