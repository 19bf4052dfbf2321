"""Save and restore the state of an mbs, so that what is tried on it leaves the simulation as it is, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import exudyn as exu
import numpy as np

CONFIGURATIONS = (exu.ConfigurationType.Current, exu.ConfigurationType.Initial, exu.ConfigurationType.StartOfStep)
LOAD_FUNCTIONS = ("loadVectorUserFunction", "loadUserFunction")
MOVED = 1e-4  # of coordinates and rates: what user functions of loads are tried with


@contextmanager
def states_kept(system: Any) -> Iterator[None]:
    """Put back what the initialisation of a solver changes: states, accelerations and times."""
    kept = [
        (system.GetSystemState(where), system.GetODE2Coordinates_tt(where), system.GetTime(where), where)
        for where in CONFIGURATIONS
    ]
    try:
        yield
    finally:
        for state, q_tt, t, where in kept:
            system.SetSystemState(state, where)
            system.SetODE2Coordinates_tt(q_tt, where)
            system.SetTime(t, where)


def loads_with_functions(mbs: Any) -> list[int]:
    """Return the numbers of loads that have a user function."""
    return [i for i in range(mbs.systemData.NumberOfLoads()) if any(map(mbs.GetLoad(i).get, LOAD_FUNCTIONS))]


def loads_by_motion(mbs: Any, numbers: list[int]) -> list[str]:
    """Names of those loads that are something else in another state at the same time."""
    if not numbers:
        return []
    system = mbs.systemData
    values = [np.asarray(mbs.GetLoadValues(i)) for i in numbers]
    with coordinates_kept(system) as (q, q_t):
        system.SetODE2Coordinates(q + MOVED * (1 + np.sin(np.arange(len(q)))))
        system.SetODE2Coordinates_t(q_t + MOVED * (1 + np.cos(np.arange(len(q)))))
        moved = [np.asarray(mbs.GetLoadValues(i)) for i in numbers]
    changed = [not np.array_equal(*pair, equal_nan=True) for pair in zip(values, moved, strict=True)]
    return [f"load {i} ({mbs.GetLoad(i)['name']})" for i, has in zip(numbers, changed, strict=True) if has]


@contextmanager
def coordinates_kept(system: Any) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Give q and q_t of the current state, and set them back."""
    q, q_t = system.GetODE2Coordinates(), system.GetODE2Coordinates_t()
    try:
        yield q, q_t
    finally:
        system.SetODE2Coordinates(q)
        system.SetODE2Coordinates_t(q_t)
