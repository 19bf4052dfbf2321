"""What the linearised mechanism covers of an mbs, and the unknowns that it has there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import AssumptionError
from ...mechanism.body import Body
from ...mechanism.rows import Rows
from ...mechanism.unknowns import Unknowns
from ..access.mbs_items import QUATERNIONS, Items, node_coordinates

TURNING = "ConnectorTorsionalSpringDamper"
WITHOUT_TANGENT = ("RigidBodyRotVecLG", "RigidBodyRotVecDataLG", "Point2DSlope1")  # types of nodes


def require_covered(mbs: Any, is_static: bool = False) -> None:
    """Raise AssumptionError where an mbs has coordinates that the linearised mechanism has not."""
    system = mbs.systemData
    settings = mbs.sys.get("simulationSettings")
    if is_static and system.ODE1Size() and not (settings and settings.staticSolver.constrainODE1Coordinates):
        raise AssumptionError("a static solve that does not hold coordinates of first order is not covered")
    data = len(system.GetDataCoordinates())
    # torsional springs count whole turns in theirs: a rotation within half a turn is the same without
    springs = (item for item in Items(mbs).objects if item["objectType"] == TURNING) if data else ()
    if data > len({int(item["nodeNumber"]) for item in springs} - {-1}):
        raise AssumptionError("data coordinates (contact, friction, plasticity) are not covered")
    for number in range(system.NumberOfNodes()):
        kind = mbs.GetNode(number)["nodeType"]
        if kind in WITHOUT_TANGENT and len(node_coordinates(mbs, number)):
            raise AssumptionError(f"node {number} of type {kind} is not covered")


def unknowns_of(mbs: Any, bodies: Sequence[Body], rows: Rows | None = None) -> Unknowns:
    """Return the unknowns of an mbs that has these floating bodies; along rows, where these have more coordinates."""
    system, others = mbs.systemData, []
    taken = {int(i) for body in bodies for i in (*body.place.frame, *body.place.modal)}
    for number in range(system.NumberOfNodes()):
        mine = node_coordinates(mbs, number)
        if len(mine) and taken.isdisjoint(mine.tolist()):
            taken |= set(mine.tolist())
            node = mbs.GetNode(number)
            is_turning = node["nodeType"] == QUATERNIONS
            others.append((mine, np.array(node["referenceCoordinates"], float) if is_turning else None))
    n = system.ODE2Size()
    if rows is None:
        return Unknowns(bodies, others, n)
    largest, duration = np.abs(rows.v[:, n:]).max(axis=0, initial=0.0), float(rows.t[-1] - rows.t[0])
    return Unknowns(bodies, others, n, largest, duration or 1.0)
