"""A report as one HTML page, one sheet of A4 in print, that needs no other file, no script and no network."""

from __future__ import annotations

import base64
import io
import os
import re
import shlex
from collections.abc import Iterable, Iterator, Sequence
from html import escape

from ..answers import SHARE, Answer, Tolerances
from ..data import ReportData
from ..judgement import extent, judged, messages, truths
from ..plots.over_time import draw_bounds, draw_signal
from ..plots.panels import script_of
from ..plots.style import COLOURS, DPI, LOOKS, new_figure, of_one_size
from ..scope import NOT_CERTIFIED, remedies
from ..verdict_text import (
    ASSESS,
    TITLES,
    after_the_step,
    has_numbers,
    size_and_half,
    size_in_words,
    worst_first,
    worst_of_cause,
)
from ..verdicts import CAUSES, Row
from ..wording import assumed_lines, digits, for_run_alone, listed, rounded_up, said_first, with_unit
from .atomic_write import write_whole

NUMBER = re.compile(r"\d[\d.]*e[-+]\d+")
CSS = """
:root { color-scheme: light dark; --text: #1a1a1a; --back: #fff; --line: #bbb; --quiet: #555; --shade: #f2f2f2;
  --bound: #009e73; --estimate: #5d3a9b; --error: #d55e00; }
@media screen and (prefers-color-scheme: dark) { :root { --text: #e8e8e8; --back: #16181b; --line: #4a4d52;
  --quiet: #a8abb0; --shade: #24272b; --bound: #2fc79b; --estimate: #b79cf0; --error: #ff9a4d; } }
body { font: 15px/1.4 system-ui, "Segoe UI", Roboto, Arial, sans-serif; color: var(--text); background: var(--back);
  max-width: 60rem; margin: 1.5rem auto; padding: 0 1rem; overflow-wrap: anywhere; }
h1 { font-size: 1.5em; margin: 0; }
h2 { font-size: 1em; margin: 0.9em 0 0.2em; }
p, ul { margin: 0.2em 0; }
ul { padding-left: 1.2em; }
.quiet, figcaption { color: var(--quiet); font-size: 0.9em; }
.answer { font-weight: 600; border: 2px solid var(--text); padding: 0.4em 0.6em; margin: 0.5em 0; }
figure { margin: 0.5em 0; display: flex; flex-direction: column; }
svg, img { width: 100%; height: auto; min-height: 0; flex: 1 1 auto; }
.wide { overflow-x: auto; margin: 0.4em 0; }
table { border-collapse: collapse; font-size: 0.95em; font-variant-numeric: tabular-nums; overflow-wrap: normal; }
.prose { width: 100%; }
caption { text-align: left; font-weight: 600; padding: 0.3em 0 0.1em; }
th, td { text-align: left; vertical-align: top; padding: 0.2em 0.7em 0.2em 0; border-bottom: 1px solid var(--line); }
thead th { border-bottom: 2px solid var(--quiet); }
.prose th, .prose td { overflow-wrap: anywhere; min-width: 5.5em; }
.numbers td, .n { white-space: pre; }
pre { background: var(--shade); padding: 0.3em 0.6em; margin: 0.2em 0; white-space: pre-wrap; word-break: break-all; }
@page { size: A4; margin: 11mm 13mm; }
@media print {
  body { font-size: 8pt; line-height: 1.3; max-width: none; margin: 0; padding: 0; print-color-adjust: exact; }
  body.sheet { display: flex; flex-direction: column; height: 274mm; }
  .sheet > * { flex: none; }
  .sheet > figure { flex: 1 1 0; min-height: 40mm; max-height: 82mm; }
  tr, pre, figure { break-inside: avoid; }
  .wide { overflow: visible; }
}
"""
# what one sheet of A4 has room for, beside a picture of 40 mm; a test prints a page that has all of it
ROWS = 5  # of the table of outputs
NAME, CELL, SENTENCE, TEXT = 28, 190, 330, 380  # letters of a name, of what to do, of the answer, of what was assumed
LINES, LINE = 10, 110  # of what was assumed, and letters in each
RASTER_FROM = 3000  # samples: as vectors, curves of more would make the page large and slow
PICTURE = (8.6, 3.8)  # inches
INK = "#1a1a1a"  # of all letters and axes of a picture, which get the page's colour
INKS = ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color")
PAGE_COLOURS = {
    INK: "text",
    COLOURS["value"]: "text",
    COLOURS["tolerance"]: "quiet",
    COLOURS["estimate"]: "estimate",
    COLOURS["error"]: "error",
    LOOKS["auxiliary"][0]: "bound",
}
NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))  # it has addresses
SIGNS = {Answer.ENOUGH: "\N{CHECK MARK}", Answer.TOO_LARGE: "\N{MULTIPLICATION X}"}
UNKNOWN = "?"
NOTHING = "\N{EN DASH}"
ABOUT = "About: an estimate of the error, right to about its half width, and no bound."
AT_MOST = "At most: a bound, proved under what stands here."
NEVER = "Never covered: the finite-element model itself, its mesh, material and linearity."
MORE = "{} more: romerr show prints all."
NO_OUTPUTS = "No outputs were asked for: only the error of the whole body is bounded, romerr show prints it."
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
<body{kind}>"""


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
    """Return the page as text: scene, question, answer by cause, picture, what was assumed, how to repeat it."""
    rows, answers, why = judged(report, tolerances)
    first = said_first(report)
    title = f"Accuracy of {script_of(report) or 'the reduced model'}"
    heard = [*messages(report), *after_the_step(rows), *why, *truths(report)]
    heard += [f"{NOT_CERTIFIED}: {remedy}" for remedy in remedies(report.uncertified)]
    parts = [
        f"<h1>{escape(_short(title, SENTENCE))}</h1>",
        *_scene(report, rows),
        *([paragraph(f"{first[0].upper()}{first[1:]}.", "answer")] if first else []),
        *(_answer(rows, answers[0].replace(f"; {ASSESS}", "")) if rows else [paragraph(NO_OUTPUTS)]),
        *picture(report, rows),
        "<h2>What was assumed, and what to know</h2>",
        _items(_fitting([*heard, *assumed_lines(report)], LINES - _lines(first))),
        paragraph(" ".join([ABOUT, *([AT_MOST] if any(row.bound is not None for row in rows) else []), NEVER])),
        "<h2>How to repeat it</h2>",
        *_repeated(report, tolerances),
    ]
    return document(_short(title, SENTENCE), parts, "sheet")


def _scene(report: ReportData, rows: Sequence[Row]) -> Iterator[str]:
    """What was simulated, and what is asked of it."""
    kind = "Static solve" if report.time == "static" else "Dynamic solve"
    bodies = [line.replace("basis: ", "") for line in report.plan.computed if "basis: " in line]
    names = listed([_short(name, NAME) for name in report.outputs])
    told = [f"{kind}, {extent(report)}", *bodies[:ROWS], f"outputs: {names}" if names else ""]
    yield paragraph(_short("; ".join(filter(None, told)), TEXT) + ".", "quiet")
    if rows:
        is_asked = any(row.limit.is_asked for row in rows)
        beside = "" if is_asked else f" None was given, so it is {100 * SHARE:g} % of the largest value."
        yield paragraph(f"Question: is the error of each output, at every instant, within its tolerance?{beside}")


def _answer(rows: Sequence[Row], sentence: str) -> Iterator[str]:
    yield paragraph(_short(sentence, SENTENCE), "answer")
    head = ("cause", "answer", "about", "+- half width", "at most", "worst at", "what to do")
    causes = [cause for cause in (*CAUSES, "sum") if any(cause in row.of for row in rows)]
    yield _without_empty("Answer by cause", head, *_by_cause(rows, causes))
    of: dict[str, Row] = {}
    for row in worst_first(rows):
        of.setdefault(row.name, row)
    worst = list(of.values())
    beside = f", the {ROWS} worst of {len(worst)}" if len(worst) > ROWS else ""
    head = ("output", "up to", "tolerance", "whole error about", "at most", "answer")
    yield _without_empty(f"Outputs{beside}", head, *map(_of_output, worst[:ROWS]))


def _by_cause(rows: Sequence[Row], causes: Sequence[str]) -> Iterator[tuple[str, ...]]:
    for cause in causes:
        row, todo = worst_of_cause(rows, cause)
        verdict = row.of[cause]
        size, half = size_and_half(verdict, row.unit, row.extent)
        # a bound of the modes is one of the rigid interfaces, too
        is_bounded = cause == ("modes" if row.scope else "sum")
        is_said_above = cause == "sum" and len(causes) > 1
        why = "; ".join(filter(None, [verdict.reason, "" if is_said_above else todo]))
        yield (
            TITLES[cause],
            _said(verdict.answer),
            size or NOTHING,
            half or NOTHING,
            _bound(row) if is_bounded else NOTHING,
            _short(row.label or row.name, NAME),
            _short(why, CELL) or NOTHING,
        )


def _of_output(row: Row) -> tuple[str, ...]:
    whole = row.of["sum"]
    return (
        _short(row.label or row.name, NAME),
        NOTHING if row.extent is None else with_unit(digits(row.extent, 4), row.unit),
        NOTHING if row.tolerance is None else with_unit(digits(row.tolerance), row.unit),
        NOTHING if whole.size is None else size_in_words(whole, row.unit, row.extent),
        _bound(row),
        _said(whole.answer),
    )


def _without_empty(caption: str, head: tuple[str, ...], *rows: tuple[str, ...]) -> str:
    """A table without the columns that say nothing: where nothing is bounded nothing is said of bounds."""
    columns = [column for column in zip(head, *rows, strict=True) if {*column[1:]} != {NOTHING}]
    return html_table(caption, *zip(*columns, strict=True))


def _bound(row: Row) -> str:
    if row.bound is None:
        return NOTHING
    return f"{with_unit(rounded_up(row.bound, 2), row.unit)}{row.scope and f' ({row.scope})'}"


def _said(answer: Answer) -> str:
    """The answer with a sign: neither colour nor print is needed to see it."""
    return f"{SIGNS.get(answer, UNKNOWN)} {answer.value}"


def _repeated(report: ReportData, tolerances: Tolerances | None) -> Iterator[str]:
    asked = "".join(f' --tolerance "{text}"' for text in (tolerances.texts if tolerances else ()))
    how = ("options", "script", "arguments")
    words = [report.made.get(name, "") for name in how] if script_of(report) else []
    is_by_run = "options" in report.made
    commands = [[f"romerr run --html page.html{asked}" if is_by_run else "python", *words]] if words else []
    commands += [[f"romerr report{asked}", shlex.quote(report.origin)]] if report.origin and not is_by_run else []
    if commands:
        yield f"<pre>{escape(chr(10).join(_short(' '.join(filter(None, of)), CELL) for of in commands))}</pre>"
    versions = [f"{name} {said}" for name, said in report.made.items() if name not in ("date", *how)]
    made = f"Computed {report.made['date']} by {', '.join(versions)}." if report.made else "Versions: not recorded."
    yield paragraph(made, "quiet")


def _short(text: str, most: int) -> str:
    """The text, or its begin and its end, by which names differ: a page has no room for more."""
    end = most // 3
    return text if len(text) <= most else f"{text[: most - end - 5]} ... {text[-end:]}"


def _lines(text: str) -> int:
    return -(-len(text) // LINE)


def _fitting(texts: Iterable[str], room: int) -> Iterator[str]:
    """Yield texts that so many lines have room for, the first ones first, and how many are left out."""
    left = 0
    for text in dict.fromkeys(_short(text, TEXT) for text in texts):
        lines = _lines(text)
        if left or lines > room:
            left += 1
        else:
            room -= lines
            yield text
    if left:
        yield MORE.format(left)


# --- the picture ---


def picture(report: ReportData, rows: Sequence[Row]) -> Iterator[str]:
    """Yield the figure of the component that is worst, if there is one of which anything is known."""
    known = [row for row in worst_first(rows) if has_numbers([row])]
    if not known:
        return
    row = known[0]
    condition = for_run_alone(report.scope) and f" (bounds hold {for_run_alone(report.scope)})"
    text = escape(f"{_short(row.label or row.name, NAME)}, the worst: what it shows; its error over time{condition}")
    yield f"<figure>{_drawn(report, row, text)}<figcaption>{text}</figcaption></figure>"


@of_one_size
def _drawn(report: ReportData, row: Row, text: str) -> str:
    """Signal and error side by side: vectors in the colours of the page; pixels of long runs."""
    from matplotlib import rc_context

    is_long = len(report.t) > RASTER_FROM
    # of letters and lines that have the colour of the page's text
    own = {} if is_long else dict.fromkeys(INKS, INK)
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "page", **own}):
        figure = new_figure(*PICTURE)
        signal, error = figure.subplots(1, 2)
        draw_signal(signal, report, row.name, row.component)
        draw_bounds(error, report, row.name, row.component, row.tolerance or None)
        stream = io.BytesIO()
        if is_long:
            figure.savefig(stream, format="png", dpi=DPI)
            source = base64.b64encode(stream.getvalue()).decode()
            return f'<img src="data:image/png;base64,{source}" alt="{text}">'
        figure.savefig(stream, format="svg", transparent=True, metadata=NO_METADATA)
    _, start, inner = stream.getvalue().decode("utf-8").partition("<svg ")
    for colour, name in PAGE_COLOURS.items():
        inner = inner.replace(colour.lower(), f"var(--{name})")
    return f'{start}role="img" aria-label="{text}" {inner}'


# --- elements: text goes in as it is, and is escaped here ---


def document(title: str, parts: Iterable[str], kind: str = "") -> str:
    """Return a whole page of elements; kind : class of its body, "sheet" is one sheet in print."""
    head = HEAD.format(title=escape(title), css=CSS, kind=kind and f' class="{kind}"')
    return "\n".join([head, *parts, "</body>\n</html>\n"])


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
