"""MonitoredBody: monitors one body along the solves of its mbs, fed with blocks of accepted steps."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import RunError
from ...linear.run.record import UNKNOWN, SolverFacts
from ...linear.run.run import BLOCK, Run, doubts_in
from ..access.mbs_items import end_time, newton_tolerance, solver_name
from .run_succession import Succession
from .tolerance_check import ToleranceCheck

if TYPE_CHECKING:
    from ...linear.run.offline import Offline
    from ...linear.trajectory.samples import Extension
    from ...report.data import Plan
    from ..access.linear_adapter import LinearSubject
    from ..floating.moving_subject import MovingSubject
    from .mechanism_run import BodyRun, MechanismRun


AT_ONCE = "it is told when the run has ended"


class MonitoredBody:
    """One monitored body; what kind of body it is only its subject knows.

    It holds neither the mbs nor anything that does: the mbs holds the hook, the hook holds this, and Python
    cannot collect a circle that runs through C++.

    subject : the body. runs, run : those so far, the one under way. error, failure : what went wrong in the last
    solve, an exception, and in words, with what is left. stopped : whether a tolerance was exceeded in it, as `check`
    finds. told : what the mechanism will tell of the solve under way, from all its rows at once; None: bounds are
    those of the body alone, which `run` has also where they are needed at once.
    """

    def __init__(self, subject: LinearSubject | MovingSubject, tolerance: dict[str, float]):
        self.item, self.tolerance, self.check = subject.item, tolerance, ToleranceCheck(tolerance)
        self.succession = Succession()
        self.runs: list[Run | BodyRun] = []
        self.error: Exception | None = None
        self._pending: Exception | None = None  # an error that counts when the steps before it do
        self.stopped, self.failure = False, ""
        self.told: BodyRun | None = None
        self.is_told = False  # from the begin of a solve on, before `told` is there
        self.subject = subject
        self._listens = False  # from the begin of a solve on, until the simulation diverges
        self._late = False  # the run starts later than the solve
        self.run: Run | None = None
        # set by begin
        self._static = False
        self._offline: Offline | None = None
        self._solver = UNKNOWN
        self._columns: Any = None
        self.width = 1  # numbers that its bounds compute with at a step
        self._newest: tuple = ()

    def bounded_until(self) -> float:
        """Return the time of the last step that was bounded in the run under way."""
        return self.succession.last[0]

    def begin(self, mbs: Any, static: bool, why_not: str = "") -> None:
        """A solve begins: read the mbs. The first row taken will open a run; why_not : no mechanism can tell."""
        self.error, self.failure, self.stopped, self.run, self._listens = None, "", False, None, False
        self._pending, self._late, self.check = None, False, ToleranceCheck(self.tolerance)
        self._static, self.is_told, self.told = static, False, None
        with self.kept_errors():
            self.is_told = self.subject.is_told(mbs, static, why_not)
        if self.error is None and (not self.is_told or self.subject.is_live):
            self._begin_alone(mbs, static, why_not or AT_ONCE)

    def _begin_alone(self, mbs: Any, static: bool, why_not: str) -> None:
        self._listens = True
        with self.kept_errors():
            self._offline = self.subject.read(mbs, static, why_not)
            self.width = self._offline.width
            facts = end_time(mbs, static), newton_tolerance(mbs, static), self.subject.floor
            self._solver = SolverFacts(*facts, name="" if static else solver_name(mbs))
            self._columns = self.subject.columns

    def plan(self, mbs: Any, why_not: str) -> tuple[Plan, bool]:
        """Return what would be computed if a solve began now, and whether the mechanism would tell."""
        if self.subject.is_told(mbs, False, why_not):
            return self.subject.told_plan(), True
        return self.subject.read(mbs, False, why_not).plan, False

    def run_told(self, run: BodyRun) -> None:
        """The mechanism will tell of the solve that begins."""
        self.told = run
        self.runs.append(run)

    def fall_back(self, mbs: Any, run: MechanismRun) -> None:
        """The mechanism cannot tell: evaluate its rows alone, under frozen inputs, unless the other was asked for."""
        self.runs.remove(self.told)
        self.run, self.told, self.is_told, notes = None, None, False, self.told.messages
        with self.kept_errors():
            self.subject.require_frozen(run.error)
        if self.error is not None:
            return
        self._begin_alone(mbs, run.is_static, str(run.error))
        rows = run.rows()
        for first in range(0, len(rows), BLOCK):
            part = rows[first : first + BLOCK]
            self.take(part.t, part.q, part.v, part.a)
        for note in notes:
            self.note(note)

    @contextmanager
    def kept_errors(self) -> Iterator[None]:
        """Keep an exception for the report; the simulation goes on without bounds."""
        try:
            yield
        except Exception as error:
            self.error = error

    def take(self, t: np.ndarray, *states: np.ndarray) -> None:
        """Evaluate rows t (S,), q, q_t, q_tt (S, all coordinates of the mbs)."""
        if self.error is None and self._listens:
            with self.kept_errors():
                self._take(t.copy(), *(state[:, self._columns].copy() for state in states))
        if self.error is None and self._pending is not None:
            self.error, self._pending = self._pending, None

    def _take(self, t: np.ndarray, *states: np.ndarray) -> None:
        t, *states = self._finite(t, *states)
        if not t.size:
            return
        if self._static:  # a static solver leaves old rates behind
            states = [states[0], 0 * states[1], 0 * states[2]]
        if self.run is None:
            first = t[0], *(state[0].copy() for state in states)
            if not self._start(*first):
                self._late = True
            t, *states = (rows[1:] for rows in (t, *states))
        if self.run is not None and t.size:
            self._extend(t, *states)
        if self.run is not None:
            self._compare()

    def _extend(self, *rows: np.ndarray) -> None:
        """Go on by rows; where one of them fails by those before it, and the error counts when these do."""
        self._pending, extension, good = None, None, len(rows[0])
        try:
            extension = self._extension(*rows)
        except Exception as error:
            self._pending, good, bad = error, 0, len(rows[0])
            while bad - good > 1:
                middle = (good + bad) // 2
                try:
                    extension = self._extension(*(x[:middle] for x in rows))
                    good = middle
                except type(error):  # any other one is an error of its own
                    bad = middle
        if extension is not None:
            self.run.advance(extension)
            self.run.settle()
            self.succession.last = tuple(x[good - 1].copy() for x in rows)

    def _extension(self, t: np.ndarray, *states: np.ndarray) -> Extension:
        return self.run.extension(t, *self.subject.sampled(t, *states))

    def _compare(self) -> None:
        """Compare with the tolerance; stop the solve if the bound is larger."""
        for reason in self.check.exceeded(self.run):
            self.stopped, t = True, self.bounded_until()
            if self.told is not None:
                self.told.stopped = t
            ended = "the run ended" if self.run.solver.ends_early(t) is False else "stopped"
            self.note(f"{ended} at t = {t:g}: {reason}")

    def note(self, message: str) -> None:
        """Add a line to the head of the current run's report."""
        for run in (self.run, self.told):
            if run is not None:
                run.messages.append(message)

    def note_error(self, t: float) -> None:
        """Say once, in the report of what was kept, why bounds end before t."""
        if self.error is None or self.failure:
            return
        text, run = f"{type(self.error).__name__}: {self.error}", self.run
        self.failure = f"there are no bounds, report() raises {text}"
        if run is not None and run in self.runs[-1:]:
            until = f"bounds end at t = {run.times[-1]:g}"
            self.failure = f"{until}, report() raises {text}"
            self.note(f"{until}: the steps up to t = {t:g} could not be evaluated, {text}")

    def _finite(self, t: np.ndarray, *states: np.ndarray) -> tuple[np.ndarray, ...]:
        """The rows before the simulation diverges."""
        finite = np.logical_and.reduce([np.isfinite(state).all(axis=1) for state in states])
        if finite.all():
            return t, *states
        count = int(np.argmin(finite))
        self._diverge(t[count])
        return tuple(rows[:count] for rows in (t, *states))

    def _start(self, t: float, *states: np.ndarray) -> bool:
        """Open a run with its first row; return whether it could begin: accelerations may not be set yet."""
        before, why_not = None, ""
        if not self._static:
            before, why_not = self.succession.before(self._offline, t, *states[:2])
        if before is None:
            offline = self._offline
        else:
            offline = self._offline.from_static() if before.is_static else before.offline
        run = Run(offline, self._solver, self.tolerance, self._static)
        run.messages += [why_not] if why_not else doubts_in(() if before is None else before.messages)
        first = self.succession.first_sample(self.subject, before, t, *states)
        if first is None:
            return False
        run.start(t, *first, after=before, is_late=self._late)
        self.run = run
        self.succession.add(run, self._offline, (t, *states))
        if self.told is None:
            self.runs.append(run)
        run.settle()
        return True

    def _diverge(self, t: float) -> None:
        if self.run is None:
            raise RunError(f"object {self.item} starts at t = {t:g} with nan or inf among its coordinates")
        self._listens = False
        self.note(f"the simulation diverged: nan or inf at t = {t:g}; bounds end before")
