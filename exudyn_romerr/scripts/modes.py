"""romerr modes: the mode tables of all bodies of a script, in each of its solves."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..mode_selection.mode_table import ModeTable
    from .run import Run

NOT_TOLD = "What the run tells of modes is not known: {}."


def mode_tables(done: Run) -> tuple[list[ModeTable], list[str]]:
    """Return the tables of all solves, and lines: all of them, and why there are no others."""
    tables: list[ModeTable] = []
    return tables, [*_lines(done, tables), *done.notes]


def _lines(done: Run, tables: list[ModeTable]) -> Iterator[str]:
    from ..mbs.studies.mode_table import mode_table

    for solve in done.solves:
        if len(done.solves) > 1:
            yield f"Solve {solve.number} ({solve.kind}):"
        for which, why in solve.refused:
            yield f"{which}: {why}"
        for flex in solve.flexes:
            tables.append(mode_table(flex, solve.report))
            yield f"{tables[-1]}\n"
        if solve.report is None:
            yield NOT_TOLD.format(solve.failure or solve.until)
