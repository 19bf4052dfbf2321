"""Pictures of several runs: errors against run time and number of modes; what runs have measured, by cause."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ..verdict_text import TITLES, by_sensor
from ..verdicts import CAUSES, Row
from ..wording import axis_label
from .style import (
    CAUSE_STYLES,
    COLOURS,
    KINDS,
    WIDE,
    finish,
    log_line,
    new_figure,
    of_one_size,
    picture,
    put_title,
    save,
)

# colour, hatch
OF_CAUSES = dict(
    zip(CAUSES, (CAUSE_STYLES[x][1:] for x in ("basis", "interfaces", "time step", "initial")), strict=True)
)
MOST = 12  # sensors in one picture: names of more run into each other; those with the largest errors
BAR = 0.8  # of the place of a sensor
HIGH = 4.6  # inches


class TimedRun(NamedTuple):
    """One run of a basis: kind of the basis, seconds it took, largest bound, true error if known, a word."""

    kind: str
    seconds: float
    bound: float
    error: float | None = None
    label: str = ""


class CountedRun(NamedTuple):
    """One run: number of modes, largest bound, true error if known."""

    n: int
    bound: float
    error: float | None = None


def plot_run_time(rows: Sequence[tuple], name: str, unit: str, path: str | os.PathLike | None = None) -> Any:
    """Draw draw_run_time's picture; save it to path if given, return the figure."""
    return picture(draw_run_time, path, rows, name, unit)


def draw_run_time(ax: Any, rows: Sequence[tuple], name: str, unit: str) -> None:
    """Draw bounds and true errors against run time, log-log: one curve for each kind of basis, Pareto front marked.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    rows : sequence of (kind, seconds, bound[, error[, label]])
        A run each: kind of its basis; run time in s; largest bound and true error over time, error None if it is not
        known; a word beside the point, such as the number of modes. Rows of a kind are joined in their order.
    name, unit : str
        Of the output.

    Raises
    ------
    InputError
        No rows; rows of other lengths; run times not above zero; nan or numbers below zero as bounds or errors.

    Notes
    -----
    On the Pareto front are the runs that no other one beats in both run time and bound; errors, which are not known
    to whoever asks, have no part in it.
    """
    runs = _checked(rows, TimedRun)
    if not all(0 < run.seconds < np.inf for run in runs):
        raise InputError("seconds of every row must be above zero and finite: the axis is logarithmic")
    kinds = list(dict.fromkeys(run.kind for run in runs))
    if len(kinds) > len(KINDS):
        raise InputError(f"rows have {len(kinds)} kinds of basis; a picture tells {len(KINDS)} apart")
    ax.set(xscale="log", yscale="log", xlabel="run time / s", ylabel=axis_label(f"largest error of {name}", unit))
    best = [runs[i] for i in pareto_front([run.seconds for run in runs], [run.bound for run in runs])]
    front = [(run.seconds, run.bound) for run in best if run.bound > 0]  # a bound of zero has no place on the axis
    style = {"drawstyle": "steps-post", "color": "#BBBBBB", "linewidth": 3 * WIDE, "zorder": 0}
    ax.plot(*np.reshape(front, (-1, 2)).T, label="Pareto front of the bounds", **style)
    for k, (kind, (colour, marker)) in enumerate(zip(kinds, KINDS, strict=False)):
        its, style = [run for run in runs if run.kind == kind], {"color": colour, "marker": marker}
        _draw_pair(ax, [run.seconds for run in its], its, {**style, "label": kind}, style)
        for run in its:
            if run.label and 0 < run.bound < np.inf:
                _write_beside(ax, run.label, (run.seconds, run.bound), k, "small")
    ax.plot([], [], "o-", color="#777777", label="filled: bound")
    if any(run.error is not None for run in runs):
        ax.plot([], [], "o:", color="#777777", markerfacecolor="none", label="hollow: true error")
    _plain_numbers(ax.xaxis)
    ax.margins(0.1)
    finish(ax, f"{name}: error against run time", _infinite(runs))


def plot_pairs(table: Sequence[dict[str, Any]], path: str | os.PathLike | None, title: str) -> Any:
    """Draw draw_pairs' picture; save it to path if given, return the figure."""
    return picture(draw_pairs, path, table, title)


