"""Bands of bounds on existing axes, such as those of Exudyn's PlotSensor."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from typing import Any

import numpy as np

from ...errors import InputError
from ...linear.residual.samples import SAME_TIMES
from ..report import BoundReport
from ..wording import under
from .style import largest_in_words

SAME_VALUES = 1e-6  # of the largest: sensor files have 10 digits; a factor between units is 10 at least


def add_bands(plotted: Any, report: BoundReport, name: str, components: int | Sequence[int] = 0) -> list[Any]:
    """Draw value ± bound around the lines of an output, in their colours: the full model lies in between.

    Parameters
    ----------
    plotted : matplotlib axes, or what mbs.PlotSensor(...) returned
        One line shows each component over time.
    report : BoundReport
    name : str
        Of an output.
    components : int or sequence of int
        Rows of the output, numbered from 0 as in PlotSensor.

    Returns
    -------
    list of matplotlib.collections.PolyCollection

    Raises
    ------
    InputError
        Unknown output or component; no line shows it (plotted with factors= or offsets=, another run).

    Notes
    -----
    A legend that is there is made anew; a band drawn before around the same line is replaced. Does not cover:
    instants at which the bound is infinite; nothing is drawn.
    """
    ax = plotted[2] if isinstance(plotted, list | tuple) and len(plotted) == 4 else plotted
    if not hasattr(ax, "fill_between"):
        raise InputError(f"plotted is a {type(ax).__name__}; needed: axes, or what mbs.PlotSensor returned")
    out = report.output(name)
    bands = []
    for row in _checked(components, len(out.row_names)):
        value, bound, shown = out.value[:, row], out.bound["best"][:, row], out.row_names[row]
        line = _line_of(ax, report.t, value, shown)
        most = largest_in_words(bound, out.unit, "bound up to" if out.uncertified else "at most")
        label = f"{shown} ± {most}{under(report.scope, doubts=out.uncertified)}"
        key = f"band of {shown} around line {ax.get_lines().index(line)}"
        for older in [x for x in ax.collections if x.get_gid() == key]:
            older.remove()
        style = {"color": line.get_color(), "alpha": 0.35, "linewidth": 0, "label": label, "gid": key}
        bands.append(ax.fill_between(report.t, value - bound, value + bound, **style))
    _renew_legend(ax)
    return bands


def _checked(components: Any, count: int) -> list[int]:
    rows = [components] if isinstance(components, Integral) else components
    if not isinstance(rows, Sequence) or not all(isinstance(row, Integral) and 0 <= row < count for row in rows):
        raise InputError(f"components={components!r}; allowed: numbers in 0..{count - 1}")
    return list(rows)


def _line_of(ax: Any, t: np.ndarray, value: np.ndarray, name: str) -> Any:
    """The line that shows the value of an output; InputError if there is none."""
    line = next((line for line in ax.get_lines() if _shows(line, t, value)), None)
    if line is None:
        raise InputError(
            f"no line of these axes shows {name} over time; plot the sensor that the output was made of, of the same "
            "run, without factors= and offsets="
        )
    return line


def _shows(line: Any, t: np.ndarray, value: np.ndarray) -> bool:
    x, y = (np.asarray(data, dtype=float) for data in line.get_data())
    x, y = x[x >= t[0]], y[x >= t[0]]  # bounds may begin a step later
    at = np.clip(np.searchsorted(t, x - SAME_TIMES * np.ptp(t)), 0, len(t) - 1)
    if not x.size or np.any(np.abs(t[at] - x) > SAME_TIMES * np.ptp(t)):
        return False
    return bool(np.all(np.abs(value[at] - y) <= SAME_VALUES * np.max(np.abs(value))))


def _renew_legend(ax: Any) -> None:
    """Take the bands into the legend that is there: PlotSensor's belongs to the figure."""
    if ax.get_legend() is not None:
        ax.legend()
    figure = ax.figure
    if figure.legends:
        for legend in list(figure.legends):
            legend.remove()
        figure.legend()
