"""User functions of loads: which of them are functions of time alone, and may be called away from the run."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from ...errors import AssumptionError
from .detached import Detached, OnlyReads
from .mbs_items import Items
from .state_guard import current_state, state_set

LOAD_FUNCTIONS = ("loadVectorUserFunction", "loadUserFunction")
MOVED = 1e-4  # of coordinates and rates: what user functions of loads are tried with
LATER = 1e-9  # of the time, or of 1 s: a memory that looks at the clock shows


def controller(mbs: Any, number: int, load: dict[str, Any]) -> str:
    """Return the name of a load that is no function of time alone: it sees the motion, or keeps something; else "".

    Copies of its functions are called in this state twice, in another one and a little later. Those that keep what
    cannot be copied are not called.
    """
    why = _why_not_by_time_alone(mbs, load)
    return "" if why is None else f"load {number} ({load['name']}{why})"


def _why_not_by_time_alone(mbs: Any, load: dict[str, Any]) -> str | None:
    """None if a load is a function of time alone; else what its function keeps, if that cannot be copied."""
    if not (functions := load_functions(load)):
        return None
    t = mbs.systemData.GetTime()
    given, detached = load.get("loadVector", load.get("load")), Detached(mbs, functions)
    if detached.lost:
        return f", whose function keeps what cannot be copied: {detached.lost}"

    def values(at: float = t) -> Any:  # given as Exudyn does: a number, or a list of their own, to write to
        return np.hstack(
            [np.ravel(detached.of(f)(OnlyReads(mbs), at, np.asarray(given).tolist())) for f in functions]
        )

    with detached.in_use(mbs):
        try:
            found = [values(), _elsewhere(mbs.systemData, values)]
        except AssumptionError as error:
            return f", for {error}"
        with suppress(Exception):  # a table that ends here
            values(t + LATER * max(abs(t), 1.0))
        found.append(values())
    same = all(np.array_equal(found[0], row, equal_nan=True) for row in found)
    return None if same and not detached.has_changed() else ""


def _elsewhere(system: Any, values: Callable[[], Any]) -> Any:
    """What values are in another state: each coordinate is moved by another amount."""
    q, q_t, q_tt, multipliers = current_state(system)
    shifts, rates = (MOVED * (1 + of(np.arange(len(q)))) for of in (np.sin, np.cos))
    with state_set(system, system.GetTime(), (q + shifts, q_t + rates, q_tt + shifts, multipliers + MOVED)):
        return values()


def load_functions(load: dict[str, Any]) -> list[Callable]:
    """Return the user functions of a load, as mbs.GetLoad gives it; symbolic ones keep nothing."""
    found = (load[key]["function"] for key in LOAD_FUNCTIONS if load.get(key))
    return [f for f in found if callable(f)]


def user_functions(mbs: Any) -> list[Callable]:
    """Return the user functions of loads and objects."""
    items = Items(mbs)
    found = [f for load in items.loads for f in load_functions(load)]
    return [*found, *(f for item in items.objects for f in functions_of(item))]


def functions_of(item: dict[str, Any]) -> list[Callable]:
    """Return the user functions of an object."""
    values = [value for key, value in item.items() if key.endswith("UserFunction") and value]
    return [f for f in (v.get("function") if isinstance(v, dict) else v for v in values) if callable(f)]
