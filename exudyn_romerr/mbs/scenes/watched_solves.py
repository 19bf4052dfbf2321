"""Solves of a script, each watched without a line of ours in the script.

What is heavy is imported when a solve moves the first reduced body: until then a script may configure what it likes.
"""

from __future__ import annotations

import os
from contextlib import ExitStack, contextmanager
from functools import partial
from time import process_time
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

from ...errors import RunError
from ...process.own_frames import without_our_places
from ...report.judgement import Solve
from ...report.verdicts import until_begun
from ..access.solvers import INTERRUPTED, EndedBy, ended_by, note_end
from .found_bodies import DYNAMIC, STATIC, StandIn, settings_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import ModuleType

    from ...report.report import BoundReport
    from .found_bodies import FoundBodies


class Watched(NamedTuple):
    """A solve under way, what gives its reports when it has ended, what is put back then."""

    solve: Solve
    tell: Callable[[EndedBy], list[BoundReport]]
    kept: ExitStack


class WatchedSolves(StandIn):
    """Stands in front of Exudyn's solvers and keeps a Solve of each; what goes wrong is in there, never raised.

    solves : in their order. plain : how many had no reduced flexible body. elsewhere : a file to which processes
    forked by the script write a byte for each solve of theirs, which is not watched. interfaces : see RecordedSolve.
    """

    def __init__(self, bodies: FoundBodies, elsewhere: str = "", interfaces: str = "free"):
        super().__init__()
        self.bodies, self.solves, self.plain, self._interfaces = bodies, [], 0, interfaces
        self._elsewhere, self._process = elsewhere, os.getpid()
        self._open: dict[int, Watched | None] = {}  # solves made step by step, by the solver's identity
        self._is_inside = False
        self._before: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()  # of each mbs how its solve before has ended

    def install(self, exudyn: ModuleType) -> None:
        """Stand in front of the solvers' functions; what they do and return stays the same."""
        for name in (*DYNAMIC, STATIC):
            self.replace(getattr(exudyn, name), "SolveSystem", partial(self._solve, name == STATIC))
        for name in DYNAMIC:
            self.replace(getattr(exudyn, name), "InitializeSolver", self._initialize)
            self.replace(getattr(exudyn, name), "FinalizeSolver", self._finalize)

    def _solve(self, is_static: bool, call: Any, solver: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
        if self._is_inside:  # ours
            return call(solver, mbs, *arguments, **options)
        opened = self._begin(solver, mbs, is_static, arguments, options)
        begin, error = process_time(), None
        try:
            return call(solver, mbs, *arguments, **options)
        except BaseException as raised:
            error = without_our_places(raised)
            raise
        finally:
            self._end(opened, ended_by(solver, error), process_time() - begin)

    def _initialize(self, call: Any, solver: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
        if not self._is_inside:
            self._open[id(solver)] = self._begin(solver, mbs, False, arguments, options)
        return call(solver, mbs, *arguments, **options)

    def _finalize(self, call: Any, solver: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
        try:
            return call(solver, mbs, *arguments, **options)
        finally:
            self._end(self._open.pop(id(solver), None), ended_by(solver))

    def _begin(self, solver: Any, mbs: Any, is_static: bool, arguments: tuple, options: dict) -> Watched | None:
        """Record, if there is anything to watch."""
        if os.getpid() != self._process:
            self._note_elsewhere()
            return None
        bodies = self.bodies.of(mbs)
        if not bodies:
            self.plain += 1
            return None
        solve = Solve(len(self.solves), "static" if is_static else "dynamic", len(bodies))
        self.solves.append(solve)
        self._is_inside = True
        begin = process_time()
        try:
            from .recorded_solve import ATTACHED_BY_SCRIPT, RecordedSolve, monitor_of_script

            kept, monitor = ExitStack(), monitor_of_script(mbs)
            settings = settings_of(arguments, options)
            if monitor is None:
                recorded = RecordedSolve(mbs, bodies, solve, self._before, settings, self._interfaces)
                kept.callback(recorded.close)
                return Watched(solve, lambda ending: recorded.reports(solver, ending), kept)
            solve.notes.append(ATTACHED_BY_SCRIPT)
            kept.enter_context(_kept_in_sys(mbs, solver, settings, is_static))
            first = len(monitor.runs)
            return Watched(solve, lambda ending: _reports(monitor, first), kept)
        except Exception as error:  # whatever it is: the script goes on, and the answer says why there is no number
            solve.failure = error
            return Watched(solve, lambda ending: [], ExitStack())
        except KeyboardInterrupt:
            solve.until = until_begun(INTERRUPTED)
            raise
        finally:
            solve.our_seconds += process_time() - begin
            self._is_inside = False

    def _end(self, watched: Watched | None, ending: EndedBy, seconds: float = 0.0) -> None:
        if watched is None:
            return
        solve, tell, kept = watched
        kept.close()
        begin, solve.seconds = process_time(), seconds
        try:
            reports = tell(ending)
            for report in reports[:-1]:  # a solver that began again at an earlier time, without being made anew
                solve.report, bodies = report, solve.bodies
                solve = Solve(len(self.solves), solve.kind, bodies, sensors=solve.sensors, chosen=solve.chosen)
                self.solves.append(solve)
            for report in reports[-1:]:
                solve.report = report
                note_end(report, ending)
        except Exception as error:  # as in _begin
            solve.failure = error
        except KeyboardInterrupt:
            solve.failure = RunError(f"{INTERRUPTED} while its error was computed")
            raise
        solve.our_seconds += process_time() - begin

    def _note_elsewhere(self) -> None:
        if self._elsewhere:
            with open(self._elsewhere, "ab") as file:
                file.write(b".")


def _reports(monitor: Any, first: int) -> list[BoundReport]:
    """The reports of the runs from number `first` on; of a run that went on from the one before with that."""
    from ...report.mechanism_report import joined_in_time

    count = len(monitor.runs)
    if count <= first + 1:
        return [monitor.report()]
    chains: list[list[BoundReport]] = []
    for i, run in enumerate(monitor.runs[first:], first):
        of_bodies = run if isinstance(run, tuple) else (run,)
        if not (chains and all(one.continues for one in of_bodies)):
            chains.append([])
        chains[-1].append(monitor.report(i))
    return [joined_in_time(chain) for chain in chains]


@contextmanager
def _kept_in_sys(mbs: Any, solver: Any, settings: Any, is_static: bool) -> Iterator[None]:
    """Let mbs.sys hold the solver while it runs, as storeSolver=True has it: monitors read its scheme there."""
    own = {("staticSolver" if is_static else "dynamicSolver"): solver, "simulationSettings": settings}
    before = {key: mbs.sys[key] for key in own if key in mbs.sys}
    mbs.sys.update(own)
    try:
        yield
    finally:
        for key, value in own.items():
            if key in before:
                mbs.sys[key] = before[key]
            elif mbs.sys.get(key) is value:
                del mbs.sys[key]
