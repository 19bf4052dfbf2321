"""How the frame of a floating body is held, and hence what bounds cover: their level, and why (theory.md 7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...errors import AssumptionError
from ...report.scope import COMPLETE, COUPLED, FROZEN
from ..access.mbs_items import Items, is_active, nodes_of, numbers

if TYPE_CHECKING:
    from ...linear.run.prepare import BoundOptions
    from .actions import Actions
    from .floating_body import ReducedMatrices

GROUND = ("Ground", "PointGround")
AUTO = "auto"
ASKABLE = (AUTO, COUPLED, FROZEN)
NO_COUPLED = "no coupled bound: "  # begins the reason of frozen inputs
REACTING = "; these react to the body's deformation: "  # goes on with what they are
OF_A_FILE = "of a file"
# scopes that leave the feedback of a mechanism out, and why
WITHOUT_FEEDBACK = {
    OF_A_FILE: "a file is evaluated for one body alone, attach before the solve has those of all",
    FROZEN: f"scope={FROZEN!r} was asked for",
}
ONLY_VECTORS = "estimators={!r} are known with frozen inputs only: 'auto' asks for the mechanism's"
FEWEST = 6  # vectors: of fewer no part tells what is left out
TOO_FEW = f"auxiliary_modes={{}} is too few to check what they leave out: {FEWEST} or more"
GIVEN_START = (
    "initial= and jumps= are covered with frozen inputs only; after SolveStatic a solve starts in its equilibrium"
)


@dataclass(frozen=True)
class Support:
    """at_rest: the frame does not move; else functions of time move it, or it reacts to the body."""

    at_rest: bool
    text: str


@dataclass(frozen=True)
class Level:
    """What bounds cover: scope and its reason. note : why it is no wider, if the user may do something about it."""

    scope: str
    reason: str
    note: str = ""


def why_not_told(scope: str, options: BoundOptions) -> str:
    """Return why no linearised mechanism can tell what attach was asked for; empty: it can."""
    if scope in WITHOUT_FEEDBACK:
        return WITHOUT_FEEDBACK[scope]
    asked, count = options.estimators, options.auxiliary_modes
    if asked not in (AUTO, "auxiliary") and set(asked) != {"auxiliary"}:
        return ONLY_VECTORS.format(asked)
    if options.initial is not None or len(options.jumps):
        return GIVEN_START
    return TOO_FEW.format(count) if count != AUTO and count < FEWEST else ""


def find_level(scope: str, actions: Actions, support: Support, why_not: str) -> Level:
    """Return what bounds of the body alone cover. scope : asked for; why_not : no mechanism tells more."""
    reacting = [place.name for place in actions.wrenches] + [load.name for load in actions.loads if load.follows]
    if not support.at_rest:
        reacting.insert(0, "the frame")
    if not reacting:
        return Level(COMPLETE, f"{support.text}; loads do not depend on the body's deformation")
    frozen = (
        f"{', '.join(reacting)}; the bound holds for the full body under the "
        "motion of the frame, the loads and the wrenches of this simulation; their feedback, and what other steps "
        "make of them, is not covered and may make the error of the whole mechanism many times larger"
    )
    note = f"{NO_COUPLED}{why_not}"
    return Level(FROZEN, f"{note}{REACTING}{frozen}", note="" if scope == FROZEN else note)


def read_support(items: Items, model: ReducedMatrices, reference_markers: set[int]) -> Support:
    """Return how the frame is held: by a weld of its reference interface to the ground, or of its own node."""
    for i, item in enumerate(items.objects):
        if not is_active(item) or not _welds(items, item, reference_markers):
            continue
        if item["offsetUserFunction"]:
            return Support(False, f"object {i} ({item['name']}) moves the reference interface by its function")
        return Support(True, f"object {i} ({item['name']}) welds the reference interface to the ground")
    held = _held_coordinates(items, model)
    if len(held) >= model.frame.size - (model.frame.size == 7):  # Euler parameters: the last follows from the others
        return Support(True, f"coordinate constraints hold the frame's node {model.nodes[0]}")
    return Support(False, "the frame moves as joints, connectors and loads let it")


def require_free_node(items: Items, model: ReducedMatrices) -> None:
    """AssumptionError if something acts on the frame's node itself, of modes that move the body in this frame.

    A force there does no work on modes, as one on the body would, whose rigid part it moves.
    """
    own = {i for i, marker in enumerate(items.markers) if model.nodes[0] in nodes_of(marker)}
    acting = [item["name"] for item in items.objects if own & numbers(item, "markerNumbers")]
    acting += [load["name"] for load in items.loads if int(load["markerNumber"]) in own]
    if acting:
        raise AssumptionError(
            f"{', '.join(acting)} act on the frame's node {model.nodes[0]} itself, and {model.rigid.share:.1e} of a "
            "mode moves the body as a rigid one in this frame: call romerr.hold_modes(fem, nodes, weights) with the "
            "interface that holds the frame before ObjectFFRFreducedOrderInterface(fem), or use markers on mesh nodes"
        )


def _welds(items: Items, item: dict, reference_markers: set[int]) -> bool:
    """Whether the object locks all six axes between a marker of the reference interface and the ground."""
    markers = numbers(item, "markerNumbers")
    if item["objectType"] != "JointGeneric" or not all(item["constrainedAxes"]) or not markers & reference_markers:
        return False
    return all(_is_on_ground(items, number) for number in markers - reference_markers)


def _is_on_ground(items: Items, number: int) -> bool:
    bodies, nodes = (numbers(items.markers[number], key) for key in ("bodyNumber", "nodeNumber"))
    kinds = [*(items.objects[i]["objectType"] for i in bodies), *(items.nodes[i]["nodeType"] for i in nodes)]
    return any(kind in GROUND for kind in kinds)


def _held_coordinates(items: Items, model: ReducedMatrices) -> set[int]:
    """Coordinates of the frame's node that constraints tie to the ground."""
    held = set()
    for item in items.objects:
        if item["objectType"] != "ConnectorCoordinate" or not is_active(item):
            continue
        markers = numbers(item, "markerNumbers")
        own = {n for n in markers if model.nodes[0] in numbers(items.markers[n], "nodeNumber")}
        moves = item["offsetUserFunction"] or item["velocityLevel"]
        if len(own) == 1 and len(markers) == 2 and all(_is_on_ground(items, n) for n in markers - own) and not moves:
            held |= {int(items.markers[n]["coordinate"]) for n in own}
    return held
