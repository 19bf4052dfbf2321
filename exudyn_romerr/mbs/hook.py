"""The one PostStep function of all monitors of an mbs: it gathers rows, which are evaluated in blocks."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np

from ..errors import InputError
from .scene import is_in, running_static_solver

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from .watch import Watch

BLOCK = 256  # rows evaluated at once; larger blocks gain nothing
BLOCK_NUMBERS = 200_000  # but no more numbers than this per array, where the mbs has many coordinates
START_OF_STEP = exu.ConfigurationType.StartOfStep


class StepHook:
    """Callable for the PostStep slot of an mbs; the slot itself is the register that monitors find it in.

    Each call stores one accepted step. A full block, a new solve or a question (flush) hands the rows to
    the watches. The user's function is called after the step was stored; its return value is passed on.
    """

    def __init__(self, mbs: Any, user: Callable | None):
        system = mbs.systemData
        self._start_of_step = system.GetTime
        self._read_q, self._read_q_t = system.GetODE2Coordinates, system.GetODE2Coordinates_t
        self._read_q_tt = system.GetODE2Coordinates_tt
        self.user = user
        self.watches: list[Watch] = []
        self._occupant: Callable = self
        self._static_solver: Any = None
        self._count = 0

    def __call__(self, mbs: Any, t: float) -> Any:
        # equal at the first call of a solve, and only there: no step was made yet
        if self._start_of_step(START_OF_STEP) == t:
            self._begin(mbs)
        i = self._count
        self._t[i] = t
        self._q[i] = self._read_q()
        self._q_t[i] = self._read_q_t()
        self._q_tt[i] = self._read_q_tt()
        self._count = i = i + 1
        go_on = i < self._limit or self.flush()
        return go_on if self.user is None else self._call_user(mbs, t, go_on)

    def flush(self) -> bool:
        """Evaluate the rows stored so far; False if the solve is to be stopped."""
        with _interrupt_deferred():
            n, self._count = self._count, 0
            if n:
                for watch in self.watches:
                    watch.take(self._t[:n], self._q[:n], self._q_t[:n], self._q_tt[:n])
                self._limit = len(self._t)
        return not any(watch.stops for watch in self.watches)

    def add(self, mbs: Any, watch: Watch) -> None:
        """Serve one more watch from the next solve on; InputError if its body is watched already."""
        self._drop_deleted(mbs)
        if watch.name in [other.name for other in self.watches]:
            raise InputError(
                f"flex: body {watch.name!r} is attached already; pass all outputs to one attach call"
            )
        self.watches.append(watch)

    def is_in_charge(self, mbs: Any) -> bool:
        """Whether Exudyn calls this hook: directly, or through a function that did so in the last solve."""
        return slot_function(mbs) is self._occupant

    def _begin(self, mbs: Any) -> None:
        self.flush()
        self._occupant = slot_function(mbs)
        self._drop_deleted(mbs)
        static = running_static_solver(mbs, self._static_solver)
        self._static_solver = static or self._static_solver
        for watch in self.watches:
            watch.begin(mbs, static is not None)
        self._allocate(mbs.systemData.ODE2Size())

    def _allocate(self, size: int) -> None:
        rows = 1 if any(watch.tolerance for watch in self.watches) else min(BLOCK, 1 + BLOCK_NUMBERS // size)
        self._t = np.empty(rows)
        self._q, self._q_t, self._q_tt = np.empty((3, rows, size))
        self._limit = 1  # the first row is evaluated at once: what is wrong shows before the first step

    def _call_user(self, mbs: Any, t: float, go_on: bool) -> Any:
        result = self.user(mbs, t)
        if not result:
            for watch in self.watches:
                watch.note(f"stopped at t = {t:g}: the PostStep function returned {result!r}")
        return result if go_on else False

    def _drop_deleted(self, mbs: Any) -> None:
        self.watches = [
            watch for watch in self.watches if is_in(mbs, watch.name, watch.items["oGenericODE2"])
        ]


def slot_function(mbs: Any) -> Callable | None:
    """Return the PostStep function that is set in the mbs, or None."""
    slot = mbs.GetPostStepUserFunction()
    return slot["function"] if slot else None


def shared_hook(mbs: Any, user: Callable | None) -> StepHook:
    """Return the hook in the slot of the mbs, or put one there that calls what was in the slot before.

    `user` is the function passed by hook=; InputError if the hook calls another one already.
    """
    found = slot_function(mbs)
    hook = found if isinstance(found, StepHook) else StepHook(mbs, found)
    if user is not None and hook.user not in (None, user):
        raise InputError(
            f"hook={user!r}, but the mbs has another PostStep function already, {hook.user!r}; "
            "pass one function that calls both"
        )
    hook.user = user or hook.user
    if hook is not found:
        mbs.SetPostStepUserFunction(hook)
    return hook


@contextmanager
def _interrupt_deferred() -> Iterator[None]:
    """Let Ctrl-C wait until the block is evaluated, so that it never leaves half a block behind."""
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    caught: list[tuple] = []
    signal.signal(signal.SIGINT, lambda *arguments: caught.append(arguments))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if caught:
            handler(*caught[0])
