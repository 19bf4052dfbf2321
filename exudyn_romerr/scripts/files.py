"""Files that an answer is written to: looked at before a script starts, written after it has ended."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

from .._version import __version__
from ..errors import InputError

if TYPE_CHECKING:
    from ..report.report import BoundReport
    from .run import Run

ENDINGS = {"save": (".npz",), "html": (".html", ".htm"), "plot": (".png", ".svg", ".pdf"), "json": (".json",)}


def checked_files(given: dict[str, str | None]) -> dict[str, str]:
    """Return absolute paths of what is to be written, by option.

    Raises
    ------
    InputError
        A folder that is not there or cannot be written to; an ending that the option does not write.
    """
    found = {}
    for option, path in given.items():
        if path is None:
            continue
        if not path.lower().endswith(ENDINGS[option]):
            raise InputError(f"--{option} {path}: the name must end in {' or '.join(ENDINGS[option])}")
        folder = os.path.dirname(os.path.abspath(path))
        if not os.path.isdir(folder):
            raise InputError(f"--{option} {path}: there is no folder {folder}; make it first")
        if not os.access(path if os.path.exists(path) else folder, os.W_OK):
            raise InputError(f"--{option} {path}: cannot be written, no permission")
        found[option] = os.path.abspath(path)
    return found


def write_files(run: Run, files: dict[str, str]) -> list[str]:
    """Write what was asked for; return a line for each file: where it is, or why it is not."""
    return [line for option, path in files.items() for line in _written(run, option, path)]


def _written(run: Run, option: str, path: str) -> list[str]:
    if option == "json":
        return [tried(path, lambda: _write_json(run, path))]
    if not run.reports:
        return [f"not written: {path}: no solve has a report"]
    return [tried(to, lambda r=report, to=to: _write(run, r, option, to)) for report, to in _numbered(run, path)]


def _numbered(run: Run, path: str) -> list[tuple[BoundReport, str]]:
    """Reports with the names of their files; of several solves each has its number."""
    if len(run.reports) == 1:
        return [(run.reports[0], path)]
    stem, ending = os.path.splitext(path)
    return [(solve.report, f"{stem}_{solve.number}{ending}") for solve in run.solves if solve.report is not None]


def _write(run: Run, report: BoundReport, option: str, path: str) -> None:
    from ..report.formats.html_page import write_page
    from ..report.plots.panels import plot_report

    if option == "save":
        report.save(path)
    else:
        {"plot": plot_report, "html": write_page}[option](report, path, tolerances=run.tolerances)


def tried(path: str, write: Any) -> str:
    """Call what writes a file; return a line: where it is, or why it is not."""
    try:
        write()
    except Exception as error:  # disk full, a picture of nothing: the other files and the exit status stay
        return f"not written: {path}: {error}"
    return f"written: {path}"


def _write_json(run: Run, path: str) -> None:
    text = json.dumps(as_json(run), indent=1, allow_nan=False, ensure_ascii=False)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text + "\n")


def as_json(run: Run) -> dict[str, Any]:
    """Return what --json writes; docs/answer.schema.json has the fields."""
    solves = [
        {
            "number": solve.number,
            "kind": solve.kind,
            "bodies": solve.bodies,
            "refused": [{"body": which, "reason": why} for which, why in solve.refused],
            "failure": None if solve.failure is None else str(solve.failure),
            "cpu_s": solve.seconds,
        }
        for solve in run.solves
    ]
    return {
        "script": run.script,
        "answer": run.judgement.answer.value if run.judgement.rows else None,
        "sensors": run.rows,
        "bodies": sum(solve.bodies for solve in run.solves),
        "solves": solves,
        "misspelt": run.misspelt,
        "notes": run.judgement.notes,
        "cpu_s": sum(solve.seconds + solve.our_seconds for solve in run.solves),
        "version": __version__,
    }
