"""romerr verify: measure how wrong a script is by running it again: shorter steps, more modes, free interfaces."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from ..checks import check_choice
from ..errors import InputError, RunError
from ..process.interrupts import interrupt_deferred
from ..report.answers import Answer, Tolerances, tolerances_of, worst
from ..report.judgement import Judgement, Solve, text
from ..report.verdicts import CAUSES, beside_estimate
from .child_run import Request, Result, estimates, run_child, stop_all, used_by_running
from .compared import STRESS, disagreements, rows_of_signal, signals
from .execute import check_script
from .files import Judged

CONTROLLERS = ("follow", "hold")
MEMORY_SHARE = 0.8  # of what is free: runs together may take so much
MORE_MEMORY = 2.0  # times that of the unchanged run: of runs with more modes, or watched
TICK = 5.0  # s between two lines of progress
AFTER, PROGRESS = "{}: {}, {:.0f} s left", "about {:.0f} %, {:.0f} s left"
PLANNED = "{} more runs, {} at a time, about {:.0f} s; Ctrl-C shows what is there"
FINER = {"half": 2, "quarter": 4}
# times the CPU time of a solve, about: known better once the first of the other runs has ended
WITH_VECTORS, WATCHED = 2.5, 3.0
NOTES = {
    "follow": "PreStep functions are called at every step, shorter ones too (--controllers follow)",
    "hold": "PreStep functions are called at the steps of the unchanged run (--controllers hold)",
}
BY_CALL = "modes: by the script's own call, twice and four times as many; they cannot see rigid interfaces"
ENDED = "{}: the script ended with {}; what it had solved until then counts"
NOT_HELD = "steps that adapt: PreStep functions are called at each of them; there are none to hold them at"


@dataclass
class Verification(Judged):
    """What runs of one script have told; print it.

    Attributes
    ----------
    results : of all runs, by name
    tolerances : as asked for
    notes : lines about what was not had, and why
    units : of length, as the user gave it
    """

    script: str
    results: dict[str, Result]
    tolerances: Tolerances
    notes: list[str] = field(default_factory=list)
    units: str = ""

    @cached_property
    def judgement(self) -> Judgement:
        """Verdicts on every sensor, component and cause; all measured."""
        rows = [row for one in signals(self.results) for row in rows_of_signal(one, self.tolerances, self.units)]
        estimated = estimates(self.results, "again")
        of = (estimated.get((row.name, row.component, row.solve), {}).get("sum") for row in rows)
        rows = [*map(beside_estimate, rows, of)]
        solves = [Solve(i, solve["kind"], 1) for i, solve in enumerate(self.results["unchanged"].solves)]
        return Judgement(rows, solves, [*self.notes, *disagreements(self.results)])

    def answer(self, name: str, tolerance: float | str, cause: str | None = None) -> str:
        """Return "enough", "too large", "not known" or "not covered" for a sensor, of the whole error or one cause.

        Raises
        ------
        InputError
            No sensor of that name; a tolerance that is none; no such cause.
        """
        if cause is not None:
            check_choice("cause", cause, CAUSES)
        names = list(dict.fromkeys(row.name for row in self.judgement.rows))
        check_choice("name", name, names)
        asked = Tolerances([str(tolerance)])
        found = [row for one in signals(self.results) if one.name == name for row in rows_of_signal(one, asked)]
        of = [row.of[cause or "sum"].answer for row in found if (cause or "sum") in row.of]
        return worst(of or [Answer.NOT_COVERED]).value

    def _of_solves(self) -> dict[str, Any]:
        runs = self.results.items()
        return {
            "bodies": self.results["unchanged"].facts["bodies"],
            "solves": [{"number": x.number, "kind": x.kind} for x in self.judgement.solves],
            "runs": [{"name": name, "failure": one.failure or None, "cpu_s": one.seconds} for name, one in runs],
            "cpu_s": sum(one.seconds for one in self.results.values()),
        }

    def plot(self, path: str | os.PathLike) -> None:
        """Draw the measured errors of all sensors by cause, with half widths, and the estimate beside them."""
        from ..report.plots.comparisons import plot_verdicts

        plot_verdicts(self.judgement.rows, path, title=f"{os.path.basename(self.script)}: errors measured")

    @property
    def missing(self) -> list[str]:
        """A line that tells of runs that were not had; none: all were."""
        lost = [f"{name} ({one.failure})" for name, one in self.results.items() if one.failure]
        return [f"Runs that were not had: {', '.join(lost)}."] if lost else []

    def __str__(self) -> str:
        return "\n".join([*self.misspelt, *self.missing, text(self.judgement, self.script)])


def verify(
    script: str | os.PathLike | Callable,
    arguments: Sequence[str] = (),
    *,
    tolerance: Sequence[str] | str | float | None = None,
    units: str = "",
    executor: Executor | None = None,
    controllers: str = "follow",
    jobs: int | None = None,
    timeout: float | None = None,
    modes_by_call: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Verification:
    """Measure the errors of a script by running it again in processes of their own.

    Runs: unchanged; unchanged again (noise), watched; half and a quarter of the step; with our vectors beside the
    modes of all reduced bodies, first those that leave interfaces as rigid as the modes make them, then all, watched;
    all together with half the step. All sensors are compared at every step of the unchanged run.

    Parameters
    ----------
    script : path, or function
        A function at the top of a file: build() -> (mbs, ..., simulationSettings), or one that solves by itself.
    arguments : sequence of str
        sys.argv[1:] of the script.
    tolerance, units : as of romerr.run
    executor : concurrent.futures.Executor, optional
        Runs are submitted to it; default: threads, each of which starts a process here.
    controllers : {"follow", "hold"}
        PreStep functions are called at every shorter step, or at the steps of the unchanged run.
    jobs : int, optional
        Runs at a time; default: as processors and memory allow.
    timeout : float, optional
        s, for each run.
    modes_by_call : bool
        Twice and four times the modes by the script's own call, too; so in any case where a body cannot be read.
    progress : function(text), optional
        Is told what is done.

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        No such script; a function that cannot be imported; unknown controllers.
    RunError
        The unchanged run failed: nothing can be compared.

    Notes
    -----
    Does not cover: what our vectors leave out, too; the FE model itself.
    """
    tolerances = tolerances_of(tolerance)
    check_choice("controllers", controllers, CONTROLLERS)
    path, function = _located(script)
    plain = Request("unchanged", path, os.getcwd(), tuple(arguments), function, timeout=timeout)
    first = _first(replace(plain, make_vectors=True))
    results, notes = {"unchanged": first}, [*first.facts["notes"]]
    if first.facts["has_controllers"]:
        notes.append(NOTES[controllers])
        if controllers == "hold" and not all(solve["fixed"] for solve in first.solves):
            notes.append(NOT_HELD)
    requests = _planned(plain, first, controllers, modes_by_call)
    if any(request.factor > 1 for request in requests):
        notes.append(BY_CALL)
    results |= _further(requests, first, executor, jobs, progress)
    return Verification(plain.script, results, tolerances, notes + _endings(results), units)


def measure_steps(
    path: str,
    home: str,
    arguments: Sequence[str],
    tolerances: Tolerances,
    units: str = "",
    progress: Callable[[str], None] | None = None,
) -> Verification:
    """Measure the error of the steps alone: unchanged, half the step, a quarter of it; as verify, which see.

    path : of the script, absolute. home : the working folder.
    """
    plain = Request("unchanged", check_script(path), home, tuple(arguments))
    first = _first(plain)
    first.facts["bodies"] = 0  # nothing is asked of their modes
    requests = [replace(plain, name=name, steps=steps) for name, steps in FINER.items()]
    results = {"unchanged": first} | _further(requests, first, None, None, progress)
    follow = [NOTES["follow"]] if first.facts["has_controllers"] else []
    return Verification(plain.script, results, tolerances, follow + _endings(results), units)


def _first(plain: Request) -> Result:
    first = run_child(plain)
    if first.failure or not first.solves:
        raise RunError(f"the unchanged run has nothing to compare: {first.failure or 'no solve of a mechanism'}")
    return first


def _further(
    requests: list[Request],
    first: Result,
    executor: Executor | None,
    jobs: int | None,
    progress: Callable[[str], None] | None,
) -> dict[str, Result]:
    """Make further runs, as many at a time as fit, and tell of them."""
    tell = progress or (lambda said: None)
    count = jobs or _jobs(first, len(requests))
    requests = [replace(request, threads="1" if count > 1 else "") for request in requests]
    forecast = _Forecast({request.name: _seconds_of(request, first) for request in requests}, count)
    tell(PLANNED.format(len(requests), count, forecast.left({})))
    return _all(requests, executor, count, forecast, tell)


def _endings(results: Mapping[str, Result]) -> list[str]:
    """A line for each run that failed, or whose script did not end well, unless it is the same for all."""
    lines, own = [], _ending(results["unchanged"])
    for name, one in results.items():
        if not one.failure and (said := _ending(one)) and (name == "unchanged" or said != own):
            lines.append(ENDED.format(name, said))
    return lines


def _ending(one: Result) -> str:
    if one.failure or not one.facts["status"]:
        return ""
    return one.facts["error"] or f"status {one.facts['status']}"


def _located(script: Any) -> tuple[str, str]:
    """The file, and the name of the function in it that is to be called; empty: the file is a script."""
    if not callable(script):
        return os.path.abspath(check_script(script)), ""
    path = inspect.getsourcefile(script)
    if path is None or "<locals>" in script.__qualname__ or not script.__qualname__.isidentifier():
        raise InputError(f"build={script!r}; needed: a function at the top of a file, which another process imports")
    return os.path.abspath(path), script.__name__


def _planned(plain: Request, first: Result, controllers: str, by_call: bool) -> list[Request]:
    """The runs that follow the unchanged one."""
    found = [replace(plain, name="again", watch=True)]
    held = replace(plain, hold=controllers == "hold")
    if any(solve["kind"] == "dynamic" for solve in first.solves):
        found += [replace(held, name=name, steps=steps) for name, steps in FINER.items()]
    if first.vectors:
        keeping = {order: P[:, keeps] for order, (P, keeps) in first.vectors.items()}
        every = {order: P for order, (P, _) in first.vectors.items()}
        is_free = any(not keeps.all() for _, keeps in first.vectors.values())
        found.append(replace(plain, name="modes", vectors=keeping, watch=not is_free))
        if is_free:
            found.append(replace(plain, name="free", vectors=every, watch=True))
        found.append(replace(held, name="all", vectors=every, steps=2))
    shows_stress = any(shows.startswith(STRESS) for solve in first.solves for shows in solve.get("shows", ()))
    is_by_call = by_call or first.facts["without_vectors"] or not first.vectors or shows_stress
    if first.facts["bodies"] and is_by_call:
        found += [replace(plain, name=name, factor=n) for name, n in (("twice", 2), ("four times", 4))]
    return found


def _jobs(first: Result, count: int) -> int:
    """How many runs fit into processors and memory."""
    fit = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    peak, free = MORE_MEMORY * first.facts["peak"], _free_memory()
    if peak and free:
        fit = min(fit, int(MEMORY_SHARE * free / peak))
    return max(1, min(fit, count))


def _free_memory() -> int:
    """Bytes; 0 where that is not known."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            return next(1024 * int(line.split()[1]) for line in file if line.startswith("MemAvailable"))
    except (OSError, StopIteration):  # no Linux
        return 0


