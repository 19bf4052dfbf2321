"""Answers of runs and measurements: names, status and JSON, and the files that they are written to.

Files are looked at before a script starts, and written after it has ended.
"""

from __future__ import annotations

import json
import os
import sys
from typing import TYPE_CHECKING, Any

from .._version import __version__
from ..errors import InputError
from ..report.answers import STATUS, WRONG_USAGE
from ..report.formats.atomic_write import write_whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..report.answers import Answer, Tolerances
    from ..report.judgement import Judgement

ENDINGS = {"save": (".npz",), "html": (".html", ".htm"), "plot": (".png", ".svg", ".pdf"), "json": (".json",)}
ENDINGS["table"] = (".csv", *ENDINGS["html"])


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


class Answered:
    """What came of runs beside the tolerances that were asked for: an exit status, and JSON."""

    tolerances: Tolerances
    _overall: Answer  # that counts for all sensors
    misspelt: list[str]  # a line for each name in a tolerance that no sensor has
    as_json: Callable[[], dict[str, Any]]

    @property
    def status(self) -> int:
        """Exit status: 0, or with a tolerance that of the answer; 2: one of a sensor that there is not."""
        if not self.tolerances.is_given:
            return 0
        return WRONG_USAGE if self.misspelt else STATUS[self._overall]

    def save(self, path: str | os.PathLike) -> None:
        """Write all numbers and answers as JSON; InputError if the file cannot be written."""
        text = json.dumps(self.as_json(), indent=1, allow_nan=False, ensure_ascii=False)
        write_whole(path, lambda stream: stream.write(f"{text}\n".encode()))


class Judged(Answered):
    """What a Run and a Verification answer alike, by their judgement."""

    script: str
    judgement: Judgement
    _of_solves: Callable[[], dict[str, Any]]  # what --json writes of solves, and CPU time of all

    @property
    def _overall(self) -> Answer:
        """The answer that counts for all sensors."""
        return self.judgement.answer

    @property
    def misspelt(self) -> list[str]:
        """A line for each name in a tolerance that no sensor has."""
        return self.tolerances.misspelt(row.name for row in self.judgement.rows)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """What --json writes of sensors: a dict for every component of every sensor in every solve."""
        return [row.as_json() for row in self.judgement.rows]

    def as_json(self) -> dict[str, Any]:
        """Return what --json writes; docs/answer.schema.json has the fields."""
        return {
            "script": self.script,
            "answer": self._overall.value if self.judgement.rows else None,
            "sensors": self.rows,
            **self._of_solves(),
            "misspelt": self.misspelt,
            "notes": self.judgement.notes,
            "version": __version__,
        }


def tried(path: str, write: Callable[[], None]) -> str:
    """Call what writes a file; return a line: where it is, or why it is not."""
    try:
        write()
    except Exception as error:  # disk full, a picture of nothing: the other files and the exit status stay
        return f"not written: {path}: {error}"
    return f"written: {path}"


def tell_on_stderr(said: str) -> None:
    """Print a line of progress."""
    print(f"romerr: {said}", file=sys.stderr, flush=True)
