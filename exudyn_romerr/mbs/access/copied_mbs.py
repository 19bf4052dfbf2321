"""Copies of an mbs, of what GetNode, GetObject, GetMarker and GetLoad give: its equations, in states of our own.

Exudyn's GetDictionary refuses objects with user functions. The mbs that is copied is read, and nothing else.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .light_mesh import lightened
from .mbs_items import FFRF

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..memory.detached import Detached


def copy_items(
    mbs: Any,
    to: Any,
    detached: Detached,
    wider: Mapping[int, dict[str, Any]],
    with_sensors: bool = False,
) -> None:
    """Add all items of an mbs to another one; sensors, and whole meshes, only with_sensors.

    detached : copies of the user functions, which it has then. wider : what bodies with more modes have, by number,
    that have neither mass nor stiffness there; further coordinates of their nodes are zero.
    """
    to.variables, to.sys = detached.spaces
    system = mbs.systemData
    objects = [_bare(mbs.GetObject(i), detached) | wider.get(i, {}) for i in range(system.NumberOfObjects())]
    markers = [_bare(mbs.GetMarker(i), detached) for i in range(system.NumberOfMarkers())]
    for i, item in enumerate(objects):
        if item["objectType"] == FFRF:
            on_it = [one for one in markers if int(one.get("bodyNumber", -1)) == i]
            light = {} if with_sensors else lightened(item, on_it)
            objects[i] = item | light | ({"computeFFRFterms": False} if i in wider else {})
    counts = {int(objects[i]["nodeNumbers"][1]): np.shape(objects[i]["modeBasis"])[1] for i in wider}
    for i in range(system.NumberOfNodes()):
        node = _bare(mbs.GetNode(i), detached)
        if i in counts:
            more = counts[i] - node["numberOfODE2Coordinates"]
            node["numberOfODE2Coordinates"] = counts[i]
            for name in ("referenceCoordinates", "initialCoordinates", "initialCoordinates_t"):
                node[name] = np.append(node[name], np.zeros(more))
        to.AddNode(node)
    for item in objects:
        to.AddObject(item)
    for item in markers:
        to.AddMarker(item)
    for i in range(system.NumberOfLoads()):
        to.AddLoad(_bare(mbs.GetLoad(i), detached))
    for i in range(system.NumberOfSensors() if with_sensors else 0):
        to.AddSensor(_bare(mbs.GetSensor(i), detached) | {"storeInternal": False, "writeToFile": False})


def _bare(item: dict[str, Any], detached: Detached) -> dict[str, Any]:
    """Return an item without its name and what is drawn, with copies of user functions."""
    kept = {key: value for key, value in item.items() if not (key.startswith("V") or key == "name")}
    return {key: _copy(value, detached) if key.endswith("UserFunction") else value for key, value in kept.items()}


def _copy(value: Any, detached: Detached) -> Any:
    """Exudyn gives user functions as they are, or with their type in a dict."""
    if isinstance(value, dict) and "function" in value:
        return value | {"function": detached.of(value["function"])}
    return detached.of(value) if callable(value) else value
