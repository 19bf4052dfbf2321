"""What acts on a floating body: known loads, and wrenches of joints and connectors, which are not (theory.md 7)."""

from __future__ import annotations

import weakref
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from ...errors import AssumptionError, InputError
from ...model.admissible_space import MeanMotion, mean_motion
from ...model.floating_frame import left_jacobian
from ..access.mbs_items import numbers

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...model.body import ElasticBody
    from ...model.floating_frame import FrameMotion
    from .floating_body import FloatingBody, ReducedMatrices

WEIGHT_SUM = 1e-9  # markers whose weights do not sum to 1 do not take a mean
NO_WORK = 1e-9  # of a column: what rounding leaves where the reference conditions hold a marker's motion at zero
FORCES_ONLY = ("JointSpherical", "ConnectorCartesianSpringDamper", "ConnectorSpringDamper")
MESH_MARKERS = ("SuperElementPosition", "SuperElementRigid")


@dataclass(frozen=True, eq=False)
class Place:
    """Where a marker acts: columns (N, 3 or 6) of unit forces and torques, the mean motion it takes, its axes (3, 3).

    turns : how Exudyn lets the marker turn, other than by the exponential map of its mean rotation; None: so.
    """

    name: str
    columns: np.ndarray
    mean: MeanMotion | None = None
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))
    turns: str | None = None

    @property
    def turn_rows(self) -> np.ndarray:
        """Rows (3, N) of the mean rotation."""
        return self.columns[:, 3:].T

    def without_torques(self) -> Place:
        """Return the place for what acts by forces only."""
        return replace(self, columns=self.columns[:, :3])

    def works(self, body: ElasticBody) -> bool:
        """Whether anything that acts here moves the body in its space of admissible displacements."""
        left = np.linalg.norm(body.space.loads(self.columns), axis=0)
        return bool(np.any(left > NO_WORK * np.linalg.norm(self.columns, axis=0)))


@dataclass(frozen=True)
class Load:
    """A known force or torque (`torque`) over time, in global axes or in those of its marker (`body_fixed`)."""

    name: str
    place: Place
    vector: Callable[[float], Any]
    torque: bool
    body_fixed: bool

    @property
    def columns(self) -> np.ndarray:
        """Unit forces or torques in body axes (N, 3)."""
        return self.place.columns[:, 3:] if self.torque else self.place.columns[:, :3]

    @property
    def follows(self) -> bool:
        """Whether it turns with the mean rotation of its interface, which the deformation makes."""
        return self.torque or self.body_fixed

    def local(self, t: np.ndarray, motion: FrameMotion, theta: np.ndarray | None) -> np.ndarray:
        """Return what acts in body axes (S, 3); theta (S, 3): mean rotation of its interface, if it follows that."""
        vectors = over_time(self.vector, t)
        if self.body_fixed:
            vectors = Rotation.from_rotvec(theta).apply(vectors @ self.place.axes.T)
        else:
            vectors = motion.local(vectors)
        # the work of a torque goes over the rates of theta
        return np.einsum("sij,sj->si", left_jacobian(theta), vectors) if self.torque else vectors


@dataclass
class Actions:
    """All that acts on one floating body.

    loads : known ones. wrenches : places where joints and connectors act. gravity : functions t -> (3,). places : all
    markers on mesh nodes, by number. idle : names of those that act but do no work.
    """

    loads: list[Load] = field(default_factory=list)
    wrenches: list[Place] = field(default_factory=list)
    gravity: list[Callable[[float], Any]] = field(default_factory=list)
    places: dict[int, Place] = field(default_factory=dict)
    idle: list[str] = field(default_factory=list)

    def interfaces(self) -> dict[str, MeanMotion]:
        """Nodes and weights of every marker that has a mean rotation."""
        return {place.name: place.mean for place in self.places.values() if place.mean is not None}

    def drop_idle(self, body: ElasticBody) -> set[int]:
        """Drop what acts where the reference conditions allow no motion; return the markers there."""
        idle = {number for number, place in self.places.items() if not place.works(body)}
        still = {self.places[number].name for number in idle}
        self.idle = sorted(still & self._acting())
        self.wrenches = [place for place in self.wrenches if place.name not in still]
        self.loads = [load for load in self.loads if load.place.name not in still]
        return idle

    @property
    def free(self) -> list[str]:
        """Names of markers that nothing acts at."""
        return [place.name for place in self.places.values() if place.name not in {*self._acting(), *self.idle}]

    def _acting(self) -> set[str]:
        return {place.name for place in self.wrenches} | {load.place.name for load in self.loads}

    def signature(self) -> tuple:
        """Return all of it that offline work depends on."""
        loads = [(x.name, x.columns.tobytes(), x.torque, x.body_fixed, x.place.axes.tobytes()) for x in self.loads]
        return bool(self.gravity), *loads, *((place.name, place.columns.tobytes()) for place in self.wrenches)


def over_time(vector: Callable[[float], Any], t: np.ndarray) -> np.ndarray:
    """Return what a user's function gives at times t (S,), called once for times that repeat: (S, 3)."""
    times, again = np.unique(t, return_inverse=True)
    return np.array([vector(x) for x in times.tolist()], dtype=float).reshape(-1, 3)[again]


