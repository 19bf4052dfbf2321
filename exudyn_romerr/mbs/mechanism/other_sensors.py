"""OtherSensors: sensors of an mbs on none of its flexible bodies, read as computed and as errors move them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np

from ...estimates.time_step_error import PROVISIONAL
from ..access.state_guard import set_state, state_kept
from ..access.tangent_reading import INCREMENTS, rotations_of
from ..floating.sensor_outputs import is_on
from .sensor_record import Sensor, SensorRecord

if TYPE_CHECKING:
    from ...estimates.time_step_error import TimeStep
    from ...online.run import Run
    from ...report.report import OutputReport
    from ..access.linearisation import Reading, Tangents

AWAY = 0.05  # of coordinates and rates: where dependences are looked for, so that nothing vanishes by chance
SEED = 19
NO_STATE = {
    "Load": "it shows a load, not the motion",
    "UserFunction": "a user function is not called away from the run",
}
NO_FUNCTION = "its object has a user function, which is not called away from the run"
MULTIPLIERS = "it depends on forces of constraints, whose errors are not estimated"
ROTATIONS = "it depends on rotations of a Lie group node, which are increments, not coordinates"
STILL = "it does not depend on the motion"
NOT_FINITE = "it is not finite when the solve begins"
NOT_COUPLED = "the linearised mechanism, which tells how it moves, is not to be had: see the scope of the bodies"
CHANGED = (
    "the mbs was changed meanwhile (by a PostStep function, or after the solve): it is not read in stored states"
)


class OtherSensors:
    """Reads sensors in states of a run, as computed and as errors move them; their derivatives are not needed.

    asked : numbers of sensors, None: all that the mbs has. bodies : with `number`, sensors on which are left to them.

    Attributes
    ----------
    left_out : (name, why) of sensors without estimate in the last solve. records : of all solves.
    """

    def __init__(self, asked: Collection[int] | None, bodies: Sequence[Any]):
        self._asked, self._bodies = asked, bodies
        self.left_out: list[tuple[str, str]] = []
        self.sensors: list[Sensor] = []
        self.records: list[SensorRecord] = []
        self._tangents: Tangents | None = None
        self._checked: Reading | None = None
        self._last: list[np.ndarray] = []  # rows of the run where the error by time steps is provisional

    def find(self, mbs: Any, is_coupled: bool) -> tuple[list[Sensor], list[tuple[str, str]]]:
        """Return sensors that can be estimated now, and (name, why) of those that cannot.

        is_coupled : whether a linearised mechanism tells how coordinates move.
        """
        sensors: list[Sensor] = []
        left_out: list[tuple[str, str]] = []
        for number in range(mbs.systemData.NumberOfSensors()) if self._asked is None else self._asked:
            sensor = mbs.GetSensor(number)
            if any(is_on(mbs, body, sensor) for body in self._bodies):
                continue
            try:
                why, rows = self._why_not(mbs, number, sensor)
            except Exception as error:
                why, rows = f"it cannot be read: {error}", 0
            why = why or ("" if is_coupled else NOT_COUPLED)
            if why:
                left_out.append((sensor["name"], why))
            else:
                sensors.append(Sensor(number, sensor["name"], sensor.get("outputVariableType"), rows))
        return sensors, left_out

    def _why_not(self, mbs: Any, number: int, sensor: dict) -> tuple[str, int]:
        """Why a sensor cannot be estimated, and how many rows it has."""
        if sensor["sensorType"] in NO_STATE:
            return NO_STATE[sensor["sensorType"]], 0
        if sensor["sensorType"] == "Object" and _has_function(mbs.GetObject(int(sensor["objectNumber"]))):
            return NO_FUNCTION, 0
        here = _read(mbs, number)
        if not np.isfinite(here).all():
            return NOT_FINITE, 0
        rates, increments, multipliers = self._depends(mbs, number)
        if multipliers or increments:
            return (MULTIPLIERS if multipliers else ROTATIONS), 0
        return ("" if rates else STILL), len(here)

    @staticmethod
    def _depends(mbs: Any, number: int) -> list[bool]:
        """Whether a sensor depends on coordinates or their rates, on rotations by increments, on multipliers."""
        system = mbs.systemData
        turned = [j for rotation in rotations_of(mbs, INCREMENTS) for j in rotation]
        with state_kept(system) as state:
            rng = np.random.default_rng(SEED)
            moves = [
                AWAY * rng.uniform(0.5, 1.0, (2, len(x))) * np.maximum(np.abs(x).max(initial=0.0), 1.0) for x in state
            ]
            for move in moves[:3]:
                move[:, turned] = 0.0
            increments = [0 * x for x in state]
            increments[0][turned] = AWAY
            away = [x + first for x, (first, _) in zip(state, moves, strict=True)]
            forces = [*(0 * x for x in state[:3]), moves[3][1]]
            others = [*(second for _, second in moves[:3]), 0 * state[3]]
            set_state(system, system.GetTime(), away)
            base, found = _read(mbs, number), []
            for change in (others, increments, forces):
                set_state(system, system.GetTime(), [x + dx for x, dx in zip(away, change, strict=True)])
                found.append(not np.array_equal(_read(mbs, number), base))
        return found

    def begin(self, mbs: Any, tangents: Tangents | None) -> None:
        """A solve begins; tangents: None where no linearised mechanism tells anything."""
        self.sensors, self.left_out = self.find(mbs, tangents is not None)
        self._tangents, self._checked = tangents, None

    def open(self, runs: Sequence[Run], goes_on: bool) -> None:
        """Runs of the bodies open; goes_on: half widths begin with those that the runs before ended with."""
        before, self._last = self.records[-1:], []
        self.records.append(SensorRecord(runs, self.sensors, self.left_out))
        if goes_on and before and before[0].sensors == self.records[-1].sensors:
            self.records[-1].estimate.go_on(before[0].estimate)

    def outputs(self, run: Any, count: int) -> tuple[list[OutputReport], list[tuple[str, str]]]:
        """Return what is known beside a run of a body, and (name, why) of what is not."""
        found = [record for record in self.records if any(run is other for other in record.runs)]
        return found[0].outputs(count) if found else ([], list(self.left_out))

    def take(
        self, mbs: Any, rows: Sequence[np.ndarray], e: np.ndarray, narrow: np.ndarray, step: TimeStep | None
    ) -> None:
        """Take rows t (S,), q, q_t, q_tt, multipliers and how errors move them.

        e (3, S, k) : what auxiliary vectors do to coordinates, the mechanism's own first; narrow (marches, 3, S, k) :
        fewer of them, and those that keep interfaces rigid; step : error by time steps.
        """
        record = self.records[-1]
        if not record.sensors or record.failure:
            return
        try:
            if not self._is_unchanged(mbs):
                record.failure = CHANGED
                return
            with state_kept(mbs.systemData):
                self._take(mbs, record, rows, e, narrow, step)
        except Exception as error:  # of a sensor in a moved state
            record.failure = f"they cannot be read from t = {rows[0][0]:g} s on: {error}"

    def _is_unchanged(self, mbs: Any) -> bool:
        """Whether the mbs gives in states before and at the end of the rows what it gave when they were passed."""
        before, last = self._checked or self._tangents.readings[0], self._tangents.readings[-1]
        self._checked = last
        return mbs is not None and all(self._tangents.reads_the_same(mbs, reading) for reading in (before, last))

    def _take(self, mbs: Any, record: SensorRecord, rows, e, narrow, step: TimeStep | None) -> None:
        here = self._shown(mbs, rows)
        record.values.append(here)
        change, *others = (self._change(mbs, rows, here, x) for x in (e, *narrow))
        parts, checks = {"basis": change}, {}
        if others:
            checks["vectors"] = change - others[0]
        if others[1:]:
            parts = {"basis": others[1], "interfaces": change - others[1]}
        record.estimate.put(parts, checks)
        self._last = [np.concatenate(pair) for pair in zip(self._last, rows, strict=True)] if self._last else [*rows]
        if step is not None:
            late = [x[len(x) - step.x.shape[1] :] for x in self._last]
            at = self._shown(mbs, late)
            record.estimate.put_time_step(step, lambda x: self._change(mbs, late, at, x))
        self._last = [x[-PROVISIONAL:] for x in self._last]

    def _change(self, mbs: Any, rows: Sequence[np.ndarray], here: np.ndarray, dx: np.ndarray) -> np.ndarray:
        """What sensors show (S, r) in moved states, less what they show here; angles without full turns."""
        t, *states, multipliers = rows
        n = states[0].shape[1]
        moved = [x + more[:, :n] for x, more in zip(states, dx, strict=True)]
        change = self._shown(mbs, (t, *moved, multipliers)) - here
        angles = np.repeat(
            [s.shows == exu.OutputVariableType.Rotation for s in self.sensors], [s.rows for s in self.sensors]
        )
        return change - 2 * np.pi * np.round(change / (2 * np.pi)) * angles

    def _shown(self, mbs: Any, rows: Sequence[np.ndarray]) -> np.ndarray:
        found = np.zeros((len(rows[0]), sum(sensor.rows for sensor in self.sensors)))
        for i, (t, *state) in enumerate(zip(*rows, strict=True)):
            set_state(mbs.systemData, t, state)
            found[i] = np.concatenate([_read(mbs, sensor.number) for sensor in self.sensors])
        return found


def _read(mbs: Any, number: int) -> np.ndarray:
    return np.atleast_1d(np.asarray(mbs.GetSensorValues(number), dtype=float)).ravel()


def _has_function(item: dict) -> bool:
    return any(key.endswith("UserFunction") and value for key, value in item.items())
