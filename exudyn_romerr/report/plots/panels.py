"""Pictures of a report's outputs that fit one screen: a panel for each, and a line of what is left out."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ..data import is_beside
from ..wording import at_round_off, for_run_alone, not_certified
from .over_time import draw_bounds, draw_causes, draw_signal
from .style import SIZE, new_figure, of_one_size, save

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable

    from ..data import OutputData, ReportData

COLUMNS = 2  # of panels side by side: what fits a page
HARDLY = 0.01  # of the largest change of an output's rows: a row that changes less is not the one that is looked at
PANELS = 4  # of a picture: more are smaller than their legends
DETAILED = 2  # so many have a second pair of axes with the bounds of all estimators
SCREEN = (10.0, 8.0)  # inches, the largest picture
LINE, NAMES = 150, 8  # letters in a line of the note; so many names are in it
TITLE = 48  # letters in a line of a title above one of two panels side by side


@of_one_size
def plot_report(report: ReportData, path: str | os.PathLike | None = None, outputs: list[str] | None = None) -> Any:
    """Draw a panel for each output, the signal with its band; of one or two, bound and true error (semilog) below.

    Of one output every row has a panel, of several the row with the largest bound. At most PANELS, those with the
    largest bounds for their size, what nobody asked for ("NAME in the frame" beside NAME) last; where there is no
    bound the estimate, half width included, stands for it. A line above says what is left out.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        No or unknown outputs; a path that no picture can be written to.
    """
    rows, left_out = _chosen(report, list(report.outputs) if outputs is None else outputs)
    draws = (draw_signal, draw_bounds) if len(rows) <= DETAILED else (draw_signal,)
    notes = _notes(report, rows, left_out and _note(left_out, "smaller bounds or estimates"))
    figure, panels = _panels(len(rows), len(draws), notes)
    for (name, i), axes in zip(rows, panels, strict=True):
        for ax in axes[:-1]:
            ax.sharex(axes[-1])
        for ax, draw in zip(axes, draws, strict=True):
            draw(ax, report, name, i)
        for ax in axes[:-1]:
            ax.set_xlabel("")
        for ax in axes[1:]:
            ax.set_title("")
        _wrap(axes[0], len(rows))
    return _saved(figure, path)


@of_one_size
def plot_causes(report: ReportData, path: str | os.PathLike | None = None, outputs: list[str] | None = None) -> Any:
    """Draw draw_causes' picture in a panel for each output that has a bound, or of `outputs`; else as plot_report."""
    rows, left_out = _chosen(report, (_bounded(report) or list(report.outputs)) if outputs is None else outputs)
    notes = _notes(report, rows, left_out and _note(left_out, "smaller bounds"))
    figure, panels = _panels(len(rows), 1, notes)
    for (name, i), (ax,) in zip(rows, panels, strict=True):
        draw_causes(ax, report, name, i)
        _wrap(ax, len(rows))
    return _saved(figure, path)


def _bounded(report: ReportData) -> list[str]:
    return [name for name, out in report.outputs.items() if np.isfinite(out.bound["best"]).any()]


def _chosen(report: ReportData, outputs: str | list[str]) -> tuple[list[tuple[str, int]], list[str]]:
    """Return the rows that are drawn, and the names of the others."""
    names = list(dict.fromkeys([outputs] if isinstance(outputs, str) else outputs or report.outputs))
    rows = [(name, i) for name in names for i in range(report.output(name).value.shape[1])]
    if not rows:
        raise InputError("the report has no outputs to plot; pass outputs= to attach or evaluate")
    kept = rows if len(names) == 1 else [(name, _worst_row(report.output(name))) for name in names]

    def rank(row: tuple[str, int]) -> tuple:
        return not is_beside(report, row[0]), _for_its_size(report.output(row[0]), row[1])

    largest = sorted(kept, key=rank, reverse=True)[:PANELS]
    kept = [row for row in kept if row in largest]
    return kept, [report.output(name).row_names[i] for name, i in rows if (name, i) not in kept]


def _worst_row(out: OutputData) -> int:
    """The row with the largest error, of those that move: beside a swing of metres nobody looks for micrometres."""
    moves = np.ptp(out.value, axis=0)
    return int(np.argmax(np.where(moves >= HARDLY * moves.max(), [_error(out, i) for i in range(len(moves))], -1.0)))


def _error(out: OutputData, row: int) -> float:
    """The largest bound of a row or the largest estimate with its half width, which may have time steps in it."""
    size = 0.0 if out.estimate is None else np.max(np.abs(out.estimate[:, row]) + out.uncertainty[:, row])
    bound = np.max(out.bound["best"][:, row])
    return float(max(size, bound) if np.isfinite(bound) or out.estimate is None else size)


def _for_its_size(out: OutputData, row: int) -> tuple[bool, float]:
    """The error of a row over the output's largest value; what is at round-off, which says nothing, last."""
    error, largest = _error(out, row), np.max(np.abs(out.value))
    return not at_round_off(out)[row], error / largest if largest > 0 else error


def _panels(count: int, high: int, note: str) -> tuple[Any, Iterable[list[Any]]]:
    """Return a figure of at most one screen, and of every panel its axes, one below the other."""
    columns = min(COLUMNS, count)
    bands = -(-count // columns)
    width, height = SIZE[0] * columns, SIZE[1] * bands * high
    figure = new_figure(min(width, SCREEN[0]), min(height, SCREEN[1]))
    if note:
        figure.suptitle(note, fontsize="small")
    axes = figure.subplots(bands * high, columns, squeeze=False)
    places = [divmod(place, columns) for place in range(bands * columns)]
    panels = [list(axes[high * band : high * (band + 1), column]) for band, column in places]
    for ax in (ax for panel in panels[count:] for ax in panel):
        ax.remove()
    return figure, panels[:count]


def _wrap(ax: Any, count: int) -> None:
    """Break a title that is longer than its panel is wide."""
    ax.set_title(fill(ax.get_title(), TITLE if count > 1 else 2 * TITLE))


def _notes(report: ReportData, rows: list[tuple[str, int]], left_out: str | list[str]) -> str:
    """What is said above all panels: what bounds leave out, why they are not certified, what is not drawn."""
    doubts = dict.fromkeys(doubt for name, _ in rows for doubt in report.output(name).uncertified)
    condition = for_run_alone(report.scope)
    said = [condition and f"Bounds hold {condition}", doubts and f"Bounds are {not_certified(doubts)}"]
    return "\n".join([*(fill(words, LINE) for words in said if words), *([left_out] if left_out else [])])


def _note(left_out: list[str], smaller: str) -> str:
    names = [name.replace(" ", "\N{NO-BREAK SPACE}") for name in left_out[:NAMES]]
    more = f" and {len(left_out) - NAMES} more" if left_out[NAMES:] else ""
    why = f"{smaller} for their size, none, or not asked for"
    return fill(f"Not shown ({why}): {', '.join(names)}{more}; outputs= chooses", LINE)


def _saved(figure: Any, path: str | os.PathLike | None) -> Any:
    if path is not None:
        save(figure, path)
    return figure
