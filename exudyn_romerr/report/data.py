"""What a report consists of: the fields that words, files and pictures of it are made from."""

from __future__ import annotations

import platform
import shlex
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from datetime import datetime, timezone
from typing import Any

import numpy as np

from .._version import __version__
from ..checks import check_choice
from ..errors import InputError
from .scope import Doubt
from .verdicts import Verdict

UNITS = {  # of what Exudyn's sensors show, by OutputVariableType without "Local": the same in every system of units
    "Rotation": "rad",
    "AngularVelocity": "rad/s",
    "AngularAcceleration": "rad/s^2",
}
# powers of time that units of quantities have beside one of length, by what OutputReport.quantity says
OF_LENGTH = {"displacement": "", "position": "", "distance": "", "velocity": "/s", "acceleration": "/s^2"}
MODULES = ("numpy", "scipy", "exudyn")
SYSTEM = platform.platform()  # it starts a program, which is better done here than within a solve
# fields of an output that are dicts of arrays, and fields that may be None; those of nodes that are dicts
DICTS = ("bound", "reduction_bound", "causes", "effectivity", "estimate_parts", "uncertainty_parts")
OPTIONAL = ("corrected", "corrected_bound", "estimate", "uncertainty", "estimate_off", "error")
NODE_DICTS = ("estimate", "displacement", "instant")
IN_THE_FRAME = " in the frame"  # ends the name of what the body's frame sees of an output in global axes, beside it


def extents(value: np.ndarray, is_position: bool = False) -> np.ndarray:
    """Return of each component of value (T, r) the largest |value|; of a position how far it moves.

    The largest of these is what 1 % is a share of, wherever it is said. Where a body is says nothing about its error.
    Does not cover: what happens between the instants.
    """
    return np.ptp(value, axis=0) if is_position else np.max(np.abs(value), axis=0, initial=0.0)


def is_rate(shows: str) -> bool:
    """Return whether a quantity, as Exudyn or an output names it, is 0 where nothing moves: in static solves."""
    return shows.removesuffix("Local").lower().endswith(("velocity", "acceleration"))


