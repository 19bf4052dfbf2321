"""Picture of question.py."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from exudyn_romerr.report.plots.style import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from benchmarks.question_scenes import Answer, Table

WAYS = {
    "with bounds": (COLOURS["auxiliary"], "o"),
    "compared": (COLOURS["error"], "s"),
    "full order": (COLOURS["value"], "D"),
}


def draw(tables: list[Table], path: Path) -> None:
    """Draw claims and true errors against wall time, a panel a question."""
    figure = Figure(figsize=(11.5, 4.8), layout="constrained")
    for axes, table in zip(figure.subplots(1, len(tables), squeeze=False)[0], tables, strict=True):
        for answer in table.answers:
            _draw_answer(axes, answer, 100 / table.largest, table.question.full_label)
        asked = 100 * table.question.share
        axes.axhline(asked, color="black", lw=1, ls=":")
        axes.text(0.01, asked, "asked for", ha="left", va="bottom", transform=axes.get_yaxis_transform(), fontsize=8)
        axes.set(xscale="log", yscale="log", xlabel="wall time to the answer / s")
        axes.set_title(f"{table.question.title}\n({table.question.covers})", fontsize=9)
        axes.xaxis.set(major_locator=LogLocator(subs=(1, 2, 5)), major_formatter="{x:g}", minor_locator=NullLocator())
        axes.margins(x=0.12)
        axes.grid(alpha=0.3)
    figure.get_axes()[0].set_ylabel("error / largest displacement / %")
    _legend(figure)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)


def _draw_answer(axes: Axes, answer: Answer, percent: float, full_label: str) -> None:
    """Draw claim and true error; a truth, which knows no better, as a vertical line."""
    colour, marker = WAYS[answer.way]
    if answer.error is None:
        axes.axvline(answer.seconds, color=colour, ls="-.", lw=1)
        spot = {"rotation": 90, "ha": "right", "va": "bottom", "transform": axes.get_xaxis_transform()}
        axes.text(answer.seconds, 0.02, full_label, fontsize=8, **spot)
        return
    ends = [percent * x for x in (answer.claim, answer.error) if x is not None]
    axes.plot([answer.seconds] * len(ends), ends, color=colour, lw=1)
    axes.plot(answer.seconds, ends[-1], marker, color=colour, ms=11, mfc="none", mew=1.5)
    if answer.claim is not None:
        axes.plot(answer.seconds, ends[0], marker, color=colour, ms=6)


def _legend(figure: Figure) -> None:
    axes = figure.get_axes()[0]
    names = {"with bounds": "one run with bounds", "compared": "two runs compared", "full order": "full-order run"}
    marks = [axes.plot([], [], m, color=c, ms=8, label=names[way])[0] for way, (c, m) in WAYS.items()]
    marks += axes.plot([], [], "o", color="#777777", ms=6, label="filled: what it claims")
    marks += axes.plot([], [], "o", color="#777777", ms=11, mfc="none", mew=1.5, label="hollow: its true error")
    figure.legend(handles=marks, loc="outside lower center", ncols=5)
