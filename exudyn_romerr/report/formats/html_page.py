"""A report as one HTML page that needs no other file, no script and no network."""

from __future__ import annotations

import os
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import is_beside, made_here
from ..report_rows import rows_of as verdicts_of
from ..scope import COMPLETE, COUPLED, FROZEN, NOT_CERTIFIED, remedies
from ..table import ASSESS, by_sensor, first_sentences, reasons, summary
from ..table import table as verdicts_table
from ..wording import (
    check_name,
    corrected_within,
    digits,
    estimated_under,
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
from .html_elements import CSS, items, numbers, paragraph, section, table
from .html_figures import figures, rows_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..answers import Tolerances
    from ..data import OutputReport, ReportData

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
        section("Messages", items(report.messages) if report.messages else paragraph("None.")),
        section("What the bounds cover", *_scope(report)),
        section("Figures", *figures(report, tolerances)),
        section("Tables", *_tables(report)),
        section("Plan", *_plan(report)),
        section("Versions", _versions(report)),
        section("Make it again", *_again(report)),
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
    rows = verdicts_of(report, tolerances)
    outputs = by_sensor(rows)
    asked = [row for row in rows if not is_beside(report, row.name)]
    what = "output" if len(asked) == len(rows) else "output asked for"
    yield paragraph(summary(asked, what, ASSESS), "first")
    yield from (paragraph(said) for said in (*first_sentences(asked), *reasons(asked)))
    head, *lines = verdicts_table(outputs, "output")
    yield table("All outputs", head, lines)
    head, *lines = verdicts_table(rows, "component")
    if len(rows) > len(outputs):
        yield table("All components", head, lines)
    notes = [f"{name}: {note}" for out, row, name in rows_of(report) for note in _notes(report, out, row)]
    if notes:
        yield items(notes)


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
    yield table("", ("estimator", "scope", "which means", "assumptions"), rows)
    if report.scope_reason:
        yield paragraph(f"Why: {report.scope_reason}.")
    if report.uncertified:
        yield paragraph("No bound of this run is certified:")
        yield items(remedies(report.uncertified))
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
        rows = [_output_row(report, out, row, name, estimators) for out, row, name in rows_of(report)]
        yield numbers("Largest bounds of outputs, and when", head, rows)
    if estimated := [found for found in rows_of(report) if is_known(found[0], found[1])]:
        head = ("output", "largest estimate", "half width", "parts", "parts of the half width")
        rows = [_estimate_row(report, out, row, name) for out, row, name in estimated]
        yield numbers("Estimates of the error, largest values over time", head, rows)
    divisor = 1.0 if report.total_mass is None else np.sqrt(report.total_mass)
    what = "in the mass norm" if report.total_mass is None else "mass-weighted RMS over the body"
    norms = (report.position_bound, report.velocity_bound)
    rows = [
        (
            f"'{e}'{under(report.scope, e, report.uncertified)}",
            *(_largest(report, bound[e] / divisor) for bound in norms),
        )
        for e in report.position_bound
    ]
    head = ("estimator", "bound of the error of position", "of velocity")
    if rows:  # a mechanism has none
        yield numbers(f"The whole body, {what}, in the units of the model", head, rows)


def _output_row(report: ReportData, out: OutputReport, row: int, name: str, estimators: list[str]) -> list[str]:
    bounds = []
    for e in estimators:
        truth = f"\n/ true error: {digits(out.effectivity[e][row])}" if out.effectivity else ""
        bounds.append(_largest(report, out.bound[e][:, row], out.unit) + truth)
    corrected = "" if out.corrected is None else _largest(report, out.corrected_bound[:, row], out.unit)
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


def _largest(report: ReportData, bound: np.ndarray, unit: str = "") -> str:
    when = instant(report.time, report.t[np.argmax(bound)])
    if not np.isfinite(np.max(bound)):
        return f"infinite\nfrom {when}"
    return f"{with_unit(rounded_up(np.max(bound)), unit)}\nat {when}"


def _plan(report: ReportData) -> Iterator[str]:
    yield items(report.plan.computed)
    if report.plan.left_out:
        yield table("Left out, and why", ("what", "why"), report.plan.left_out)


def _versions(report: ReportData) -> str:
    run, here = report.made, made_here()
    rows = [(name, run.get(name, "not recorded"), here.get(name, "not loaded")) for name in {**run, **here}]
    return table("", ("", "bounds", "this page"), rows)


def _again(report: ReportData) -> Iterator[Any]:
    if not report.origin:
        yield paragraph('This report was not saved: report.save("run.npz") keeps its numbers.')
        return
    yield paragraph("This page, the summary and all numbers over time, from the saved report:")
    commands = [f'romerr {what} "{report.origin}"' for what in ("report", "show", "csv")]
    calls = ["import exudyn_romerr as romerr", f"report = romerr.load_report({report.origin!r})", "print(report)"]
    yield from (f"<pre>{escape(chr(10).join(lines))}</pre>" for lines in (commands, calls))
