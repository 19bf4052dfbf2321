"""Sensors of an mbs: what they show in rows of a run, and their gradients, in closed form where that is known."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from re import sub
from typing import Any, NamedTuple

import numpy as np

from ...mechanism.outputs import InClosedForm, NodeSensor, Outputs, RowsInFrame
from ...mechanism.rotations import rotation_matrix, times_transposed
from ...mechanism.rows import Rows
from ...mechanism.unknowns import Unknowns
from ...mechanism_bounds.bounds import MeshRows
from ...model.outputs import AXES, Output
from ...report.data import UNITS
from ..access.detached import Detached
from ..access.mbs_items import Items, sensor_names
from ..floating.sensor_outputs import NO_STATE, measured_of
from .hollow_copy import STEP, HollowCopy
from .pre_step import PreStep
from .vectors import Enriched

KINDS = {  # closed form of what a mesh node shows in global axes, by quantity
    "displacement": "Displacement",
    "position": "Position",
    "velocity": "Velocity",
}
# vectors whose gradients are looked at in axes of the body they are on, where they hardly change
TURNED = ("Displacement", "Position", "Velocity", "Acceleration", "AngularVelocity", "AngularAcceleration")
TOGETHER = 1024  # rows whose states are made at once
FIRST = 3  # rows: the first, the last, one between
FASTER = 1e3  # times steps of coordinates: of rates and accelerations, to differentiate by


@dataclass(frozen=True)
class ShownSensor:
    """A sensor, or an output of a body, that can be told: its name, rows, what it shows in words.

    number : Exudyn's; None: an output, of body number `body`. shows : rows that are shown of it, of those it has;
    own : numbers of these among the rows of all.
    """

    name: str
    rows: slice
    of: str
    number: int | None
    body: int | None
    unit: str
    labels: tuple[str, ...]
    shows: np.ndarray
    quantity: str

    @property
    def own(self) -> np.ndarray:
        """See above."""
        return self.rows.start + self.shows


class Sensors:
    """All sensors of an mbs that show its state.

    shown : in their order. left_out : (name, why) of others. count : of all rows. in_frames : rows of those that show
    mesh nodes in frames of their bodies.
    """

    def __init__(
        self,
        mbs: Any,
        enriched: Sequence[Enriched],
        unknowns: Unknowns,
        detached: Detached,
        outputs: Sequence[Sequence[Output]] = (),
        numbers: Iterable[int] | None = None,
        pre_step: PreStep | None = None,
    ):
        """Find out what can be told.

        Parameters
        ----------
        detached, pre_step : copies of user functions
        outputs : of each body, beside sensors
        numbers : of sensors; None: all of the mbs
        """
        self._mbs, self._enriched, self._unknowns = mbs, enriched, unknowns
        self.shown: list[ShownSensor] = []
        self.left_out: list[tuple[str, str]] = []
        self.nodes: list[InClosedForm] = []
        self.in_frames: list[MeshRows] = []
        self._axes: list[int] = []
        self.count = 0
        for one in _looked_at(mbs, numbers):
            self._add(*one)
        for b, of_body in enumerate(outputs):
            for out in of_body:
                self._add_output(b, out)
        self._asked = [one for one in self.shown if one.rows.start not in {node.first for node in self.nodes}]
        self._pre_step = pre_step
        self._copy = HollowCopy(mbs, enriched, unknowns, detached, True, pre_step) if self._asked else None

    def _add(self, number: int, name: str, item: dict[str, Any], kind: str, why: str) -> None:
        if why:
            self.left_out.append((name, why))
            return
        for b, one in enumerate(self._enriched):
            found = measured_of(self._mbs, one.known.flex, number)
            if found is not None:
                self._add_output(b, replace(found.output(), name=name), number)
                return
        values = np.atleast_1d(self._mbs.GetSensorValues(number)).ravel()
        if not np.isfinite(values).all():
            self.left_out.append((name, "it is not finite"))
            return
        count, (of, unit) = len(values), _words(kind)
        axes = self._body_of(item) if count == 3 and kind in TURNED else -1
        self._show(axes, count, name, of, number, None, unit, tuple(AXES) if count == 3 else (), np.arange(count), of)

    def _body_of(self, item: dict[str, Any]) -> int:
        """Number of the body that a sensor is on, or on whose frame's node; -1: on none."""
        for b, one in enumerate(self._enriched):
            number = one.body.place.number
            frame = self._mbs.GetObject(number)["nodeNumbers"][0]
            if number == int(item.get("bodyNumber", -1)) or int(frame) == int(item.get("nodeNumber", -1)):
                return b
        return -1

    def _show(self, axes: int, count: int, name: str, *about: Any) -> None:
        """Take up a sensor with `count` rows; axes : number of the body in whose axes gradients are, -1: global."""
        self.shown.append(ShownSensor(name, slice(self.count, self.count + count), *about))
        self._axes += [axes] * count
        self.count += count

    def _add_output(self, b: int, out: Output, number: int | None = None) -> None:
        """Add an output of body number b, in closed form; or say why it cannot be told."""
        one = self._enriched[b]
        C, axes, view = out.resolve(one.known.held), -1, out.view(one.known.held)
        is_rate, shows = out.of == "velocity", np.arange(len(C))
        # a sensor shows what Exudyn's frame sees
        shapes = C @ (one.held_shapes if view is None and number is None else one.shapes)
        if view is None:
            self.nodes.append(RowsInFrame(self.count, b, shapes, is_rate))
            if out.is_requested:
                self.in_frames.append(MeshRows(self.count, b, C, is_rate))
        elif len(C) != 3 or not np.isclose(view.shift[0], 1.0):
            why = "in global axes one place is told, a node or the mean of several with weights of sum 1"
            self.left_out.append((out.name, why))
            return
        else:
            kind = KINDS[out.of]
            self.nodes.append(NodeSensor(self.count, b, kind, shapes, view.places[0]))
            axes, shows = b, np.array(view.axes)
        body = b if number is None else None
        about = out.of, number, body, out.unit, out.labels, shows, out.quantity or out.of
        self._show(axes, len(C), out.name, *about)

    def outputs(self, rows: Rows) -> Outputs:
        """Return the gradients along a run."""
        source = None if self._copy is None else _Differences(self, rows)
        self._leave_out_what_is_set(rows)
        asked = [one.rows for one in self._asked]
        return Outputs(self._unknowns, rows, np.array(self._axes, int), self.nodes, asked, source)

    def _leave_out_what_is_set(self, rows: Rows) -> None:
        """Leave out sensors of what a PreStep function sets by what it sees: they are off at once, too."""
        if self._copy is None or self._pre_step is None:
            return
        t, q, v, a, lam = rows.row(-1)
        shown = []
        for moved in (0.0, STEP):
            self._copy.begin_step(t, moved)
            shown.append(self.shown_by(t, *map(self._copy.wide, (q, v, a)), lam))
        changed = shown[0] != shown[1]
        why = "it shows what the PreStep function sets by what it sees"
        self.left_out += [(one.name, why) for one in self.shown if changed[one.rows].any()]
        self.shown = [one for one in self.shown if not changed[one.rows].any()]

    def values(self, rows: Rows) -> np.ndarray:
        """Return what they show in rows of the run, (T, R)."""
        found = np.zeros((len(rows), self.count))
        for node in self.nodes:
            found[:, node.rows] = node.values(self._unknowns.bodies[node.body], rows)
        for first in range(0, len(rows), TOGETHER) if self._asked else ():
            part = rows[first : first + TOGETHER]
            wide = (self._copy.wide(x) for x in (part.q, part.v, part.a))
            for i, state in enumerate(zip(part.t, *wide, part.multipliers, strict=True)):
                self._copy.begin_step(state[0])
                found[first + i] += self.shown_by(*state)
        return found

    def shown_by(self, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray, lam: np.ndarray) -> np.ndarray:
        """Return what sensors without closed form show in a state of the copy, (R,), zero of all others."""
        self._copy.set(t, q, v, a, lam)
        found = np.zeros(self.count)
        for one in self._asked:
            found[one.rows] = np.ravel(self._copy.mbs.GetSensorValues(one.number))
        return found


