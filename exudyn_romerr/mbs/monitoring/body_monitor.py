"""Watch: the bounds of one body along the solves of its mbs, fed with blocks of accepted steps."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import RunError
from ...online.initial_condition import LOADS_JUMP, loads_jump
from ...online.run import Run
from ...online.static_run import StaticRun
from ...report.scope import FROZEN
from ..access.mbs_items import end_time, newton_tolerance

if TYPE_CHECKING:
    from ...offline.prepare import Offline
    from ...online.run import Extension
    from ..floating.enriched_body import EnrichedBody
    from .floating_adapter import MovingSubject
    from .linear_adapter import LinearSubject


SAME = 1e-9  # of a time: solvers add up their steps, and users give the next start as they think of it


class Watch:
    """One monitored body; what kind of body it is only its subject knows.

    It holds neither the mbs nor anything that does: the mbs holds the hook, the hook holds this, and Python
    cannot collect a circle that runs through C++.

    Attributes
    ----------
    subject : the body
    runs : list of Run or StaticRun
    error, failure : Exception or None, str
        What went wrong in the last solve, and in words, with what is left.
    stopped : bool
        A tolerance was exceeded in the last solve.
    """

    def __init__(self, subject: LinearSubject | MovingSubject, tolerance: dict[str, float]):
        self.item, self.tolerance = subject.item, tolerance
        self.runs: list[Run | StaticRun] = []
        self.error: Exception | None = None
        self._pending: Exception | None = None  # an error that counts when the steps before it do
        self.stopped, self.failure = False, ""
        self.subject = subject
        self._listens = False  # from the begin of a solve on, until the simulation diverges
        self._run: Run | StaticRun | None = None
        self._changed = False  # the mbs, since the run that this one starts at the end of
        self._last: tuple | None = None  # time, q, q_t, q_tt of the last row evaluated

    @property
    def stops(self) -> bool:
        """Whether the solve is to be stopped."""
        return self.stopped or self.error is not None

    @property
    def enriched(self) -> EnrichedBody | None:
        """The body with auxiliary vectors that react with the mechanism, if it has such."""
        return getattr(self.subject, "enriched", None)

    @property
    def run(self) -> Run | StaticRun | None:
        """The run that is under way."""
        return self._run

    def bounded_until(self) -> float:
        """Return the time of the last step that was bounded in the run under way."""
        return self._last[0]

    @property
    def is_coupled(self) -> bool:
        """Whether its bounds are those of the mechanism, and need those of other bodies."""
        return self.error is None and self._listens and self._offline.scene.coupled

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
        return self.subject.sampled(t, *(state[:, self._columns] for state in states))

    def read(self, mbs: Any, static: bool = False, attached: Collection[int] = (), others: str = "") -> Offline:
        """Read the mbs; return what the bounds are made with, or raise if their assumptions do not hold there.

        attached: objects that are watched. others: why these have no coupled bounds; this one has none either then.
        """
        return self.subject.read(mbs, static, attached, others)

    def begin(self, mbs: Any, static: bool, attached: Collection[int] = (), others: str = "") -> None:
        """A solve begins: read the mbs. The first row taken will open a run."""
        self.error, self.failure, self.stopped, self._run, self._listens = None, "", False, None, True
        self._pending, self._late = None, False  # late: the run starts later than the solve
        self._kind = StaticRun if static else Run
        with self.kept_errors():
            self._offline = self.read(mbs, static, attached, others)
            self._end_time, self._newton_tolerance = end_time(mbs, static), newton_tolerance(mbs, static)
            self._columns = self.subject.columns

    @contextmanager
    def kept_errors(self) -> Iterator[None]:
        """Keep an exception for the report; the solve will be stopped."""
        try:
            yield
        except Exception as error:
            self.error = error

    def receive(self, t: np.ndarray, *states: np.ndarray) -> None:
        """Phase 1 of Mechanism.take: look at rows t (S,), q, q_t, q_tt; what a run opens with is in `opening` then.

        In a mechanism the watches of all bodies take the phases together: bounds of one need the others' segments.
        """
        self.opening = self.extension = None
        self.rows: tuple = ()
        if self.error is None and self._listens:
            with self.kept_errors():
                self._look(t.copy(), *(state[:, self._columns].copy() for state in states))

    def postpone(self) -> None:
        """Leave the run closed: other bodies cannot open theirs yet."""
        self._run, self.opening, self.rows, self._late = None, None, (), True

    def open(self) -> None:
        """Phase 2: open the run that phase 1 found."""
        if self.error is None and self.opening is not None:
            with self.kept_errors():
                self._run.open(self.opening)

    def admit(self) -> None:
        """Phase 2, when all that belongs to it was opened: from now on the run has a report."""
        if self.error is None and self.opening is not None:
            self.runs.append(self._run)
            self._run.settle()
            self._last = self._opened

    def segment(self) -> None:
        """Phase 3: make segments of the rows that go on, in `extension`; samples are kept in `rows`."""
        if self.error is None and self.rows and self._run is not None:
            t, *states = self.rows
            with self.kept_errors():
                self.extension = self._extension(t, *states)
            if self.error is not None and not self._offline.scene.coupled:
                self._extend_by_part(t, *states)

    def _extension(self, *rows: np.ndarray) -> Extension:
        self.rows = rows[0], *self.subject.sampled(*rows)
        return self._run.extension(*self.rows)

    def _extend_by_part(self, *rows: np.ndarray) -> None:
        """Go on by the steps before the first that fails; the error counts when they do."""
        self._pending, self.error = self.error, None
        good, bad = 0, len(rows[0])
        while bad - good > 1:
            middle = (good + bad) // 2
            try:
                self.extension = self._extension(*(x[:middle] for x in rows))
                good = middle
            except Exception:
                bad = middle
        self._newest = tuple(x[good - 1] for x in rows)  # not taken if there are none

    def advance(self) -> None:
        """Phase 4: advance the bounds."""
        if self.error is None and self.extension is not None:
            with self.kept_errors():
                self._run.advance(self.extension)

    def settle(self) -> None:
        """Phase 5: what was advanced counts; it is compared with the tolerance, and the solve stopped if larger."""
        if self.error is not None or self._run is None:
            return
        if self.extension is not None:
            self._run.settle()
            self._last = self._newest
        self.error, self._pending = self._pending, None
        with self.kept_errors():
            self._compare(self.bounded_until())

    def note(self, message: str) -> None:
        """Add a line to the head of the current run's report."""
        if self._run is not None:
            self._run.messages.append(message)

    def note_error(self, t: float) -> None:
        """Say once, in the report of what was kept, why bounds end before t."""
        if self.error is None or self.failure:
            return
        text, run = f"{type(self.error).__name__}: {self.error}", self._run
        self.failure = f"there are no bounds, report() raises {text}"
        if run is not None and run in self.runs[-1:]:
            until = f"bounds end at t = {run.last_time:g}"
            self.failure = f"{until}, report() raises {text}"
            self.note(f"{until}: the steps up to t = {t:g} could not be evaluated, {text}")

    def _look(self, t: np.ndarray, *states: np.ndarray) -> None:
        finite = np.logical_and.reduce([np.isfinite(state).all(axis=1) for state in states])
        if not finite.all():
            self._diverge(t[np.argmin(finite)])
            t, *states = (rows[: np.argmin(finite)] for rows in (t, *states))
        if not t.size:
            return
        if self._kind is StaticRun:  # a static solver leaves old rates behind
            states = [states[0], 0 * states[1], 0 * states[2]]
        self._newest = (t[-1], *(state[-1] for state in states))
        if self._run is None:
            self._opened = (t[0], *(state[0] for state in states))
            self._start(*self._opened)
            t, *states = (rows[1:] for rows in (t, *states))
        if self._run is not None:
            self.rows = (t, *states) if t.size else ()

    def _start(self, t: float, *states: np.ndarray) -> None:
        before = None if self._kind is StaticRun else self._run_before(t, *states[:2])
        if before is None:
            offline = self._offline
        else:
            offline = self._offline.from_static() if before.is_static else before.offline
        run = self._kind(offline)
        run.source = self._offline
        if before is None and self._changed:
            run.messages.append("the mbs was changed since the run before: its error so far is not carried over")
        first = self._first(t, before, *states)
        if first is None:
            self._late = True
            return
        self.opening = run.opening(t, *first, after=before)
        if before is not None and before.is_static and loads_jump(self.opening, run):
            run.messages.append(LOADS_JUMP)
        if self._late and self._kind is Run:
            run.messages.append(f"the solver has no accelerations at its start: bounds begin at t = {t:g} s")
        run.floor, run.end_time, run.newton_tolerance = self.subject.floor, self._end_time, self._newton_tolerance
        self._run = run

    def _first(self, t: float, before: Run | None, *states: np.ndarray) -> tuple | None:
        """Return the first sample; a run that continues another has the accelerations that one ended with."""
        first = self.subject.first(t, *states)
        if first is None and before is not None:
            first = self.subject.first(t, *states[:2], self._last[3], may_be_late=True)
        return first

    def _run_before(self, t: float, q: np.ndarray, q_t: np.ndarray) -> Run | None:
        """Return the run in whose last state this one starts: also a static one, if no initial state was given."""
        self._changed = False
        if not self.runs:
            return None
        before, (t_last, q_last, q_t_last, _) = self.runs[-1], self._last
        if not np.array_equal(q, q_last):
            return None
        if before.is_static:
            released = self._offline.initial is None and not q_t.any()
            return before if released and before.inputs == self._offline.balance.coordinates.p else None
        if abs(t - t_last) > SAME * abs(t_last) or not np.array_equal(q_t, q_t_last):
            return None
        self._changed = before.source is not self._offline
        return None if self._changed else before

    def _diverge(self, t: float) -> None:
        if self._run is None:
            raise RunError(f"object {self.item} starts at t = {t:g} with nan or inf among its coordinates")
        self._listens = False
        self.note(f"the simulation diverged: nan or inf at t = {t:g}; bounds end before")

    def _compare(self, t: float) -> None:
        best = self._run.best_now() if self.tolerance else {}
        for name, limit in self.tolerance.items():
            if not np.all(best[name] <= limit):
                self.stopped = True
                bound = np.max(best[name])
                self.note(f"stopped at t = {t:g}: tolerance on {name!r} exceeded, {bound:.3g} > {limit:g}")
