"""ModeTable: which coordinate of a reduced body is which, and what it does; as text, CSV and HTML."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ..report.formats.atomic_write import write_whole
from ..report.formats.html_page import CSS, _paragraph, _table
from ..report.table import aligned
from ..report.wording import digits, percent, rounded_up, with_unit
from .mode_properties import Coordinates, Frequencies

if TYPE_CHECKING:
    import os

AXES = "xyz"
ALONE = "Each coordinate alone, in the order of the body's; effective mass beside those before it"
HELD = "Frequencies of the body as it is held in its frame; of the full model none is missed (Sylvester's law)"
WITHOUT = "About what the largest error would grow by without it, to first order"
LACKS = "Not there, the lowest of the full body: {}."
MOST, MUCH = 5, 10.0  # modes that are named; a relative difference of which no percentage is told
Block = tuple[str, tuple[str, ...], list[tuple[str, ...]]]


@dataclass(frozen=True)
class InRun:
    """What coordinates do in a run: energy (n,), shares of the strain energy; sensors {name: (unit, (n,))}.

    why_not : why there is no number of sensors.
    """

    energy: np.ndarray
    sensors: dict[str, tuple[str, np.ndarray]]
    why_not: str = ""


@dataclass(frozen=True)
class ModeTable:
    """What is known of the n coordinates of a reduced body; print() it.

    Attributes
    ----------
    name : of the body
    kinds : (n,) texts, "static, interface 2 ('right', 36 nodes about 0.4, 0, 0), displacement x", "eigenmode 1"
    why : why there are so many, and which interface was left out
    coordinates : .omega (n,) rad/s, .zeta (n,), .mass (n, 3), effective, shares of the body's by direction
    frequencies : .reduced, .full (n,) rad/s, .off, .within (n,): relative difference and how far off it may be;
        .missing, .missing_omega: modes of the full body that the basis lacks. None: not known
    in_run : .energy (n,), .sensors {name: (unit, (n,))}; None: no report was given
    notes : what is not known, and why
    """

    name: str
    kinds: Sequence[str]
    why: str
    coordinates: Coordinates
    frequencies: Frequencies | None
    in_run: InRun | None
    notes: Sequence[str]

    def blocks(self) -> Iterator[Block]:
        """Yield tables of texts: caption, head, lines."""
        yield self._of_coordinates()
        if self.frequencies is not None:
            yield self._of_frequencies(self.frequencies)
        if self.in_run is not None and self.in_run.sensors:
            yield self._of_sensors(self.in_run.sensors)

    def _of_coordinates(self) -> Block:
        of, rows = self.coordinates, [[str(j), kind] for j, kind in enumerate(self.kinds)]
        head = ["coordinate", "is", "alone [Hz]"]
        _add(rows, (digits(x / (2 * np.pi), 4) for x in of.omega))
        if of.zeta is not None:
            head.append("damping")
            _add(rows, (percent(x) or "over 10" for x in of.zeta))
        if of.mass is not None:
            head += [f"mass {axis}" for axis in AXES] + [f"sum {axis}" for axis in AXES]
            for shares in (of.mass, np.cumsum(of.mass, axis=0)):
                for axis in range(len(AXES)):
                    _add(rows, map(_share, shares[:, axis]))
        if self.in_run is not None:
            head.append("strain energy")
            _add(rows, map(_share, self.in_run.energy))
        return ALONE, tuple(head), [tuple(row) for row in rows]

    def _of_frequencies(self, of: Frequencies) -> Block:
        head, rows = (
            ["mode", "reduced [Hz]", "full [Hz]", "off by at most"],
            [[str(k + 1)] for k in range(len(of.off))],
        )
        for x in (of.reduced, of.full):
            _add(rows, (f"{hertz:.5g}" for hertz in x / (2 * np.pi)))
        most = np.abs(of.off) + of.within
        _add(rows, (f"{rounded_up(100 * x, 2)} %" if x < MUCH else "more than 10 times" for x in most))
        if of.zeta is not None:
            head.append("damping")
            _add(rows, (percent(x) or "over 10" for x in of.zeta))
        _add(rows, map(str, of.mainly))
        return HELD, (*head, "mainly coordinate"), [tuple(row) for row in rows]

    def _of_sensors(self, sensors: dict[str, tuple[str, np.ndarray]]) -> Block:
        columns = [[with_unit(digits(x, 2), unit) for x in grows] for unit, grows in sensors.values()]
        return (
            WITHOUT,
            ("coordinate", *sensors),
            [(str(j), *line) for j, line in enumerate(zip(*columns, strict=True))],
        )

    def _missing(self) -> list[str]:
        """A line of the lowest modes of the full body that the basis lacks."""
        of = self.frequencies
        if of is None or not len(of.missing):
            return []
        lowest = zip(of.missing[:MOST].tolist(), of.missing_omega, strict=False)
        told = (
            f"mode {k + 1:g} at {digits(w / (2 * np.pi), 4)} Hz ({percent(share)} of it)" for (k, share), w in lowest
        )
        return [LACKS.format(", ".join(told))]

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.why}."]
        for caption, head, rows in self.blocks():
            lines += ["", f"{caption}:", *aligned([head, *rows])]
        return "\n".join([*lines, "", *self._missing(), *self.notes]).rstrip()

    def save(self, path: str | os.PathLike) -> None:
        """Write it: .csv with all digits, a line for each coordinate (mode k of the body in line k), or .html.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        write_tables([self], path)

    def columns(self) -> dict[str, Sequence]:
        """Return the columns of the CSV file: name -> (n,)."""
        of, modes = self.coordinates, self.frequencies
        found: dict[str, Sequence] = {"body": [self.name] * len(self.kinds), "coordinate": range(len(self.kinds))}
        found |= {"kind": self.kinds, "alone [rad/s]": of.omega, "damping ratio": of.zeta}
        found |= {f"effective mass {axis}": None if of.mass is None else of.mass[:, i] for i, axis in enumerate(AXES)}
        if modes is not None:
            found |= {"mode reduced [rad/s]": modes.reduced, "mode full [rad/s]": modes.full}
            found |= {"mode off": modes.off, "mode off known within": modes.within, "mode damping ratio": modes.zeta}
        if self.in_run is not None:
            found["share of strain energy"] = self.in_run.energy
            found |= {f"{name} without it": grows for name, (_, grows) in self.in_run.sensors.items()}
        return {name: x for name, x in found.items() if x is not None}


