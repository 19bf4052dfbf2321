"""A report as one HTML page that needs no other file, no script and no network."""

from __future__ import annotations

import base64
import io
import os
import re
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import is_beside, made_here
from ..plots.over_time import draw_bounds, draw_causes, draw_signal
from ..plots.style import DPI, SIZE, new_figure, of_one_size
from ..report_rows import asked_for, limit_of, rows_of
from ..scope import COMPLETE, COUPLED, FROZEN, NOT_CERTIFIED, remedies
from ..table import ASSESS, by_sensor, first_sentences, reasons, summary, table
from ..wording import (
    check_name,
    corrected_within,
    digits,
    estimated_under,
    for_run_alone,
    instant,
    is_known,
    off_by,
    outside,
    rounded_up,
    said_first,
    under,
    widest,
    widest_scope,
    with_unit,
)
from .atomic_write import write_whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from ..answers import Tolerances
    from ..data import OutputReport, ReportData

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
MEANINGS = {
    COMPLETE: "loads and supports do not depend on how the body deforms: the bound is that of the full body",
    COUPLED: "joints, springs and other bodies react to the body's error: covered to first order; time steps are not",
    FROZEN: "the bound holds for the full body under the frame motion, loads and wrenches of this run; what joints "
    "and controllers do with other steps or modes is not covered",
}
TIME_WORDS = {
    "reconstructed": "The error of the time integration is included.",
    "sampled": "The error of the time integration is not covered, nor what the residual does between the samples.",
    "static": "A static solve: there is no time integration.",
}
OF_THE_BODY = (
    "The error of the time integration is included as far as it is the body's own, under the forces of this run; "
    "what other steps make of these is not."
)
ABOUT = (
    "An estimate is the error of the reduced output as well as it can be told, with its half width; it is no bound. "
    "Value + estimate is the best guess of the full model's output."
)
NEVER = "Never covered: the finite-element model itself, its mesh, material and linearity."


def write_page(report: ReportData, path: str | os.PathLike, tolerances: Tolerances | None = None) -> None:
    """Write the page of a report.

    Parameters
    ----------
    report : BoundReport
    path : str or os.PathLike
        Such as "run.html".
    tolerances : Tolerances, optional
        In place of those that attach was given.

    Raises
    ------
    InputError
        The file cannot be written; one that was there is as it was.
    """
    text = page(report, tolerances).encode("utf-8")
    write_whole(path, lambda stream: stream.write(text))


def page(report: ReportData, tolerances: Tolerances | None = None) -> str:
    """Return the page as text: verdicts, messages, scope, figures, tables, plan, versions, how to make it again."""
    title = f"Error bounds of {os.path.basename(report.origin) or 'a run'}"
    safe = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    parts = [
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}</title>',
        f'<meta http-equiv="Content-Security-Policy" content="{safe}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n<link rel="icon" href="data:,">',
        f"<style>{CSS}</style>\n</head>\n<body>\n<h1>{escape(title)}</h1>",
        *([paragraph(f"{first}.", "first")] if (first := said_first(report)) else []),
        paragraph(_extent(report), "extent"),
        *(['<p><a href="#messages">Read the messages below, too.</a></p>'] if report.messages else []),
        *_verdicts(report, tolerances),
        _section("Messages", _items(report.messages) if report.messages else paragraph("None.")),
        _section("What the bounds cover", *_scope(report)),
        _section("Figures", *figures(report, tolerances)),
        _section("Tables", *_tables(report)),
        _section("Plan", *_plan(report)),
        _section("Versions", _versions(report)),
        _section("Make it again", *_again(report)),
        "</body>\n</html>\n",
    ]
    return "\n".join(parts)


def _extent(report: ReportData) -> str:
    axis, unit = ("load factor", "") if report.time == "static" else ("t", " s")
    made = f", computed {report.made['date']} by {report.made['script']}" if report.made else ""
    return f"{len(report.t)} instants, {axis} = {report.t[0]:g} ... {report.t[-1]:g}{unit}{made}"


