"""What a sweep returns, and its variations on an executor of concurrent.futures: an exception is a value.

A process that is killed costs its own variation only.
"""

from __future__ import annotations

from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import RunError

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

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
            lines = [f"{self._point(i)}: {failure}" for i, failure in self.failures.items()]
            raise RunError(f"{len(lines)} of {len(self.values)} variations failed:\n" + "\n".join(lines))
        return self.values

    def _point(self, i: int) -> str:
        return ", ".join(f"{name}={x[i]:g}" for name, x in self.parameters.items())


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


def run_on(
    executor: Executor | Callable[[], Executor], function: Callable[[dict], Any], sets: dict[int, dict], done: Done
) -> None:
    """Call done(i, function(sets[i])) for all i, in the order in which they are ready.

    No more variations are in the executor than it has workers. Where it breaks, these are repeated one at a time in a
    new one; what breaks that too is a Failure.
    """
    unfinished = dict(sets)

    def finish(i: int, value: Any) -> None:
        del unfinished[i]
        done(i, value)

    pool = _Pool(executor)
    try:
        _run(pool, Guarded(function), dict(sets), finish)
    except _NotAgainError:
        for i in list(unfinished):
            finish(i, Failure(NOT_AGAIN.format(type(executor).__name__)))
    finally:
        pool.close()


def _run(pool: _Pool, function: Callable[[dict], Any], left: dict[int, dict], done: Done) -> None:
    while left:
        suspects = {i: left.pop(i) for i in _in_it_when_it_broke(pool.executor, function, left, done)}
        if len(suspects) == 1:
            done(*suspects, Failure(KILLED))
        if suspects:
            pool.renew()
        if len(suspects) > 1:
            for i, parameters in suspects.items():
                _run(pool, function, {i: parameters}, done)


def _in_it_when_it_broke(executor: Executor, function: Callable[[dict], Any], left: dict, done: Done) -> list[int]:
    """Finish what is left; return what was in the executor when it broke, which is left still."""
    width, waiting, running = _width(executor), list(left)[::-1], {}
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


def _width(executor: Executor) -> float:
    """How many variations at once: as many as there are workers, all of them if that is not known."""
    return getattr(executor, "num_workers", None) or getattr(executor, "_max_workers", None) or inf


class _NotAgainError(Exception):
    """An executor that broke is the only one."""


class _Pool:
    """An executor, and others like it after it broke; those that are made here are shut down here."""

    def __init__(self, executor: Executor | Callable[[], Executor]):
        self.given = executor
        self.own = callable(executor)
        self.executor = executor() if callable(executor) else executor

    def renew(self) -> None:
        self.close()
        self.executor, self.own = self._another(), True

    def _another(self) -> Executor:
        if callable(self.given):
            return self.given()
        if type(self.given) is ProcessPoolExecutor and all(hasattr(self.given, kept) for kept in KEPT.values()):
            return ProcessPoolExecutor(**{name: getattr(self.given, kept) for name, kept in KEPT.items()})
        raise _NotAgainError

    def close(self) -> None:
        if self.own:
            self.executor.shutdown()
