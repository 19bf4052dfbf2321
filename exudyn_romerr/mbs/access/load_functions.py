"""User functions of loads: which of them are functions of time alone, and may be called away from the run."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from ..memory.kept_values import Copies
from ..memory.user_memory import memory_kept
from .state_guard import state_kept

LOAD_FUNCTIONS = ("loadVectorUserFunction", "loadUserFunction")
MOVED = 1e-4  # of coordinates and rates: what user functions of loads are tried with
LATER = 1e-9  # of the time, or of 1 s: a memory that looks at the clock shows


def loads_with_functions(mbs: Any) -> list[int]:
    """Return the numbers of loads that have a user function."""
    return [i for i in range(mbs.systemData.NumberOfLoads()) if any(map(mbs.GetLoad(i).get, LOAD_FUNCTIONS))]


def controllers(mbs: Any, numbers: list[int], copies: Copies | None = None) -> dict[int, str]:
    """Number -> name of those loads that are not functions of time alone: they see the motion, or keep something.

    They are called in this state twice, in another one and a little later; what they keep is put back. Those that
    hold what cannot be put back are not called. All together, for most often there is none; else one by one.
    copies: of what they keep, where they are looked at again and again.
    """
    if not numbers or _why_not_by_time_alone(mbs, numbers, copies) is None:
        return {}
    reasons = {i: _why_not_by_time_alone(mbs, [i]) for i in numbers}
    found = {i: reason for i, reason in reasons.items() if reason is not None} or dict.fromkeys(numbers, "")
    return {i: f"load {i} ({mbs.GetLoad(i)['name']}{reason})" for i, reason in found.items()}


def _why_not_by_time_alone(mbs: Any, numbers: list[int], copies: Copies | None = None) -> str | None:
    """None if loads are functions of time alone; else what their functions hold, if that cannot be put back."""
    system, values, t = mbs.systemData, [], mbs.systemData.GetTime()
    loads = [mbs.GetLoad(i) for i in numbers]
    functions = [load_functions(load) for load in loads]

    def keep() -> None:
        values.append([mbs.GetLoadValues(i) for i in numbers])

    with memory_kept(mbs, [f for own in functions for f in own], copies) as memory:
        if memory.lost:
            return f", whose function can reach: {memory.lost}"
        keep()
        with state_kept(system) as (q, q_t, q_tt, multipliers):
            system.SetODE2Coordinates(q + shifts(len(q)))
            system.SetODE2Coordinates_t(q_t + MOVED * (1 + np.cos(np.arange(len(q)))))
            system.SetODE2Coordinates_tt(q_tt + shifts(len(q)))
            system.SetAECoordinates(multipliers + MOVED)
            keep()
        for load, own in zip(loads, functions, strict=True):
            for f in own:
                with suppress(Exception):  # a table that ends here
                    f(mbs, t + LATER * max(abs(t), 1.0), as_given(load.get("loadVector", load.get("load"))))
        remembers = memory.changed  # before the next call, which may lead back: that of an integral over time does
        keep()
    first, *others = (np.hstack(rows) for rows in values)
    same = all(np.array_equal(first, row, equal_nan=True) for row in others)
    return None if same and not (remembers or memory.was_changed) else ""


def remembering_joints(mbs: Any) -> list[str]:
    """Return the names of constraints whose offset keeps something from call to call, or cannot be called away."""
    found, t = [], mbs.systemData.GetTime()
    for i in range(mbs.systemData.NumberOfObjects()):
        item = mbs.GetObject(i)
        f = (item.get("offsetUserFunction") or {}).get("function")
        if callable(f):
            with memory_kept(mbs, [f]) as memory, suppress(Exception):
                for time in () if memory.lost else (t, t, t + LATER * max(abs(t), 1.0)):
                    f(mbs, time, i, as_given(item.get("offsetUserFunctionParameters", item.get("offset"))))
            if memory.lost or memory.was_changed:
                found.append(f"object {i} ({item['name']}, {item['objectType']})")
    return found


def load_functions(load: dict[str, Any]) -> list[Callable]:
    """Return the user functions of a load, as mbs.GetLoad gives it; symbolic ones keep nothing."""
    found = (load[key]["function"] for key in LOAD_FUNCTIONS if load.get(key))
    return [f for f in found if callable(f)]


def user_functions(mbs: Any) -> list[Callable]:
    """Return the user functions of loads and objects."""
    found = [f for i in loads_with_functions(mbs) for f in load_functions(mbs.GetLoad(i))]
    for i in range(mbs.systemData.NumberOfObjects()):
        values = [value for key, value in mbs.GetObject(i).items() if key.endswith("UserFunction") and value]
        found += [f for f in (v.get("function") if isinstance(v, dict) else v for v in values) if callable(f)]
    return found


def shifts(n: int) -> np.ndarray:
    """Return what coordinates (n,) are moved by to see what functions of the motion do: each by another amount."""
    return MOVED * (1 + np.sin(np.arange(n)))


def as_given(values: Any) -> Any:
    """Return a parameter as Exudyn gives it to user functions: a number, or a list of their own, to write to."""
    return np.asarray(values).tolist()
