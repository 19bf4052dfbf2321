"""A picture of verdicts: errors by cause and sensor, their half widths, the estimate beside what was measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..report.plots.style import CAUSE_STYLES, new_figure, of_one_size, save
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
MOST = 12  # sensors in one picture: names of more run into each other; those with the largest errors
WIDTH = 0.8  # of the place of a sensor


@of_one_size
def draw_causes(rows: Sequence[Row], path: str | os.PathLike) -> None:
    """Draw the errors of all sensors by cause, as shares of what they show.

    Parameters
    ----------
    rows : of verdicts
    path : .png, .svg or .pdf
    """
    sensors = [row for row in by_sensor(rows) if row.largest and row.of["sum"].size is not None]
    sensors = sorted(sensors, key=lambda row: -row.of["sum"].most / row.largest)[:MOST]
    causes = [cause for cause in CAUSES if any(_known(row, cause) for row in sensors)]
    figure = new_figure(max(6.4, 0.9 * len(sensors) + 2.5), 4.2)
    axes = figure.subplots()
    for k, cause in enumerate(causes):
        _draw(axes, sensors, cause, k - (len(causes) - 1) / 2, WIDTH / max(len(causes), 1))
    at = [i for i, row in enumerate(sensors) if row.estimated is not None and row.estimated.size]
    if at:
        shares = [100 * sensors[i].estimated.size / sensors[i].largest for i in at]
        axes.plot(at, shares, "kD", markersize=5, label="whole error, estimated")
    axes.set(yscale="log", ylabel="error / largest value of the sensor in %")
    axes.set_xticks(range(len(sensors)), [row.name for row in sensors], rotation=20 if len(sensors) > 4 else 0)
    axes.grid(axis="y", alpha=0.4)
    axes.set_axisbelow(True)
    figure.legend(loc="outside lower center", ncols=2)
    save(figure, path)


def _draw(axes: Any, sensors: Sequence[Row], cause: str, offset: float, width: float) -> None:
    """Bars of one cause, with half widths as lines."""
    colour, hatch = STYLES[cause]
    at = [i for i, row in enumerate(sensors) if _known(row, cause)]
    sizes = [100 * sensors[i].of[cause].size / sensors[i].largest for i in at]
    halves = [100 * (sensors[i].of[cause].half_width or 0.0) / sensors[i].largest for i in at]
    places, how = [i + offset * width for i in at], sensors[at[0]].of[cause].how
    below = [min(half, 0.9 * size) for half, size in zip(halves, sizes, strict=True)]  # a logarithm has no zero
    axes.bar(places, sizes, width, color=colour, hatch=hatch, edgecolor="white", label=f"{TITLES[cause]}, {how}")
    axes.errorbar(places, sizes, [below, halves], fmt="none", ecolor="0.3", capsize=3)


def _known(row: Row, cause: str) -> bool:
    verdict: Verdict | None = row.of.get(cause)
    return verdict is not None and bool(verdict.size)
