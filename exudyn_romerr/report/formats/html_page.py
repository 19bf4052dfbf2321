"""A report as one HTML page that needs no other file, no script and no network."""

from __future__ import annotations

import base64
import io
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from html import escape

import numpy as np

from ..answers import Tolerances
from ..assessment import limit_of
from ..data import OutputReport, ReportData, made_here
from ..judgement import OUTPUT, extent, judged, messages, of_bounds
from ..plots.over_time import draw_bounds, draw_causes, draw_signal
from ..plots.panels import worst_first
from ..plots.style import DPI, SIZE, new_figure, of_one_size
from ..verdict_text import by_sensor, table
from ..wording import (
    digits,
    estimator_lines,
    for_run_alone,
    instant,
    rounded_up,
    said_first,
    under,
    with_unit,
)
from .atomic_write import write_whole
from .csv_table import series_of

NUMBER = re.compile(r"\d[\d.]*e[-+]\d+")
CSS = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, "Segoe UI", Roboto, Arial, sans-serif; color: #1a1a1a; background: #fff;
  max-width: 60rem; margin: 2rem auto; padding: 0 1rem; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; margin-bottom: 0; }
h2 { font-size: 1.2rem; margin-top: 2rem; border-bottom: 1px solid #bbb; }
.extent, figcaption { color: #555; font-size: 0.9rem; }
.extent { margin-top: 0; }
figure { margin: 1rem 0; }
img { width: 100%; height: auto; }
.wide { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; overflow-wrap: normal; }
caption { text-align: left; font-weight: 600; padding: 0.3rem 0; }
th, td { text-align: left; vertical-align: top; padding: 0.3rem 0.6rem; border-bottom: 1px solid #ccc; }
thead th { border-bottom: 2px solid #555; }
.numbers td, .n { white-space: pre; }
pre { background: #f4f4f4; padding: 0.6rem; white-space: pre-wrap; }
@page { size: A4; margin: 18mm; }
@media print {
  body { font-size: 10pt; max-width: none; margin: 0; padding: 0; print-color-adjust: exact; }
  h2, caption { break-after: avoid; }
  figure, tr, pre { break-inside: avoid; }
  tbody tr:first-child { break-before: avoid; }
  img { max-height: 235mm; object-fit: contain; }
  .wide { overflow: visible; }
}
"""
RASTER_FROM = 3000  # samples: as vectors, curves of more would make the page large and slow
MOST = 6  # figures: each takes a third of a second to draw and 0.25 MB
ABOUT = (
    "An estimate is the error of the reduced output as well as it can be told, within about its uncertainty; it is "
    "no bound. Value + estimate is the best guess of the full model's output."
)
NEVER = "Never covered: the finite-element model itself, its mesh, material and linearity."
HEAD = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<style>{css}</style>
</head>
<body>"""


def write_page(report: ReportData, path: str | os.PathLike, tolerances: Tolerances | None = None) -> None:
    """Write the page of a report; tolerances : in place of those that attach was given.

    Raises
    ------
    InputError
        The file cannot be written; one that was there is as it was.
    """
    text = page(report, tolerances).encode("utf-8")
    write_whole(path, lambda stream: stream.write(text))


def page(report: ReportData, tolerances: Tolerances | None = None) -> str:
    """Return the page as text: verdicts, messages, scope, figures, tables, plan, versions, how to make it again."""
    heard = [*messages(report)]
    sections = {
        "Messages": [_items(heard) if heard else paragraph("None.")],
        "What the bounds cover": _scope(report),
        "Figures": figures(report, tolerances),
        "Tables": _tables(report),
        "Plan": _plan(report),
        "Versions": [_versions(report)],
        "Make it again": _again(report),
    }
    made = f", computed {report.made['date']} by {report.made['script']}" if report.made else ""
    first = said_first(report)
    parts = [
        *([paragraph(f"{first}.", "first")] if first else []),
        paragraph(f"{extent(report)}{made}", "extent"),
        *(['<p><a href="#messages">Read the messages below, too.</a></p>'] if heard else []),
        *_verdicts(report, tolerances),
        *(_section(title, *content) for title, content in sections.items()),
    ]
    title = f"Error bounds of {os.path.basename(report.origin) or 'a run'}"
    return document(title, [f"<h1>{escape(title)}</h1>", *parts])


def _verdicts(report: ReportData, tolerances: Tolerances | None) -> Iterator[str]:
    rows, answers, why = judged(report, tolerances)
    if not rows:
        yield paragraph("No outputs were asked for: only the error of the whole body is bounded, see the tables.")
        return
    yield paragraph(answers[0], "first")
    yield from map(paragraph, [*answers[1:], *why])
    for caption, of, what in (("All outputs", by_sensor(rows), OUTPUT), ("All components", rows, "component")):
        yield html_table(caption, *table(of, what))
    yield _items(of_bounds(report))


def _scope(report: ReportData) -> Iterator[str]:
    yield _items(line.strip() for line in estimator_lines(report))
    if report.scope_reason:
        yield paragraph(f"Why: {report.scope_reason}.")
    has_estimates = any(out.estimate is not None for out in report.outputs.values())
    yield paragraph(f"{NEVER}{f' {ABOUT}' if has_estimates else ''}")


def _tables(report: ReportData) -> Iterator[str]:
    """Largest values over time, of what a CSV file has columns of."""
    for out in report.outputs.values():
        components = range(len(out.row_names))
        rows = (
            (what or "value", *(_largest_and_when(report, x[:, i], out.unit, what) for i in components))
            for what, x in series_of(out, report.scope)
        )
        title = f"{out.name}: largest values over time, and when"
        yield html_table(title, ("over time", *out.row_names), *rows, kind="numbers")
    divisor = 1.0 if report.total_mass is None else np.sqrt(report.total_mass)
    what = "in the mass norm" if report.total_mass is None else "mass-weighted RMS over the body"
    head = ("estimator", "bound of the error of position", "of velocity")
    norms = (report.position_bound, report.velocity_bound)
    rows = [
        (
            f"'{e}'{under(report.scope, e, report.uncertified)}",
            *(_largest_and_when(report, bound[e] / divisor) for bound in norms),
        )
        for e in report.position_bound
    ]
    if rows:  # a mechanism has none
        yield html_table(f"The whole body, {what}, in the units of the model", head, *rows, kind="numbers")


def _largest_and_when(report: ReportData, x: np.ndarray, unit: str = "", what: str = "bound") -> str:
    """The largest |x|, rounded up where it is what something is at most."""
    at = np.argmax(np.abs(x))
    size, when = abs(x[at]), instant(report.time, report.t[at])
    if not np.isfinite(size):
        return f"infinite\nfrom {when}"
    is_signed = what in ("", "corrected", "true error") or what.startswith("estimate")
    return f"{with_unit((digits if is_signed else rounded_up)(size), unit)}\nat {when}"


def _plan(report: ReportData) -> Iterator[str]:
    yield _items(report.plan.computed)
    if report.plan.left_out:
        yield html_table("Left out, and why", ("what", "why"), *report.plan.left_out)


def _versions(report: ReportData) -> str:
    run, here = report.made, made_here()
    rows = ((name, run.get(name, "not recorded"), here.get(name, "not loaded")) for name in {**run, **here})
    return html_table("", ("", "bounds", "this page"), *rows)


def _again(report: ReportData) -> Iterator[str]:
    if not report.origin:
        yield paragraph('This report was not saved: report.save("run.npz") keeps its numbers.')
        return
    yield paragraph("This page, the summary and all numbers over time, from the saved report:")
    commands = [f'romerr {what} "{report.origin}"' for what in ("report", "show", "csv")]
    calls = ["import exudyn_romerr as romerr", f"report = romerr.load_report({report.origin!r})", "print(report)"]
    yield from (f"<pre>{escape(chr(10).join(lines))}</pre>" for lines in (commands, calls))


# --- figures ---


def figures(report: ReportData, tolerances: Tolerances | None = None) -> Iterator[str]:
    """Yield the figures of all rows; where these are many, of the worst rows, the worst of every output first."""
    condition = for_run_alone(report.scope) and f" (bounds hold {for_run_alone(report.scope)})"
    rows = [(name, i) for name, out in report.outputs.items() for i in range(len(out.row_names))]
    worst = worst_first(report, rows)
    firsts = {name: (name, i) for name, i in reversed(worst)}.values()
    worst, left = sorted(worst, key=lambda row: row not in firsts)[:MOST], []
    for name, i in rows:
        out, title = report.outputs[name], report.outputs[name].row_names[i]
        if (name, i) not in worst:
            left.append(title)
            continue
        text = escape(
            f"{title}: signal; error over time{'; where the bound comes from' * _has_causes(out, i)}{condition}"
        )
        source = _picture(report, name, i, tolerances)
        yield f'<figure><img src="{source}" alt="{text}"><figcaption>{text}</figcaption></figure>'
    if left:
        yield paragraph(
            "Drawn are the rows whose errors are the largest shares of their outputs, one of every output first, "
            f"what was not asked for last. Not drawn: {', '.join(left)}. "
            'report.plot("one.png", outputs=["NAME"]) draws all rows of an output.'
        )


def _has_causes(out: OutputReport, row: int) -> bool:
    return bool(np.isfinite(out.bound["best"][:, row]).any()) or out.estimate is None


@of_one_size
def _picture(report: ReportData, name: str, row: int, tolerances: Tolerances | None) -> str:
    """Pairs of axes as a data address."""
    out = report.output(name)
    draws = (draw_signal, draw_bounds, draw_causes)[: 2 + _has_causes(out, row)]
    figure = new_figure(1.25 * SIZE[0], len(draws) * SIZE[1])
    limit = limit_of(out, tolerances)
    for ax, draw in zip(figure.subplots(len(draws), 1, sharex=True), draws, strict=True):
        draw(ax, report, name, row, *([limit.size] if draw is draw_bounds and limit.is_asked else []))
        ax.tick_params(labelbottom=True)
    kind, mime = ("svg", "svg+xml") if len(report.t) <= RASTER_FROM else ("png", "png")
    stream = io.BytesIO()
    figure.savefig(stream, format=kind, dpi=DPI)
    return f"data:image/{mime};base64,{base64.b64encode(stream.getvalue()).decode()}"


# --- elements: text goes in as it is, and is escaped here ---


def document(title: str, parts: Iterable[str]) -> str:
    """Return a whole page of elements."""
    return "\n".join([HEAD.format(title=escape(title), css=CSS), *parts, "</body>\n</html>\n"])


def _section(title: str, *content: str) -> str:
    """Return a heading, with an id made of its words, and what follows."""
    number = title.lower().replace(" ", "-")
    return "\n".join([f'<section id="{number}">', f"<h2>{escape(title)}</h2>", *content, "</section>"])


def paragraph(text: str, kind: str = "") -> str:
    """Return a paragraph of a CSS class."""
    return f'<p class="{kind}">{_words(text)}</p>' if kind else f"<p>{_words(text)}</p>"


def _items(texts: Iterable[str]) -> str:
    """Return a list."""
    return "<ul>\n" + "\n".join(f"<li>{_words(text)}</li>" for text in texts) + "\n</ul>"


def html_table(caption: str, head: Sequence[str], *rows: Sequence[str], kind: str = "prose") -> str:
    """Return a table of a CSS class; the first cell of a row is its heading."""
    above = f"<caption>{escape(caption)}</caption>\n" if caption else ""
    top = "".join(f'<th scope="col">{escape(text)}</th>' for text in head)
    body = "\n".join(_row(*row) for row in rows)
    inner = f"{above}<thead><tr>{top}</tr></thead>\n<tbody>\n{body}\n</tbody>"
    return f'<div class="wide"><table class="{kind}">\n{inner}\n</table></div>'


def _words(text: str) -> str:
    """Return text escaped; 1e-09 is not broken after its sign."""
    return NUMBER.sub(r'<span class="n">\g<0></span>', escape(text))


def _row(first: str, *others: str) -> str:
    cells = "".join(f"<td>{_words(text)}</td>" for text in others)
    return f'<tr><th scope="row">{_words(first)}</th>{cells}</tr>'
