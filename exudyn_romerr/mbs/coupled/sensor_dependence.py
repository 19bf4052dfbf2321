"""What a sensor of an mbs depends on: whether it can be estimated, and what has to be moved to do so."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..access.state_guard import set_state, state_kept
from ..derivatives.tangent_reading import INCREMENTS, rotations_of
from ..sensors.without_state import NO_STATE
from .sensor_record import Sensor

AWAY = 0.05  # of coordinates and rates: where dependences are looked for, so that nothing vanishes by chance
SEED = 19
NO_FUNCTION = "its object has a user function, which is not called away from the run"
SHARED = (
    "it depends on forces of redundant constraints, of which only the sum is determined: leave one of them out, for "
    "instance an axis of a joint"
)
LINEAR = "it shows a linear body, whose basis no linearised mechanism knows: pass (flex, Output) in outputs="
ROTATIONS = "it depends on rotations of a Lie group node, which are increments, not coordinates"
STILL = "it does not depend on the motion"
NOT_FINITE = "it is not finite when the solve begins"


def sensor_or_reason(mbs: Any, number: int, shared: np.ndarray, linear: Sequence[int] = ()) -> Sensor | str:
    """Return a sensor that can be estimated, or why it cannot be.

    shared : numbers of redundant constraints, and of those that imply them. linear : coordinates of linear bodies.
    """
    item = mbs.GetSensor(number)
    if item["sensorType"] in NO_STATE:
        return NO_STATE[item["sensorType"]]
    if item["sensorType"] == "Object" and _has_function(mbs.GetObject(int(item["objectNumber"]))):
        return NO_FUNCTION
    here = read_sensor(mbs, number)
    if not np.isfinite(here).all():
        return NOT_FINITE
    motion, increments, accelerations, forces, of_shared, of_linear = _depends(mbs, number, shared, linear)
    if increments or of_shared or of_linear:
        return ROTATIONS if increments else SHARED if of_shared else LINEAR
    if not motion and not forces:
        return STILL
    return Sensor(number, item["name"], item.get("outputVariableType"), len(here), accelerations or forces)


def _depends(mbs: Any, number: int, shared: np.ndarray, linear: Sequence[int]) -> list[bool]:
    """Whether it depends on the motion, increments of rotations, q_tt, multipliers, some of these, linear bodies."""
    system = mbs.systemData
    turned = [j for rotation in rotations_of(mbs, INCREMENTS) for j in rotation]
    with state_kept(system) as state:
        rng = np.random.default_rng(SEED)
        moves = [
            AWAY * rng.uniform(0.5, 1.0, (2, len(x))) * np.maximum(np.abs(x).max(initial=0.0), 1.0) for x in state
        ]
        for move in moves[:3]:
            move[:, turned] = 0.0
        away, (*motion, forces) = zip(*moves, strict=True)
        still = [0 * x for x in state]
        increments, of_shared = still[0].copy(), still[3].copy()
        increments[turned], of_shared[shared] = AWAY, forces[shared]
        changes = (
            [*motion, still[3]],
            [increments, *still[1:]],
            [*still[:2], motion[2], still[3]],
            [*still[:3], forces],
            [*still[:3], of_shared],
            [*(x * np.isin(np.arange(len(x)), linear) for x in motion), still[3]],
        )
        at = [x + dx for x, dx in zip(state, away, strict=True)]
        set_state(system, system.GetTime(), at)
        base, found = read_sensor(mbs, number), []
        for change in changes:
            set_state(system, system.GetTime(), [x + dx for x, dx in zip(at, change, strict=True)])
            found.append(not np.array_equal(read_sensor(mbs, number), base))
    return found


def read_sensor(mbs: Any, number: int) -> np.ndarray:
    """What it shows (r,) in the current state."""
    return np.asarray(mbs.GetSensorValues(number), dtype=float).reshape(-1)


def _has_function(item: dict) -> bool:
    return any(key.endswith("UserFunction") and value for key, value in item.items())
