"""The one PostStep function of all monitors of an mbs: it gathers rows, of the mechanism until its end."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from contextlib import contextmanager
from math import inf
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np

from ...compiled.loops import loops
from ...errors import AssumptionError, InputError, RunError
from ...linear.run.run import BLOCK
from ...process.blas_threads import OTHERS, one_thread
from ...process.interrupts import interrupt_deferred
from ...report.scope import UNATTACHED
from ...report.wording import rounded_up, under, with_unit
from ..access.equations import IN_PLACE
from ..access.mbs_items import FFRF, Items, slot_function
from ..access.solvers import holds_rates, just_begun, scheme_from
from ..floating.moving_subject import MovingSubject
from ..floating.sensor_outputs import other_sensors
from ..mirror.covered import require_covered
from ..mirror.pre_step import parameters
from ..mirror.told_solve import Asked, Ended
from .mechanism_run import BodyRun, MechanismRun

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from .body_monitor import MonitoredBody

START_OF_STEP = exu.ConfigurationType.StartOfStep


def gatherer(mbs: Any, hook: Any) -> tuple[Callable, Callable, Callable]:
    """Return step(mbs, t), the PostStep function; drain() -> t, q, q_t, q_tt, multipliers stored since; end_block().

    end_block() ends the block at the next step. hook : a StepHook, with the user's own PostStep function, whether
    multipliers are kept, and the time from which on the last block is evaluated at every step; it is told of a solve
    that begins, of rows to be taken, and calls the user. Closures: as a method, with its look-ups of attributes, step
    would add 6 % to the step of a small body.
    """
    system = mbs.systemData
    start_of_step = system.GetTime
    readers = system.GetODE2Coordinates, system.GetODE2Coordinates_t, system.GetODE2Coordinates_tt
    read_q, read_q_t, read_q_tt = readers

    def read_multipliers(*place: Any) -> np.ndarray:
        """Multipliers; behind them coordinates of first order and their rates, if there are any."""
        multipliers, x = system.GetAECoordinates(*place), system.GetODE1Coordinates(*place)
        return np.concatenate([multipliers, x, system.GetODE1Coordinates_t(*place)]) if len(x) else multipliers

    i = room = 0
    end, is_wide = inf, False
    times = q = q_t = q_tt = multipliers = None

    def step(mbs: Any, t: float) -> Any:
        nonlocal i, room, end, is_wide, times, q, q_t, q_tt, multipliers
        # equal at the first call of a solve, and only there: no step was made yet
        if start_of_step(START_OF_STEP) == t:
            times, q, q_t, q_tt, multipliers = hook.begin(mbs)
            is_wide, end = hook.keeps_multipliers, hook.end
            room = 1  # the first row is evaluated at once: what is wrong shows before the first step
        times[i] = t
        q[i] = read_q(*IN_PLACE)
        q_t[i] = read_q_t(*IN_PLACE)
        q_tt[i] = read_q_tt(*IN_PLACE)
        if is_wide:
            multipliers[i] = read_multipliers(*IN_PLACE)
        i += 1
        go_on = True
        if i == room:
            room = int(min(hook.rows_until_next(), len(times)))
            go_on = room > 0
        elif t >= end:
            hook.flush()  # while the mbs is what it was
        return go_on if hook.user is None else hook.call_user(mbs, t, go_on)

    def stored() -> None:
        """Take back from C how many rows it has stored."""
        nonlocal i
        i += 0 if recorder is None else recorder.stop()

    def drain() -> tuple:
        nonlocal i
        stored()
        n, i = i, 0
        return () if n == 0 else (times[:n], q[:n], q_t[:n], q_tt[:n], multipliers[:n])

    def end_block() -> None:
        nonlocal room
        stored()
        room = i + 1

    def checked_step(mbs: Any, t: float) -> Any:
        """Make the step in Python, and let rows be stored in C up to the next one that something is due at."""
        stored()
        go_on = step(mbs, t)
        if hook.user is None and i < room - 1 and go_on:
            recorder.go_on(i, room - 1, end, times, q, q_t, q_tt, *([multipliers] if is_wide else []))
        return go_on

    recorder = None
    if loops is None:
        step.hook = hook
        return step, drain, end_block
    recorder = loops.Recorder(checked_step, start_of_step, START_OF_STEP, IN_PLACE[0], *readers, read_multipliers)
    recorder.hook = hook
    return recorder, drain, end_block


LONGEST = 4  # times BLOCK: a block of bounds that take few numbers a step
CACHED = 700_000  # numbers, which all that is computed at control points in a block has at most then
BLOCK_NUMBERS = 200_000  # but no more numbers than this per array, where the mbs has many coordinates
FREED = 1_000_000  # numbers of an array that is made and let go, so that the C library keeps memory of blocks


class StepHook:
    """Dispatcher installed as PostStep function of an mbs, and found there by every further monitor.

    `step` stores one accepted step at each call. A full block, a new solve or a question (flush) hands rows to the
    watches. The user's function is called after the step was stored, and its return value is passed on.
    """

    def __init__(self, mbs: Any, user: Callable | None):
        self.user, self._verbose, self._static_solver = user, False, None
        self.watches: list[MonitoredBody] = []
        self.sensors: list[int] | None = []  # on no flexible body, of mechanisms; None: all
        self.run: MechanismRun | None = None  # of bodies that a mechanism reacts to, in the last solve
        self._ended: Ended | None = None  # how the rows so far have ended
        self._has_begun = False  # whether the solve has more rows than its first
        self.step, self._drain, self._end_block = gatherer(mbs, self)
        self._occupant: Callable = self.step
        self._arrays: tuple = ()
        self._said: set[str] = set()  # why there are no bounds, in the solve under way

    @one_thread()
    def begin(self, mbs: Any) -> tuple[np.ndarray, ...]:
        """A solve begins: read the mbs, return the arrays for its rows of t, q, q_t, q_tt and multipliers."""
        self.finish(mbs)
        self._said.clear()
        at_once = False
        with self._run_goes_on():
            at_once = self._begin(mbs)
        # glibc gives back what blocks free, and asking again takes a third of their time; not so once it has seen a
        # piece come and go that is as large; nothing is ever written into this one
        np.empty(FREED)
        return self._rows(mbs.systemData, at_once)

    def _begin(self, mbs: Any) -> bool:
        """Read the mbs; return whether each step is to be evaluated at once."""
        self._occupant, self._mbs = slot_function(mbs), weakref.ref(mbs)
        self.run, self._has_begun = None, False
        # one kept out of mbs.sys by storeSolver=False cannot be told from a dynamic one
        static = just_begun(mbs, static=True)
        static = None if static is self._static_solver else static
        self._static_solver = static or self._static_solver
        solver = just_begun(mbs) if static is None else static
        self._verbose = solver is not None and solver.output.verboseMode > 1
        why = self.why_not_told(mbs, static is not None)
        for watch in self.watches:
            watch.begin(mbs, static is not None, why)
        if any(watch.is_told for watch in self.watches):
            self._begin_mechanism(mbs, solver, static is not None)
        return static is not None  # load steps are few, and loads may change before the next solve asks for a block

    def why_not_told(self, mbs: Any, is_static: bool) -> str:
        """Return why the linearised mechanism can tell of no body of this mbs; empty: nothing is known yet."""
        attached = {watch.item for watch in self.watches}
        reduced = ((i, item) for i, item in enumerate(Items(mbs).objects) if item["objectType"] == FFRF)
        if missing := [f"object {i} ({item['name']})" for i, item in reduced if i not in attached]:
            return f"{UNATTACHED}, so their errors are not known: {', '.join(missing)}; attach them all"
        if not is_static and just_begun(mbs) is None:
            return "the solver is not kept in mbs.sys; call SolveDynamic without storeSolver=False"
        try:
            require_covered(mbs, is_static)
        except AssumptionError as error:
            return str(error)
        return ""

    def _begin_mechanism(self, mbs: Any, solver: Any, is_static: bool) -> None:
        """Keep rows of this solve."""
        floating = [watch for watch in self.watches if isinstance(watch.subject, MovingSubject)]
        subjects = [watch.subject for watch in floating]
        flexes, outputs = [one.flex for one in subjects], [one.outputs for one in subjects]
        sensors = other_sensors(mbs, flexes, self.sensors)
        vectors = max(one.vectors for one in subjects)
        rates = holds_rates(mbs.sys.get("simulationSettings"))
        asked = Asked(flexes, outputs, scheme_from(solver), is_static, sensors, vectors, rates, parameters(mbs))
        self.run = MechanismRun(asked, float(solver.it.endTime), self._ended, mbs.systemData.ODE1Size())
        for i, watch in enumerate(floating):
            if watch.is_told:
                watch.told = BodyRun(self.run, i, watch.subject, watch.tolerance)
                watch.runs.append(watch.told)

    @contextmanager
    def _run_goes_on(self) -> Iterator[None]:
        """Keep an error for the reports of all bodies: nothing of ours stops the user's run."""
        try:
            yield
        except Exception as error:
            for watch in self.watches:
                watch.error = watch.error or error

    def flush(self) -> None:
        """Evaluate the rows stored so far."""
        with interrupt_deferred(), one_thread():
            self._evaluate()
        if hint := OTHERS.hint():
            exu.Print(f"exudyn_romerr: {hint}")

    def finish(self, mbs: Any) -> None:
        """Evaluate the rows stored so far, and tell those of a mechanism."""
        self.flush()
        if self.run is not None:
            with interrupt_deferred(), one_thread():
                self._tell(mbs)

    def _tell(self, mbs: Any) -> None:
        """Let the mechanism tell of its rows; where it cannot, bounds are those under frozen inputs."""
        run = self.run
        self._ended = run.tell(mbs) or self._ended
        if run.error is not None and not isinstance(run.error, RunError):  # which says that more steps are to come
            self.run = None
        for watch in self.watches:
            if watch.is_told and self.run is None:
                watch.fall_back(mbs, run)
            elif watch.is_told and run.known is not None:
                watch.error = None  # of what was shown at once

    def _evaluate(self) -> None:
        rows = self._drain()
        if not rows:
            return
        t, *state, multipliers = rows
        with self._run_goes_on():
            for watch in self.watches:
                watch.take(t, *state)
            if self.run is None and self._has_begun:
                self._ended = Ended(state[0][-1].copy(), state[1][-1].copy())
            elif self.run is not None:
                self.run.append(t, *state, multipliers)
                if t[-1] >= self.end:
                    self._tell(self._mbs())
            if self._verbose:
                exu.Print(live_line(self.watches, t[-1]))
        self._has_begun = True
        for watch in self.watches:
            watch.note_error(t[-1])
            if self._is_over and watch.run is not None:
                watch.run.solver = watch.run.solver._replace(is_stopped=True)
        self._say_failures(t[-1])

    def _say_failures(self, t: float) -> None:
        """Say once what cannot be bounded: SolveDynamic does not raise, only report() will."""
        for failure in dict.fromkeys(watch.failure for watch in self.watches if watch.failure):
            if failure not in self._said:
                self._said.add(failure)
                exu.Print(f"exudyn_romerr at t = {t:g}: {failure}. The simulation goes on")

    def evaluate_now(self) -> None:
        """Evaluate the rows stored so far between two steps; the next one stops if a tolerance is exceeded."""
        self.flush()
        if self._is_over:
            self._end_block()

    def rows_until_next(self) -> float:
        """Evaluate the rows stored so far; return how many may be stored before they are, 0 to stop the solve."""
        self.flush()
        return 0 if self._is_over else min((watch.check.room for watch in self.watches), default=np.inf)

    @property
    def _is_over(self) -> bool:
        return any(watch.stopped for watch in self.watches)

    @property
    def end(self) -> float:
        """When the solve ends, s, where a mechanism is told."""
        return np.inf if self.run is None else self.run.due

    @property
    def keeps_multipliers(self) -> bool:
        """Whether the solve that has begun needs multipliers."""
        return self.run is not None

    def call_user(self, mbs: Any, t: float, go_on: bool) -> Any:
        """Call the user's function and pass on what it returns, unless the solve is to be stopped."""
        result = self.user(mbs, t)
        for watch in () if result else self.watches:
            why = f"the PostStep function returned {result!r}; it must return True to go on"
            watch.note(f"stopped at t = {t:g}: {why}")
        return result if go_on else False

    def check(self, watch: MonitoredBody, user: Callable | None) -> None:
        """Raise InputError if its body is watched already, or another function than `user` is called already."""
        if watch.item in [other.item for other in self.watches]:
            raise InputError(
                f"flex: the body of object {watch.item} is attached already; pass all outputs to one attach call"
            )
        if user is not None and self.user not in (None, user):
            raise InputError(
                f"hook={user!r}, but the mbs has another PostStep function already, {self.user!r}; "
                "pass one function that calls both"
            )

    def is_in_charge(self, mbs: Any) -> bool:
        """Whether Exudyn calls this hook: directly, or through a function that did so in the last solve."""
        return slot_function(mbs) is self._occupant

    def _rows(self, system: Any, at_once: bool) -> tuple[np.ndarray, ...]:
        size, width = system.ODE2Size(), max((watch.width for watch in self.watches), default=CACHED)
        rows = 1 if at_once else block_rows(size, width)
        behind = len(system.GetAECoordinates()) + 2 * system.ODE1Size()
        shapes = [(rows,), *((rows, n) for n in (size, size, size, behind))]
        # those of the solve before, which watches copy from: fresh memory costs half of what storing in it does
        if [x.shape for x in self._arrays] != shapes:
            self._arrays = tuple(map(np.empty, shapes))
        return self._arrays