def line_of(out: Any) -> str:
    """Return the line of a plan that says that an output is estimated; out : has a name, of what it is, a unit."""
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

    bound : (nodes,) of the length of the error; in a mechanism there is none. estimate : (nodes, 3), the error,
    signed; without those that know none of it. displacement : (nodes, 3) of the reduced body. instant : its time.
    positions : (nodes, 3) without load. Only `bound` is in reports that 0.1 saved.
    """

    bound: dict[str, np.ndarray]
    estimate: dict[str, np.ndarray] = field(default_factory=dict)
    displacement: dict[str, np.ndarray] = field(default_factory=dict)
    instant: dict[str, float] = field(default_factory=dict)
    positions: np.ndarray | None = None


@dataclass(frozen=True)
class Feature:
    """One number of every component of an output.

    Attributes
    ----------
    value : (r,)
        Of this run, in the output's unit.
    error : (r,) or None
        That of the full model less value, as well as it can be told, signed; None where no estimate covers all of it.
    half_width : (r,) or None
        How far error may be off where the output's estimate is off by its half width at most. Does not cover: what
        happens between the instants.
    """

    value: np.ndarray
    error: np.ndarray | None
    half_width: np.ndarray | None


@dataclass(repr=False)
class OutputReport:
    """One output along a run.

    value : (T, r) output of the reduced body. bound[e] : (T, r) bound of its error by estimator e, bound["best"]
    the smallest. reduction_bound[e] : the same for the residual at the samples only, which does not see the time
    integration. corrected (T, r) : the output with the known part of its error taken out, within corrected_bound of
    the truth; None without auxiliary modes. round_off (T, r) : what rounding of the matrices, loads and samples, as
    they came in, may move the output by; a bound below it says nothing about the body. causes[cause] : (T, r), shares
    of bound["best"]: "basis", "interfaces" (what rigid interfaces stiffen), "time step", "initial", "jumps".
    estimate (T, r) : the error y_full - y_reduced as well as it can be told, signed, within about uncertainty (T, r);
    no bound. None where nothing of it is known. estimate_parts[cause] : (T, r), signed, sum `estimate`, keys as in
    causes. uncertainty_parts[check] : (T, r), what each check adds to uncertainty: "steps", "vectors",
    "linearisation" (of what vectors predict), "linearisation of steps", "loads", "sampled feedback" (of a PreStep
    function); of mechanisms others, see causes.py; "proved" where a bound of the rest is all of it. estimate_scope :
    what the estimate covers, as in BoundReport.scope: "coupled (linearised)": motion of the frame and answers of
    joints are in it, to first order; "inputs frozen": the body alone, under the frame motion, loads and joint forces
    of this run.
    error (T, r), effectivity[e] (r,) = max_t bound / max_t |error| and, with an estimate, estimate_off (r,) =
    max_t |error - estimate| / max_t |error| once a truth was compared. labels : names of the rows, or ().
    tolerance : what attach, or choose_modes, was asked to keep the bound below, None: nothing. stopped : instant at
    which such a tolerance, of this or another output, stopped the run before its end; None: none did. beside_steps :
    what helps beside shorter steps where these do not resolve what starts at once. uncertified : see BoundReport.
    verdict[cause] : "modes", "interfaces", "step", "start" where there is something of them, and "sum": size, half
    width, answer, reason and cure beside `tolerance`, of the component where that is worst. peak, rms, end : the
    largest |value|, its root mean square over time, the last one, each with the error of that number and its half
    width, see Feature. These, and verdict, are of BoundReport.output.
    """

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
    verdict: dict[str, Verdict] = field(default_factory=dict)
    peak: Feature | None = None
    rms: Feature | None = None
    end: Feature | None = None

    def __repr__(self) -> str:
        """In a line what it is and which arrays it has: they would fill screens, and need the report's scope."""
        optional = ("estimate", "uncertainty", "corrected", "error")
        known = (name for name in optional if getattr(self, name) is not None)
        arrays = ", ".join(["value", *(f"bound[{e!r}]" for e in self.bound), *known])
        what = f"{self.of}{self.unit and f' in {self.unit}'}, {len(self.value)} instants; {arrays}"
        return f"<OutputReport {', '.join(map(repr, self.row_names))}: {what}; print(report) says what they mean>"

    def at_round_off(self) -> np.ndarray:
        """Return for each row (r,) whether the largest bound is below twice what rounding of the input may move."""
        bound, floor = (np.max(x, axis=0, initial=0.0) for x in (self.bound["best"], self.round_off))
        return bound < 2 * floor

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
    outputs: dict[str, OutputReport]
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
    modes: Any = None
    bodies: tuple[ReportData, ...] = ()

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
            raise InputError(
                "what is known at nodes was not saved with this report; ask for it before save() or pickling"
            )
        return self.nodes

    def __getstate__(self) -> dict:
        """Leave out what would compute node_bound, or tell of modes: it holds the whole run, cannot be pickled."""
        return {**self.__dict__, "nodes": None if callable(self.nodes) else self.nodes, "modes": None}

    def output(self, name: str) -> OutputReport:
        """Return the output of that name; InputError lists the known ones."""
        check_choice("output", name, self.outputs)
        return self.outputs[name]


def units_of_length(length: str) -> dict[str, str]:
    """Return the units of all quantities that have one of length, by OutputReport.quantity: "mm" -> "mm", "mm/s", ...

    length : "": not known, nor are the others. Times are in s. Forces and stresses need a unit of mass, too.
    """
    return {quantity: length and f"{length}{per}" for quantity, per in OF_LENGTH.items()}


def name_units(outputs: Iterable[OutputReport], length: str) -> None:
    """Give outputs the units that follow from one of length, but for those that have one, in place."""
    units = units_of_length(length)
    for out in outputs:
        out.unit = out.unit or units.get(out.quantity, "")


def is_beside(report: ReportData, name: str) -> bool:
    """Return whether an output is there for another one's sake: nobody asked for it by its name."""
    return name.removesuffix(IN_THE_FRAME) in report.outputs.keys() - {name}


def made_here() -> dict[str, str]:
    """Return date, script and versions of this process; Exudyn's only if it is loaded."""
    loaded = {name: sys.modules[name] for name in MODULES if sys.modules.get(name) is not None}
    return {
        "date": datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC"),
        "script": sys.argv[0] if sys.argv[0] not in ("", "-", "-c") else "interactive session",
        "arguments": shlex.join(sys.argv[1:]),
        "system": SYSTEM,
        "exudyn_romerr": __version__,
        "python": platform.python_version(),
        **{name: str(module.__version__) for name, module in loaded.items()},
    }
