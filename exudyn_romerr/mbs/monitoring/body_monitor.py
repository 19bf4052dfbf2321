"""Watch: monitors one body along the solves of its mbs, fed with blocks of accepted steps."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import RunError
from ...online.initial_condition import begins_late, loads_jump
from ...online.run import Run
from ...online.run_messages import doubts_in, stopped_or_ended
from ...online.run_record import UNKNOWN, SolverFacts
from ...online.static_run import StaticRun
from ...online.tolerance_check import ToleranceCheck
from ...report.scope import FROZEN
from ..access.mbs_items import end_time, newton_tolerance, solver_name
from .run_succession import Succession

if TYPE_CHECKING:
    from ...offline.prepared import Offline
    from ...online.run import Opening
    from ...trajectory.samples import Extension
    from ..access.linear_adapter import LinearSubject
    from ..floating.moving_subject import MovingSubject


class Watch:
    """One monitored body; what kind of body it is only its subject knows.

    It holds neither the mbs nor anything that does: the mbs holds the hook, the hook holds this, and Python
    cannot collect a circle that runs through C++.

    subject : the body. runs, run : those so far, the one under way. error, failure : what went wrong in the last
    solve, an exception, and in words, with what is left. stopped : whether a tolerance was exceeded in it, as `check`
    finds.
    """

    def __init__(self, subject: LinearSubject | MovingSubject, tolerance: dict[str, float]):
        self.item, self.tolerance, self.check = subject.item, tolerance, ToleranceCheck(tolerance)
        self.succession = Succession()
        self.runs = self.succession.runs
        self.error: Exception | None = None
        self._pending: Exception | None = None  # an error that counts when the steps before it do
        self.stopped, self.failure = False, ""
        self.subject = subject
        self._listens = False  # from the begin of a solve on, until the simulation diverges
        self._late = False  # the run starts later than the solve
        self.run: Run | StaticRun | None = None
        # set by begin
        self._kind: type[Run] = Run
        self._offline: Offline | None = None
        self._solver = UNKNOWN
        self._columns: Any = None
        self.width = 1  # numbers that its bounds compute with at a step
        # of the rows that Mechanism.take evaluates, set by receive and segment
        self.rows: tuple = ()
        self.opening: Opening | None = None
        self.extension: Extension | None = None
        self._opened = self._newest = ()

    @property
    def enriched(self) -> Any:
        """The body with auxiliary vectors that react with the mechanism, if it has such."""
        return self.subject.enriched

    def bounded_until(self) -> float:
        """Return the time of the last step that was bounded in the run under way."""
        return self.succession.last[0]

    @property
    def is_coupled(self) -> bool:
        """Whether its bounds are those of the mechanism, and need those of other bodies."""
        return self.error is None and self._listens and self._offline.scene.coupled

    @property
    def is_alone(self) -> bool:
        """Whether it needs nothing of the mechanism: neither bounds nor estimates know its feedback."""
        return not self.is_coupled and not (self.is_frozen and self.enriched is not None)

    @property
    def is_frozen(self) -> bool:
        """Whether its bounds have frozen inputs, though something reacts to the body."""
        return self.error is None and self._offline.scene.scope == FROZEN

    @property
    def kind(self) -> tuple:
        """What has to be the same for all bodies of a mechanism: which bounds, over which streams."""
        return self.shares_energy, self._offline.time

    @property
    def shares_energy(self) -> bool:
        """Whether the energy of the modes alone is bounded."""
        return "energy" in self._offline.estimators

    def sampled(self, t: np.ndarray, *states: np.ndarray) -> tuple:
        """Return q, q_t, q_tt, u and the frame of rows of the mbs."""
        return self.subject.sampled(t, *(state[:, self._columns].copy() for state in states))

    def begin(self, mbs: Any, static: bool, attached: Collection[int] = (), others: str = "") -> None:
        """A solve begins: read the mbs. The first row taken will open a run."""
        self.error, self.failure, self.stopped, self.run, self._listens = None, "", False, None, True
        self._pending, self._late, self.check = None, False, ToleranceCheck(self.tolerance)
        self._kind = StaticRun if static else Run
        with self.kept_errors():
            self._offline = self.subject.read(mbs, static, attached, others)
            self.width = self._offline.width
            facts = end_time(mbs, static), newton_tolerance(mbs, static), self.subject.floor
            self._solver = SolverFacts(*facts, name="" if static else solver_name(mbs))
            self._columns = self.subject.columns

    @contextmanager
    def kept_errors(self) -> Iterator[None]:
        """Keep an exception for the report; the simulation goes on without bounds."""
        try:
            yield
        except Exception as error:
            self.error = error

    def receive(self, t: np.ndarray, *states: np.ndarray) -> None:
        """Phase 1 of Mechanism.take: look at rows t (S,), q, q_t, q_tt; what a run opens with is in `opening` then.

        In a mechanism the watches of all bodies take the phases together: bounds of one need the others' segments.
        """
        self.opening, self.extension, self.rows = None, None, ()
        if self.error is None and self._listens:
            with self.kept_errors():
                self._look(t.copy(), *(state[:, self._columns].copy() for state in states))

    def postpone(self) -> None:
        """Leave the run closed: other bodies cannot open theirs yet."""
        self.run, self.opening, self.rows, self._late = None, None, (), True

    def open(self) -> None:
        """Phase 2: open the run that phase 1 found."""
        if self.error is None and self.opening is not None:
            with self.kept_errors():
                self.run.open(self.opening)

    def admit(self) -> None:
        """Phase 2, when all that belongs to it was opened: from now on the run has a report."""
        if self.error is None and self.opening is not None:
            self.succession.add(self.run, self._offline, self._opened)
            self.run.settle()

    def segment(self) -> None:
        """Phase 3: make segments of the rows that go on, in `extension`; samples are kept in `rows`."""
        if self.error is None and self.rows and self.run is not None:
            t, *states = self.rows
            with self.kept_errors():
                self.extension = self._extension(t, *states)
            if self.error is not None and not self._offline.scene.coupled:
                self._pending, self.error = self.error, None
                with self.kept_errors():
                    self._extend_by_part(t, *states)

    def _extension(self, *rows: np.ndarray) -> Extension:
        self.rows = rows[0], *self.subject.sampled(*rows)
        return self.run.extension(*self.rows)

    def _extend_by_part(self, *rows: np.ndarray) -> None:
        """Go on by the steps before the first that fails; the error counts when they do."""
        good, bad = 0, len(rows[0])
        while bad - good > 1:
            middle = (good + bad) // 2
            try:
                self.extension = self._extension(*(x[:middle] for x in rows))
                good = middle
            except type(self._pending):  # any other one is an error of its own
                bad = middle
        self._newest = tuple(x[good - 1] for x in rows)  # not taken if there are none

    def advance(self) -> None:
        """Phase 4: advance the bounds."""
        if self.error is None and self.extension is not None:
            with self.kept_errors():
                self.run.advance(self.extension)

    def settle(self) -> None:
        """Phase 5: what was advanced counts; it is compared with the tolerance, and the solve stopped if larger."""
        if self.error is not None or self.run is None:
            return
        if self.extension is not None:
            self.run.settle()
            self.succession.last = self._newest
        self.error, self._pending = self._pending, None
        with self.kept_errors():
            for reason in self.check.exceeded(self.run):
                self.stopped, t = True, self.bounded_until()
                self.note(f"{stopped_or_ended(t, self.run.solver)} at t = {t:g}: {reason}")

    def forget_block(self) -> None:
        """Let the rows go: blocks are large, and the next is made anew."""
        self.opening, self.extension, self.rows = None, None, ()

    def note(self, message: str) -> None:
        """Add a line to the head of the current run's report."""
        if self.run is not None:
            self.run.messages.append(message)

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

    def _look(self, t: np.ndarray, *states: np.ndarray) -> None:
        if not all(np.isfinite(state).all() for state in states):
            finite = np.logical_and.reduce([np.isfinite(state).all(axis=1) for state in states])
            self._diverge(t[np.argmin(finite)])
            t, *states = (rows[: np.argmin(finite)] for rows in (t, *states))
        if not t.size:
            return
        if self._kind is StaticRun:  # a static solver leaves old rates behind
            states = [states[0], 0 * states[1], 0 * states[2]]
        self._newest = (t[-1], *(state[-1].copy() for state in states))
        if self.run is None:
            self._opened = (t[0], *(state[0].copy() for state in states))
            self._start(*self._opened)
            t, *states = (rows[1:] for rows in (t, *states))
        if self.run is not None:
            self.rows = (t, *states) if t.size else ()

    def _start(self, t: float, *states: np.ndarray) -> None:
        before, why_not = None, ""
        if self._kind is not StaticRun:
            before, why_not = self.succession.before(self._offline, t, *states[:2])
        if before is None:
            offline = self._offline
        else:
            offline = self._offline.from_static() if before.is_static else before.offline
        run = self._kind(offline, self._solver, self.tolerance)
        run.messages += [why_not] if why_not else doubts_in(() if before is None else before.messages)
        first = self.succession.first_sample(self.subject, before, t, *states)
        if first is None:
            self._late = True
            return
        self.opening = run.opening(t, *first, after=before)
        if before is not None and before.is_static:
            run.messages += loads_jump(run.offline, self.opening.first, self.opening.rest)
        if self._late and self._kind is Run:
            run.messages.append(begins_late(t))
        goes_on_late = before is not None and not before.is_static and before.begins_late
        run.begins_late = self._late or goes_on_late
        self.run = run

    def _diverge(self, t: float) -> None:
        if self.run is None:
            raise RunError(f"object {self.item} starts at t = {t:g} with nan or inf among its coordinates")
        self._listens = False
        self.note(f"the simulation diverged: nan or inf at t = {t:g}; bounds end before")