def live_line(watches: Sequence[MonitoredBody], t: float) -> str:
    """Return in words what the bounds are at t, the largest of the rows of each output."""
    found = [
        f"{out.name} {with_unit(rounded_up(np.max(bounds[out.name])), out.unit)}"
        f"{under(watch.scope(), doubts=watch.run.doubts())}"
        for watch in watches
        for bounds in [watch.bounds_at(t)]
        for out in watch.subject.outputs
        if out.name in bounds
    ]
    return f"error bounds at t = {t:g}: {', '.join(found) or 'none'}\n"


def block_rows(size: int, width: int = CACHED) -> int:
    """Return the number of steps in a block of an mbs with `size` coordinates.

    width : numbers that bounds compute with at a step.
    """
    times = min(max(CACHED // (width * BLOCK), 1), LONGEST)
    return min(times * BLOCK, 1 + BLOCK_NUMBERS // (1 + size))


def shared_hook(mbs: Any, user: Callable | None, *watches: MonitoredBody) -> StepHook:
    """Let the hook in the slot of the mbs serve watches, or put one there that calls what was in the slot before.

    `user` is the function passed by hook=. Where InputError is raised, the mbs is as it was.
    """
    found = slot_function(mbs)
    hook = getattr(found, "hook", None)
    if not isinstance(hook, StepHook):
        hook = StepHook(mbs, found)
    for watch in watches:
        hook.check(watch, user)
    hook.user = user or hook.user
    if hook.step is not found:
        mbs.SetPostStepUserFunction(hook.step)
    hook.watches += watches
    return hook
