"""Copies of an mbs, of what GetNode, GetObject, GetMarker and GetLoad give: its equations, in states of our own.

Exudyn's GetDictionary refuses objects with user functions. The mbs that is copied is read, and nothing else.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from .light_mesh import TRIANGLE, lightened
from .mbs_items import FFRF


def copy_items(
    mbs: Any,
    to: Any,
    wider: Mapping[int, dict[str, Any]] | None = None,
    hollow: Collection[int] = (),
    functions_look: bool = False,
) -> None:
    """Add all items of an mbs to another one; sensors, and whole meshes, only if its functions look at them.

    wider : what bodies with more modes have, by number; further coordinates of their nodes are zero. hollow : numbers
    of bodies that have neither mass nor stiffness there. User functions find the variables that they know.
    """
    to.variables, to.sys = mbs.variables, mbs.sys
    system, wider = mbs.systemData, wider or {}
    objects = [_bare(mbs.GetObject(i)) | wider.get(i, {}) for i in range(system.NumberOfObjects())]
    markers = [_bare(mbs.GetMarker(i)) for i in range(system.NumberOfMarkers())]
    for i, item in enumerate(objects):
        if item["objectType"] == FFRF:
            on_it = [one for one in markers if int(one.get("bodyNumber", -1)) == i]
            light = {} if functions_look else lightened(item, on_it)
            objects[i] = item | light | ({"computeFFRFterms": False} if i in hollow else {})
    counts = {int(objects[i]["nodeNumbers"][1]): np.shape(objects[i]["modeBasis"])[1] for i in wider}
    for i in range(system.NumberOfNodes()):
        node = _bare(mbs.GetNode(i))
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
        to.AddLoad(_bare(mbs.GetLoad(i)))
    for i in range(system.NumberOfSensors() if functions_look else 0):
        to.AddSensor(_bare(mbs.GetSensor(i)) | {"storeInternal": False, "writeToFile": False})


def may_be_lighter(mbs: Any) -> bool:
    """Whether there are markers of more nodes than they need."""
    markers = map(mbs.GetMarker, range(mbs.systemData.NumberOfMarkers()))
    return any(len(marker.get("meshNodeNumbers", ())) > len(TRIANGLE) for marker in markers)


def _bare(item: dict[str, Any]) -> dict[str, Any]:
    """Return an item without its name and what is drawn."""
    return {key: value for key, value in item.items() if not (key.startswith("V") or key == "name")}