def _verdicts(report: ReportData, tolerances: Tolerances | None) -> Iterator[str]:
    if not report.outputs:
        yield paragraph("No outputs were asked for: only the error of the whole body is bounded, see the tables.")
        return
    rows = rows_of(report, tolerances)
    outputs = by_sensor(rows)
    asked = asked_for(report, rows, tolerances)
    what = "output" if len(asked) == len(rows) else "output asked for"
    yield paragraph(summary(asked, what, ASSESS), "first")
    yield from (paragraph(said) for said in (*first_sentences(asked), *reasons(asked)))
    head, *lines = table(outputs, "output")
    yield html_table("All outputs", head, lines)
    head, *lines = table(rows, "component")
    if len(rows) > len(outputs):
        yield html_table("All components", head, lines)
    notes = [f"{name}: {note}" for out, row, name in components_of(report) for note in _notes(report, out, row)]
    if notes:
        yield _items(notes)


def _notes(report: ReportData, out: OutputReport, row: int) -> Iterator[str]:
    """What stands beside a verdict: which bound, what the corrected output is worth, how far a truth is away."""
    best = min(widest(report.scope), key=lambda e: np.max(out.bound[e][:, row], initial=0.0))
    if not np.isfinite(np.max(out.bound["best"][:, row])):
        yield f"No bound by '{best}'. That estimator {report.reasons[best]}."
    if out.corrected is not None:
        said = corrected_within(out, out.corrected_bound[:, row], report.scope)
        yield f"{said[0].upper()}{said[1:]}."
    if out.error is not None:
        largest, ratio = np.max(np.abs(out.error[:, row])), out.effectivity["best"][row]
        off = "" if out.estimate is None else f"; {off_by(out, row)}"
        bound = f"bound ({NOT_CERTIFIED})" if out.uncertified else "bound"
        size = with_unit(digits(largest), out.unit)
        yield f"The true error is up to {size}; {bound} / error: {digits(ratio)}{off}."
        if words_of := outside(out, row, report.time):
            yield f"{words_of}."


def _scope(report: ReportData) -> Iterator[str]:
    rows = [(f"'{e}'", scope, MEANINGS[scope], report.reasons[e]) for e, scope in report.scope.items()]
    yield html_table("", ("estimator", "scope", "which means", "assumptions"), rows)
    if report.scope_reason:
        yield paragraph(f"Why: {report.scope_reason}.")
    if report.uncertified:
        yield paragraph("No bound of this run is certified:")
        yield _items(remedies(report.uncertified))
    has_estimates = any(out.estimate is not None for out in report.outputs.values())
    is_of_body = report.time == "reconstructed" and widest_scope(report.scope) == FROZEN
    time = OF_THE_BODY if is_of_body else TIME_WORDS[report.time]
    yield paragraph(f"{time} {NEVER}{f' {ABOUT}' if has_estimates else ''}")


def _tables(report: ReportData) -> Iterator[str]:
    estimators = list(report.scope)
    if report.outputs:
        head = (
            "output",
            "largest value",
            *(f"bound '{e}'{under(report.scope, e, report.uncertified)}" for e in estimators),
            f"corrected within{f', {NOT_CERTIFIED}' if report.uncertified else ''}",
            "round-off",
        )
        rows = [_output_row(report, out, row, name, estimators) for out, row, name in components_of(report)]
        yield html_table("Largest bounds of outputs, and when", head, rows, "numbers")
    if estimated := [found for found in components_of(report) if is_known(found[0], found[1])]:
        head = ("output", "largest estimate", "half width", "parts", "parts of the half width")
        rows = [_estimate_row(report, out, row, name) for out, row, name in estimated]
        yield html_table("Estimates of the error, largest values over time", head, rows, "numbers")
    divisor = 1.0 if report.total_mass is None else np.sqrt(report.total_mass)
    what = "in the mass norm" if report.total_mass is None else "mass-weighted RMS over the body"
    norms = (report.position_bound, report.velocity_bound)
    rows = [
        (
            f"'{e}'{under(report.scope, e, report.uncertified)}",
            *(_largest_and_when(report, bound[e] / divisor) for bound in norms),
        )
        for e in report.position_bound
    ]
    head = ("estimator", "bound of the error of position", "of velocity")
    if rows:  # a mechanism has none
        yield html_table(f"The whole body, {what}, in the units of the model", head, rows, "numbers")


