"""The results in a folder as one table, a line for each variation."""

from __future__ import annotations

import csv
import io
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..report.formats.atomic_write import write_whole
from ..report.formats.csv_table import largest
from ..report.report import BoundReport
from .result_files import results_in
from .variations import Failure

if TYPE_CHECKING:
    from collections.abc import Iterator

VALUE, FAILURE = "value", "failure"  # columns of what has no name of its own
ENDINGS = {".csv": "csv", ".md": "markdown"}


def table_of(folder: str | os.PathLike) -> tuple[list[str], list[list[Any]]]:
    """Return head and lines: parameters first, then what the function returned, and what failed.

    Dicts have a column for each key, lists and tuples for each place; of arrays with several numbers the largest
    absolute value is told; of reports, for each output, those of value, estimate, its half width, and best bound. A
    cell is None where a variation has nothing.

    Raises
    ------
    InputError
        No such folder, no result in it, or a damaged one.
    """
    lines = [{**kept.parameters, **dict(_cells("", kept.value))} for kept in results_in(folder)]
    head = list(dict.fromkeys(name for line in lines for name in line))
    head.sort(key=lambda name: name == FAILURE)
    return head, [[line.get(name) for name in head] for line in lines]


def markdown(head: list[str], lines: list[list[Any]]) -> str:
    """Return the table as text that lines up, four digits a number."""
    rows = [[_cell(x) for x in line] for line in [head, *lines]]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, ["-" * width for width in widths])
    return "\n".join(f"| {' | '.join(map(str.ljust, row, widths))} |" for row in rows)


def write_table(folder: str | os.PathLike, path: str | os.PathLike) -> None:
    """Write it: .csv has all digits, .md is what is printed."""
    kind = ENDINGS.get(os.path.splitext(path)[1].lower())
    if kind is None:
        raise InputError(f"{os.fspath(path)} does not end in .csv or .md; pass such a name after -o")
    head, lines = table_of(folder)
    text = f"{markdown(head, lines)}\n" if kind == "markdown" else _csv(head, lines)
    encoding = "utf-8" if text.isascii() or kind == "markdown" else "utf-8-sig"  # Excel needs the mark
    write_whole(path, lambda stream: stream.write(text.encode(encoding)))


def _csv(head: list[str], lines: list[list[Any]]) -> str:
    text = io.StringIO(newline="")
    csv.writer(text).writerows([head, *lines])
    return text.getvalue()


def _cell(x: Any) -> str:
    text = f"{x:.4g}" if isinstance(x, float) else "" if x is None else str(x)
    return " ".join(text.split()).replace("|", "\\|")


def _cells(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Names and single values of what a variation returned."""
    if isinstance(value, Failure):
        yield FAILURE, str(value)
    elif isinstance(value, BoundReport):
        yield from ((f"{name} {column}".strip(), x) for column, x in largest(value).items())
    elif isinstance(value, dict | list | tuple):
        for key, x in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _cells(f"{name} {key}".strip(), x)
    elif isinstance(value, np.ndarray) and value.size > 1 and value.dtype.kind not in "SU":
        yield f"{name or VALUE} largest", float(np.max(np.abs(value)))
    else:
        single = value if not isinstance(value, np.ndarray | np.generic) else _single(value)
        yield name or VALUE, single


def _single(value: np.ndarray | np.generic) -> Any:
    return value.item() if value.size == 1 else ", ".join(map(str, value.ravel()))
