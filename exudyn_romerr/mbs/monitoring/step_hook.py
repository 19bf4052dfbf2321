"""The one PostStep function of all monitors of an mbs: it gathers rows, which are evaluated in blocks."""

from __future__ import annotations

import weakref
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np

from ...errors import InputError
from ...online.run import BLOCK
from ...process.blas_threads import OTHERS, one_thread
from ...process.interrupts import interrupt_deferred
from ...report.scope import FROZEN
from ..access.mbs_items import end_time, is_verbose, running_static_solver
from ..memory.standstill import no_step_is_made
from .evaluation import Evaluation
from .live_output import live_line
from .run_succession import SAME_TIME
from .step_recorder import gatherer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from ...offline.prepared import Offline
    from .body_monitor import Watch
    from .coupled_core import Mechanism, OtherSensors

LONGEST = 4  # times BLOCK: a block of bounds that take few numbers a step
CACHED = 700_000  # numbers, which all that is computed at control points in a block has at most then
BLOCK_NUMBERS = 200_000  # but no more numbers than this per array, where the mbs has many coordinates
FREED = 1_000_000  # numbers of an array that is made and let go, so that the C library keeps memory of blocks
TANGENT_NUMBERS = 1_000_000  # 8 MB for each of its matrices in a block; splines through all take 15 times that


