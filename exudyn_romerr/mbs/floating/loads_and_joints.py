"""What acts on a floating body: loads, which are known, and wrenches of joints, which are not (theory.md 7)."""

from __future__ import annotations

import weakref
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import AssumptionError, InputError
from ...linear.residual.input_signal import FEW, values_at_once
from ...model.admissible_space import MeanMotion, mean_motion
from ...model.floating_frame import left_jacobian
from ..access.detached import Detached, OnlyReads, controller
from ..access.mbs_items import Items, is_active, nodes_of, numbers

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...model.body import ElasticBody
    from ...model.floating_frame import FrameMotion
    from .floating_body import FloatingBody, ReducedMatrices

WEIGHT_SUM = 1e-9  # markers whose weights do not sum to 1 do not take a mean
FORCES_ONLY = ("JointSpherical", "ConnectorCartesianSpringDamper", "ConnectorSpringDamper")
MESH_MARKERS = ("SuperElementPosition", "SuperElementRigid")
NO_WORK = 1e-9  # of a column: what rounding leaves where the reference conditions hold a marker's motion at zero


@dataclass(frozen=True, eq=False)
class Place:
    """Where a marker acts: columns (N, 3 or 6) of unit forces and torques, the mean motion it takes, its axes (3, 3).

    The transpose of the columns of torques takes the mean rotation.

    turns : how Exudyn lets the marker turn, other than by the exponential map of its mean rotation; None: so.
    """

    name: str
    columns: np.ndarray
    mean: MeanMotion | None = None
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))
    turns: str | None = None

    def without_torques(self) -> Place:
        """Return the place for what acts by forces only."""
        return replace(self, columns=self.columns[:, :3])

    def works(self, body: ElasticBody) -> bool:
        """Whether anything that acts here moves the body in its space of admissible displacements."""
        left = np.linalg.norm(body.space.loads(self.columns), axis=0)
        return bool(np.any(left > NO_WORK * np.linalg.norm(self.columns, axis=0)))


@dataclass(frozen=True)
class OfTime:
    """A vector (3,) over time; function : the user's own behind it, if there is one, of an mbs, a weak reference.

    at : of the function, a function of time; None: the vector is `given` all the time. given : (3,), what the
    function is given. name, number : of the load.
    """

    at: Callable[[Callable | None], Callable[[float], Any]] | None
    function: Callable | None = None
    mbs: Callable[[], Any] | None = None
    given: tuple[float, ...] = ()
    name: str = ""
    number: int = -1

    def by(self, detached: Detached) -> Callable[[float], Any]:
        """Return it as a function of time that calls a copy of the user's."""
        if self.at is None:
            return lambda t: self.given
        return self.at(self.function and detached.of(self.function))


@dataclass(frozen=True)
class Load:
    """A known force or torque (`torque`) over time, in global axes or in those of its marker (`body_fixed`)."""

    name: str
    place: Place
    vector: OfTime
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
            from scipy.spatial.transform import Rotation  # here, for it takes long to import, and few loads need it

            vectors = Rotation.from_rotvec(theta).apply(vectors @ self.place.axes.T)
        else:
            vectors = motion.local(vectors)
        # the work of a torque goes over the rates of theta
        return np.einsum("sij,sj->si", left_jacobian(theta), vectors) if self.torque else vectors


