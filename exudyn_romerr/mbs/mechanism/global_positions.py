"""GlobalPositions: what auxiliary vectors leave of positions in global axes, bounded (theory.md 8)."""

from __future__ import annotations

import copy
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from ...estimators.rigid_motion import Equations, RigidMotion, cubic
from ...model.floating_frame import RIGID_INERTIA
from ..derivatives.tangent_reading import by_masses
from .enriched_body import EnrichedBody

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...estimates.march import Tangent
    from ..derivatives.linearisation import Reading
    from .extended_tangents import ExtendedTangents

DIFFERENCE = 1e-6  # of coordinates of frames, to differentiate positions by
MOST = 60  # freedoms: of mechanisms with many rigid bodies or other elements the matrices here were large


class _Sight(NamedTuple):
    """What outputs in global axes of a body see at S instants, shown : numbers (r,) of these.

    rigid (S, r, frame) : of the coordinates of its frame. modal (S, r, k) : of modes and vectors. rows (S, r, R) :
    of the rows C of its deformations.
    """

    shown: np.ndarray
    rigid: np.ndarray
    modal: np.ndarray
    rows: np.ndarray


class _Node(NamedTuple):
    """A time that is gone through at once, after a reading of this number."""

    start: float
    end: float
    reading: int


class GlobalPositions:
    """Bounds along a run of what is left of positions and displacements in global axes beside the estimate.

    Attributes
    ----------
    failure : why there are none, from where on; empty if there are.
    """

    failure = ""

    def __init__(self, parts: Sequence[tuple[EnrichedBody, slice]], size: int):
        """Parts: bodies, and where their vectors are among so many coordinates."""
        self._parts, self._size, self._others = parts, size, []
        elastic = []
        for body, own in parts:
            others = slice(self._size, self._size + RIGID_INERTIA)
            elastic.append(np.concatenate([body.modal, *(np.arange(x.start, x.stop) for x in (own, others))]))
            self._others.append(OtherDeformations(body))
            self._size = others.stop
        ends = np.cumsum([0, *(len(own) for own in elastic)])
        elastic = np.concatenate(elastic)
        self._rigid = np.setdiff1d(np.arange(self._size), elastic)
        self._places = [slice(a, b) for a, b in pairwise(ends.tolist())]
        self._flexibility = block_diag(*(body.deformations.flexibility for body, _ in parts))
        self._motion = RigidMotion(self._rigid, elastic, self._flexibility)

    @classmethod
    def of(cls, parts: Sequence[tuple[EnrichedBody, slice]], size: int) -> GlobalPositions | None:
        """Return them where an output asks for them."""
        asked = any(_asked(body) for body, _ in parts)
        return cls(parts, size) if asked else None

    def go_on(self, before: GlobalPositions) -> None:
        """Go on from the run before."""
        self._t, self._at_rest, self.failure = before._t, before._at_rest, before.failure
        self._motion, self._scale = copy.copy(before._motion), before._scale

    def start(
        self, t: float, tangents: ExtendedTangents, readings: Sequence[Reading], g: float, at_rest: float | None
    ) -> None:
        """Begin at a reading with the energy g, without error or in static equilibrium.

        at_rest : |R|_{K^-1} there, which is not in g; None: without error.
        """
        self._t, self._at_rest, rests = t, at_rest or 0.0, at_rest is not None
        # so that no unit of length tells how far a rotation is: coordinates are turned into one another
        self._scale = by_masses(readings[0].masses[self._rigid])
        rows = self._rows(tangents, readings)
        if not self._motion.start(rows.at(t, 0), g + self._at_rest, rests):
            self.failure = CHANGED.format(t)
        elif self._motion.freedoms > MOST:
            self.failure = MANY.format(self._motion.freedoms, MOST)

    def opened(self, q: np.ndarray, g: float) -> list[np.ndarray]:
        """Return what is left (1, r) of every body's outputs as shown, at coordinates q (1, all)."""
        at = self._looked_at([_seen(body, q) for body, _ in self._parts], 0)
        return [((g + self._at_rest) * direct + freed)[None] for direct, freed in at]

    def advance(
        self,
        tangents: ExtendedTangents,
        readings: Sequence[Reading],
        steps: tuple[np.ndarray, np.ndarray],
        g: np.ndarray,
        impulses: np.ndarray,
    ) -> list[np.ndarray]:
        """Go on by steps; return what is left (S, r) of every body's outputs as shown.

        readings : those of the tangents. steps : t (S,), coordinates q (S, all) at their ends. g (2, S) : energy
        there, and its largest in them. impulses (S,) : integral of |F|_{M^-1} in them.
        """
        (t, q), (g, peak) = steps, g + self._at_rest  # |R|_{K^-1} is at most that
        rows, nodes = self._rows(tangents, readings), self._nodes(tangents.t, t)
        ends = np.array([0, *(np.searchsorted(t, node.end, side="right") for node in nodes)])
        seen = [_seen(body, q[np.maximum(ends - 1, 0)]) for body, _ in self._parts]
        at = [self._looked_at(seen, 0)]
        for i, (a, b, j) in enumerate(nodes):
            if not self.failure:
                step, span = slice(*ends[i : i + 2]), (None if i else rows.at(a, j), rows.at(b, j))
                is_known = np.isfinite(most := peak[step].max())
                if not (is_known and self._motion.advance(b - a, span, most, impulses[step].sum())):
                    self.failure = CHANGED.format(a) if is_known else f"nothing is bounded from t = {a:g} s on"
            at.append(self._looked_at(seen, i + 1))
        times, self._t = np.array([self._t, *(node.end for node in nodes)]), float(t[-1])
        after = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
        g = np.where(np.isfinite(g), g, 0.0)
        share, left = ((t - times[after - 1]) / np.diff(times)[after - 1])[:, None], []
        for direct, freed in (map(np.array, zip(*of_body, strict=True)) for of_body in zip(*at, strict=True)):
            followed = (1 - share) * direct[after - 1] + share * direct[after]
            left.append(g[:, None] * followed + np.maximum(freed[after - 1], freed[after]))
        return left

    def _rows(self, tangents: ExtendedTangents, readings: Sequence[Reading]) -> _RigidRows:
        return _RigidRows(tangents, readings, (self._rigid, self._scale), self._others)

    def _nodes(self, readings: np.ndarray, t: np.ndarray) -> list[_Node]:
        """Intervals from here to the last of t, which end at samples: of readings, and the last."""
        ends = t[np.searchsorted(t, readings[(readings > self._t) & (readings < t[-1])])]
        ends = np.unique(np.append(ends, t[-1]))
        starts = np.array([self._t, *ends[:-1]])
        before = np.maximum(np.searchsorted(readings, (starts + ends) / 2) - 1, 0)
        return [_Node(*node) for node in zip(starts.tolist(), ends.tolist(), before.tolist(), strict=True)]

    def _looked_at(self, seen: Sequence[_Sight], i: int) -> list[tuple[np.ndarray, np.ndarray]]:
        """Of every body's outputs at instant i: factors (r,) of the energy g, and what freedoms are off by (r,)."""
        found = []
        for (body, _), place, sight in zip(self._parts, self._places, seen, strict=True):
            count = body.offline.shown_slices[-1].stop if body.offline.outputs else 0
            direct, freed = np.zeros(count), np.full(count, np.inf)
            if not self.failure and sight.shown.size:
                rigid = np.zeros((len(sight.shown), len(self._rigid)))
                rigid[:, np.searchsorted(self._rigid, body.columns[: body.frame_size])] = sight.rigid[i]
                rigid *= self._scale
                followed, freed[sight.shown] = rigid @ self._motion.follows, self._motion.sizes(rigid)
                direct[sight.shown] = self._direct(body, place, followed, sight.modal[i], sight.rows[i])
            found.append((direct, freed))
        return found

    def _direct(self, body: EnrichedBody, place: slice, followed: np.ndarray, modal, rows) -> np.ndarray:
        """|C u + C H u| where |u + K^-1 R|_K <= g, and |C H K^-1 R| where that is as large."""
        inertia, whole, rest = followed[:, place.stop - RIGID_INERTIA : place.stop], followed.copy(), rows.shape[1]
        whole[:, place.start : place.stop - RIGID_INERTIA] += modal
        own, other = (np.sum((x @ self._flexibility) * x, axis=1) for x in (whole, followed))
        beside = np.hstack([rows, 2 * inertia]) @ body.deformations.rest[:, :rest]
        return np.sqrt(np.maximum(own + np.sum(beside * rows, axis=1), 0.0)) + np.sqrt(other)