class StepHook:
    """Dispatcher installed as PostStep function of an mbs, and found there by every further monitor.

    `step` stores one accepted step at each call. A full block, a new solve or a question (flush) hands rows to the
    watches. The user's function is called after the step was stored, and its return value is passed on.
    """

    def __init__(self, mbs: Any, user: Callable | None):
        self.user, self._verbose, self._static_solver = user, False, None
        self.watches: list[Watch] = []
        self.sensors: list[OtherSensors] = []  # on no flexible body
        self._evaluation: Evaluation | Mechanism = Evaluation([])
        self.step, self._drain, self._hurry = gatherer(mbs, self)
        self._occupant: Callable = self.step
        self._arrays: tuple = ()
        self._said: set[str] = set()  # why there are no bounds, in the solve under way
        self.end = np.inf  # of the solve, if tangents are to be read in its last block
        self.is_silent = False  # whether nothing is printed: who watches a script from outside says it afterwards

    @one_thread()
    def begin(self, mbs: Any) -> tuple[np.ndarray, ...]:
        """A solve begins: read the mbs, return the arrays for its rows of t, q, q_t, q_tt and multipliers."""
        self.flush()
        self._said.clear()
        at_once = False
        with self._run_goes_on(), no_step_is_made():
            at_once = self._begin(mbs)
        # glibc gives back what blocks free, and asking again takes a third of their time; not so once it has seen a
        # piece come and go that is as large; nothing is ever written into this one
        np.empty(FREED)
        return self._rows(mbs.systemData, at_once)

    def _begin(self, mbs: Any) -> bool:
        """Read the mbs; return whether each step is to be evaluated at once."""
        self._occupant = slot_function(mbs)
        static = running_static_solver(mbs, self._static_solver)
        self._static_solver = static or self._static_solver
        self._verbose = is_verbose(mbs, static is not None) and not self.is_silent
        for watch in self.watches:
            watch.begin(mbs, static is not None, self.attached)
        others = _frozen([watch for watch in self.watches if watch.is_frozen])
        for watch in self.watches if others else ():
            if watch.is_coupled:
                watch.begin(mbs, static is not None, self.attached, others)
        self._mbs = weakref.ref(mbs)
        self._begin_evaluation(mbs)
        end = end_time(mbs, static is not None) if self.has_tangents else None
        self.end = np.inf if end is None else end - SAME_TIME * abs(end)
        return static is not None  # load steps are few, and loads may change before the next solve asks for a block

    def _begin_evaluation(self, mbs: Any) -> None:
        """Choose what evaluates the rows of the solve that begins."""
        if not self.sensors and all(watch.is_alone for watch in self.watches):
            self._evaluation = Evaluation(self.watches)
            return
        from .coupled_core import Mechanism

        before = self._evaluation if isinstance(self._evaluation, Mechanism) else None
        self._evaluation = Mechanism(self.watches, before, self.sensors)
        self._evaluation.begin(mbs, self.user is not None or self._occupant is not self.step)

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
        with interrupt_deferred(), one_thread(), no_step_is_made():
            self._evaluate()
        if not self.is_silent and (hint := OTHERS.hint()):
            exu.Print(f"exudyn_romerr: {hint}")

    def _evaluate(self) -> None:
        *rows, multipliers = self._drain() or ((),)
        if not rows:
            return
        with self._run_goes_on():
            self._evaluation.evaluate(self._mbs(), *rows, multipliers)
            if self._verbose:
                exu.Print(live_line(self.watches, rows[0][-1]))
        for watch in self.watches:
            watch.note_error(rows[0][-1])
            if self._is_over and watch.run is not None:
                watch.run.solver = watch.run.solver._replace(is_stopped=True)
        self._say_failures(rows[0][-1])

    def _say_failures(self, t: float) -> None:
        """Say once what cannot be bounded: SolveDynamic does not raise, only report() will."""
        for failure in dict.fromkeys(watch.failure for watch in self.watches if watch.failure):
            if failure not in self._said and not self.is_silent:
                self._said.add(failure)
                exu.Print(f"exudyn_romerr at t = {t:g}: {failure}. The simulation goes on")

    def look(self) -> None:
        """Evaluate the rows stored so far between two steps; the next one stops if a tolerance is exceeded."""
        self.flush()
        if self._is_over:
            self._hurry()

    def goes_on(self) -> float:
        """Evaluate the rows stored so far; return how many may be stored before they are, 0 to stop the solve."""
        self.flush()
        return 0 if self._is_over else min((watch.check.room for watch in self.watches), default=np.inf)

    @property
    def _is_over(self) -> bool:
        return any(watch.stopped for watch in self.watches)

    @one_thread()
    def read(self, mbs: Any, watch: Watch) -> Offline:
        """Return what a watch would make bounds with if a solve began now."""
        offline = watch.subject.read(mbs, attached=self.attached)
        if not offline.scene.coupled:
            return offline
        if len(self.watches) == 1:
            watch.subject.read_alone(mbs)
        others = [other for other in self.watches if other is not watch]
        frozen = [other for other in others if other.subject.read(mbs, attached=self.attached).scene.scope == FROZEN]
        return watch.subject.read(mbs, attached=self.attached, others=_frozen(frozen)) if frozen else offline

    @property
    def attached(self) -> set[int]:
        """Numbers of the objects that are watched."""
        return {watch.item for watch in self.watches}

    @property
    def has_tangents(self) -> bool:
        """Whether the solve that has begun needs tangents of the mechanism."""
        return self._evaluation.tangents is not None

    @one_thread()
    def read_tangent(self, mbs: Any, t: float) -> int:
        """Read the tangent now; return after how many steps it is to be read again."""
        return self._evaluation.read_tangent(mbs, t)

    def call_user(self, mbs: Any, t: float, go_on: bool, *row: np.ndarray) -> Any:
        """Call the user's function and pass on what it returns, unless the solve is to be stopped; row: q, q_t."""
        result = self.user(mbs, t)
        if self.has_tangents:
            self._evaluation.equations.compare(mbs, t, *row)
        for watch in () if result else self.watches:
            why = f"the PostStep function returned {result!r}; it must return True to go on"
            watch.note(f"stopped at t = {t:g}: {why}")
        return result if go_on else False

    def check(self, watch: Watch, user: Callable | None) -> None:
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
        rows = 1 if at_once else block_rows(size, self.has_tangents, width)
        shapes = [(rows,), *((rows, n) for n in (size, size, size, len(system.GetAECoordinates())))]
        # those of the solve before, which watches copy from: fresh memory costs half of what storing in it does
        if self.has_tangents or [x.shape for x in self._arrays] != shapes:
            self._arrays = tuple(map(np.empty, shapes))
        return self._arrays


def _frozen(watches: Sequence[Watch]) -> str:
    """Why coupled bounds cannot be had beside these; empty if there are none."""
    numbers = ", ".join(str(watch.item) for watch in watches)
    return f"it needs those of all bodies, and object {numbers} has frozen inputs only, see there" if watches else ""


def block_rows(size: int, with_tangents: bool = False, width: int = CACHED) -> int:
    """Return the number of steps in a block of an mbs with `size` coordinates, of which each may have a tangent.

    width : numbers that bounds compute with at a step.
    """
    times = 1 if with_tangents else min(max(CACHED // (width * BLOCK), 1), LONGEST)
    rows = min(times * BLOCK, 1 + BLOCK_NUMBERS // (1 + size))
    return min(rows, 1 + TANGENT_NUMBERS // (1 + size**2)) if with_tangents else rows


def slot_function(mbs: Any) -> Callable | None:
    """Return the PostStep function that is set in the mbs, or None."""
    slot = mbs.GetPostStepUserFunction()
    return slot["function"] if slot else None


def shared_hook(mbs: Any, user: Callable | None, *watches: Watch) -> StepHook:
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
