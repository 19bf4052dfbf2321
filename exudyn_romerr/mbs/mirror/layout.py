"""Which coordinates an mbs has, as the linearised mechanism lays them out; what it does not cover."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import AssumptionError
from ...mechanism.body import Body
from ...mechanism.unknowns import Unknowns
from ..access.mbs_items import QUATERNIONS, Items

TURNING = "ConnectorTorsionalSpringDamper"
WITHOUT_TANGENT = ("RigidBodyRotVecLG", "RigidBodyRotVecDataLG", "Point2DSlope1")  # types of nodes


def require_covered(mbs: Any) -> None:
    """Raise AssumptionError where an mbs has coordinates that the linearised mechanism has not."""
    system = mbs.systemData
    if len(system.GetDataCoordinates()) > len(_turns_counted(mbs)):
        raise AssumptionError("data coordinates (contact, friction, plasticity) are not covered")
    if len(system.GetODE1Coordinates()):
        raise AssumptionError("coordinates of first order (ODE1) are not covered")
    for number in range(system.NumberOfNodes()):
        kind = mbs.GetNode(number)["nodeType"]
        if kind in WITHOUT_TANGENT and len(system.GetNodeLTGODE2(number)):
            raise AssumptionError(f"node {number} of type {kind} is not covered")


def _turns_counted(mbs: Any) -> set[int]:
    """Nodes in which torsional springs count whole turns: a rotation within half a turn is the same without."""
    if not len(mbs.systemData.GetDataCoordinates()):
        return set()
    springs = (item for item in Items(mbs).objects if item["objectType"] == TURNING)
    nodes = {int(item["nodeNumber"]) for item in springs}
    return nodes - {-1}


def unknowns_of(mbs: Any, bodies: Sequence[Body]) -> Unknowns:
    """Return the unknowns of an mbs that has these floating bodies."""
    system, others = mbs.systemData, []
    taken = {int(i) for body in bodies for i in (*body.place.frame, *body.place.modal)}
    for number in range(system.NumberOfNodes()):
        mine = np.array(system.GetNodeLTGODE2(number), int)
        if len(mine) and taken.isdisjoint(mine.tolist()):
            taken |= set(mine.tolist())
            node = mbs.GetNode(number)
            is_turning = node["nodeType"] == QUATERNIONS
            others.append((mine, np.array(node["referenceCoordinates"], float) if is_turning else None))
    return Unknowns(bodies, others, system.ODE2Size())