class OtherDeformations(EnrichedBody):
    """What couples to the mechanism of deformations w beside modes and vectors: sums m w and m x w, in their place.

    In the order of inertia_columns: sum m w_i (3), sum m x_j w_i (9).
    """

    def __init__(self, body: EnrichedBody):
        vars(self).update(vars(body))
        n, self.m = len(body.modal), RIGID_INERTIA
        self.K_PP = self.D_PP = np.zeros((self.m, self.m))
        self.K_VP = self.D_VP = np.zeros((n, self.m))
        unit = np.eye(self.m)
        self._pull, self._arms = unit[:3], unit[3:].reshape(3, 3, self.m).swapaxes(0, 1)
        self._of_V, self._of_P = np.zeros((3, 3, n, self.m)), np.zeros((3, 3, self.m, self.m))
        self._moved_loads = [np.zeros((3, self.m)) for _ in self._moved_loads]
        self._forcing = np.zeros((self.m, self._forcing.shape[1]))


def _seen(body: EnrichedBody, q: np.ndarray) -> _Sight:
    """What outputs of a body see at coordinates q (S, all) of the mechanism."""
    offline, size, modal = body.offline, body.frame_size, q[:, body.modal]
    moving = size if body.sampler.terms.rigid is None else len(body.columns)  # coordinates that move the held frame
    steps = DIFFERENCE * np.eye(moving, len(body.columns) + body.m)
    steps = np.vstack([0 * steps[:1], steps, -steps])
    states = (np.pad(q[:, body.columns], ((0, 0), (0, body.m)))[:, None] + steps).reshape(-1, steps.shape[1])
    moved = body.sampler.held_frame(states, 0 * states, 0 * states)
    shown, rigid, rows = [], [], [np.zeros((len(q), 0, len(offline.value_rows)))]
    for out, part, view, of in zip(offline.outputs, offline.slices, offline.views, offline.shown_slices, strict=True):
        if view is not None and out.of != "velocity":
            base = modal @ offline.value_rows[part, : modal.shape[1]].T
            at = view.values(np.repeat(base, len(steps), axis=0), moved, offline.scene.pose)
            at = at.reshape(len(q), len(steps), -1)
            shown.extend(range(of.start, of.stop))
            rigid.append((at[:, 1 : moving + 1] - at[:, moving + 1 :]).swapaxes(1, 2) / (2 * DIFFERENCE))
            rows.append(np.zeros((len(q), rigid[-1].shape[1], len(offline.value_rows))))
            rows[-1][:, :, part] = view.matrices(moved[:: len(steps)])
    whole = np.concatenate(rows, axis=1)
    rigid, by_modes = np.split(np.concatenate([np.zeros((len(q), 0, moving)), *rigid], axis=1), [size], axis=2)
    modal = whole @ offline.value_rows
    modal[:, :, : moving - size] += by_modes
    return _Sight(np.array(shown, dtype=int), rigid, modal, whole)


