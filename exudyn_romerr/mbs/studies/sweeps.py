"""Many runs of one function: on an executor, an exception being a value; kept in a folder; as one table."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, RunError
from ...report.formats.atomic_write import write_whole
from ...report.formats.csv_table import csv_bytes, largest, main_series
from ...report.formats.npz_file import arrays_of
from ...report.mechanism_report import report_of
from ...report.report import BoundReport
from ...report.wording import digits, rounded_up

Done = Callable[[int, Any], None]

KILLED = "BrokenExecutor: the process that ran this variation ended: killed, out of memory, or crashed"
NOT_AGAIN = (
    "BrokenExecutor: a process ended, and a {0} cannot be made again for the variations that were left; pass a "
    "function that makes one, executor=lambda: {0}(...)"
)
# arguments of ProcessPoolExecutor, and where it keeps them
KEPT = {
    "max_workers": "_max_workers",
    "mp_context": "_mp_context",
    "initializer": "_initializer",
    "initargs": "_initargs",
}
FORMAT = 1
KEY = "sweep"  # of the text beside the arrays
KINDS = "numbers, texts, None, arrays of numbers, reports, and lists, tuples and dicts of these"
INDEX = "computationIndex"  # moves when the grid grows; the variation stays the same
VALUE, FAILURE = "value", "failure"  # columns of what has no name of its own
ENDINGS = {".csv": "csv", ".md": "markdown"}


class Failure(str):
    """What a variation left instead of a value: type and message of its exception."""


class Sweep(NamedTuple):
    """Result of a sweep.

    parameters : name -> (variations,), as ParameterVariation returns them. values : what the function returned, in
    that order, or a Failure.
    """

    parameters: dict[str, np.ndarray]
    values: list

    @property
    def failures(self) -> dict[int, Failure]:
        """Position in values -> what went wrong there."""
        return {i: value for i, value in enumerate(self.values) if isinstance(value, Failure)}

    def complete(self) -> list:
        """Return values if every variation has one; RunError lists the failures."""
        if self.failures:
            points = (", ".join(f"{name}={x[i]:g}" for name, x in self.parameters.items()) for i in self.failures)
            lines = [f"{point}: {failure}" for point, failure in zip(points, self.failures.values(), strict=True)]
            raise RunError(f"{len(lines)} of {len(self.values)} variations failed:\n" + "\n".join(lines))
        return self.values


def failed(error: BaseException) -> Failure:
    """Return what an exception leaves."""
    return Failure(f"{type(error).__name__}: {error}")


class Guarded:
    """The function, with an exception as its value; a class, for other processes to unpickle."""

    def __init__(self, function: Callable[[dict], Any]):
        self.function = function

    def __call__(self, parameters: dict) -> Any:
        try:
            return self.function(parameters)
        except Exception as error:  # whatever it is: the other variations go on
            return failed(error)


# --- on an executor: a process that is killed costs its own variation only ---


def run_on(
    executor: Executor | Callable[[], Executor], function: Callable[[dict], Any], sets: dict[int, dict], done: Done
) -> None:
    """Call done(i, function(sets[i])) for all i, in the order in which they are ready.

    No more variations are in the executor than it has workers. Where it breaks, these are repeated one at a time in a
    new one; what breaks that too is a Failure. Executors that are made here are shut down here.
    """
    pool, is_own = (executor(), True) if callable(executor) else (executor, False)
    batches = [dict(sets)]
    try:
        while batches:
            batch = batches.pop()
            suspects = _in_it_when_it_broke(pool, Guarded(function), batch, done)
            if len(suspects) == 1:
                del batch[suspects[0]]
                done(suspects[0], Failure(KILLED))
            if suspects:
                _shut_down(pool, is_own)
                pool, is_own = _another(executor), True
                alone = [{i: batch.pop(i)} for i in suspects[::-1] if i in batch]
                batches += [batch, *alone]
            if pool is None:
                for i in sorted(i for batch in batches for i in batch):
                    done(i, Failure(NOT_AGAIN.format(type(executor).__name__)))
                return
    finally:
        _shut_down(pool, is_own)


def _shut_down(pool: Executor | None, is_own: bool) -> None:
    if pool is not None and is_own:
        pool.shutdown()


def _another(given: Executor | Callable[[], Executor]) -> Executor | None:
    """An executor like the one that broke; None: it is the only one."""
    if callable(given):
        return given()
    if type(given) is ProcessPoolExecutor and all(hasattr(given, kept) for kept in KEPT.values()):
        return ProcessPoolExecutor(**{name: getattr(given, kept) for name, kept in KEPT.items()})
    return None


def _in_it_when_it_broke(executor: Executor, function: Callable[[dict], Any], left: dict, done: Done) -> list[int]:
    """Finish what is left; return what was in the executor when it broke, which is left still."""
    # as many at once as there are workers, all of them if that is not known
    width = getattr(executor, "num_workers", None) or getattr(executor, "_max_workers", None) or inf
    waiting, running = list(left)[::-1], {}
    try:
        while waiting or running:
            while waiting and len(running) < width:
                i = waiting.pop()
                running[_submitted(executor, function, left[i])] = i
            finished = wait(running, return_when=FIRST_COMPLETED).done
            for future in finished:
                if not isinstance(future.exception(), BrokenExecutor):
                    i = running.pop(future)
                    del left[i]
                    done(i, failed(future.exception()) if future.exception() else future.result())
            if not finished.isdisjoint(running):
                return list(running.values())
    finally:  # an interrupt, too
        for future in running:
            future.cancel()
    return []


def _submitted(executor: Executor, function: Callable[[dict], Any], parameters: dict) -> Future:
    try:
        return executor.submit(function, parameters)
    except BrokenExecutor as error:
        broken: Future = Future()
        broken.set_exception(error)
        return broken


# --- in a folder: a file for each variation, its parameters and what the function returned; no pickle ---


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


def _results_in(folder: str | os.PathLike) -> list[Kept]:
    """All results of a folder; InputError if it has none."""
    if not os.path.isdir(folder):
        raise InputError(f"{os.fspath(folder)} is no folder; pass the one that sweep was given, folder=...")
    found = [kept for path in sorted(Path(folder).glob("*.npz")) if (kept := read_result(path)) is not None]
    if not found:
        raise InputError(f"{os.fspath(folder)} has no result of a sweep; pass the folder that sweep was given")
    return sorted(found, key=lambda kept: list(kept.parameters.items()))


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


# --- as one table, a line for each variation ---


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
    return _table([_line(kept) for kept in _results_in(folder)])


def text_of(folder: str | os.PathLike) -> str:
    """Return the table to be read, four digits a number, in columns that line up.

    Of reports it has a line for each row of each output, for one line would be too wide.
    """
    lines = []
    for kept in _results_in(folder):
        own = _line(kept, with_reports=False)
        lines += [{**own, **row} for name, x in _leaves(kept.value) for row in _report_rows(name, x)] or [own]
    head, lines = _table(lines)
    rows = [[_cell(x) for x in line] for line in [head, *lines]]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, ["-" * width for width in widths])
    return "\n".join(f"| {' | '.join(map(str.ljust, row, widths))} |" for row in rows)


def write_table(folder: str | os.PathLike, path: str | os.PathLike) -> None:
    """Write the table: .csv has all digits and a line for each variation, .md is what is printed."""
    kind = ENDINGS.get(os.path.splitext(path)[1].lower())
    if kind is None:
        raise InputError(f"{os.fspath(path)} does not end in .csv or .md; pass such a name after -o")
    data = csv_bytes(*table_of(folder)) if kind == "csv" else f"{text_of(folder)}\n".encode()
    write_whole(path, lambda stream: stream.write(data))


def _table(lines: list[dict[str, Any]]) -> tuple[list[str], list[list[Any]]]:
    head = list(dict.fromkeys(name for line in lines for name in line))
    head.sort(key=lambda name: name == FAILURE)
    return head, [[line.get(name) for name in head] for line in lines]


def _cell(x: Any) -> str:
    text = f"{x:.4g}" if isinstance(x, float) else "" if x is None else str(x)
    return " ".join(text.split()).replace("|", "\\|")


def _leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """What a variation returned, taken apart where it is a dict, list or tuple, and how each part is called."""
    if isinstance(value, dict | list | tuple):
        for key, x in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _leaves(x, f"{name} {key}".strip())
    else:
        yield name, value


def _line(kept: Kept, with_reports: bool = True) -> dict[str, Any]:
    """Parameters and single values of a variation; of its reports, too, or not."""
    line = dict(kept.parameters)
    for name, x in _leaves(kept.value):
        if isinstance(x, Failure):
            line[FAILURE] = str(x)
        elif isinstance(x, BoundReport):
            line |= {f"{name} {column}".strip(): y for column, y in largest(x).items() if with_reports}
        elif isinstance(x, np.ndarray) and x.size > 1 and x.dtype.kind not in "SU":
            line[f"{name or VALUE} largest"] = float(np.max(np.abs(x)))
        elif isinstance(x, np.ndarray | np.generic):
            line[name or VALUE] = x.item() if x.size == 1 else ", ".join(map(str, x.ravel()))
        else:
            line[name or VALUE] = x
    return line


def _report_rows(name: str, report: Any) -> Iterator[dict[str, Any]]:
    """What is known of each row of each output of a report, largest values over time; nothing of other values."""
    for out in report.outputs.values() if isinstance(report, BoundReport) else ():
        sizes = {what: np.abs(x).max(axis=0) for what, x in main_series(out, report.scope).items()}
        for row, row_name in enumerate(out.row_names):
            found = dict(_size(what, float(x[row])) for what, x in sizes.items())
            yield {"output": f"{name} {row_name}{out.unit and f' [{out.unit}]'}".strip(), **found}


def _size(what: str, x: float) -> tuple[str, Any]:
    """Name and cell of a value, its estimate, or how far these are off at most, rounded up, with its condition."""
    title, comma, condition = what.replace("uncertainty", "half width").partition(", ")
    if not np.isfinite(x):
        return title, "not bounded" if "bound" in title else "not known"
    said = digits(x) if title == "estimate" else rounded_up(x)
    return title or "largest", f"{said}{comma}{condition}" if title else x
