"""The one style of all pictures, and how they are saved. Matplotlib is imported when the first one is made."""

from __future__ import annotations

import os
from functools import wraps
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ..formats.atomic_write import write_whole

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

LETTERS = 10  # points
# Okabe and Ito: told apart by the colour-blind; line styles, markers and hatches tell them apart in grey print
COLOURS = {
    "value": "#000000",
    "error": "#D55E00",
    "estimate": "#000000",
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
MARKERS = {
    "state-space": "x",
    "fast": "s",
    "convolution": "D",
    "output-kernel": "P",
    "energy": "^",
    "auxiliary": "o",
    "static": "o",
}
CAUSE_STYLES = {  # name in words, colour, hatch
    "basis": ("basis", "#0072B2", ""),
    "interfaces": ("rigid interfaces", "#009E73", "\\\\"),
    "time step": ("time step", "#E69F00", "//"),
    "initial": ("initial error", "#CC79A7", ".."),
    "jumps": ("load jumps", "#56B4E9", "xx"),
}
KINDS = (("#0072B2", "o"), ("#E69F00", "s"), ("#009E73", "^"), ("#CC79A7", "D"), ("#56B4E9", "v"), ("#000000", "P"))

WIDE, THIN = 2.5, 1.0  # a sharp bound lies on the true error: the wide line shows on both sides of the thin one
SIZE = (6.4, 3.6)  # inches of one pair of axes: a column of a report
DPI = 150
NARROW = 4.0  # inches: a legend of two columns is wider where it says what bounds hold under
LEGEND_LINE = {1: 72, 2: 46}  # letters in a line of a legend, by its columns: more run off a picture of our sizes
TICKS = 5  # intervals of an axis of time: labels such as 0.0175 of more run into each other in narrow panels
LEGEND_BELOW = 0.5  # inches under the axes: below tick labels and the axis' own
EDGES = (  # of the axes: what it means, where, marker
    ("lower edge: exactly zero", 0.0, "v"),
    ("upper edge: infinite", 1.0, "^"),
)


def of_one_size(make: Callable) -> Callable:
    """Let a function make its picture with our size of letters: Exudyn's PlotSensor sets another for the process."""

    @wraps(make)
    def made(*arguments: Any, **options: Any) -> Any:
        from matplotlib import rc_context

        with rc_context({"font.size": LETTERS}):
            return make(*arguments, **options)

    return made


def new_figure(width: float = SIZE[0], height: float = SIZE[1]) -> Any:
    """Return an empty figure; not pyplot's: no window, no global list of figures."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def save(figure: Any, path: str | os.PathLike) -> None:
    """Write a picture, PNG, SVG or PDF by the ending of its name, whole or not at all.

    Raises
    ------
    InputError
        An ending that matplotlib has no format for, or a file that cannot be written.
    """
    ending, known = os.path.splitext(os.fspath(path))[1][1:].lower(), figure.canvas.get_supported_filetypes()
    if ending not in known:
        raise InputError(f"path={os.fspath(path)!r} ends in no format of pictures; use .png, .svg or .pdf")
    write_whole(path, lambda stream: figure.savefig(stream, format=ending, dpi=DPI))


@of_one_size
def picture(
    draw: Callable, path: str | os.PathLike | None, *arguments: Any, projection: str | None = None, **options: Any
) -> Any:
    """Return a figure with one pair of axes that draw(ax, *arguments, **options) filled; save it if path is given."""
    figure = new_figure() if projection is None else new_figure(height=SIZE[0] * 0.75)
    draw(figure.add_subplot(projection=projection), *arguments, **options)
    if path is not None:
        save(figure, path)
    return figure


def log_line(ax: Any, x: np.ndarray, y: np.ndarray, every: Iterable[int] | None = None, **style: Any) -> None:
    """Plot y >= 0 on a logarithmic axis; zeros and inf, which have no place there, become marks at its edges.

    every : places of markers, default all; single places between others that are not drawn have one anyway.
    """
    drawn = (y > 0) & np.isfinite(y)
    at = None if every is None else sorted({*every, *isolated(drawn).tolist()})
    marker = None if at == [] else style.pop("marker", None)  # not in the legend if nowhere else
    ax.plot(x, np.where(drawn, y, np.nan), **{**style, "markevery": at, "marker": marker})
    mark_edges(ax, x, y, style.get("color"))


def mark_edges(ax: Any, x: np.ndarray, y: np.ndarray, colour: str | None) -> None:
    """Mark where y is zero at the lower edge of the axes, where it is inf at the upper one; say so in the legend."""
    for mask, (words, height, marker) in zip((y == 0, np.isinf(y)), EDGES, strict=True):
        if np.any(mask):
            at = {"markevery": ends(mask).tolist(), "transform": ax.get_xaxis_transform(), "clip_on": False}
            style = {"linewidth": 2 * WIDE, "solid_capstyle": "butt", "marker": marker, "gid": words, "zorder": 3}
            ax.plot(x, np.where(mask, height, np.nan), color=colour, **style, **at)


def isolated(mask: np.ndarray) -> np.ndarray:
    """Return the places of True between two that are not: no line goes there."""
    padded = np.concatenate([[False], mask, [False]])
    return np.flatnonzero(mask & ~padded[:-2] & ~padded[2:])


def ends(mask: np.ndarray) -> np.ndarray:
    """Return the first and last place of every run of True; a single one has no line, only its marker."""
    padded = np.concatenate([[False], mask, [False]])
    return np.flatnonzero(mask & ~(padded[:-2] & padded[2:]))


def spread(count: int, place: int) -> range:
    """Return where a curve of `count` samples has its markers: about ten, beside those of other curves."""
    step = max(count // 10, 1)
    return range((place * step) // 3 % step, count, step)


def finish(ax: Any) -> None:
    """Grid, and a legend below the axes, where it hides nothing."""
    from matplotlib.ticker import AutoLocator
    from matplotlib.transforms import ScaledTranslation

    drawn = {line.get_gid() for line in ax.lines}
    for words, _, marker in EDGES:
        if words in drawn:
            ax.plot([], [], marker, color="#777777", label=words)
    ax.grid(which="major", alpha=0.3)
    ax.tick_params(labelsize=LETTERS)  # of ticks that are made later, too
    if isinstance(ax.xaxis.get_major_locator(), AutoLocator):
        ax.locator_params(axis="x", nbins=TICKS)
    below = ax.transAxes + ScaledTranslation(0, -LEGEND_BELOW, ax.figure.dpi_scale_trans)
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "bbox_transform": below, "borderaxespad": 0}
    columns = 1 if ax.bbox.width / ax.figure.dpi < NARROW else 2
    lines, labels = ax.get_legend_handles_labels()
    labels = [fill(label, LEGEND_LINE[columns], break_on_hyphens=False) for label in labels]
    ax.legend(lines, labels, ncols=columns, fontsize="small", frameon=False, **place)
