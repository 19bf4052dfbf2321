"""What a report consists of: the fields that words, files and pictures of it are made from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..checks import check_choice
from ..errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from .scope import Doubt

UNITS = {  # of what Exudyn's sensors show, by OutputVariableType without "Local": the same in every system of units
    "Rotation": "rad",
    "AngularVelocity": "rad/s",
    "AngularAcceleration": "rad/s^2",
}
# powers of time that units of quantities have beside one of length, by what OutputData.quantity says
OF_LENGTH = {"displacement": "", "position": "", "distance": "", "velocity": "/s", "acceleration": "/s^2"}
IN_THE_FRAME = " in the frame"  # ends the name of what the body's frame sees of an output in global axes, beside it


def extents(value: np.ndarray, is_position: bool = False) -> np.ndarray:
    """Return of each component the largest |value|; of a position how far it moves.

    The largest of these is what 1 % is a share of, wherever it is said. Where a body is says nothing about its error.

    Parameters
    ----------
    value : (T, r)
        In the output's unit.
    is_position : bool
        Whether it is a place.

    Returns
    -------
    (r,)
        In the output's unit. Does not cover: what happens between the instants.
    """
    return np.ptp(value, axis=0) if is_position else np.max(np.abs(value), axis=0, initial=0.0)


def is_rate(shows: str) -> bool:
    """Return whether a quantity, as Exudyn or OutputData.of names it, is 0 where nothing moves: in static solves."""
    return shows.removesuffix("Local").lower().endswith(("velocity", "acceleration"))


class Watched(Protocol):
    """What is estimated, or shown: a name, of what, in which unit."""

    name: str
    of: str
    unit: str


def line_of(out: Watched) -> str:
    """Return the line of a plan that says that an output is estimated."""
    return f"output {out.name!r}: {out.of}{out.unit and f' in {out.unit}'}, estimated"


@dataclass(frozen=True)
class Plan:
    """Readable with print().

    computed : lines; left_out : (what, why) pairs.
    """

    computed: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        lines = ["computed:", *(f"  {line}" for line in self.computed)]
        if self.left_out:
            lines += ["left out:", *(f"  {what}: {why}" for what, why in self.left_out)]
        return "\n".join(lines)


@dataclass(frozen=True)
class NodeFields:
    """What is known of displacements at the mesh nodes, by estimator at its worst instant.

    bound : (nodes,) of the length of the error. estimate : (nodes, 3), the error, signed; without those that know
    none of it. displacement : (nodes, 3) of the reduced body. instant : its time. positions : (nodes, 3) without
    load. Only `bound` is in reports that 0.1 saved.
    """

    bound: dict[str, np.ndarray]
    estimate: dict[str, np.ndarray] = field(default_factory=dict)
    displacement: dict[str, np.ndarray] = field(default_factory=dict)
    instant: dict[str, float] = field(default_factory=dict)
    positions: np.ndarray | None = None


@dataclass
class OutputData:
    """The fields of OutputReport, which describes them."""

    name: str
    unit: str
    of: str
    value: np.ndarray
    round_off: np.ndarray
    bound: dict[str, np.ndarray]
    reduction_bound: dict[str, np.ndarray]
    corrected: np.ndarray | None
    corrected_bound: np.ndarray | None
    causes: dict[str, np.ndarray]
    estimate: np.ndarray | None = None
    estimate_parts: dict[str, np.ndarray] = field(default_factory=dict)
    uncertainty: np.ndarray | None = None
    uncertainty_parts: dict[str, np.ndarray] = field(default_factory=dict)
    estimate_scope: str = ""
    estimate_off: np.ndarray | None = None
    error: np.ndarray | None = None
    effectivity: dict[str, np.ndarray] = field(default_factory=dict)
    labels: tuple[str, ...] = ()
    tolerance: float | None = None
    stopped: float | None = None
    beside_steps: tuple[str, ...] = ()
    uncertified: tuple[Doubt, ...] = ()
    quantity: str = ""

    @property
    def extents(self) -> np.ndarray:
        """What each component shows at most, (r,)."""
        return extents(self.value, self.of == "position")

    @property
    def row_names(self) -> list[str]:
        """How the rows are called: "tip x", "tip y"; "tip row 1" without labels; "tip" if there is only one."""
        count = self.value.shape[1]
        labels = self.labels or [f"row {row + 1}" for row in range(count)]
        return [self.name] if count == 1 else [f"{self.name} {label}" for label in labels]


@dataclass(repr=False)
class ReportData:
    """The fields of BoundReport, which describes them."""

    t: np.ndarray
    position_bound: dict[str, np.ndarray]
    velocity_bound: dict[str, np.ndarray]
    outputs: dict[str, OutputData]
    scope: dict[str, str]
    scope_reason: str
    reasons: dict[str, str]
    plan: Plan
    messages: list[str]
    time: str
    total_mass: float | None
    nodes: Callable[[], NodeFields] | NodeFields | None = None
    remainder: dict[str, float] = field(default_factory=dict)
    made: dict[str, str] = field(default_factory=dict)
    planned_end: float | None = None
    ended_by: str = ""
    on_purpose: bool = False
    origin: str = ""
    uncertified: tuple[Doubt, ...] = ()

    @property
    def node_bound(self) -> dict[str, np.ndarray]:
        """Bound of the displacement's error at every mesh node (nodes,), by every estimator, at its worst instant.

        Computed when first asked for, one solve with K for every coordinate; saved if it was asked for before.

        Raises
        ------
        InputError
            A body without node positions, or a loaded report that was saved without.
        """
        return self.at_nodes().bound

    def at_nodes(self) -> NodeFields:
        """Return what is known at the nodes; as node_bound."""
        if callable(self.nodes):
            self.nodes = self.nodes()
        if self.nodes is None:
            raise InputError("node_bound was not saved with this report; ask for it before save() or pickling")
        return self.nodes

    def __getstate__(self) -> dict:
        """Leave out what would compute node_bound: it holds the whole run, and cannot be pickled."""
        return {**self.__dict__, "nodes": None if callable(self.nodes) else self.nodes}

    def output(self, name: str) -> OutputData:
        """Return the output of that name; InputError lists the known ones."""
        check_choice("output", name, self.outputs)
        return self.outputs[name]


def units_of_length(length: str) -> dict[str, str]:
    """Return the units of all quantities that have one of length, by OutputData.quantity: "mm" -> "mm", "mm/s", ...

    Parameters
    ----------
    length : str
        The model's unit of length; "": not known, nor are the others.

    Returns
    -------
    dict
        Of displacements, positions, distances, velocities and accelerations; times are in s. Forces and stresses
        need a unit of mass, too.
    """
    return {quantity: length and f"{length}{per}" for quantity, per in OF_LENGTH.items()}


def name_units(outputs: Iterable[OutputData], length: str) -> None:
    """Give outputs the units that follow from one of length, but for those that have one, in place."""
    units = units_of_length(length)
    for out in outputs:
        out.unit = out.unit or units.get(out.quantity, "")


def is_beside(report: ReportData, name: str) -> bool:
    """Return whether an output is there for another one's sake: nobody asked for it by its name."""
    return name.removesuffix(IN_THE_FRAME) in report.outputs.keys() - {name}
