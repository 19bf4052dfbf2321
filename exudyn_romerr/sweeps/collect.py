"""The results in a folder as one table, a line for each variation."""

from __future__ import annotations

import csv
import io
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..report.formats.atomic_write import write_whole
from ..report.formats.csv_table import largest, main_series
from ..report.report import BoundReport
from ..report.wording import digits, rounded_up
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
    return _table([{**kept.parameters, **dict(_cells("", kept.value))} for kept in results_in(folder)])


def text_of(folder: str | os.PathLike) -> str:
    """Return the table to be read: of reports a line for each row of each output, for one line would be too wide."""
    lines = []
    for kept in results_in(folder):
        own = {**kept.parameters, **dict(_cells("", kept.value, reports=False))}
        lines += [{**own, **row} for row in _report_rows("", kept.value)] or [own]
    return markdown(*_table(lines))


def _table(lines: list[dict[str, Any]]) -> tuple[list[str], list[list[Any]]]:
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
    """Write the table: .csv has all digits and a line for each variation, .md is what is printed."""
    kind = ENDINGS.get(os.path.splitext(path)[1].lower())
    if kind is None:
        raise InputError(f"{os.fspath(path)} does not end in .csv or .md; pass such a name after -o")
    text = f"{text_of(folder)}\n" if kind == "markdown" else _csv(*table_of(folder))
    encoding = "utf-8" if text.isascii() or kind == "markdown" else "utf-8-sig"  # Excel needs the mark
    write_whole(path, lambda stream: stream.write(text.encode(encoding)))


def _csv(head: list[str], lines: list[list[Any]]) -> str:
    text = io.StringIO(newline="")
    csv.writer(text).writerows([head, *lines])
    return text.getvalue()


def _cell(x: Any) -> str:
    text = f"{x:.4g}" if isinstance(x, float) else "" if x is None else str(x)
    return " ".join(text.split()).replace("|", "\\|")


def _cells(name: str, value: Any, reports: bool = True) -> Iterator[tuple[str, Any]]:
    """Names and single values of what a variation returned; of its reports, too, or not."""
    if isinstance(value, Failure):
        yield FAILURE, str(value)
    elif isinstance(value, BoundReport):
        yield from ((f"{name} {column}".strip(), x) for column, x in largest(value).items() if reports)
    elif isinstance(value, dict | list | tuple):
        for key, x in _parts(value):
            yield from _cells(f"{name} {key}".strip(), x, reports)
    elif isinstance(value, np.ndarray) and value.size > 1 and value.dtype.kind not in "SU":
        yield f"{name or VALUE} largest", float(np.max(np.abs(value)))
    else:
        if isinstance(value, np.ndarray | np.generic):
            value = value.item() if value.size == 1 else ", ".join(map(str, value.ravel()))
        yield name or VALUE, value


def _report_rows(name: str, value: Any) -> Iterator[dict[str, Any]]:
    """What is known of each row of each output of the reports that a variation returned, largest values over time."""
    if isinstance(value, BoundReport):
        for out in value.outputs.values():
            largest = {what: np.abs(x).max(axis=0) for what, x in main_series(out, value.scope).items()}
            for row, row_name in enumerate(out.row_names):
                found = dict(_size(what, float(x[row])) for what, x in largest.items())
                yield {"output": f"{name} {row_name}{out.unit and f' [{out.unit}]'}".strip(), **found}
    elif isinstance(value, dict | list | tuple):
        for key, x in _parts(value):
            yield from _report_rows(f"{name} {key}".strip(), x)


def _size(what: str, x: float) -> tuple[str, Any]:
    """Name and cell of a value, its estimate, or how far these are off at most, rounded up, with its condition."""
    title, comma, condition = what.replace("uncertainty", "half width").partition(", ")
    if not np.isfinite(x):
        return title, "not bounded" if "bound" in title else "not known"
    said = digits(x) if title == "estimate" else rounded_up(x)
    return title or "largest", f"{said}{comma}{condition}" if title else x


def _parts(value: dict | list | tuple) -> Any:
    return value.items() if isinstance(value, dict) else enumerate(value)
