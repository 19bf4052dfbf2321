"""Solves of a script, each watched by monitors of the bodies that it moves, without a line of ours in the script."""

from __future__ import annotations

import os
from contextlib import contextmanager
from functools import wraps
from time import process_time
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

from ...offline.options import BoundOptions
from ...process.blas_threads import one_thread
from ...report.watched_solve import Solve
from ..access.mbs_items import sensor_name
from ..floating.floating_body import floating_body
from ..monitoring.attach import attach
from ..monitoring.monitor import MechanismMonitor, Monitor
from ..monitoring.requests import make_subject
from ..monitoring.step_hook import StepHook, slot_function
from .chosen_outputs import chosen_outputs
from .found_bodies import NO_FEM, FoundBodies, FoundBody

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    from ..floating.floating_body import FloatingBody

DYNAMIC = ("MainSolverImplicitSecondOrder", "MainSolverExplicit")
STATIC = "MainSolverStatic"
ATTACHED_BY_SCRIPT = "the script attaches monitors of its own"


class Asked(NamedTuple):
    """The bodies that a monitor of ours was made for, by number, and why others have none."""

    numbers: tuple[int, ...]
    refused: tuple[tuple[str, str], ...]
    chosen: bool


class WatchedSolves:
    """Stands in front of Exudyn's solvers and keeps a Solve of each; what goes wrong is in there, never raised.

    solves : in their order. plain : how many had no reduced flexible body. elsewhere : a file to which other
    processes write a byte for each solve of theirs, which is not watched.
    """

    def __init__(self, bodies: FoundBodies, elsewhere: str = ""):
        self.bodies, self.solves, self.plain = bodies, [], 0
        self._elsewhere, self._process = elsewhere, os.getpid()
        self._asked: WeakKeyDictionary[Any, Asked] = WeakKeyDictionary()
        self._installed: list[tuple[Any, str, Any]] = []
        self._open: dict[int, Any] = {}  # solves step by step, by the solver's identity
        self._is_inside = False

    def install(self, exudyn: ModuleType) -> None:
        """Stand in front of the solvers' functions; what they do and return stays the same."""
        for name in (*DYNAMIC, STATIC):
            solver = getattr(exudyn, name)
            self._replace(solver, "SolveSystem", self._solved(solver.SolveSystem, name == STATIC))
        for name in DYNAMIC:
            solver = getattr(exudyn, name)
            self._replace(solver, "InitializeSolver", self._begun(solver.InitializeSolver))
            self._replace(solver, "FinalizeSolver", self._ended(solver.FinalizeSolver))

    def uninstall(self) -> None:
        """Put back Exudyn's own functions."""
        while self._installed:
            setattr(*self._installed.pop())

    def _replace(self, owner: Any, name: str, function: Any) -> None:
        self._installed.append((owner, name, getattr(owner, name)))
        setattr(owner, name, function)

    def _solved(self, solve_system: Any, is_static: bool) -> Any:
        @wraps(solve_system)
        def SolveSystem(solver: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
            if self._is_inside:  # ours, or another one of Exudyn's within it
                return solve_system(solver, mbs, *arguments, **options)
            settings = arguments[0] if arguments else next(iter(options.values()), None)
            solve, monitor = self._begin(mbs, is_static)
            with self._kept_in_sys(mbs, solver, settings, is_static) if monitor else _nothing():
                begin = process_time()
                try:
                    return solve_system(solver, mbs, *arguments, **options)
                finally:
                    if solve is not None:
                        solve.seconds = process_time() - begin
                    self._end(solve, monitor)

        return SolveSystem

    def _begun(self, initialize: Any) -> Any:
        @wraps(initialize)
        def InitializeSolver(solver: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
            if not self._is_inside:
                self._open[id(solver)] = self._begin(mbs, False)
            return initialize(solver, mbs, *arguments, **options)

        return InitializeSolver

    def _ended(self, finalize: Any) -> Any:
        @wraps(finalize)
        def FinalizeSolver(solver: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
            try:
                return finalize(solver, mbs, *arguments, **options)
            finally:
                self._end(*self._open.pop(id(solver), (None, None)))

        return FinalizeSolver

    @contextmanager
    def _kept_in_sys(self, mbs: Any, solver: Any, settings: Any, is_static: bool) -> Iterator[None]:
        """Let mbs.sys hold the solver while it runs, as storeSolver=True has it: what is read of it is read there."""
        own = {("staticSolver" if is_static else "dynamicSolver"): solver, "simulationSettings": settings}
        before = {key: mbs.sys[key] for key in own if key in mbs.sys}
        if all(before.get(key) is value for key, value in own.items()):
            yield
            return
        mbs.sys.update(own)
        try:
            yield
        finally:
            for key, value in own.items():
                if key in before:
                    mbs.sys[key] = before[key]
                elif mbs.sys.get(key) is value:
                    del mbs.sys[key]

    def _begin(self, mbs: Any, is_static: bool) -> tuple[Solve | None, Any]:
        """Attach monitors, if there is anything to watch; return what is known, and the monitor of this solve."""
        if os.getpid() != self._process:
            self._note_elsewhere()
            return None, None
        bodies = self.bodies.of(mbs)
        if not bodies:
            self.plain += 1
            return None, None
        solve = Solve(len(self.solves), "static" if is_static else "dynamic", len(bodies))
        self.solves.append(solve)
        self._is_inside = True
        begin = process_time()
        try:
            return solve, self._monitor(mbs, solve)
        except Exception as error:  # whatever it is: the script goes on, and the answer says why there is no number
            solve.failure = error
            return solve, None
        finally:
            solve.our_seconds += process_time() - begin
            self._is_inside = False

    def _end(self, solve: Solve | None, monitor: Any) -> None:
        if solve is None or monitor is None:
            return
        begin = process_time()
        try:
            solve.report = monitor.report()
        except Exception as error:  # as in _begin
            solve.failure = error
        solve.our_seconds += process_time() - begin

    def _note_elsewhere(self) -> None:
        if self._elsewhere:
            with open(self._elsewhere, "ab") as file:
                file.write(b".")

    @one_thread()
    def _monitor(self, mbs: Any, solve: Solve) -> Any:
        """Return the monitor of the bodies that the mbs has now: the one of the solve before, or a new one."""
        numbers = tuple(body.number for body in self.bodies.of(mbs))
        hook, asked = getattr(slot_function(mbs), "hook", None), self._asked.get(mbs)
        solve.sensors = _sensor_names(mbs)
        if isinstance(hook, StepHook) and hook.watches:
            if asked is None:
                solve.notes.append(ATTACHED_BY_SCRIPT)
                return _monitor_of(mbs, hook)
            if asked.numbers == numbers:
                solve.refused, solve.chosen = list(asked.refused), asked.chosen
                return _monitor_of(mbs, hook)
            mbs.SetPostStepUserFunction(hook.user or 0)
        flexes, solve.refused = self._readable(mbs)
        self._asked[mbs] = Asked(numbers, tuple(solve.refused), False)
        if not flexes:
            return None
        outputs = chosen_outputs(mbs, flexes)
        solve.chosen = outputs is not None
        self._asked[mbs] = Asked(numbers, tuple(solve.refused), solve.chosen)
        return attach(mbs, list(flexes), outputs=outputs)

    def _readable(self, mbs: Any) -> tuple[list[Any], list[tuple[str, str]]]:
        """Return the bodies that can be read, and (which, why not) of the others."""
        found = [(body, _flex_or_reason(mbs, body)) for body in self.bodies.of(mbs)]
        refused = [(_named(mbs, body), why) for body, why in found if isinstance(why, str)]
        return [flex for _, flex in found if not isinstance(flex, str)], refused


def _flex_or_reason(mbs: Any, body: FoundBody) -> FloatingBody | str:
    """Return the body as attach wants it, or why it cannot be read."""
    if body.fem is None:
        return NO_FEM
    try:
        flex = floating_body(body.fem, body.items(mbs))
        make_subject(mbs, flex, BoundOptions(outputs=[]), "auto", alone=False)
    except Exception as error:  # whatever it is: the other bodies, and the script, go on
        return str(error)
    return flex


def _named(mbs: Any, body: FoundBody) -> str:
    name = mbs.GetObject(body.number)["name"]
    return f"body {body.number}{name and f' ({name})'}"


@contextmanager
def _nothing() -> Iterator[None]:
    yield


def _monitor_of(mbs: Any, hook: StepHook) -> Any:
    monitors = [Monitor(mbs, hook, watch) for watch in hook.watches]
    return MechanismMonitor(mbs, monitors, hook.sensors[-1]) if hook.sensors else monitors[0]


def _sensor_names(mbs: Any) -> list[str]:
    return [sensor_name(mbs, i) for i in range(mbs.systemData.NumberOfSensors())]