def read_actions(
    mbs: Any, flex: FloatingBody, model: ReducedMatrices, load_factor: Callable[[float], float] | None = None
) -> Actions:
    """Read loads, joints and connectors on the body; load_factor: what a static solver scales constant loads with.

    Raises
    ------
    AssumptionError
        Something acts on single modes, or in a way that is not known here.
    InputError
        A marker with nodes that the body does not have, or with weights that do not sum to 1.
    """
    actions = Actions()
    users = _users(mbs, flex, model)
    for i in range(mbs.systemData.NumberOfMarkers()):
        marker = mbs.GetMarker(i)
        if flex.number in numbers(marker, "bodyNumber") and marker["markerType"] in MESH_MARKERS:
            with nullcontext() if i in users else suppress(InputError, AssumptionError):  # sensors may use any marker
                actions.places[i] = _place(i, marker, flex)
        elif i in users:
            _refuse_others(i, marker, flex, model)
    _read_loads(mbs, flex, actions, load_factor)
    _read_objects(mbs, flex, actions)
    return actions


def _users(mbs: Any, flex: FloatingBody, model: ReducedMatrices) -> set[int]:
    """Markers that loads and objects act through; AssumptionError for objects on the modal coordinates."""
    system = mbs.systemData
    used = {int(mbs.GetLoad(i)["markerNumber"]) for i in range(system.NumberOfLoads())}
    for i in range(system.NumberOfObjects()):
        item = mbs.GetObject(i)
        if i == flex.number:
            continue
        if model.nodes[1] in numbers(item, "nodeNumber") | numbers(item, "nodeNumbers"):
            raise AssumptionError(f"object {i} ({item['name']}) is on the modal coordinates of object {flex.number}")
        used |= numbers(item, "markerNumbers")
    return used


def _refuse_others(number: int, marker: dict, flex: FloatingBody, model: ReducedMatrices) -> None:
    """Raise AssumptionError for markers whose loads no full model has; what acts on the frame alone does no work."""
    kind, name = marker["markerType"], f"marker {number} ({marker['name']})"
    modal = model.nodes[1] in numbers(marker, "nodeNumber") | numbers(marker, "nodeNumbers")
    if modal or flex.number in numbers(marker, "objectNumber"):
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
    try:
        mean = mean_motion(nodes, weights)
        return mean, mean.motion_rows(flex.positions)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _read_loads(mbs: Any, flex: FloatingBody, actions: Actions, load_factor: Callable | None) -> None:
    for i in range(mbs.systemData.NumberOfLoads()):
        load = mbs.GetLoad(i)
        number = int(load["markerNumber"])
        if number in actions.places:
            actions.loads.append(_load(i, load, actions.places[number], _vector(mbs, load, load_factor)))
        elif load["loadType"] == "MassProportional" and flex.number in numbers(mbs.GetMarker(number), "bodyNumber"):
            actions.gravity.append(_vector(mbs, load, load_factor))


def _load(i: int, load: dict, place: Place, vector: Callable[[float], Any]) -> Load:
    name = f"load {i} ({load['name']})"
    made = Load(name, place, vector, load["loadType"] == "TorqueVector", bool(load["bodyFixed"]))
    if made.follows and place.turns:
        raise AssumptionError(f"{name} turns with {place.name}, which has {place.turns}: leave that option as it is")
    return made


def _vector(mbs: Any, load: dict, load_factor: Callable | None) -> Callable[[float], Any]:
    """Load vector as a function of time; a user function is called again, after the steps were made."""
    vector, user = np.array(load["loadVector"], dtype=float), load["loadVectorUserFunction"]
    if not user:
        return (lambda t: vector) if load_factor is None else (lambda t: vector * load_factor(t))
    f = user["function"]
    f = f if callable(f) else f.Evaluate  # a symbolic function
    owner = weakref.ref(mbs)  # the mbs holds the hook; a hook that held the mbs would keep it for ever
    return lambda t: f(owner(), t, vector)


def _read_objects(mbs: Any, flex: FloatingBody, actions: Actions) -> None:
    """Collect where joints and connectors act; what acts on the same nodes with the same weights is one wrench."""
    joined: list[Place] = []
    for i in range(mbs.systemData.NumberOfObjects()):
        item = mbs.GetObject(i)
        if i == flex.number or item.get("activeConnector") is False:
            continue
        for number in sorted(numbers(item, "markerNumbers") & set(actions.places)):
            place = actions.places[number]
            _join(joined, place.without_torques() if _has_no_torque(item) else place)
    actions.wrenches = joined


def _has_no_torque(item: dict) -> bool:
    generic = item["objectType"] == "JointGeneric" and not any(item["constrainedAxes"][3:])
    return generic or item["objectType"] in FORCES_ONLY


def _join(joined: list[Place], place: Place) -> None:
    for k, other in enumerate(joined):
        if np.array_equal(other.columns[:, :3], place.columns[:, :3]):
            joined[k] = max(other, place, key=lambda p: p.columns.shape[1])
            return
    joined.append(place)
