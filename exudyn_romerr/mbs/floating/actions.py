"""Actions: known loads on a floating body, and places where unknown wrenches act (theory.md 7)."""

from __future__ import annotations

import weakref
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import AssumptionError
from ...linear.residual.input_signal import FEW, values_at_once
from ...model.admissible_space import MeanMotion
from ...model.floating_frame import left_jacobian
from ..access.detached import Detached, OnlyReads

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...model.body import ElasticBody
    from ...model.floating_frame import FrameMotion

REMEMBERS = (
    "the function of a load, called for t = {:g} to {:g} s away from the run, keeps something from call to call: its "
    "values are not those of the run; make it a function of time alone"
)
NO_WORK = 1e-9  # of a column: what rounding leaves where the reference conditions hold a marker's motion at zero


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
class OfTime:
    """A vector (3,) over time; function : the user's own behind it, if there is one, of an mbs, a weak reference.

    at : of the function, a function of time; None: the vector is `given` all the time. given : (3,), what the
    function is given. name : of the load, in lines of the plan.
    """

    at: Callable[[Callable | None], Callable[[float], Any]] | None
    function: Callable | None = None
    mbs: Callable[[], Any] | None = None
    given: tuple[float, ...] = ()
    name: str = ""


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

    def sizes_of_gravity(self) -> np.ndarray:
        """Return the sum (3,) of the sizes of all accelerations of gravity at the start."""
        return sum((np.abs(over_time(g, np.zeros(1))[0]) for g in self.gravity), np.zeros(3))

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
    return _called(vector, times)[again]


def _called(vector: OfTime, times: np.ndarray) -> np.ndarray:
    """The same at ascending times (T,), (T, 3)."""
    if vector.function is None:
        return _values(vector.at(None), times)
    detached = Detached(vector.mbs(), [vector.function])
    try:
        with detached.in_use(*filter(None, [vector.mbs()])):
            return _values(vector.at(detached.of(vector.function)), times)
    finally:  # what it keeps may make it fail, too
        if detached.has_changed():
            raise AssumptionError(REMEMBERS.format(times[0], times[-1]))


def _values(at: Callable[[float], Any], times: np.ndarray) -> np.ndarray:
    values = values_at_once(at, times, 3) if len(times) > FEW else None
    if values is None:  # backwards: the run may be at the last time, where memory of the time would be what it was
        values = np.array([at(x) for x in times[::-1].tolist()], dtype=float).reshape(-1, 3)[::-1]
    return values


def load_vector(mbs: Any, name: str, load: dict, load_factor: Callable | None) -> OfTime:
    """Return a load's vector as a function of time; a user function is called again, after the steps were made."""
    vector, user = np.array(load["loadVector"], dtype=float), load["loadVectorUserFunction"]
    if not user:
        if load_factor is None:
            return OfTime(None, given=tuple(vector.tolist()), name=name)
        return OfTime(lambda _: lambda t: vector * load_factor(t), name=name)
    f, given = user["function"], tuple(vector.tolist())
    owner = weakref.ref(mbs)  # the mbs holds the hook; a hook that held the mbs would keep it for ever
    # a list of its own, as Exudyn gives it: functions may write to it, and return it
    if callable(f):
        return OfTime(lambda f: lambda t: f(OnlyReads(owner()), t, [*given]), f, owner, given, name)
    return OfTime(
        lambda _: lambda t: f.Evaluate(owner(), t, [*given]), None, owner, given, name
    )  # a symbolic function