def _output_row(report: ReportData, out: OutputReport, row: int, name: str, estimators: list[str]) -> list[str]:
    bounds = []
    for e in estimators:
        truth = f"\n/ true error: {digits(out.effectivity[e][row])}" if out.effectivity else ""
        bounds.append(_largest_and_when(report, out.bound[e][:, row], out.unit) + truth)
    corrected = "" if out.corrected is None else _largest_and_when(report, out.corrected_bound[:, row], out.unit)
    values, floor = (with_unit(digits(np.max(np.abs(x[:, row]))), out.unit) for x in (out.value, out.round_off))
    return [name, values, *bounds, corrected, floor]


def _estimate_row(report: ReportData, out: OutputReport, row: int, name: str) -> list[str]:
    parts, checks = (
        "\n".join(
            f"{check_name(key, out.uncertified)} {digits(np.max(np.abs(x[:, row])))}" for key, x in found.items()
        )
        for found in (out.estimate_parts, out.uncertainty_parts)
    )
    size, half = np.abs(out.estimate[:, row]), np.max(out.uncertainty[:, row])
    largest = f"{with_unit(f'{np.max(size):.3g}', out.unit)}\nat {instant(report.time, report.t[np.argmax(size)])}"
    return [
        f"{name}{estimated_under(out, report.scope)}",
        largest,
        with_unit(rounded_up(half), out.unit),
        parts,
        checks,
    ]


def _largest_and_when(report: ReportData, bound: np.ndarray, unit: str = "") -> str:
    when = instant(report.time, report.t[np.argmax(bound)])
    if not np.isfinite(np.max(bound)):
        return f"infinite\nfrom {when}"
    return f"{with_unit(rounded_up(np.max(bound)), unit)}\nat {when}"


def _plan(report: ReportData) -> Iterator[str]:
    yield _items(report.plan.computed)
    if report.plan.left_out:
        yield html_table("Left out, and why", ("what", "why"), report.plan.left_out)


def _versions(report: ReportData) -> str:
    run, here = report.made, made_here()
    rows = [(name, run.get(name, "not recorded"), here.get(name, "not loaded")) for name in {**run, **here}]
    return html_table("", ("", "bounds", "this page"), rows)


def _again(report: ReportData) -> Iterator[Any]:
    if not report.origin:
        yield paragraph('This report was not saved: report.save("run.npz") keeps its numbers.')
        return
    yield paragraph("This page, the summary and all numbers over time, from the saved report:")
    commands = [f'romerr {what} "{report.origin}"' for what in ("report", "show", "csv")]
    calls = ["import exudyn_romerr as romerr", f"report = romerr.load_report({report.origin!r})", "print(report)"]
    yield from (f"<pre>{escape(chr(10).join(lines))}</pre>" for lines in (commands, calls))


# --- figures ---


def components_of(report: ReportData) -> Iterator[tuple[OutputReport, int, str]]:
    """Yield every row of every output, and its name."""
    for out in report.outputs.values():
        yield from ((out, row, name) for row, name in enumerate(out.row_names))


def figures(report: ReportData, tolerances: Tolerances | None = None) -> Iterator[str]:
    """Yield the figures of all rows; where these are many, of the worst rows, the worst of every output first."""
    condition = for_run_alone(report.scope) and f" (bounds hold {for_run_alone(report.scope)})"
    drawn = _worst(report, list(components_of(report)))
    for out, row, name in drawn:
        text = f"{name}: signal; error over time{'; where the bound comes from' * _has_causes(out, row)}{condition}"
        source = _picture(report, out.name, row, tolerances)
        yield f'<figure><img src="{source}" alt="{escape(text)}"><figcaption>{escape(text)}</figcaption></figure>'
    left = [name for _, _, name in components_of(report) if name not in {name for _, _, name in drawn}]
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


# --- elements: text goes in as it is, and is escaped here ---


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


def html_table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "prose") -> str:
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