@dataclass
class Actions:
    """All that acts on one floating body.

    loads : known ones. wrenches : places where joints and connectors act. gravity : accelerations. places : all
    markers on mesh nodes, by number. idle : names of those that act but do no work.
    """

    loads: list[Load] = field(default_factory=list)
    wrenches: list[Place] = field(default_factory=list)
    gravity: list[OfTime] = field(default_factory=list)
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

    def lines(self) -> tuple[str, ...]:
        """Return lines of the plan: what is known, and where the balance tells what acts."""
        known = (*(load.name for load in self.loads), *(f"gravity, {g.name}" for g in self.gravity))
        return *(f"known: {name}" for name in known), *(f"wrench from V^T R = 0: {p.name}" for p in self.wrenches)

    def gravity_at(self, t: np.ndarray) -> np.ndarray:
        """Return the acceleration of gravity at times t (S,), in global axes: (S, 3)."""
        if all(g.at is None for g in self.gravity):
            return np.broadcast_to(sum((np.array(g.given) for g in self.gravity), np.zeros(3)), (len(t), 3))
        return sum((over_time(g, t) for g in self.gravity), np.zeros((len(t), 3)))

    def gravity_by(self, detached: Detached) -> Callable[[float], np.ndarray]:
        """Return gravity (3,) as a function of time that calls copies of the user's, while these are in use."""
        parts = [one.by(detached) for one in self.gravity]
        return lambda t: sum((np.asarray(part(t), float) for part in parts), np.zeros(3))

    def weight(self, carried: np.ndarray) -> float:
        """Largest entry of V^T M e_j (n, 3) times the size of gravity at the start: terms that may cancel."""
        sizes = sum((np.abs(over_time(g, np.zeros(1))[0]) for g in self.gravity), np.zeros(3))
        return float(np.max(np.abs(carried) @ sizes, initial=0.0))

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


def over_time(vector: OfTime, t: np.ndarray) -> np.ndarray:
    """Return a vector at times t (S,), a user's function called once for times that repeat: (S, 3).

    A copy of it is called: the run goes on with what it keeps.

    Raises
    ------
    AssumptionError
        It keeps something from call to call, which it did not when the solve began.
    """
    if vector.at is None:
        return np.tile(vector.given, (len(t), 1))
    times, again = np.unique(t, return_inverse=True)
    if vector.function is None:
        return _values(vector.at(None), times)[again]
    detached = Detached(vector.mbs(), [vector.function])
    try:
        with detached.in_use(vector.mbs()):
            return _values(vector.by(detached), times)[again]
    finally:  # what it keeps may make it fail, too
        if detached.has_changed():
            raise AssumptionError(
                f"the function of a load, called for t = {times[0]:g} to {times[-1]:g} s away from the run, keeps "
                "something from call to call: its values are not those of the run; make it a function of time alone"
            )


def _values(at: Callable[[float], Any], times: np.ndarray) -> np.ndarray:
    """A function of time at ascending times (T,), (T, 3)."""
    values = values_at_once(at, times, 3) if len(times) > FEW else None
    if values is None:  # backwards: the run may be at the last time, where memory of the time would be what it was
        values = np.array([at(x) for x in times[::-1].tolist()], dtype=float).reshape(-1, 3)[::-1]
    return values


def load_vector(mbs: Any, name: str, number: int, load: dict, load_factor: Callable | None) -> OfTime:
    """Return a load's vector as a function of time; a user function is called again, after the steps were made."""
    vector, user = np.array(load["loadVector"], dtype=float), load["loadVectorUserFunction"]
    given = tuple(vector.tolist())
    if not user:
        at = None if load_factor is None else lambda _: lambda t: vector * load_factor(t)
        return OfTime(at, given=given, name=name, number=number)
    f, owner = user["function"], weakref.ref(mbs)  # the mbs holds the hook; one that held it would keep it for ever

    def of_function(copy: Callable | None) -> Callable[[float], Any]:
        # a list of its own, as Exudyn gives it: functions may write to it, and return it
        if copy is None:  # a symbolic function
            return lambda t: f.Evaluate(owner(), t, [*given])
        return lambda t: copy(OnlyReads(owner()), t, [*given])

    return OfTime(of_function, f if callable(f) else None, owner, given, name, number)


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
            actions.gravity.append(load_vector(mbs, name, i, load, load_factor))
        elif unknown:
            _join(actions.wrenches, place if load["loadType"] == "TorqueVector" else place.without_torques())
        else:
            actions.loads.append(_load(name, load, place, load_vector(mbs, name, i, load, load_factor)))


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
