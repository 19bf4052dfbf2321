"""Reads what acts on a floating body: loads, which are known, wrenches of joints, which are not (theory.md 7)."""

from __future__ import annotations

from contextlib import nullcontext, suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import AssumptionError, InputError
from ...model.admissible_space import MeanMotion, mean_motion
from ..access.load_functions import controller
from ..access.mbs_items import Items, is_active, nodes_of, numbers
from .actions import Actions, Load, OfTime, Place, load_vector

if TYPE_CHECKING:
    from collections.abc import Callable

    from .floating_body import FloatingBody, ReducedMatrices

WEIGHT_SUM = 1e-9  # markers whose weights do not sum to 1 do not take a mean
FORCES_ONLY = ("JointSpherical", "ConnectorCartesianSpringDamper", "ConnectorSpringDamper")
MESH_MARKERS = ("SuperElementPosition", "SuperElementRigid")


def read_actions(
    items: Items, flex: FloatingBody, model: ReducedMatrices, load_factor: Callable[[float], float] | None = None
) -> Actions:
    """Read loads, joints and connectors on the body; load_factor: what a static solver scales constant loads with.

    Raises
    ------
    AssumptionError
        Something acts on single modes, or in a way that is not known here.
    InputError
        A marker with nodes that the body does not have, or with weights that do not sum to 1.
    """
    used = _used(items, flex, model)
    actions = Actions(places=_places(items, flex, used))
    for i in sorted(used - set(actions.places)):
        _refuse(i, items.markers[i], flex, model)
    _read_loads(items, flex, actions, load_factor)
    _read_objects(items, flex, actions)
    return actions


def read_interfaces(mbs: Any, flex: FloatingBody) -> dict[str, MeanMotion]:
    """Return nodes and weights of the body's markers that have a mean rotation, before or after Assemble."""
    return Actions(places=_places(Items(mbs), flex, set())).interfaces()


def _places(items: Items, flex: FloatingBody, used: set[int]) -> dict[int, Place]:
    """Where markers on mesh nodes act; only those in use have to be known here, for sensors may use any."""
    places = {}
    for i, marker in enumerate(items.markers):
        if flex.number in numbers(marker, "bodyNumber") and marker["markerType"] in MESH_MARKERS:
            with nullcontext() if i in used else suppress(InputError, AssumptionError):
                places[i] = _place(i, marker, flex)
    return places


def _used(items: Items, flex: FloatingBody, model: ReducedMatrices) -> set[int]:
    """Markers that loads and objects act through; AssumptionError for objects on the modal coordinates."""
    used = {int(load["markerNumber"]) for load in items.loads}
    for i, item in enumerate(items.objects):
        if i == flex.number:
            continue
        if model.nodes[1] in nodes_of(item):
            raise AssumptionError(f"object {i} ({item['name']}) is on the modal coordinates of object {flex.number}")
        used |= numbers(item, "markerNumbers")
    return used


def _refuse(number: int, marker: dict, flex: FloatingBody, model: ReducedMatrices) -> None:
    """Raise AssumptionError for markers whose loads no full model has; what acts on the frame alone does no work."""
    kind, name = marker["markerType"], f"marker {number} ({marker['name']})"
    if model.nodes[1] in nodes_of(marker) or flex.number in numbers(marker, "objectNumber"):
        raise AssumptionError(
            f"{name} is on the modal coordinates of object {flex.number}; loads and constraints on single modes have "
            "no counterpart in the full model: use markers on mesh nodes"
        )
    if flex.number in numbers(marker, "bodyNumber") and kind != "BodyMass":
        raise AssumptionError(
            f"{name} of type {kind!r} is on object {flex.number}; Exudyn's forces there are not those of mesh nodes: "
            "use MarkerSuperElementPosition or MarkerSuperElementRigid"
        )


