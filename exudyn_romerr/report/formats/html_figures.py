"""Figures of an HTML page: those of the rows that err most, as data in the page."""

from __future__ import annotations

import base64
import io
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ..data import is_beside
from ..plots.over_time import draw_bounds, draw_causes, draw_signal
from ..plots.style import DPI, SIZE, new_figure, of_one_size
from ..report_rows import limit_of
from ..wording import for_run_alone, is_known
from .html_elements import paragraph

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..answers import Tolerances
    from ..data import OutputReport, ReportData

RASTER_FROM = 3000  # samples: as vectors, curves of more would make the page large and slow
MOST = 6  # figures: each takes a third of a second to draw and 0.25 MB


def rows_of(report: ReportData) -> Iterator[tuple[OutputReport, int, str]]:
    """Yield every row of every output, and its name."""
    for out in report.outputs.values():
        yield from ((out, row, name) for row, name in enumerate(out.row_names))


def figures(report: ReportData, tolerances: Tolerances | None = None) -> Iterator[str]:
    """Yield the figures of all rows; where these are many, of the worst rows, the worst of every output first."""
    condition = for_run_alone(report.scope) and f" (bounds hold {for_run_alone(report.scope)})"
    drawn = _worst(report, list(rows_of(report)))
    for out, row, name in drawn:
        text = f"{name}: signal; error over time{'; where the bound comes from' * _has_causes(out, row)}{condition}"
        source = _picture(report, out.name, row, tolerances)
        yield f'<figure><img src="{source}" alt="{escape(text)}"><figcaption>{escape(text)}</figcaption></figure>'
    left = [name for _, _, name in rows_of(report) if name not in {name for _, _, name in drawn}]
    if left:
        yield paragraph(
            "Drawn are the rows whose errors are the largest shares of their outputs, one of every output first, "
            f"what was not asked for last. Not drawn: {', '.join(left)}. "
            'report.plot("one.png", outputs=["NAME"]) draws all rows of an output.'
        )


def _worst(report: ReportData, rows: list[tuple[OutputReport, int, str]]) -> list[tuple[OutputReport, int, str]]:
    """At most MOST rows, in their order: the worst of as many outputs as there is room for, then others.

    What nobody asked for comes last.
    """
    by_error = sorted(range(len(rows)), key=lambda i: (is_beside(report, rows[i][0].name), -_share(*rows[i][:2])))
    names = [rows[i][0].name for i in by_error]
    firsts = [i for place, i in enumerate(by_error) if names[place] not in names[:place]]
    others = [i for i in by_error if i not in firsts]
    return [rows[i] for i in sorted((firsts + others)[:MOST])]


def _share(out: OutputReport, row: int) -> float:
    """The error of a row as far as it is known, a share of the largest value of its output."""
    known = is_known(out, row)
    error = np.max(np.abs(out.estimate[:, row]) + out.uncertainty[:, row] if known else out.bound["best"][:, row])
    size = np.max(np.abs(out.value), initial=0.0)
    return float(error / size) if size > 0 else float(error > 0)


def _has_causes(out: OutputReport, row: int) -> bool:
    return bool(np.isfinite(out.bound["best"][:, row]).any()) or out.estimate is None


@of_one_size
def _picture(report: ReportData, name: str, row: int, tolerances: Tolerances | None) -> str:
    """Pairs of axes as a data address."""
    draws = (draw_signal, draw_bounds, draw_causes)[: 2 + _has_causes(report.output(name), row)]
    figure = new_figure(1.25 * SIZE[0], len(draws) * SIZE[1])
    axes = figure.subplots(len(draws), 1, sharex=True)
    limit = limit_of(report.output(name), tolerances)
    for ax, draw in zip(axes, draws, strict=True):
        draw(ax, report, name, row, *([limit.size] if draw is draw_bounds and limit.is_asked else []))
        ax.tick_params(labelbottom=True)
    kind, mime = ("svg", "svg+xml") if len(report.t) <= RASTER_FROM else ("png", "png")
    stream = io.BytesIO()
    figure.savefig(stream, format=kind, dpi=DPI)
    return f"data:image/{mime};base64,{base64.b64encode(stream.getvalue()).decode()}"