def draw_pairs(ax: Any, table: Sequence[dict[str, Any]], title: str) -> None:
    """Draw errors beside their tolerances against run time, log-log, of numbers of modes and steps.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    table : Tuning.table, of runs and forecasts
    title : above it
    """
    points = [(line, (line["cpu_s"], 100 * line["ratio"])) for line in table if line["ratio"]]
    runs, forecasts = ([x for x in points if x[0]["how"] == how] for how in ("run", "forecast"))
    found, colour = [x for x in runs if x[0]["is_found"]], COLOURS["auxiliary"]
    for label, of, style in (
        ("run", runs, {"color": colour}),
        ("forecast", forecasts, {"color": colour, "mfc": "none"}),
        ("found", found, {"color": COLOURS["error"], "mfc": "none", "markersize": 14}),
    ):
        ax.plot(*np.reshape([at for _, at in of], (-1, 2)).T, "o", label=label, **style)
    ax.axhline(100, color="#555555", linestyle="--", linewidth=WIDE, label="tolerance")
    for k, (line, at) in enumerate(points):
        _write_beside(ax, f"{', '.join(map(str, line['numbers'])) or '-'} | {line['steps']}", at, k, "x-small")
    ax.set(xscale="log", yscale="log", xlabel="CPU time of the solves / s", ylabel="largest error / tolerance in %")
    _plain_numbers(ax.xaxis, ax.yaxis)
    ax.margins(0.2)
    finish(ax, title, ["beside the points: modes | steps"])


def plot_convergence(rows: Sequence[tuple], name: str, unit: str, path: str | os.PathLike | None = None) -> Any:
    """Draw draw_convergence's picture; save it to path if given, return the figure."""
    return picture(draw_convergence, path, rows, name, unit)


def draw_convergence(ax: Any, rows: Sequence[tuple], name: str, unit: str) -> None:
    """Draw bound and true error against the number of modes, semilog.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    rows : sequence of (n, bound[, error])
        A run each: number of modes, largest bound and true error over time; error None if it is not known.
    name, unit : str
        Of the output.

    Raises
    ------
    InputError
        No rows; rows of other lengths; nan or numbers below zero.
    """
    from matplotlib.ticker import MaxNLocator

    runs = sorted(_checked(rows, CountedRun), key=lambda run: run.n)
    ax.set(yscale="log", xlabel="number of modes", ylabel=axis_label(f"largest error of {name}", unit))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    bound = {"color": COLOURS["auxiliary"], "marker": "o", "label": "bound"}
    error = {"color": COLOURS["error"], "marker": "s", "label": "|true error|"}
    _draw_pair(ax, [run.n for run in runs], runs, bound, error)
    finish(ax, f"{name}: error against the number of modes", _infinite(runs))


def pareto_front(seconds: Sequence[float], bounds: Sequence[float]) -> list[int]:
    """Return the places of runs that no other one beats in both, the fastest first."""
    order = sorted(range(len(bounds)), key=lambda i: (seconds[i], bounds[i]))
    return [i for k, i in enumerate(order) if bounds[i] < min((bounds[j] for j in order[:k]), default=np.inf)]


def _infinite(runs: list) -> list[str]:
    """A note of bounds that have no place on the axis."""
    count = sum(np.isinf(run.bound) for run in runs)
    return [f"{count} of {len(runs)} bounds infinite"] if count else []


def _plain_numbers(*axes: Any) -> None:
    """Ticks of logarithmic axes: 1, 2, 5 and their multiples by ten, written as such."""
    from matplotlib.ticker import LogLocator, NullLocator

    for axis in axes:
        axis.set(major_locator=LogLocator(subs=(1, 2, 5)), major_formatter="{x:g}", minor_locator=NullLocator())


def _write_beside(ax: Any, text: str, point: tuple[float, float], turn: int, size: str) -> None:
    """A word beside a point, above and below in turn: kinds of basis often come close."""
    offset, side = (((5, 5), "left"), ((-5, -13), "right"))[turn % 2]
    ax.annotate(text, point, offset, textcoords="offset points", fontsize=size, ha=side)


