"""OtherSensors: sensors of an mbs on none of its flexible bodies, read as computed and as errors move them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np

from ...online.kept_estimate import REMAINDER
from ...trajectory.estimate import PROVISIONAL
from ..access.load_functions import user_functions
from ..access.mbs_items import sensor_name
from ..access.state_guard import set_state, state_kept
from ..derivatives.twin import Place
from ..floating.sensor_outputs import is_on
from ..mechanism.stored_residuals import HOLDS, MEMORY
from ..memory.user_memory import memory_kept
from .sensor_dependence import read_sensor, sensor_or_reason
from .sensor_record import Sensor, SensorRecord

if TYPE_CHECKING:
    from ...online.run import Run
    from ...report.report import OutputReport
    from ...trajectory.estimate import TimeStep
    from ..derivatives.linearisation import Reading, Tangents

COORDINATES = exu.OutputVariableType.Coordinates
NOT_COUPLED = "the linearised mechanism, which tells how it moves, is not to be had: {}"
NO_MECHANISM = "nothing reacts to the deformation of an attached body"
CHANGED = (
    "the mbs was changed meanwhile (by a PostStep function, or after the solve): it is not read in stored states"
)


class OtherSensors:
    """Reads sensors in states of a run, as computed and as errors move them; their derivatives are not needed.

    asked : numbers of sensors, None: all that the mbs has. bodies : with `number`, sensors on which are left to them.
    linear : numbers of the nodes of linear bodies, sensors on which are left out.

    Attributes
    ----------
    left_out : (name, why) of sensors without estimate in the last solve. records : of all solves.
    """

    def __init__(self, asked: Collection[int] | None, bodies: Sequence[Any], linear: Sequence[int] = ()):
        self._asked, self._bodies, self._linear = asked, bodies, linear
        self.left_out: list[tuple[str, str]] = []
        self.sensors: list[Sensor] = []
        self.records: list[SensorRecord] = []
        self._tangents: Tangents | None = None
        self._checked: Reading | None = None
        self._last: list[np.ndarray] = []  # rows of the run where the error by time steps is provisional

    def find(
        self, mbs: Any, is_coupled: bool, tangents: Tangents | None = None, why: str = ""
    ) -> tuple[list[Sensor], list[tuple[str, str]]]:
        """Return sensors that can be estimated now, and (name, why) of those that cannot.

        is_coupled : whether a linearised mechanism tells how coordinates move; tangents : of this, if there are some.
        why : there is none.
        """
        shared = np.zeros(0, int) if tangents is None else tangents.shared(mbs)
        linear = [
            mbs.GetNodeODE2Index(i) + j for i in self._linear for j in range(len(mbs.GetNodeOutput(i, COORDINATES)))
        ]
        sensors: list[Sensor] = []
        left_out: list[tuple[str, str]] = []
        for number in range(mbs.systemData.NumberOfSensors()) if self._asked is None else self._asked:
            sensor = mbs.GetSensor(number)
            if any(is_on(mbs, body, sensor) for body in self._bodies):
                continue
            try:
                found = sensor_or_reason(mbs, number, shared, linear)
            except Exception as error:
                found = f"it cannot be read: {error}"
            name = sensor_name(mbs, number) if self._asked is None else sensor["name"]
            if isinstance(found, Sensor) and is_coupled:
                sensors.append(found._replace(name=name))
            else:
                left_out.append(
                    (name, NOT_COUPLED.format(why or NO_MECHANISM) if isinstance(found, Sensor) else found)
                )
        return sensors, left_out

    def begin(self, mbs: Any, tangents: Tangents | None, why: str = "") -> None:
        """A solve begins; tangents: None where no linearised mechanism tells anything, and why."""
        self.sensors, self.left_out = self.find(mbs, tangents is not None, tangents, why)
        self._tangents, self._checked = tangents, None
        self._functions = user_functions(mbs) if any(sensor.balanced for sensor in self.sensors) else []

    def open(self, runs: Sequence[Run], goes_on: bool) -> None:
        """Runs of the bodies open; goes_on: half widths begin with those that the runs before ended with."""
        before, self._last = self.records[-1:], []
        if before and before[0].runs == tuple(runs):  # once more, with other vectors
            self.records.pop()
        self.records.append(SensorRecord(runs, self.sensors, self.left_out))
        if goes_on and before and before[0].sensors == self.records[-1].sensors:
            self.records[-1].estimate.go_on(before[0].estimate, before[0].values.read)

    def outputs(self, run: Any, count: int) -> tuple[list[OutputReport], list[tuple[str, str]]]:
        """Return what is known beside a run of a body, and (name, why) of what is not."""
        found = [record for record in self.records if any(run is other for other in record.runs)]
        return found[0].outputs(count) if found else ([], list(self.left_out))

    def take(
        self,
        mbs: Any,
        rows: Sequence[np.ndarray],
        moves: Sequence[tuple[np.ndarray, ...]],
        step: TimeStep | None,
        left: Sequence[np.ndarray] | None = None,
    ) -> None:
        """Take rows t (S,), q, q_t, q_tt, multipliers and how errors move them.

        moves : what auxiliary vectors do to coordinates (3, S, k), the mechanism's own first, and multipliers (S, c);
        fewer of them, and those that keep interfaces rigid. step : error by time steps. left : what the former may
        lack, the sum of the sizes of these (3, S, k); None: it was not measured.
        """
        record = self.records[-1]
        if not record.sensors or record.failure:
            return
        try:
            if not self._is_unchanged(mbs):
                record.failure = CHANGED
                return
            with state_kept(mbs.systemData), self._memory_kept(mbs, record):
                self._take(mbs, record, rows, moves, step, left)
        except Exception as error:  # of a sensor in a moved state
            record.failure = f"they cannot be read from t = {rows[0][0]:g} s on: {error}"

    @contextmanager
    def _memory_kept(self, mbs: Any, record: SensorRecord) -> Iterator[None]:
        """Put back what user functions keep, where forces are balanced; if they keep something, they are not."""
        if record.unbalanced or not any(sensor.balanced for sensor in self.sensors):
            yield
            return
        with memory_kept(mbs, self._functions) as memory:
            record.unbalanced = HOLDS.format(memory.lost) if memory.lost else ""
            yield
            record.unbalanced = record.unbalanced or (MEMORY if memory.changed else "")

    def _is_unchanged(self, mbs: Any) -> bool:
        """Whether the mbs gives in states before and at the end of the rows what it gave when they were passed."""
        before, last = self._checked or self._tangents.readings[0], self._tangents.readings[-1]
        self._checked = last
        return mbs is not None and all(self._tangents.reads_the_same(mbs, reading) for reading in (before, last))

    def _take(
        self, mbs: Any, record: SensorRecord, rows, moves: Sequence[tuple], step: TimeStep | None, left
    ) -> None:
        here = self._shown(mbs, rows)
        record.values.append(here)
        change, *others = (self._change(mbs, rows, here, *move) for move in moves)
        parts, checks = {"basis": change}, {}
        if others:
            checks["vectors"] = change - others[0]
        if left is not None:
            e, forces = moves[0]
            moved = (self._change(mbs, rows, here, e + x, forces) for x in left if x.any())
            checks[REMAINDER] = sum((np.abs(y - change) for y in moved), 0.0 * change)
        if others[1:]:
            parts = {"basis": others[1], "interfaces": change - others[1]}
        record.estimate.put(parts, checks)
        self._last = [np.concatenate(pair) for pair in zip(self._last, rows, strict=True)] if self._last else [*rows]
        if step is not None:
            late = [x[len(x) - step.x.shape[1] :] for x in self._last]
            at, balanced = record.values.read()[-len(late[0]) :], self._shown(mbs, late, record)
            record.estimate.put_time_step(
                step, lambda x: self._change(mbs, late, balanced, x, record=record), balanced - at
            )
        self._last = [x[-PROVISIONAL:] for x in self._last]

    def _change(
        self,
        mbs: Any,
        rows: Sequence[np.ndarray],
        here: np.ndarray,
        dx: np.ndarray,
        multipliers: np.ndarray | float = 0.0,
        record: SensorRecord | None = None,
    ) -> np.ndarray:
        """What sensors show (S, r) in moved states, less what they show here; angles without full turns.

        dx (3, S, k), multipliers (S, c) : what moves. record : of sensors that are read where forces balance there.
        """
        if not dx.any() and not np.any(multipliers):
            return 0.0 * here
        t, *states, forces = rows
        n = states[0].shape[1]
        moved = self._tangents.moved(states, dx[..., :n])
        forces = forces.copy()
        forces[:, self._tangents.independent] += multipliers
        change = self._shown(mbs, (t, *moved, forces), record) - here
        angles = np.repeat(
            [s.shows == exu.OutputVariableType.Rotation for s in self.sensors], [s.rows for s in self.sensors]
        )
        return change - 2 * np.pi * np.round(change / (2 * np.pi)) * angles

    def _balanced(self, mbs: Any, rows: Sequence[np.ndarray], record: SensorRecord) -> Sequence[np.ndarray]:
        """The rows with accelerations and multipliers that balance, if these can be had."""
        try:
            at = self._cheapest(mbs, rows)
            return at.equations.balanced(at.mbs, rows, self._tangents.independent)
        except Exception as error:  # of a user function, or of a state that cannot be
            record.unbalanced = str(error)
            return rows

    def _cheapest(self, mbs: Any, rows: Sequence[np.ndarray]) -> Place:
        """The light copy if it shows what the mbs shows at another time than the mbs is at; or the mbs."""
        t, *state = (x[0] for x in rows)
        is_there = mbs.systemData.GetTime() == t
        return Place(self._tangents.equations, mbs) if is_there else self._tangents.cheapest(mbs, t, state)

    def _shown(self, mbs: Any, rows: Sequence[np.ndarray], record: SensorRecord | None = None) -> np.ndarray:
        """What sensors show (S, r) in states; record: of its run, where accelerations and multipliers balance."""
        if record is not None and not record.unbalanced and any(sensor.balanced for sensor in self.sensors):
            rows = self._balanced(mbs, rows, record)
        found = np.zeros((len(rows[0]), sum(sensor.rows for sensor in self.sensors)))
        for i, (t, *state) in enumerate(zip(*rows, strict=True)):
            set_state(mbs.systemData, t, state)
            found[i] = np.concatenate([read_sensor(mbs, sensor.number) for sensor in self.sensors])
        return found