class _Differences:
    """Gradients of sensors by central differences on the copy; uses (4,) : of what sensors know at all.

    What changed no digit of any of them in the first rows that were looked at is not moved in others.
    """

    def __init__(self, sensors: Sensors, rows: Rows):
        self._of, self._rows = sensors, rows
        self._looks, self._known = 0, [set() for _ in range(4)]
        self._copy, self._unknowns = sensors._copy, sensors._unknowns
        self.uses = self._used()

    def _used(self) -> list[bool]:
        """Whether sensors know coordinates, rates, accelerations, multipliers."""
        t, *state = self._state(len(self._rows) - 1)
        rng, found = np.random.default_rng(3), []
        shown = self._of.shown_by(t, *state)
        for k, x in enumerate(state):
            moved = [*state]
            moved[k] = x + rng.uniform(0.5, 1.0, len(x)) * (1 + np.abs(x).max(initial=0.0)) * STEP
            found.append(bool(len(x)) and bool(np.any(self._of.shown_by(t, *moved) != shown)))
        return [True, *found[1:]]

    def _state(self, i: int) -> tuple:
        """Row i; parameters of the copy are what they are there."""
        t, q, v, a, lam = self._rows.row(i)
        self._copy.begin_step(t)
        return t, *(self._copy.wide(x) for x in (q, v, a)), lam

    def _jacobians(self, *state: np.ndarray) -> np.ndarray:
        """J, J', J'' (3, size, n) of all unknowns, oscillators too, in a state q, v, a."""
        u, J = self._unknowns, np.zeros((3, self._copy.size, self._unknowns.n))
        J[..., : u.n_a] = self._copy.jacobians(*(x[None] for x in state))[:, 0]
        J[0, self._copy.extra, np.concatenate(u.of_vectors())] = 1.0
        return J

    def gradients(self, i: int) -> list[np.ndarray]:
        """Return of row i the gradients by coordinates, rates, accelerations, multipliers."""
        t, *state = self._state(i)
        (J, J1, J2), lam, steps = self._jacobians(*state[:3]), state[3], self._unknowns.steps(STEP)
        moves = (  # of q, v, a, lam by each unknown, its rate, its acceleration, each multiplier; None: nothing
            (J, J1, J2, None),
            (None, J, 2 * J1, None),
            (None, None, J, None),
            (None, None, None, np.eye(len(lam))),
        )
        sizes = steps, FASTER * steps, FASTER * steps, STEP * (1 + np.abs(lam))
        found, here = [], self._of.shown_by(t, *state)
        for known, is_used, move, h in zip(self._known, self.uses, moves, sizes, strict=True):
            G = np.zeros((self._of.count, len(h)))
            numbers = range(len(h)) if self._looks < FIRST else sorted(known)
            for j in numbers if is_used else ():
                ahead, behind = (self._shown(t, state, move, j, by) for by in (h[j], -h[j]))
                G[:, j] = (ahead - behind) / (2 * h[j])
                if np.any(ahead != here) or np.any(behind != here):
                    known.add(j)
            found.append(self._turned(G, i))
        self._looks += 1
        return found

    def _shown(self, t: float, state: Sequence[np.ndarray], move: Sequence, j: int, by: float) -> np.ndarray:
        return self._of.shown_by(t, *(x if J is None else x + by * J[:, j] for x, J in zip(state, move, strict=True)))

    def _turned(self, y: np.ndarray, i: int) -> np.ndarray:
        """Rows of vectors (R, n) in axes of their bodies."""
        axes = np.array(self._of._axes, int)
        for b in set(axes[axes >= 0]):
            A, own = rotation_matrix(self._unknowns.nodes[b].parameters(self._rows.q[i])), np.flatnonzero(axes == b)
            vectors = y[own].reshape(-1, 3, y.shape[1]).swapaxes(1, 2)
            y[own] = times_transposed(A, vectors).swapaxes(1, 2).reshape(len(own), -1)
        return y