class _Forecast:
    """What is left of a number of runs: by what the first one took, corrected by those that have ended.

    Parameters
    ----------
    seconds : by name, as forecast
    count : runs at a time
    """

    def __init__(self, seconds: Mapping[str, float], count: int):
        self._left, self._count = dict(seconds), count
        self._all, self._forecast, self._taken = sum(seconds.values()), 0.0, 0.0

    def end(self, name: str, elapsed: float) -> None:
        """Take what a run has taken, s: runs beside one another slow each other down, so that others will, too."""
        self._forecast += self._left.pop(name, 0.0)
        self._taken += elapsed

    def left(self, used: Mapping[str, float]) -> float:
        """Return about how many s are left; used : CPU time of those that run, by name."""
        remaining = [max(self._slower * x - used.get(name, 0.0), 0.0) for name, x in self._left.items()]
        return max(max(remaining, default=0.0), sum(remaining) / self._count)

    def share(self, used: Mapping[str, float]) -> float:
        """Return which share of the work is done, 0 to 1."""
        done = self._forecast + sum(min(used.get(name, 0.0) / self._slower, x) for name, x in self._left.items())
        return done / self._all if self._all > 0 else 1.0

    @property
    def _slower(self) -> float:
        """How much longer than forecast those that have ended took."""
        return self._taken / self._forecast if self._forecast > 0 else 1.0