def _place(number: int, marker: dict, flex: FloatingBody) -> Place:
    nodes, weights = np.asarray(marker["meshNodeNumbers"], dtype=int), np.asarray(marker["weightingFactors"])
    name = f"marker {number} ({marker['name']})"
    if nodes.size and (nodes.min() < 0 or nodes.max() >= len(flex.positions)):
        raise InputError(f"{name} names node {nodes.max()}; the body has nodes 0..{len(flex.positions) - 1}")
    if abs(weights.sum() - 1) > WEIGHT_SUM:
        raise InputError(f"{name} has weights of sum {weights.sum():.9g}; needed: 1, or it takes no mean motion")
    forces = np.zeros((len(flex.positions), 3, 3))
    np.add.at(forces, nodes, weights[:, None, None] * np.eye(3))
    forces = forces.reshape(-1, 3)
    if marker["markerType"] == "SuperElementPosition":
        return Place(name, forces)
    if not marker["useAlternativeApproach"]:
        raise AssumptionError(f"{name} has useAlternativeApproach=False, which takes no mean rotation; leave it True")
    mean, rows = _mean_motion(name, nodes, weights, flex)
    turns = None if marker["rotationsExponentialMap"] else "rotationsExponentialMap=0"
    axes = np.asarray(marker["localHT"])[:3, :3]
    return Place(name, rows.T, mean, axes, turns)  # an offset moves the frame only


def _mean_motion(name: str, nodes: np.ndarray, weights: np.ndarray, flex: FloatingBody) -> tuple:
    """The mean motion of an interface, and its rows (6, N)."""
    made, key = flex.known.setdefault("means", {}), (nodes.tobytes(), weights.tobytes())
    try:
        if key not in made:
            mean = mean_motion(nodes, weights)
            made[key] = mean, mean.motion_rows(flex.positions)
        return made[key]
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _read_loads(items: Items, flex: FloatingBody, actions: Actions, load_factor: Callable | None) -> None:
    mbs = items.mbs
    for i, load in enumerate(items.loads):
        number, name = int(load["markerNumber"]), f"load {i} ({load['name']})"
        place, on = actions.places.get(number), numbers(items.markers[number], "bodyNumber")
        if place is None and not (load["loadType"] == "MassProportional" and flex.number in on):
            continue
        unknown = controller(mbs, i, load)  # never called for other times than those of the solver
        if place is None:
            if unknown:
                raise AssumptionError(
                    f"{unknown}, gravity of object {flex.number}, depends on the motion or on earlier calls: what "
                    "it is between the solver's calls is not known; make it a function of time alone"
                )
            actions.gravity.append(load_vector(mbs, name, load, load_factor))
        elif unknown:
            _join(actions.wrenches, place if load["loadType"] == "TorqueVector" else place.without_torques())
        else:
            actions.loads.append(_load(name, load, place, load_vector(mbs, name, load, load_factor)))


def _load(name: str, load: dict, place: Place, vector: OfTime) -> Load:
    made = Load(name, place, vector, load["loadType"] == "TorqueVector", bool(load["bodyFixed"]))
    if made.follows and place.turns:
        raise AssumptionError(f"{name} turns with {place.name}, which has {place.turns}: leave that option as it is")
    return made


def _read_objects(items: Items, flex: FloatingBody, actions: Actions) -> None:
    """Collect where joints and connectors act; what acts on the same nodes with the same weights is one wrench."""
    for item in (other for i, other in enumerate(items.objects) if i != flex.number and is_active(other)):
        for number in sorted(numbers(item, "markerNumbers") & set(actions.places)):
            place = actions.places[number]
            _join(actions.wrenches, place.without_torques() if _has_no_torque(item) else place)


def _has_no_torque(item: dict) -> bool:
    generic = item["objectType"] == "JointGeneric" and not any(item["constrainedAxes"][3:])
    return generic or item["objectType"] in FORCES_ONLY


def _join(joined: list[Place], place: Place) -> None:
    for k, other in enumerate(joined):
        if np.array_equal(other.columns[:, :3], place.columns[:, :3]):
            joined[k] = max(other, place, key=lambda p: p.columns.shape[1])
            return
    joined.append(place)
