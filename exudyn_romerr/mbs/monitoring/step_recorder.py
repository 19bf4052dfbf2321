"""PostStep function that stores each accepted step: as little Python as possible, none where loops are compiled."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any

import exudyn as exu

from ...compiled.loops import loops
from ..access.state_guard import IN_PLACE

START_OF_STEP = exu.ConfigurationType.StartOfStep


def gatherer(mbs: Any, hook: Any) -> tuple[Callable, Callable, Callable]:
    """Return step(mbs, t), the PostStep function; drain() -> t, q, q_t, q_tt, multipliers stored since; hurry().

    hurry() ends the block at the next step. hook : a StepHook, with the user's own PostStep function, whether
    multipliers are kept, and the time from which on the last block is evaluated at every step; it is told of a solve
    that begins, of rows to be taken, and calls the user. Closures: as a method, with its look-ups of attributes, step
    would add 6 % to the step of a small body.
    """
    system = mbs.systemData
    start_of_step = system.GetTime
    readers = system.GetODE2Coordinates, system.GetODE2Coordinates_t, system.GetODE2Coordinates_tt
    read_q, read_q_t, read_q_tt = readers
    read_multipliers = system.GetAECoordinates
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
            room = int(min(hook.goes_on(), len(times)))
            go_on = room > 0
        elif t >= end:
            hook.flush()  # while the mbs is what it was
        return go_on if hook.user is None else hook.call_user(mbs, t, go_on)

    def drain() -> tuple:
        nonlocal i
        n, i = i, 0
        return () if n == 0 else (times[:n], q[:n], q_t[:n], q_tt[:n], multipliers[:n])

    def hurry() -> None:
        nonlocal room
        room = i + 1

    if loops is None:
        step.hook = hook
        return step, drain, hurry

    def checked_step(mbs: Any, t: float) -> Any:
        """Make the step in Python, and let rows be stored in C up to the next one that something is due at."""
        stored()
        go_on = step(mbs, t)
        if hook.user is None and i < room - 1 and go_on:
            recorder.go_on(i, room - 1, end, times, q, q_t, q_tt, *([multipliers] if is_wide else []))
        return go_on

    def stored() -> None:
        nonlocal i
        i += recorder.stop()

    def drain_stored() -> tuple:
        stored()
        return drain()

    def hurry_stored() -> None:
        stored()
        hurry()

    recorder = loops.Recorder(checked_step, start_of_step, START_OF_STEP, IN_PLACE[0], *readers, read_multipliers)
    recorder.hook = hook
    return recorder, drain_stored, hurry_stored