def write_tables(tables: Sequence[ModeTable], path: str | os.PathLike) -> None:
    """Write tables of bodies into one file: .csv, or else HTML; InputError if it cannot be written."""
    text = _csv(tables) if str(path).lower().endswith(".csv") else _page(tables)
    write_whole(path, lambda stream: stream.write(text.encode("utf-8")))


def _csv(tables: Sequence[ModeTable]) -> str:
    of = [table.columns() for table in tables]
    names, stream = list(dict.fromkeys(name for one in of for name in one)), io.StringIO(newline="")
    writer = csv.writer(stream)
    writer.writerow(names)
    for table, one in zip(tables, of, strict=True):
        none = [""] * len(table.kinds)
        columns = [np.asarray(one.get(name, none)).tolist() for name in names]
        writer.writerows(zip(*columns, strict=True))
    return stream.getvalue()


def _page(tables: Sequence[ModeTable]) -> str:
    head = '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>Modes</title>'
    parts = [f"{head}\n<style>{CSS}</style>\n</head>\n<body>"]
    for table in tables:
        parts += [f"<h1>Modes of {escape(table.name)}</h1>", _paragraph(f"{table.why}.")]
        parts += [_table(*block, "numbers") for block in table.blocks()]
        parts += [_paragraph(line) for line in (*table._missing(), *table.notes)]
    return "\n".join([*parts, "</body>\n</html>\n"])


def _add(rows: list[list[str]], column: Iterator[str]) -> None:
    for row, cell in zip(rows, column, strict=True):
        row.append(cell)


def _share(x: float) -> str:
    """A share in %, in steps of 0.01 %."""
    return f"{100 * x + 0.0:.2f} %".replace("-0.00", "0.00")
