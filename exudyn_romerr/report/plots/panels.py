"""Pictures of a report's outputs that fit one screen: a panel for each, and a line of what is left out."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from textwrap import fill
from typing import Any

import numpy as np

from ...errors import InputError
from ..answers import Tolerances
from ..assessment import limit_of
from ..data import OutputReport, ReportData, is_beside
from ..wording import for_run_alone, largest, listed, not_certified
from .over_time import draw_bounds, draw_causes, draw_signal
from .style import SIZE, new_figure, of_one_size, put_legend, put_title, save

HARDLY = 0.01  # of the largest change of an output's rows: a row that changes less is not the one that is looked at
PANELS = 4  # of a picture: more are smaller than their legends
DETAILED = 3  # so many have a second pair of axes with their errors
SCREEN = (10.0, 8.0)  # inches, the largest picture
NOTE = 15  # letters in an inch of the notes
NO_SCRIPT = re.compile(r"ipykernel|__")  # what runs a user's cells, or was run with python -m


@of_one_size
def plot_report(
    report: ReportData,
    path: str | os.PathLike | None = None,
    outputs: list[str] | None = None,
    tolerances: Tolerances | None = None,
) -> Any:
    """Draw a panel for each output, the signal with its band; of DETAILED or fewer the error (semilog) beside it.

    Of one output every row has a panel, of several the row with the largest bound. At most PANELS, those with the
    largest bounds for their size, what nobody asked for ("NAME in the frame" beside NAME) last; where there is no
    bound the estimate, half width included, stands for it. A line below says what is left out. tolerances : None:
    those that the report was made with.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        No or unknown outputs; a path that no picture can be written to.
    """

    def draw(panel: Sequence[Any], name: str, i: int) -> None:
        signal, *error = panel
        draw_signal(signal, report, name, i)
        for ax in error:
            limit = limit_of(report.output(name), tolerances)
            draw_bounds(ax, report, name, i, limit.size if limit.is_asked else None)
            signal.sharex(ax)

    return _plot(report, path, outputs, draw, 2, _question(report), "smaller bounds or estimates")


@of_one_size
def plot_causes(report: ReportData, path: str | os.PathLike | None = None, outputs: list[str] | None = None) -> Any:
    """Draw draw_causes' picture in a panel for each output that has a bound, or of `outputs`; else as plot_report."""
    bounded = [name for name, out in report.outputs.items() if np.isfinite(out.bound["best"]).any()]
    script = script_of(report)
    title = f"{script}: what do the bounds come from?" if script else "What do the bounds come from?"
    outputs = bounded if outputs is None else outputs
    return _plot(
        report, path, outputs, lambda panel, *of: draw_causes(*panel, report, *of), 1, title, "smaller bounds"
    )


def _plot(
    report: ReportData,
    path: str | os.PathLike | None,
    outputs: str | Sequence[str] | None,
    draw: Callable[[Sequence[Any], str, int], None],
    high: int,
    title: str,
    smaller: str,
) -> Any:
    """Title above, draw(axes, output, row) in each panel, notes below all; saved to path.

    outputs : those to choose from; none: all. high : axes in a panel, if there is room. smaller : what others have.
    Times stand at the lowest of axes above one another alone.
    """
    names = list(dict.fromkeys([outputs] if isinstance(outputs, str) else outputs or report.outputs))
    of_all = [(name, i) for name in names for i in range(report.output(name).value.shape[1])]
    if not of_all:
        raise InputError("the report has no outputs to plot; pass outputs= to attach or evaluate")
    rows = of_all if len(names) == 1 else [(name, _worst_row(report.outputs[name])) for name in names]
    worst = worst_first(report, rows)[:PANELS]
    rows = [row for row in rows if row in worst]
    figure, panels = _panels(len(rows), high if len(rows) <= DETAILED else 1)
    for (name, i), panel in zip(rows, panels, strict=True):
        draw(panel, name, i)
    put_title(figure, title)
    doubts = dict.fromkeys(doubt for name, _ in rows for doubt in report.outputs[name].uncertified)
    condition = for_run_alone(report.scope)
    notes = [condition and f"Bounds hold {condition}", doubts and f"Bounds are {not_certified(doubts)}"]
    of_others = (report.outputs[name].row_names[i] for name, i in of_all if (name, i) not in worst)
    if others := listed([name.replace(" ", "\N{NO-BREAK SPACE}") for name in of_others]):
        why = f"{smaller} for their size, none, or not asked for"
        notes.append(f"Not shown ({why}): {others}; outputs= chooses")
    if any(notes):
        width = int(NOTE * figure.get_figwidth())
        figure.supxlabel("\n".join(fill(note, width) for note in notes if note), fontsize="small")
    for ax in figure.axes:
        if not ax.get_subplotspec().is_last_row():
            ax.set_xlabel("")
            put_legend(ax)
    return save(figure, path)


def worst_first(report: ReportData, rows: list[tuple[str, int]]) -> list[tuple[str, int]]:
    """Return rows of outputs by their error over the output's largest value.

    Behind these what is at round-off, which says nothing, and last what nobody asked for.
    """

    def rank(row: tuple[str, int]) -> tuple[bool, bool, float]:
        out, error = report.outputs[row[0]], _error(report.outputs[row[0]], row[1])
        return not is_beside(report, out.name), not out.at_round_off()[row[1]], error / (largest(out.value) or 1.0)

    return sorted(rows, key=rank, reverse=True)


def _worst_row(out: OutputReport) -> int:
    """The row with the largest error, of those that move: beside a swing of metres nobody looks for micrometres."""
    moves = np.ptp(out.value, axis=0)
    return int(np.argmax(np.where(moves >= HARDLY * moves.max(), [_error(out, i) for i in range(len(moves))], -1.0)))


def _error(out: OutputReport, row: int) -> float:
    """The largest bound of a row or the largest estimate with its half width, which may have time steps in it."""
    size = 0.0 if out.estimate is None else np.max(np.abs(out.estimate[:, row]) + out.uncertainty[:, row])
    bound = np.max(out.bound["best"][:, row])
    return float(max(size, bound) if np.isfinite(bound) or out.estimate is None else size)


def _panels(count: int, high: int) -> tuple[Any, np.ndarray]:
    """Return a figure of at most one screen, without an empty place, and axes (count, high), one panel a row."""
    columns = 2 - count % 2 if high == 1 else min(count, 2)
    shape = (count // columns, columns) if high == 1 else (count, 2) if count > columns else (2, count)
    figure = new_figure(*np.minimum(SCREEN, (SIZE[0] * shape[1], SIZE[1] * shape[0])))
    axes = figure.subplots(*shape, squeeze=False)
    # three signals have their errors beside them
    return figure, axes.reshape(count, 1) if high == 1 else axes if count > columns else axes.T


def script_of(report: ReportData) -> str:
    """Return the name of the script that made a report; empty where it is not known."""
    name = os.path.basename(report.made.get("script", ""))
    return name if name.endswith(".py") and not NO_SCRIPT.match(name) else ""


def _question(report: ReportData) -> str:
    """What a picture answers: how wrong this many modes and steps are."""
    if not script_of(report):
        return "How wrong is the reduced model?"
    found = [of for line in report.plan.computed for of in re.findall(r"^basis: .*?(\d+) (?:modes|columns)", line)]
    modes, its = (f"{found[0]} modes", "") if len(found) == 1 else ("its modes", "its ")
    steps = "" if report.time == "static" else f" and {its}{len(report.t) - 1:,} steps"
    return f"{script_of(report)}: how wrong are {modes}{steps}?"
