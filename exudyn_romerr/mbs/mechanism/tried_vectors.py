"""A trial of auxiliary vectors: what is gone through once more, what that leaves, who is told if they are taken."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from ...report.wording import at_round_off, permitted

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...online.run import Opening, Run
    from ...report.data import OutputData
    from ..floating.sensor_outputs import BodySensors

    Rows = tuple[np.ndarray, ...]

TINY = np.finfo(float).tiny


class Vectors(Protocol):
    """A body with vectors. asked, most : how many were to be made, and how many there can be."""

    asked: int
    most: int


class Subject(Protocol):
    """A body. more : makes it with so many vectors; None: their number was asked for. sensors : it shows."""

    enriched: Vectors
    more: Callable[[int], Vectors] | None
    sensors: BodySensors


class Watch(Protocol):
    """What is watched of it; see mbs/monitoring/body_monitor.py."""

    subject: Subject
    run: Run
    opening: Opening | None
    rows: tuple
    tolerance: dict[str, float]


class Reaction(Protocol):
    """What vectors react with. said : notes in the messages of runs."""

    said: list[str]

    def open(self, rows: Rows, before: Any, mbs: Any = None) -> None:
        """Begin with the first of the rows."""

    def advance(self, rows: Rows, mbs: Any) -> None:
        """Take rows that follow."""


class Sensors(Protocol):
    """Sensors of other bodies; see mbs/sensors/other_sensors.py."""

    def open(self, runs: Sequence[Run], goes_on: bool) -> None:
        """Runs of the bodies open."""

    def take(self, *what: Any) -> None:
        """Take rows, and how errors move them."""


class WaitingSensors:
    """Stands for sensors while vectors are tried; once these are taken it hands on what it is told.

    To read the sensors in all moved states takes as long as the march: it is done for what is taken alone, and the
    march is not made once more for it.
    """

    def __init__(self, sensors: Sensors):
        self._sensors = sensors
        self._waiting: list[tuple[Callable, tuple]] | None = []

    def open(self, *what: Any) -> None:
        """As in Sensors."""
        self._tell(self._sensors.open, what)

    def take(self, *what: Any) -> None:
        """As in Sensors."""
        self._tell(self._sensors.take, what)

    def tell(self) -> None:
        """The vectors are taken: tell the sensors."""
        waiting, self._waiting = self._waiting, None
        for call, what in waiting or ():
            call(*what)

    def _tell(self, call: Callable, what: tuple) -> None:
        if self._waiting is None:
            call(*what)
        else:
            self._waiting.append((call, what))


class Result(NamedTuple):
    """What a reaction has left: vectors, companion, estimate and messages of each watch; bounds by body and name.

    far : of the bounds that ask for more vectors, how many times the estimate they are. sensors : that wait for it.
    """

    reaction: Reaction
    left: list[tuple]
    bounds: dict[tuple[int, str], float]
    far: dict[tuple[int, str], float]
    sensors: Sequence[WaitingSensors] = ()


def times_the_estimate(out: OutputData) -> tuple[float, float]:
    """How many times the estimate the largest bound of an output is: of what it bounds, and of what it might bring.

    More vectors leave what time steps make: the latter is both with that beside, but for a tolerance, which counts
    bounds alone. 0 if nobody needs to know.
    """
    bound = np.max(out.bound["best"], initial=0.0)
    if out.estimate is None or np.all(at_round_off(out)) or bound <= permitted(out)[0]:
        return 0.0, 0.0
    steps = out.estimate_parts["time step"]
    bounded, beside = (np.max(np.abs(x), initial=0.0) for x in (out.estimate - steps, steps))
    beside = beside if out.tolerance is None else 0.0
    return float(bound / max(bounded, TINY)), float((bound + beside) / max(bounded + beside, TINY))
