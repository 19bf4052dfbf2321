"""How the frame of a floating body is held, and hence what a bound covers: its scope (theory.md 7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ...errors import AssumptionError
from ..access.mbs_items import numbers

if TYPE_CHECKING:
    from .floating_body import ReducedMatrices

GROUND = ("Ground", "PointGround")


@dataclass(frozen=True)
class Support:
    """at_rest: the frame does not move; else functions of time move it, or it reacts to the body."""

    at_rest: bool
    text: str


def read_support(mbs: Any, model: ReducedMatrices, reference_markers: set[int]) -> Support:
    """Return how the frame is held: by a weld of its reference interface to the ground, or of its own node."""
    for i in range(mbs.systemData.NumberOfObjects()):
        item = mbs.GetObject(i)
        if item.get("activeConnector") is False or not _welds(mbs, item, reference_markers):
            continue
        if item["offsetUserFunction"]:
            return Support(False, f"object {i} ({item['name']}) moves the reference interface by its function")
        return Support(True, f"object {i} ({item['name']}) welds the reference interface to the ground")
    held = _held_coordinates(mbs, model)
    if len(held) >= model.frame.size - (model.frame.size == 7):  # Euler parameters: the last follows from the others
        return Support(True, f"coordinate constraints hold the frame's node {model.nodes[0]}")
    return Support(False, "the frame moves as joints, connectors and loads let it")


def require_free_node(mbs: Any, model: ReducedMatrices) -> None:
    """AssumptionError if something acts on the frame's node itself, of modes that move the body in this frame.

    A force there does no work on modes, as one on the body would, whose rigid part it moves.
    """
    own = {i for i in range(mbs.systemData.NumberOfMarkers()) if _is_on(mbs.GetMarker(i), model.nodes[0])}
    objects = [mbs.GetObject(i) for i in range(mbs.systemData.NumberOfObjects())]
    acting = [item["name"] for item in objects if own & numbers(item, "markerNumbers")]
    loads = (mbs.GetLoad(i) for i in range(mbs.systemData.NumberOfLoads()))
    acting += [load["name"] for load in loads if int(load["markerNumber"]) in own]
    if acting:
        raise AssumptionError(
            f"{', '.join(acting)} act on the frame's node {model.nodes[0]} itself, and {model.rigid.share:.1e} of a "
            "mode moves the body as a rigid one in this frame: call romerr.hold_modes(fem, nodes, weights) with the "
            "interface that holds the frame before ObjectFFRFreducedOrderInterface(fem), or use markers on mesh nodes"
        )


def _is_on(marker: dict, node: int) -> bool:
    return node in numbers(marker, "nodeNumber") | numbers(marker, "nodeNumbers")


def _welds(mbs: Any, item: dict, reference_markers: set[int]) -> bool:
    """Whether the object locks all six axes between a marker of the reference interface and the ground."""
    markers = numbers(item, "markerNumbers")
    if item["objectType"] != "JointGeneric" or not all(item["constrainedAxes"]) or not markers & reference_markers:
        return False
    return all(_on_ground(mbs, number) for number in markers - reference_markers)


def _on_ground(mbs: Any, number: int) -> bool:
    marker = mbs.GetMarker(number)
    bodies, nodes = numbers(marker, "bodyNumber"), numbers(marker, "nodeNumber")
    return any(mbs.GetObject(b)["objectType"] in GROUND for b in bodies) or any(
        mbs.GetNode(n)["nodeType"] in GROUND for n in nodes
    )


def _held_coordinates(mbs: Any, model: ReducedMatrices) -> set[int]:
    """Coordinates of the frame's node that constraints tie to the ground."""
    held = set()
    for i in range(mbs.systemData.NumberOfObjects()):
        item = mbs.GetObject(i)
        if item["objectType"] != "ConnectorCoordinate" or item.get("activeConnector") is False:
            continue
        markers = numbers(item, "markerNumbers")
        own = {n for n in markers if model.nodes[0] in numbers(mbs.GetMarker(n), "nodeNumber")}
        moves = item["offsetUserFunction"] or item["velocityLevel"]
        if len(own) == 1 and len(markers) == 2 and all(_on_ground(mbs, n) for n in markers - own) and not moves:
            held |= {int(mbs.GetMarker(n)["coordinate"]) for n in own}
    return held