def _seconds_of(request: Request, first: Result) -> float:
    """Return about how many s a run takes: Python's start, the script's own work, and its solves."""
    solves = first.facts["solve_seconds"]
    start = max(first.elapsed - solves - first.facts.get("vector_seconds", 0.0), 0.0)
    more = request.steps * (WITH_VECTORS if request.vectors or request.factor > 1 else 1.0)
    return start + solves * more * (WATCHED if request.watch else 1.0)


def _all(
    requests: list[Request], executor: Executor | None, count: int, forecast: _Forecast, tell: Callable
) -> dict[str, Result]:
    """Run all; Ctrl-C ends those that run, and those that have ended count."""
    own = executor or ThreadPoolExecutor(count)
    futures = {own.submit(run_child, request): request.name for request in requests}
    found: dict[str, Result] = {request.name: Result(request.name, "it was stopped") for request in requests}
    waiting = set(futures)
    try:
        while waiting:
            ended, waiting = wait(waiting, TICK, FIRST_COMPLETED)
            for future in ended:
                name, error = futures[future], future.exception()
                found[name] = Result(name, str(error)) if error else future.result()
                forecast.end(name, found[name].elapsed)
                how = found[name].failure or f"{found[name].elapsed:.1f} s"
                tell(AFTER.format(name, how, forecast.left(used_by_running())))
            if not ended:
                used = used_by_running()
                tell(PROGRESS.format(100 * forecast.share(used), forecast.left(used)))
    except KeyboardInterrupt:
        with suppress(KeyboardInterrupt), interrupt_deferred():  # who types it twice wants the same
            for future in futures:
                future.cancel()
            stop_all()
            _shut(own, executor)
    finally:
        _shut(own, executor)
    return found


def _shut(own: Executor, given: Executor | None) -> None:
    """End our threads; an executor of the user's is the user's."""
    if given is None:
        own.shutdown(wait=True, cancel_futures=True)
