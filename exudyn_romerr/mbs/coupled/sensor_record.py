"""SensorRecord: what sensors on no flexible body show along a solve, and how wrong that is about."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from re import sub
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...online.kept_estimate import KeptEstimate
from ...report.data import UNITS
from ...report.report import OutputReport
from ...report.scope import COUPLED
from ...trajectory.growing_array import GrowingArray

if TYPE_CHECKING:
    from ...online.run import Run
    from ...trajectory.estimate import Estimate

ENDED = (
    "estimates of the mechanism ended before its bounds: the line that begins with 'estimates are those under frozen "
    "inputs' says why"
)
UNBALANCED = "it depends on accelerations or forces of constraints, which are not computed away from the run: {}"


class Sensor(NamedTuple):
    """A sensor that can be estimated: number, name, what it shows, rows.

    balanced : whether it depends on accelerations or multipliers, which are those that balance the forces.
    """

    number: int
    name: str
    shows: Any
    rows: int
    balanced: bool = False

    @property
    def of(self) -> str:
        """What it shows, in words: "angular velocity"."""
        shows = "" if self.shows is None else self.shows.name.removesuffix("Local")
        return sub(r"(?<!^)([A-Z])", r" \1", shows).lower()

    @property
    def unit(self) -> str:
        """The unit of that, where it is the same in every system of units."""
        return "" if self.shows is None else UNITS.get(self.shows.name.removesuffix("Local"), "")


class SensorRecord:
    """What sensors showed along one solve.

    runs : of the bodies. sensors, left_out : those read, and (name, why) of others. values (T, r), estimate : of all
    rows. failure : why nothing is known. unbalanced : why forces cannot be balanced, which some sensors need.
    """

    def __init__(self, runs: Sequence[Run], sensors: Sequence[Sensor], left_out: Sequence[tuple[str, str]]):
        self.runs, self.sensors, self.left_out = tuple(runs), tuple(sensors), tuple(left_out)
        ends = np.cumsum([0, *(sensor.rows for sensor in sensors)])
        self.parts = [slice(a, b) for a, b in pairwise(ends.tolist())]
        rings = np.repeat([sensor.balanced for sensor in sensors], [sensor.rows for sensor in sensors])
        self.values, self.estimate, self.failure = GrowingArray(), KeptEstimate(rings), ""
        self.unbalanced = ""

    def outputs(self, count: int) -> tuple[list[OutputReport], list[tuple[str, str]]]:
        """Return what is known at the first `count` instants, and (name, why) of what is not."""
        left_out, failure = list(self.left_out), self.failure or (ENDED if len(self.values) < count else "")
        if failure or not self.sensors:
            return [], left_out + [(sensor.name, failure) for sensor in self.sensors]
        whole, at = self.estimate.read(slice(count), self.values.read), self.values.read()[:count]
        lost = [sensor for sensor in self.sensors if sensor.balanced and self.unbalanced]
        left_out += [(sensor.name, UNBALANCED.format(self.unbalanced)) for sensor in lost]
        known = [of for of in zip(self.sensors, self.parts, strict=True) if of[0] not in lost]
        return [self._output(*of, whole, at) for of in known], left_out

    @staticmethod
    def _output(sensor: Sensor, part: slice, whole: Estimate, at: np.ndarray) -> OutputReport:
        estimate, value = whole.of_rows(part), at[:, part]
        causes = {cause: np.full(value.shape, np.inf if cause == "basis" else 0.0) for cause in estimate.parts}
        return OutputReport(
            name=sensor.name,
            unit=sensor.unit,
            quantity=sensor.of,
            of=sensor.of,
            value=value,
            round_off=np.finfo(float).eps * np.abs(value),
            bound={},
            reduction_bound={},
            corrected=None,
            corrected_bound=None,
            causes=causes,
            estimate=estimate.total,
            estimate_parts=estimate.parts,
            uncertainty=estimate.uncertainty,
            uncertainty_parts=estimate.half_widths,
            estimate_scope=COUPLED,
            labels=("x", "y", "z") if sensor.rows == 3 else (),
        )
