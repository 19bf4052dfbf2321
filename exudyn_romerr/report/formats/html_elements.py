"""Pieces of an HTML page: text goes in as it is, and is escaped here."""

from __future__ import annotations

import re
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

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


def section(title: str, *content: str) -> str:
    """Return a heading, with an id made of its words, and what follows."""
    number = title.lower().replace(" ", "-")
    return "\n".join([f'<section id="{number}">', f"<h2>{escape(title)}</h2>", *content, "</section>"])


def paragraph(text: str, kind: str = "") -> str:
    """Return a paragraph of a CSS class."""
    return f'<p class="{kind}">{words(text)}</p>' if kind else f"<p>{words(text)}</p>"


def items(texts: Iterable[str]) -> str:
    """Return a list."""
    return "<ul>\n" + "\n".join(f"<li>{words(text)}</li>" for text in texts) + "\n</ul>"


def numbers(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table whose cells keep their lines."""
    return table(caption, head, rows, "numbers")


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "prose") -> str:
    """Return a table of a CSS class; the first cell of a row is its heading."""
    above = f"<caption>{escape(caption)}</caption>\n" if caption else ""
    top = "".join(f'<th scope="col">{escape(text)}</th>' for text in head)
    body = "\n".join(_row(*row) for row in rows)
    inner = f"{above}<thead><tr>{top}</tr></thead>\n<tbody>\n{body}\n</tbody>"
    return f'<div class="wide"><table class="{kind}">\n{inner}\n</table></div>'


def words(text: str) -> str:
    """Return text escaped; 1e-09 is not broken after its sign."""
    return NUMBER.sub(r'<span class="n">\g<0></span>', escape(text))


def _row(first: str, *others: str) -> str:
    cells = "".join(f"<td>{words(text)}</td>" for text in others)
    return f'<tr><th scope="row">{words(first)}</th>{cells}</tr>'