def _asked(body: EnrichedBody) -> bool:
    outputs = zip(body.offline.outputs, body.offline.views, strict=True)
    return any(view is not None and out.of != "velocity" for out, view in outputs)


class _RigidRows:
    """Rows of rigid coordinates in the linearised equations, with what others than modes and vectors do to them.

    rigid : numbers of these coordinates, and sizes that are 1 in the equations.
    """

    def __init__(
        self,
        tangents: ExtendedTangents,
        readings: Sequence[Reading],
        rigid: tuple[np.ndarray, np.ndarray],
        others: Sequence[OtherDeformations],
    ):
        self._tangents, (self._rigid, self._scale) = tangents, rigid
        rigid, self._count = self._rigid, RIGID_INERTIA * len(others)
        states = [np.array([reading.state[k] for reading in readings]) for k in range(3)]
        self._others = np.zeros((len(readings), 3, len(rigid), self._count))
        for i, body in enumerate(others):
            at = body.couplings(tangents.t, [x[:, body.columns] for x in states])
            own, frame = slice(i * RIGID_INERTIA, (i + 1) * RIGID_INERTIA), body.frame_size
            rows = np.searchsorted(rigid, body.columns[:frame])
            self._others[:, :, rows, own] = np.stack([X[:, :frame] for X in at[:3]], axis=1)
        self._rates = np.zeros_like(self._others)
        if len(readings) > 1:
            from scipy.interpolate import CubicSpline  # here, for it takes long to import

            self._rates = CubicSpline(tangents.t, self._others)(tangents.t, 1)

    def at(self, t: float, j: int) -> Equations:
        """At t between readings j and j + 1: cubic; after the last one, with what it changes by."""
        numbers = j, min(j + 1, len(self._tangents.t) - 1)
        first, last = (self._tangents[i] for i in numbers)
        found = []
        for name in Equations._fields:
            ends = (self._whole(x, name, self._others[i]) for x, i in zip((first, last), numbers, strict=True))
            rates = (self._whole(x.rate, name, self._rates[i]) for x, i in zip((first, last), numbers, strict=True))
            found.append(self._scaled(cubic(*ends, *rates, last.t - first.t, t - first.t), name))
        return Equations(*found)

    def _scaled(self, rows: np.ndarray, name: str) -> np.ndarray:
        """Values and derivatives (3, r or c, k) of rows in coordinates without units."""
        rows[:, :, self._rigid] *= self._scale
        if name in "MDK":
            return rows * self._scale[:, None]
        size = np.linalg.norm(rows[0][:, self._rigid], axis=1)[:, None]  # of constraints: in length, or in radians
        return rows / np.where(size > 0, size, 1.0)

    def _whole(self, tangent: Tangent, name: str, others: np.ndarray) -> np.ndarray:
        rows = getattr(tangent, name)
        if name in "MDK":
            return np.hstack([rows[self._rigid], others["MDK".index(name)]])
        return np.hstack([rows, np.zeros((len(rows), self._count))])


MANY = "the mechanism has {} freedoms; up to {} are gone through"
CHANGED = "how many freedoms the mechanism has changes, or is lost in rounding, at t = {:g} s"
