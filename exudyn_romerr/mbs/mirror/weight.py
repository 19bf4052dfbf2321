"""Loads on the mass of a floating body, which its closed form has."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


def weight_of(mbs: Any, number: int) -> tuple[Callable[[float], np.ndarray], list[int]]:
    """Return the acceleration (3,) over time that loads on a body's mass make, m/s^2, and numbers of these loads."""
    found, loads = [], []
    for i in range(mbs.systemData.NumberOfLoads()):
        load = mbs.GetLoad(i)
        if load["loadType"] != "MassProportional":
            continue
        if int(mbs.GetMarker(int(load["markerNumber"])).get("bodyNumber", -1)) == number:
            loads.append(i)
            found.append((np.array(load["loadVector"], float), _called(load["loadVectorUserFunction"])))

    def acceleration(t: float) -> np.ndarray:
        values = (vector if call is None else np.asarray(call(mbs, t, [*vector]), float) for vector, call in found)
        return sum(values, np.zeros(3))

    return acceleration, loads


def _called(user: Any) -> Callable | None:
    """A user function, as Exudyn keeps it: in a dict, symbolic or a Python function; 0 where there is none."""
    if not user:
        return None
    function = user["function"] if isinstance(user, dict) else user
    return function if callable(function) else function.Evaluate
