"""MonitoredBody: one body along the solves of its mbs; Succession of its runs, ToleranceCheck of their bounds."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import RunError
from ...linear.run.balance import UNKNOWN
from ...linear.run.record import doubts_in
from ...linear.run.run import BLOCK, Run
from ...report.scope import COUPLED, cures_of
from ...report.wording import for_run_alone, not_certified
from ..access.solvers import SAME_TIME, solver_facts

if TYPE_CHECKING:
    from ...linear.residual.samples import Extension
    from ...linear.run.prepare import Offline
    from ..access.reduced_body import LinearSubject
    from ..floating.moving_subject import MovingSubject
    from .mechanism_run import BodyRun, MechanismRun

AT_ONCE = "it is told when the run has ended"
# Steps that may be made before they are compared, as their evaluation one by one takes as long as tens of steps of
# the simulation: so many that a bound which rises twice as fast as it ever did among those before stays below its
# tolerance; but not fewer than FEWEST on the average, nor more than MOST
FEWEST, MOST = 16, 128
TINY = np.finfo(float).tiny


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
        self.subject, self.item, self.tolerance = subject, subject.item, tolerance
        self.succession = Succession()
        self.runs: list[Run | BodyRun] = []
        self._offline: Offline | None = None
        self._solver = UNKNOWN
        self.width = 1  # numbers that its bounds compute with at a step
        self._forget(static=False)

    def _forget(self, static: bool) -> None:
        """Nothing is known of the solve that begins."""
        self.run: Run | None = None
        self.told: BodyRun | None = None
        self.is_told = False  # from the begin of a solve on, before `told` is there
        self.error: Exception | None = None
        self._pending: Exception | None = None  # an error that counts when the steps before it do
        self.stopped, self.failure, self.check = False, "", ToleranceCheck(self.tolerance)
        self._static = static
        self._listens = False  # from the begin of a solve on, until the simulation diverges
        self._late = False  # the run starts later than the solve

    def begin(self, mbs: Any, static: bool, why_not: str = "") -> None:
        """A solve begins: read the mbs. The first row taken will open a run; why_not : no mechanism can tell."""
        self._forget(static)
        with self.kept_errors():
            offline = self.subject.read(mbs, static, why_not)
            self.is_told = offline is None
            if self.is_told and self.subject.is_live:
                offline = self.subject.read_alone(mbs, static, AT_ONCE)
            if offline is not None:
                self._begin_alone(mbs, offline)

    def _begin_alone(self, mbs: Any, offline: Offline) -> None:
        self._offline, self.width, self._listens = offline, offline.width, True
        self._solver = solver_facts(mbs, self._static, self.subject.floor)

    def fall_back(self, mbs: Any, run: MechanismRun) -> None:
        """The mechanism cannot tell: evaluate its rows alone, under frozen inputs, unless the other was asked for."""
        self.runs.remove(self.told)
        self.run, self.told, self.is_told, notes = None, None, False, self.told.messages
        if self.subject.scope == COUPLED:
            self.error = run.error
            return
        with self.kept_errors():
            self._begin_alone(mbs, self.subject.read(mbs, run.asked.is_static, str(run.error)))
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
                self._take(t.copy(), *(state[:, self.subject.columns].copy() for state in states))
        if self.error is None and self._pending is not None:
            self.error, self._pending = self._pending, None

    def _take(self, t: np.ndarray, *states: np.ndarray) -> None:
        t, *states = self._finite(t, *states)
        if not t.size:
            return
        if self._static:  # a static solver leaves old rates behind
            states = [states[0], 0 * states[1], 0 * states[2]]
        if self.run is None:
            if not self._start(t[0], *(state[0].copy() for state in states)):
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
            self.succession.last = tuple(x[good - 1].copy() for x in rows)

    def _extension(self, t: np.ndarray, *states: np.ndarray) -> Extension:
        return self.run.extension(t, *self.subject.sampled(t, *states))

    def _compare(self) -> None:
        """Compare with the tolerance; stop the solve if the bound is larger."""
        for reason in self.check.exceeded(self.run):
            self.stopped, t = True, self.succession.last[0]
            if self.told is not None:
                self.told.stopped = t
            ended = "the run ended" if self.run.solver.ends_early(t) is False else "stopped"
            self.note(f"{ended} at t = {t:g}: {reason}")

    def bounds_at(self, t: float) -> dict[str, np.ndarray]:
        """Return the smallest bound (r,) of each output at t; empty if t was not bounded."""
        is_bounded = self.run is not None and self.succession.last[0] == t
        return {name: rows[0] for name, rows in self.run.best_of_last(1).items()} if is_bounded else {}

    def scope(self) -> dict[str, str]:
        """Return what the bounds of the run under way cover, by estimator."""
        return dict.fromkeys(self.run.assumptions(), self.run.offline.scene.scope)

    def what_numbers_cannot_say(self) -> str:
        """Return in words why the bounds so far are not certified, and what they leave out; empty: nothing."""
        doubts, alone = self.run.doubts(), for_run_alone(self.scope())
        said = [alone and f"it holds {alone}", doubts and f"{not_certified(doubts)}: {cures_of(doubts)}"]
        return "; ".join(filter(None, said))

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
            offline = self._offline.from_static if before.is_static else before.offline
        run = Run(offline, self._solver, self.tolerance, self._static)
        run.messages += [why_not] if why_not else doubts_in(() if before is None else before.messages)
        first = self.subject.first(t, *states)
        if first is None and before is not None:  # with the accelerations that the run before ended with
            first = self.subject.first(t, *states[:2], self.succession.last[3], may_be_late=True)
        if first is None:
            return False
        run.start(t, *first, after=before, is_late=self._late)
        self.run = self.succession.run = run
        self.succession.source, self.succession.last = self._offline, (t, *states)
        if self.told is None:
            self.runs.append(run)
        return True

    def _diverge(self, t: float) -> None:
        if self.run is None:
            raise RunError(f"object {self.item} starts at t = {t:g} with nan or inf among its coordinates")
        self._listens = False
        self.note(f"the simulation diverged: nan or inf at t = {t:g}; bounds end before")


class Succession:
    """What a run may go on from: the one before of the same body.

    run : that. source : what it was read as; its own may be one from a static run. last : time, q, q_t, q_tt of the
    last row that was bounded.
    """

    def __init__(self) -> None:
        self.run: Run | None = None
        self.source: Offline | None = None
        self.last: tuple | None = None
        self._begins = True  # whether the last run has gone on from no other

    def before(self, offline: Offline, t: float, q: np.ndarray, q_t: np.ndarray) -> tuple[Run | None, str]:
        """Return the run in whose last state another one starts, or None and why it does not go on, if it might.

        None if there is none, or what bounds are of was changed; also a static one, if no initial state was given. A
        solve, static or not, that failed in its first step has left nothing to go on from; a static one of a frame
        that is free begins with the load step after, where what acts on the body is not in balance before.
        """
        before, why_not = self._before(offline, t, q, q_t)
        if before is not None and len(before.times) == 1:
            made_a_step = before.begins_late if before.is_static else not self._begins
            before = before if made_a_step else None
        self._begins = before is None
        return before, why_not

    def _before(self, offline: Offline, t: float, q: np.ndarray, q_t: np.ndarray) -> tuple[Run | None, str]:
        if self.run is None:
            return None, ""
        before, (t_last, q_last, q_t_last, _) = self.run, self.last
        if not np.array_equal(q, q_last):
            return None, ""
        if before.is_static:
            released = offline.initial is None and not q_t.any()
            return (before if released and before.last.u.shape[1] == offline.coordinates.p else None), ""
        if abs(t - t_last) > SAME_TIME * abs(t_last) or not np.array_equal(q_t, q_t_last):
            return None, ""
        return (before, "") if self.source is offline else (None, _other_bounds(self.source, offline))


def _other_bounds(before: Offline, now: Offline) -> str:
    """Why a run does not go on from one before in whose last state it starts."""
    was, scene, reason = before.scene, now.scene, "the mbs was changed since the run before"
    if (was.scope, was.note) != (scene.scope, scene.note):
        reason = f"bounds cover something else than in the run before ({was.scope!r}, now {scene.scope!r}"
        reason += f": {scene.note})" if scene.note else ")"
    return f"{reason}; its error so far is not carried over"


class ToleranceCheck:
    """The bounds of one run beside their tolerances, output -> what it is to stay below.

    room : number of steps that may be made before they are compared, inf if there are no tolerances.
    """

    def __init__(self, limits: dict[str, float]):
        self._limits, self._compared, self._calls = limits, 0, 0
        self._last: dict[str, float] = {}  # share that each bound had of its tolerance at the last step compared
        self.room = 1 if limits else np.inf

    def exceeded(self, run: Run) -> list[str]:
        """Return in words which bounds were above their tolerance at any of the steps since the last call."""
        t = run.times[self._compared :]
        if not t.size or not self._limits:
            return []
        self._compared, self._calls = self._compared + len(t), self._calls + 1
        best = run.best_of_last(len(t))
        shares = {name: np.max(best[name], axis=1, initial=0.0) / limit for name, limit in self._limits.items()}
        above = [(name, share) for name, share in shares.items() if not np.all(share <= 1)]
        condition = not_certified(run.doubts()) if above else ""
        found = [f"{self._in_words(*one, t)}{condition and f' ({condition})'}" for one in above]
        self.room = 1 if found else self._next_room(shares)
        self._last = {name: share[-1] for name, share in shares.items()}
        return found

    def _next_room(self, shares: dict[str, np.ndarray]) -> int:
        fewest = 1 if self._calls < FEWEST + self._compared / FEWEST else FEWEST
        left = min(self._steps_left(self._last.get(name, 0.0), share) for name, share in shares.items())
        return int(np.clip(left, fewest, max(fewest, min(2 * self.room, MOST))))

    def _steps_left(self, before: float, share: np.ndarray) -> float:
        """How many steps a bound needs to reach its tolerance, of which it had such shares (S,), twice as fast."""
        return (1 - share[-1]) / max(2 * np.diff(share, prepend=before).max(), TINY)

    def _in_words(self, name: str, share: np.ndarray, t: np.ndarray) -> str:
        i, limit = int(np.argmin(share <= 1)), self._limits[name]
        since = f" at t = {t[i]:g}" if i < len(t) - 1 else ""
        return f"tolerance on {name!r} exceeded{since}, {share[i] * limit:.3g} > {limit:g}"