def _draw_pair(ax: Any, x: list, runs: list, bound: dict, error: dict) -> None:
    """Bounds filled and solid, true errors hollow and dotted; those that are not known are left out."""
    log_line(ax, np.array(x, dtype=float), np.array([run.bound for run in runs], dtype=float), **bound)
    known = [(at, run.error) for at, run in zip(x, runs, strict=True) if run.error is not None]
    if known:
        log_line(ax, *np.array(known, dtype=float).T, markerfacecolor="none", linestyle=":", **error)


def _checked(rows: Sequence[tuple], kind: type) -> list:
    """Rows as named tuples."""
    rows = [tuple(row) for row in rows]
    if not rows:
        raise InputError("rows is empty; pass one for every run")
    most, least = len(kind._fields), len(kind._fields) - len(kind._field_defaults)
    for row in rows:
        if not least <= len(row) <= most:
            raise InputError(f"rows has {row!r}; needed: {least} to {most} of ({', '.join(kind._fields)})")
    runs = [kind(*row) for row in rows]
    for field, value in ((field, getattr(run, field)) for run in runs for field in ("bound", "error")):
        if value is not None and not value >= 0:
            raise InputError(f"rows has a {field} of {value!r}; needed: a number, zero or above, or inf")
    return runs


@of_one_size
def plot_verdicts(rows: Sequence[Row], path: str | os.PathLike, title: str = "Errors measured") -> Any:
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
    axes, width = figure.subplots(), BAR / max(len(causes), 1)
    for k, cause in enumerate(causes):
        _draw_cause(axes, sensors, cause, (k - (len(causes) - 1) / 2) * width, width)
    places = np.arange(len(sensors))
    estimated = {i: row.estimated.size for i, row in enumerate(sensors) if row.estimated and row.estimated.size}
    if estimated:
        shares = [_share(sensors[i], size) for i, size in estimated.items()]
        axes.plot([*estimated], shares, "kD", markersize=5, label="whole error, estimated")
    if asked := [i for i in places if sensors[i].limit.is_asked and sensors[i].tolerance]:
        shares, at = [_share(sensors[i], sensors[i].tolerance) for i in asked], np.array(asked)
        style = {"colors": COLOURS["tolerance"], "linewidth": 2.5, "label": "tolerance"}
        axes.hlines(shares, at - BAR / 2, at + BAR / 2, **style)
    if any(row.of[cause].half_width is None for row in sensors for cause in causes if _known(row, cause)):
        axes.plot([], [], "^", color="0.3", label="that or more")
    axes.set(yscale="log", ylabel="error / largest value of the sensor in %")
    turn = {"rotation": 20, "ha": "right"} if len(sensors) > 4 else {}
    axes.set_xticks(places, [row.label or row.name for row in sensors], **turn)
    axes.grid(axis="y", alpha=0.4)
    axes.set_axisbelow(True)
    put_title(figure, title)
    if entries := len(axes.get_legend_handles_labels()[1]):  # none where nothing is known
        figure.legend(loc="outside lower center", ncols=max(2, -(-entries // 2)), fontsize="small", frameon=False)
    return save(figure, path)


def _draw_cause(axes: Any, sensors: Sequence[Row], cause: str, offset: float, width: float) -> None:
    """Bars of one cause, with half widths as lines; an arrow where it is that or more."""
    colour, hatch = OF_CAUSES[cause]
    known = [(i + offset, row, row.of[cause]) for i, row in enumerate(sensors) if _known(row, cause)]
    label = f"{TITLES[cause]}, {known[0][2].how}"
    bars = np.array([(at, _share(row, x.size), _share(row, x.half_width or 0.0)) for at, row, x in known])
    axes.bar(bars[:, 0], bars[:, 1], width, color=colour, hatch=hatch, edgecolor="white", label=label)
    is_open = np.array([x.half_width is None for _, _, x in known])
    for of, style in ((~is_open, {"capsize": 3}), (is_open, {"lolims": True, "capsize": 4})):
        if of.any():
            at, sizes, halves = bars[of].T
            below = np.minimum(halves, 0.9 * sizes)  # a logarithm has no zero
            above = sizes if style.get("lolims") else halves
            axes.errorbar(at, sizes, [below, above], fmt="none", color="0.3", **style)


def _share(row: Row, x: float) -> float:
    """In %, of what all components of the sensor show."""
    return 100 * x / row.extent


def _known(row: Row, cause: str) -> bool:
    return cause in row.of and bool(row.of[cause].size)
