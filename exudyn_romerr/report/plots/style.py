"""The one style of all pictures, how axes stay readable, and files. Matplotlib is imported with the first picture."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from textwrap import fill
from typing import Any

import numpy as np

from ...errors import InputError
from ..formats.atomic_write import write_whole
from ..wording import axis_label, rounded_up, with_unit

LETTERS = 10  # points
# Okabe and Ito, and two of Tol for what these leave open: told apart by the colour-blind; line styles, markers and
# hatches tell them apart in grey print. Green is a bound, and nothing else
LOOKS = {  # of estimators: colour, line, marker
    "state-space": ("#999999", ":", "x"),
    "fast": ("#56B4E9", "--", "s"),
    "convolution": ("#0072B2", "-", "D"),
    "energy": ("#CC79A7", "-.", "^"),
    "auxiliary": ("#009E73", "-", "o"),
    "static": ("#009E73", "-", "o"),
}
COLOURS = {"value": "#000000", "error": "#D55E00", "estimate": "#5D3A9B", "tolerance": "#444444"}
COLOURS |= {e: colour for e, (colour, _, _) in LOOKS.items()}
OTHERS = "#E69F00", (0, (5, 1, 1, 1, 1, 1)), "P"  # of estimators that only files of earlier versions have
CAUSE_STYLES = {  # name in words, colour, hatch
    "basis": ("basis", "#0072B2", ""),
    "interfaces": ("rigid interfaces", "#882255", "\\\\"),
    "time step": ("time step", "#E69F00", "//"),
    "initial": ("initial error", "#CC79A7", ".."),
    "jumps": ("load jumps", "#56B4E9", "xx"),
}
KINDS = (("#0072B2", "o"), ("#E69F00", "s"), ("#882255", "^"), ("#CC79A7", "D"), ("#56B4E9", "v"), ("#000000", "P"))

WIDE, THIN = 2.5, 1.0  # a sharp bound lies on the true error: the wide line shows on both sides of the thin one
SIZE = (6.4, 3.6)  # inches of one pair of axes: a column of a report
DPI = 150
TICKS = 5  # intervals of an axis of time: labels such as 0.0175 of more run into each other in narrow panels
BELOW, BARE = 0.5, 0.25  # inches from axes to legend: below tick labels and the axis' own, or tick labels alone
ASIDE = 0.8  # inches of a panel beside its axes
LETTER = 0.078  # inches, a letter of a title
SIDEWAYS = 24  # letters in a line of a label of a y axis: more run into the panel above
LINES = 2  # of a legend
# times what is shown beside it: a band that is wider is cut off. Bounds are shown up to ten times what the output
# changes by; half widths, which are no promise, up to three times of all that
OF_BOUND, OF_HALF_WIDTH = 10.0, 3.0
MARGIN = 0.1  # of what is shown, on both sides
USELESS = 1e3  # times output, estimate and error: three decades are read with ease, a larger bound tells nothing
DEEP = 1e-4  # of the lowest curve's largest value: what is lower, at first instants say, is not worth an axis
ZERO = "zero"  # marked at the lower edge of a logarithmic axis


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


def save(figure: Any, path: str | os.PathLike | None) -> Any:
    """Return a picture, written to path if there is one: PNG, SVG or PDF by its ending, whole or not at all.

    Raises
    ------
    InputError
        An ending that matplotlib has no format for, or a file that cannot be written.
    """
    if path is None:
        return figure
    ending, known = os.path.splitext(os.fspath(path))[1][1:].lower(), figure.canvas.get_supported_filetypes()
    if ending not in known:
        raise InputError(f"path={os.fspath(path)!r} ends in no format of pictures; use .png, .svg or .pdf")
    write_whole(path, lambda stream: figure.savefig(stream, format=ending, dpi=DPI))
    return figure


@of_one_size
def picture(
    draw: Callable, path: str | os.PathLike | None, *arguments: Any, projection: str | None = None, **options: Any
) -> Any:
    """Return a figure with one pair of axes that draw(ax, *arguments, **options) filled; save it if path is given."""
    figure = new_figure() if projection is None else new_figure(height=SIZE[0] * 0.75)
    draw(figure.add_subplot(projection=projection), *arguments, **options)
    return save(figure, path)


def log_line(ax: Any, x: np.ndarray, y: np.ndarray, every: Iterable[int] | None = None, **style: Any) -> None:
    """Plot y >= 0 on a logarithmic axis; zeros, which have no place there, become marks at its edge; inf ends a line.

    every : places of markers, default all; single places between others that are not drawn have one anyway.
    """
    drawn = (y > 0) & np.isfinite(y)
    at = None if every is None else sorted({*every, *isolated(drawn).tolist()})
    marker = None if at == [] else style.pop("marker", None)  # not in the legend if nowhere else
    style["label"] = style.get("label") if drawn.any() else None
    ax.plot(x, np.where(drawn, y, np.nan), **{**style, "markevery": at, "marker": marker})
    mark_zeros(ax, x, y, style.get("color"))


def mark_zeros(ax: Any, x: np.ndarray, y: np.ndarray, colour: str | None) -> None:
    """Mark where y is zero at the lower edge of the axes."""
    if np.any(y == 0):
        at = {"markevery": ends(y == 0).tolist(), "transform": ax.get_xaxis_transform(), "clip_on": False}
        style = {"linewidth": WIDE, "solid_capstyle": "butt", "marker": "v", "gid": ZERO, "zorder": 3}
        ax.plot(x, np.where(y == 0, 0.0, np.nan), color=colour, **style, **at)


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


def quantity(name: str, unit: str) -> str:
    """Return the label of an axis, with its unit if that is known, in lines that a panel is high."""
    kept = axis_label("", unit).replace(" ", "\N{NO-BREAK SPACE}")
    lines = fill(f"{name}{kept}", SIDEWAYS, break_long_words=False, break_on_hyphens=False)
    return lines.replace("\N{NO-BREAK SPACE}", " ")


def finish(ax: Any, title: str, notes: Iterable[str] = ()) -> None:
    """Grid, a title with a line of notes, and a legend below the axes, where it hides nothing."""
    from matplotlib.ticker import AutoLocator

    if any(line.get_gid() == ZERO for line in ax.lines):
        ax.plot([], [], "v", color="#777777", label=ZERO)
    ax.grid(which="major", alpha=0.3)
    ax.tick_params(labelsize=LETTERS)  # of ticks that are made later, too
    if isinstance(ax.xaxis.get_major_locator(), AutoLocator):
        ax.locator_params(axis="x", nbins=TICKS)
    lines = filter(None, [title, "; ".join(filter(None, notes))])
    filled = (fill(line, int(_room(ax) / LETTER), break_on_hyphens=False) for line in lines)
    ax.set_title("\n".join(filled), fontsize=LETTERS)
    put_legend(ax)


def put_title(figure: Any, title: str) -> None:
    """Put a title above all axes, in as many lines as it needs."""
    figure.suptitle(fill(title, int(figure.get_figwidth() / LETTER)), fontsize=1.2 * LETTERS)


def put_legend(ax: Any) -> None:
    """Put a legend of LINES lines below the axes and their labels; what has the same label is one entry."""
    from matplotlib.transforms import ScaledTranslation

    entries: dict[str, list] = {}
    for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
        entries.setdefault(label, []).append(handle)
    if not entries:
        return
    down = ScaledTranslation(0, -(BELOW if ax.get_xlabel() else BARE), ax.figure.dpi_scale_trans)
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "bbox_transform": ax.transAxes + down}
    handles = [tuple(of) if of[1:] else of[0] for of in entries.values()]
    count, few = len(entries), -(-len(entries) // LINES)
    shapes = ((columns, size) for size in ("small", "x-small") for columns in ((count, few) if count < 4 else (few,)))
    for columns, size in shapes:  # the best first
        style = {"ncols": columns, "fontsize": size, "columnspacing": 1.2, "borderaxespad": 0, "frameon": False}
        legend = ax.legend(handles, list(entries), **style, **place)
        if legend.get_window_extent().width <= _room(ax) * ax.figure.dpi:
            break


def _room(ax: Any) -> float:
    """Inches that axes have beside those in the next column."""
    spec = ax.get_subplotspec()
    return ax.figure.get_figwidth() / (1 if spec is None else spec.get_gridspec().ncols) - ASIDE


# --- limits: what would leave nothing else to be seen leaves the axes, and the legend says so ---


def limits_of_signal(
    lines: Sequence[np.ndarray], bands: Sequence[tuple[np.ndarray, np.ndarray, float]]
) -> tuple[tuple[float, float] | None, list[bool]]:
    """Return limits of an axis on which lines can be read, and which of the bands leave it; None: none does.

    bands : middle, half width, and how many times as wide as what is shown so far a band may be.
    """
    low, high = min(map(np.min, lines)), max(map(np.max, lines))
    leaves = []
    for middle, half, factor in bands:
        known = np.isfinite(middle + half)
        least = np.min(middle - half, where=known, initial=low)
        most = np.max(middle + half, where=known, initial=high)
        leaves.append(bool(most - least > factor * (high - low) > 0))
        low, high = (low, high) if leaves[-1] else (least, most)
    margin = MARGIN * (high - low)
    return ((low - margin, high + margin) if any(leaves) else None), leaves


def limits_of_errors(bounds: dict[str, np.ndarray], others: Sequence[np.ndarray], size: float) -> tuple | None:
    """Return limits of a logarithmic axis of bounds (T,), and others, estimate and error, of an output of that size.

    None: nothing is to be drawn. Bounds whose largest finite value is above them leave the axis.
    """
    most = {name: largest_finite(x) for name, x in bounds.items()}
    reads = [x for x in map(largest_finite, others) if x > 0]
    known = [x for x in most.values() if x > 0]
    if not reads and not known:
        return None
    top = USELESS * max([size, *reads]) if reads else max(USELESS * size, min(known))
    shown = [*reads, *(x for x in known if x <= top)]
    drawn = np.concatenate([x[np.isfinite(x) & (x > 0)] for x in (*bounds.values(), *others)])
    lowest = max(float(drawn.min()), DEEP * min(shown))
    return lowest / 2, 2 * max(shown)


def largest_finite(x: np.ndarray) -> float:
    """Return the largest finite value; 0: there is none."""
    return float(np.max(x, where=np.isfinite(x), initial=0.0))


def largest_in_words(bound: np.ndarray, unit: str, words: str) -> str:
    """Return the largest bound in words; half widths of estimates, and bounds not certified, are "up to"."""
    finite = bound[np.isfinite(bound)]
    largest = f"{words} {with_unit(rounded_up(np.max(finite), 2), unit)}" if finite.size else "nowhere finite"
    return largest if finite.size in (0, bound.size) else f"{largest} where finite"


def infinite(t: np.ndarray, bound: np.ndarray, by: str, axis: tuple[str, str]) -> str:
    """Return that, and when, a bound is infinite; empty: nowhere. by : " by 'energy'"; axis : name and unit of t."""
    at = np.flatnonzero(~np.isfinite(bound))
    if at.size in (0, len(t)):
        return f"no finite bound{by}" if at.size else ""
    name, unit = axis
    first, last = t[at[0]], t[at[-1]]
    when = f"{name} = {first:.4g}" + (f" to {last:.4g}" if last > first else "") + f" {unit}".rstrip()
    return f"bound{by} infinite at {when}{'' if at[-1] - at[0] < at.size else ', not throughout'}"
