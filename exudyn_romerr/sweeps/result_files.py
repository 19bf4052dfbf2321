"""One file for each variation: its parameters and what the function returned; no pickle, written whole."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..report.formats.atomic_write import write_whole
from ..report.formats.load import report_of
from ..report.formats.npz_file import arrays_of
from ..report.report import BoundReport
from .variations import Failure

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

FORMAT = 1
KEY = "sweep"  # of the text beside the arrays
KINDS = "numbers, texts, None, arrays of numbers, reports, and lists, tuples and dicts of these"
INDEX = "computationIndex"  # moves when the grid grows; the variation stays the same


class Kept(NamedTuple):
    """What a file has: parameters as they were varied, and the value."""

    parameters: dict[str, float]
    value: Any


class ResultFolder:
    """The files of one function's variations in a folder."""

    def __init__(self, folder: str | os.PathLike, function: Callable):
        self.folder, self.function = Path(folder), getattr(function, "__qualname__", type(function).__name__)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"folder={os.fspath(folder)!r} cannot be made: {error.strerror}") from error

    def path(self, parameters: dict) -> Path:
        """Return where the result of a parameter set is, or goes; functionData and the function's name count too."""
        same = {name: x for name, x in parameters.items() if name != INDEX}
        try:
            text = json.dumps([self.function, same], sort_keys=True)
        except TypeError as error:
            raise InputError(
                f"parameterFunctionData: {error}; with folder= pass numbers, texts, lists and dicts, by which a "
                "result is found again"
            ) from error
        return self.folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.npz"

    def write(self, parameters: dict, value: Any) -> None:
        """Keep a result; InputError if it is of a kind that has no place in such a file."""
        arrays: dict[str, np.ndarray] = {}
        varied = {name: x for name, x in parameters.items() if name not in (INDEX, "functionData")}
        record = {"format": FORMAT, "parameters": varied, "value": _packed(value, arrays)}
        text = np.array(json.dumps(record))
        write_whole(self.path(parameters), lambda stream: np.savez_compressed(stream, **{KEY: text}, **arrays))


def read_result(path: str | os.PathLike) -> Kept | None:
    """Return what a file keeps; None if it is another's. InputError if it is damaged or cannot be read."""
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
            if KEY not in file.files:
                return None
            record = json.loads(str(file[KEY]))
            arrays = {name: file[name] for name in file.files}
        if record["format"] == FORMAT:
            return Kept(record["parameters"], _unpacked(record["value"], arrays, os.fspath(path)))
    except Exception as error:  # damaged bytes make zipfile, zlib, numpy and json raise a dozen types
        raise InputError(f"{path} cannot be read ({error}); delete it, and sweep again") from error
    raise InputError(f"{path} has format {record['format']!r}; this version reads format {FORMAT}: sweep again")


def results_in(folder: str | os.PathLike) -> Iterator[Kept]:
    """Return all results of a folder; InputError if it has none."""
    if not os.path.isdir(folder):
        raise InputError(f"{os.fspath(folder)} is no folder; pass the one that sweep was given, folder=...")
    found = [kept for path in sorted(Path(folder).glob("*.npz")) if (kept := read_result(path)) is not None]
    if not found:
        raise InputError(f"{os.fspath(folder)} has no result of a sweep; pass the folder that sweep was given")
    return iter(sorted(found, key=lambda kept: list(kept.parameters.items())))


def _packed(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    """The value as JSON; arrays that it has go to `arrays`."""
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, Failure):
        return {"failure": str(value)}
    if type(value) in (list, tuple):
        return {type(value).__name__: [_packed(x, arrays) for x in value]}
    if type(value) is dict and all(type(name) in (str, int) for name in value):
        return {"dict": [[name, _packed(x, arrays)] for name, x in value.items()]}
    if isinstance(value, BoundReport):  # the first one without prefix: load_report and `romerr show` read it too
        prefix = f"report/{len(arrays)}/" if "meta" in arrays else ""
        arrays.update({f"{prefix}{name}": x for name, x in arrays_of(value).items()})
        return {"report": prefix}
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "biufcSU":
        name = f"array/{len(arrays)}"
        arrays[name] = np.asarray(value)
        return {"array" if isinstance(value, np.ndarray) else "scalar": name}
    raise InputError(f"the function returned a {type(value).__name__}; with folder= it may return {KINDS}")


def _unpacked(value: Any, arrays: dict[str, np.ndarray], path: str) -> Any:
    if not isinstance(value, dict):
        return value
    ((kind, x),) = value.items()
    if kind in ("list", "tuple"):
        items = [_unpacked(item, arrays, path) for item in x]
        return items if kind == "list" else tuple(items)
    if kind == "dict":
        return {name: _unpacked(item, arrays, path) for name, item in x}
    if kind == "report":
        return report_of({name.removeprefix(x): y for name, y in arrays.items() if name.startswith(x)}, path)
    return {"failure": Failure, "array": arrays.get, "scalar": lambda name: arrays[name][()]}[kind](x)
