"""A picture of verdicts: errors by cause and sensor, their half widths, the estimate beside what was measured."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any

from ..report.plots.style import CAUSE_STYLES, COLOURS, LETTER, LETTERS, new_figure, of_one_size, save
from ..report.table import TITLES, by_sensor
from ..report.verdicts import CAUSES

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    from ..report.verdicts import Row, Verdict

STYLES = {
    "modes": CAUSE_STYLES["basis"][1:],
    "interfaces": CAUSE_STYLES["interfaces"][1:],
    "step": CAUSE_STYLES["time step"][1:],
    "start": CAUSE_STYLES["initial"][1:],
}
MOST = 12  # rows in one picture: names of more run into each other; those with the largest errors
WIDTH = 0.8  # of the place of a sensor
HIGH = 4.6  # inches


@of_one_size
def draw_causes(rows: Sequence[Row], path: str | os.PathLike, title: str = "Errors measured") -> Any:
    """Draw the errors of all sensors by cause, as shares of what they show, and the tolerances that were given.

    Returns the figure.

    Parameters
    ----------
    rows : of verdicts
    path : .png, .svg or .pdf
    title : above all
    """
    sensors = [row for row in by_sensor(rows) if row.extent and row.of["sum"].size is not None]
    sensors = sorted(sensors, key=lambda row: -row.of["sum"].most / row.extent)[:MOST]
    causes = [cause for cause in CAUSES if any(_known(row, cause) for row in sensors)]
    figure = new_figure(min(max(6.4, 0.7 * len(sensors) + 2.5), 10.0), HIGH)
    axes = figure.subplots()
    for k, cause in enumerate(causes):
        _draw(axes, sensors, cause, k - (len(causes) - 1) / 2, WIDTH / max(len(causes), 1))
    _draw_whole(axes, sensors)
    if any(row.of[cause].half_width is None for row in sensors for cause in causes if _known(row, cause)):
        axes.plot([], [], "^", color="0.3", label="that or more")
    axes.set(yscale="log", ylabel="error / largest value of the sensor in %")
    turn = {"rotation": 20, "ha": "right"} if len(sensors) > 4 else {}
    axes.set_xticks(range(len(sensors)), [row.label or row.name for row in sensors], **turn)
    axes.grid(axis="y", alpha=0.4)
    axes.set_axisbelow(True)
    figure.suptitle(fill(title, int(figure.get_figwidth() / LETTER)), fontsize=1.2 * LETTERS)
    columns = max(2, -(-len(axes.get_legend_handles_labels()[1]) // 2))
    figure.legend(loc="outside lower center", ncols=columns, fontsize="small", frameon=False)
    save(figure, path)
    return figure


def _draw(axes: Any, sensors: Sequence[Row], cause: str, offset: float, width: float) -> None:
    """Bars of one cause, with half widths as lines; an arrow where it is that or more."""
    colour, hatch = STYLES[cause]
    at = [i for i, row in enumerate(sensors) if _known(row, cause)]
    verdicts = [sensors[i].of[cause] for i in at]
    sizes = [_share(sensors[i], x.size) for i, x in zip(at, verdicts, strict=True)]
    halves = [_share(sensors[i], x.half_width or 0.0) for i, x in zip(at, verdicts, strict=True)]
    places = [i + offset * width for i in at]
    label = f"{TITLES[cause]}, {verdicts[0].how}"
    axes.bar(places, sizes, width, color=colour, hatch=hatch, edgecolor="white", label=label)
    below = [min(half, 0.9 * size) for half, size in zip(halves, sizes, strict=True)]  # a logarithm has no zero
    for more in (False, True):
        of = [k for k, x in enumerate(verdicts) if (x.half_width is None) == more]
        if of:
            x, y, low, high = ([found[k] for k in of] for found in (places, sizes, below, sizes if more else halves))
            style = {"lolims": True, "capsize": 4} if more else {"capsize": 3}
            axes.errorbar(x, y, [[0.0] * len(of) if more else low, high], fmt="none", color="0.3", **style)


def _draw_whole(axes: Any, sensors: Sequence[Row]) -> None:
    """The estimate of the whole error as a diamond, the tolerance that was given as a line at the sensor's place."""
    at = [i for i, row in enumerate(sensors) if row.estimated is not None and row.estimated.size]
    if at:
        shares = [_share(sensors[i], sensors[i].estimated.size) for i in at]
        axes.plot(at, shares, "kD", markersize=5, label="whole error, estimated")
    at = [i for i, row in enumerate(sensors) if row.is_asked and row.tolerance]
    if at:
        shares = [_share(sensors[i], sensors[i].tolerance) for i in at]
        low, high = ([i + side * WIDTH / 2 for i in at] for side in (-1, 1))
        axes.hlines(shares, low, high, colors=COLOURS["tolerance"], linewidth=2.5, label="tolerance")


def _share(row: Row, x: float) -> float:
    """In %, of what all components of the sensor show."""
    return 100 * x / row.extent


def _known(row: Row, cause: str) -> bool:
    verdict: Verdict | None = row.of.get(cause)
    return verdict is not None and bool(verdict.size)
