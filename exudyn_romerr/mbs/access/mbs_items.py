"""Items of an mbs, as their dictionaries have them."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

FFRF, QUATERNIONS = "FFRFreducedOrder", "RigidBodyEP"  # types of floating bodies, of nodes with Euler parameters


class Items:
    """All items of an mbs, each kind read once, when it is first asked for."""

    def __init__(self, mbs: Any):
        self.mbs, self._system = mbs, mbs.systemData

    def _all(self, kind: str) -> list[dict[str, Any]]:
        return [*map(getattr(self.mbs, f"Get{kind}"), range(getattr(self._system, f"NumberOf{kind}s")()))]

    nodes = cached_property(lambda self: self._all("Node"))
    objects = cached_property(lambda self: self._all("Object"))
    markers = cached_property(lambda self: self._all("Marker"))
    loads = cached_property(lambda self: self._all("Load"))
    sensors = cached_property(lambda self: self._all("Sensor"))


def slot_function(mbs: Any) -> Callable | None:
    """Return the PostStep function that is set in the mbs, or None."""
    slot = mbs.GetPostStepUserFunction()
    return slot["function"] if slot else None


def sensor_names(mbs: Any) -> list[str]:
    """Return the names of all sensors; where several have one, with their numbers."""
    names = [sensor["name"] for sensor in Items(mbs).sensors]
    return [name if names.count(name) == 1 else f"{name} (sensor {i})" for i, name in enumerate(names)]


def numbers(item: dict, key: str) -> set[int]:
    """Return the item numbers under a key, which may hold one or a list."""
    value = item.get(key, [])
    return {int(number) for number in (value if isinstance(value, list | tuple) else [value])}


def nodes_of(item: dict) -> set[int]:
    """Return the numbers of the nodes that a marker or an object is on."""
    return numbers(item, "nodeNumber") | numbers(item, "nodeNumbers")


def is_active(item: dict) -> bool:
    """Return whether an object is no connector that is switched off."""
    return item.get("activeConnector") is not False


def dense(matrix: Any, n: int) -> np.ndarray:
    """Return a matrix (n, n) of Exudyn, where an empty one is zero."""
    found = np.asarray(matrix.Convert2DenseMatrix(), dtype=float)
    return found if found.size else np.zeros((n, n))


def node_coordinates(mbs: Any, node: int) -> np.ndarray:
    """Return the numbers of a node's coordinates in the mbs."""
    return np.array(mbs.systemData.GetNodeLTGODE2(node), int)
