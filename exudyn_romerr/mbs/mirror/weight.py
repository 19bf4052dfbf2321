"""Loads on the mass of a floating body, which its closed form has."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any

import numpy as np

from ..access.detached import Detached, OnlyReads


def weight_of(mbs: Any, number: int, detached: Detached) -> tuple[Callable[[float], np.ndarray], list[int]]:
    """Return the acceleration (3,) over time, m/s^2, that loads on a body's mass make, and numbers of these loads.

    detached : copies of user functions, which are called in their place.
    """
    found, loads, owner = [], [], weakref.ref(mbs)
    for i in range(mbs.systemData.NumberOfLoads()):
        load = mbs.GetLoad(i)
        if load["loadType"] != "MassProportional":
            continue
        if int(mbs.GetMarker(int(load["markerNumber"])).get("bodyNumber", -1)) == number:
            loads.append(i)
            found.append((np.array(load["loadVector"], float), _called(load["loadVectorUserFunction"], detached)))

    def acceleration(t: float) -> np.ndarray:
        values = (
            vector if call is None else np.asarray(call(owner(), t, [*vector]), float) for vector, call in found
        )
        return sum(values, np.zeros(3))

    return acceleration, loads


def _called(user: Any, detached: Detached) -> Callable | None:
    """A user function, as Exudyn keeps it: in a dict, symbolic or a Python function; 0 where there is none."""
    if not user:
        return None
    function = user["function"] if isinstance(user, dict) else user
    if not callable(function):
        return function.Evaluate
    copy = detached.of(function)
    return lambda mbs, *given: copy(OnlyReads(mbs), *given)
