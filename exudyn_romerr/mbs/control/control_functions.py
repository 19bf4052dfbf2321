"""Controllers: user functions of springs and loads whose forces follow the motion, and which of them can be followed.

A force f(q, q', t) that smoothly follows the motion, and keeps nothing from call to call, is a spring and damper to
first order. Where its gains are those of a passive one, it does no work on the error, either.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import exudyn as exu
import numpy as np

from ..access.load_functions import LATER, MOVED, as_given, controllers, load_functions, loads_with_functions, shifts
from ..access.state_guard import state_kept
from ..memory.standstill import look_up, note
from ..memory.user_memory import memory_kept
from .mbs_by_name import hint_of

OUTPUT = exu.OutputVariableType
Force = Callable[[float, float], np.ndarray]  # of a time, of what displacement and velocity are moved by
DIFFERENCE = 1e-6  # of displacements and velocities, to differentiate by; 10 times as much tells what is not smooth
SMOOTH = 0.1  # of the largest gain: what both may differ by
PASSIVE = 1e-6  # of the largest gain: rounding of differences
KEEPS = (
    "depends on earlier calls: a controller may do work on the error, and cannot be asked beside the run, so let it "
    "depend on what it is given alone"
)
REACHES = "may depend on earlier calls, for its function can reach what no call beside the run could put back: {}"
FAILS = "has a function that fails where it is tried: {}"
BY_FORCES = (
    "has a function of accelerations or forces: a linearised mechanism has none of these, so let it depend on the "
    "displacement and velocity that it is given"
)
JUMPS = (
    "has a function that is not smooth where the run begins: a linearised mechanism is, so let it be (for sign(v) "
    "take tanh(v / v0))"
)
LOOKS = "is a controller that looks at the motion elsewhere: it may do work on the error"
WORKS = "is a controller with negative, or coupled, stiffness or damping: it may do work on the error"
MAY_WORK = (LOOKS, WORKS)


class SpringType(NamedTuple):
    """A type of object: its user function, what this is given last, and which outputs it is given as its motion."""

    function: str
    last: str
    displacement: str
    velocity: str


SPRINGS = {
    "ConnectorTorsionalSpringDamper": SpringType(
        "springTorqueUserFunction", "offset", "Rotation", "AngularVelocityLocal"
    ),
    "ConnectorCoordinateSpringDamper": SpringType("springForceUserFunction", "offset", "Displacement", "Velocity"),
    "ConnectorCartesianSpringDamper": SpringType("springForceUserFunction", "offset", "Displacement", "Velocity"),
    "ConnectorLinearSpringDamper": SpringType(
        "springForceUserFunction", "offset", "DisplacementLocal", "VelocityLocal"
    ),
    "ConnectorSpringDamper": SpringType("springForceUserFunction", "force", "Displacement", "Velocity"),
}


class Spring(NamedTuple):
    """A spring whose force is a user function (mbs, t, number, displacement, velocity, stiffness, damping, last)."""

    number: int
    name: str
    function: Callable
    item: dict[str, Any]

    @property
    def type(self) -> SpringType:
        """Of the object."""
        return SPRINGS[self.item["objectType"]]

    def motion(self, mbs: Any) -> np.ndarray:
        """Return displacement and velocity (2, k) that the function is given in the current state."""
        outputs = self.type.displacement, self.type.velocity
        x, v = (mbs.GetObjectOutput(self.number, getattr(OUTPUT, name)) for name in outputs)
        if self.item["objectType"] == "ConnectorSpringDamper":
            length = np.linalg.norm(x)
            x, v = length - self.item["referenceLength"], np.dot(x, v) / length
        return np.reshape([x, v], (2, -1))

    def force(self, mbs: Any, t: float, motion: np.ndarray) -> np.ndarray:
        """Return the force (k,) of a motion (2, k), as Exudyn asks for it."""
        x, v = motion if motion.shape[1] > 1 else motion[:, 0]
        given = [as_given(self.item[name]) for name in ("stiffness", "damping", self.type.last)]
        return np.ravel(self.function(mbs, t, self.number, as_given(x), as_given(v), *given)).astype(float)

    def gains(self, mbs: Any, t: float, motion: np.ndarray, step: float = DIFFERENCE) -> np.ndarray:
        """Return derivatives (2, k, k) of the force by displacement and by velocity."""
        found = np.zeros((2, motion.shape[1], motion.shape[1]))
        for place in np.ndindex(motion.shape):
            by = np.zeros(motion.shape)
            by[place] = step * max(1.0, np.abs(motion[place[0]]).max())
            sides = self.force(mbs, t, motion + by) - self.force(mbs, t, motion - by)
            found[place[0], :, place[1]] = sides / (2 * by[place])
        return found


@dataclass(frozen=True)
class Controls:
    """Controllers of an mbs.

    refused : why the motion of errors cannot be told with them. active : why they may do work on the error. springs :
    those that do none, as far as they can be told from the state that they were tried in. loads : numbers of loads
    that follow the motion. functions_look : whether user functions look at the mbs, beyond what Exudyn gives them.
    """

    refused: tuple[str, ...] = ()
    active: tuple[str, ...] = ()
    springs: tuple[Spring, ...] = ()
    loads: frozenset[int] = frozenset()
    functions_look: bool = False


def find_controls(mbs: Any) -> Controls:
    """Return the controllers of an mbs in its current state; what functions keep, and the state, are set back.

    While no step is made, found once.
    """
    key = find_controls, id(mbs)
    found = look_up(key) or note(key, (mbs, _found(mbs)))
    return found[1]


def _found(mbs: Any) -> Controls:
    refused, active, passive, functions_look = [], [], [], False
    for spring in _springs(mbs):
        kind = _tried(mbs, [spring.function], lambda spring=spring: _of_spring(mbs, spring))
        looks = kind == LOOKS
        kind = kind if kind and not looks else _kind_of_gains(mbs, spring, looks)
        if kind == "":
            passive.append(spring)
        else:
            hint = _of_outside(kind, [spring.function])
            (active if kind in MAY_WORK else refused).append(f"{spring.name} {kind}{hint}")
            functions_look = functions_look or looks
    loads = frozenset(controllers(mbs, loads_with_functions(mbs)))
    for i in sorted(loads):
        item = mbs.GetLoad(i)
        kind = _tried(mbs, load_functions(item), lambda item=item: _of_load(mbs, item))
        hint = _of_outside(kind, load_functions(item))
        (active if kind in MAY_WORK else refused).append(f"load {i} ({item['name']}) {kind or KEEPS}{hint}")
    return Controls(tuple(refused), tuple(active), tuple(passive), loads, functions_look or bool(loads))


def _of_outside(kind: str, functions: list[Callable]) -> str:
    """What to type where functions look at the motion in an mbs that they were not given; empty: they do not."""
    hint = hint_of(functions) if kind == LOOKS else ""
    return hint and f", and {hint}"


def is_followed(item: dict[str, Any]) -> bool:
    """Whether an object is a spring whose user function can be followed, if nothing else speaks against it."""
    kind = SPRINGS.get(item["objectType"])
    return bool(kind and item[kind.function] and callable(item[kind.function]["function"]))


def _springs(mbs: Any) -> list[Spring]:
    found = []
    for i in range(mbs.systemData.NumberOfObjects()):
        item = mbs.GetObject(i)
        if is_followed(item):
            name = f"object {i} ({item['name']}, {item['objectType']})"
            found.append(Spring(i, name, item[SPRINGS[item["objectType"]].function]["function"], item))
    return found


def _of_spring(mbs: Any, spring: Spring) -> Force:
    motion = spring.motion(mbs)
    return lambda t, by: spring.force(mbs, t, motion + by)


def _of_load(mbs: Any, item: dict[str, Any]) -> Force:
    functions, given = load_functions(item), as_given(item.get("loadVector", item.get("load")))
    return lambda t, by: np.hstack([f(mbs, t, given) for f in functions])


def _tried(mbs: Any, functions: list[Callable], prepared: Callable[[], Force]) -> str:
    """Why a force, given its own displacement and velocity, is not one of time alone; empty: it is."""
    system, t = mbs.systemData, mbs.systemData.GetTime()
    with memory_kept(mbs, functions) as memory:
        if memory.lost:
            return REACHES.format(memory.lost)
        try:
            with state_kept(system) as (q, q_t, q_tt, multipliers):
                force = prepared()
                first = force(t, 0.0)
                system.SetODE2Coordinates_tt(_moved(q_tt))
                system.SetAECoordinates(_moved(multipliers))
                by_forces = force(t, 0.0)
                system.SetODE2Coordinates(_moved(q))
                system.SetODE2Coordinates_t(_moved(q_t))
                by_motion = force(t, 0.0)
                force(t + LATER * max(abs(t), 1.0), MOVED)  # an integral over time would show in what follows
            remembers = memory.changed
            again = force(t, 0.0)
        except Exception as error:
            return FAILS.format(error)
    if remembers or memory.was_changed or not np.array_equal(first, again):
        return KEEPS
    if not np.array_equal(first, by_forces):
        return BY_FORCES
    return "" if np.array_equal(first, by_motion) else LOOKS


def _moved(x: np.ndarray) -> np.ndarray:
    return x + shifts(len(x)) * np.abs(x).max(initial=1.0)


def _kind_of_gains(mbs: Any, spring: Spring, looks: bool) -> str:
    """Why the gains are not those of a passive spring and damper; empty: they are."""
    t, motion = mbs.systemData.GetTime(), spring.motion(mbs)
    try:
        near, far = (spring.gains(mbs, t, motion, step) for step in (DIFFERENCE, 10 * DIFFERENCE))
    except Exception as error:
        return FAILS.format(error)
    if not np.all(np.abs(near - far).max(axis=(1, 2)) <= SMOOTH * np.abs(near).max(axis=(1, 2))):
        return JUMPS
    return LOOKS if looks else "" if are_passive(near) else WORKS


def are_passive(gains: np.ndarray) -> bool:
    """Whether gains (2, k, k) by displacement and velocity take energy away or keep it."""
    stiffness, damping = gains
    symmetric = np.abs(stiffness - stiffness.T).max() <= PASSIVE * np.abs(stiffness).max()
    rest = [np.linalg.eigvalsh(x + x.T)[0] >= -PASSIVE * np.abs(x).max() for x in (stiffness, damping)]
    return bool(symmetric and all(rest))