class Planned(NamedTuple):
    """A sensor that will be told: its name, what it shows, and the unit of that."""

    name: str
    of: str
    unit: str


def planned_sensors(mbs: Any, numbers: Iterable[int]) -> tuple[list[Planned], list[tuple[str, str]]]:
    """Return the sensors that can be told, as far as is known before a solve, and (name, why) of the others."""
    seen = [*_looked_at(mbs, numbers)]
    found = [Planned(name, *_words(kind)) for _, name, _, kind, why in seen if not why]
    return found, [(name, why) for _, name, _, _, why in seen if why]


def _looked_at(mbs: Any, numbers: Iterable[int] | None) -> Iterator[tuple[int, str, dict[str, Any], str, str]]:
    """Number, name, dictionary and kind of sensors, None: of all, and why they cannot be told; empty: they can.

    kind : what one shows, as Exudyn calls it; empty: it has no such name.
    """
    sensors, names = Items(mbs).sensors, sensor_names(mbs)
    for number in range(len(sensors)) if numbers is None else numbers:
        item = sensors[number]
        kind = getattr(item.get("outputVariableType"), "name", "")
        yield number, names[number], item, kind, _why_not(mbs, item, kind)


def _words(kind: str) -> tuple[str, str]:
    """The same in words, and its unit where that is the same in every system of units."""
    shown = kind.removesuffix("Local")
    return sub(r"(?<!^)([A-Z])", r" \1", shown).lower(), UNITS.get(shown, "")


def _why_not(mbs: Any, item: dict[str, Any], kind: str) -> str:
    """Why a sensor cannot be told; empty: it can."""
    if item["sensorType"] in NO_STATE:
        return NO_STATE[item["sensorType"]]
    if item["sensorType"] == "Object":
        on = mbs.GetObject(int(item["objectNumber"]))
        if any(key.endswith("UserFunction") and value for key, value in on.items()):
            return "its object has a user function, which is not called away from the run"
    if item["sensorType"] == "SuperElement" and kind.startswith(("Stress", "Strain")):
        return "Exudyn makes it of elements of the mesh; romerr.node_stress and node_strain are told, by attach"
    return ""
