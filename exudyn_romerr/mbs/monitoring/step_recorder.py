"""The part of the hook that runs at every step: as little Python as possible."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import exudyn as exu

if TYPE_CHECKING:
    from .step_hook import StepHook

START_OF_STEP = exu.ConfigurationType.StartOfStep


def gatherer(mbs: Any, hook: StepHook) -> tuple[Callable, Callable, Callable]:
    """Return step(mbs, t), the PostStep function; drain() -> (t, q, q_t, q_tt), the rows it stored since; hurry().

    After hurry() the next step ends the block. Closures: as a method, with its look-ups of attributes, step would add
    6 % to the step of a small body.
    """
    system = mbs.systemData
    start_of_step = system.GetTime
    read_q, read_q_t, read_q_tt = (
        system.GetODE2Coordinates,
        system.GetODE2Coordinates_t,
        system.GetODE2Coordinates_tt,
    )
    i = room = due = 0
    times = q = q_t = q_tt = None

    def step(mbs: Any, t: float) -> Any:
        nonlocal i, room, due, times, q, q_t, q_tt
        # equal at the first call of a solve, and only there: no step was made yet
        if start_of_step(START_OF_STEP) == t:
            times, q, q_t, q_tt = hook.begin(mbs)
            due = int(hook.has_tangents)
            room = 1  # the first row is evaluated at once: what is wrong shows before the first step
        times[i] = t
        q[i] = read_q()
        q_t[i] = read_q_t()
        q_tt[i] = read_q_tt()
        i += 1
        if due:
            due -= 1
            if due == 0:
                due = hook.read_tangent(mbs, t)
                room = room if due else i  # it failed: what is stored is evaluated now, as far as it holds
        go_on = True
        if i == room:
            go_on, room = hook.goes_on(t), len(times)
        return go_on if hook.user is None else hook.call_user(mbs, t, go_on)

    def drain() -> tuple:
        nonlocal i
        n, i = i, 0
        return () if n == 0 else (times[:n], q[:n], q_t[:n], q_tt[:n])

    def hurry() -> None:
        nonlocal room
        room = i + 1

    step.hook = hook
    return step, drain, hurry
