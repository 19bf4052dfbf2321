"""GlobalPositions: what auxiliary vectors leave of positions in global axes, bounded (theory.md 8)."""

from __future__ import annotations

import copy
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from ...estimators.rigid_motion import Equations, RigidMotion
from ...model.floating_frame import RIGID_INERTIA
from .enriched_body import EnrichedBody
from .extended_tangents import ExtendedTangents

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...estimates.march import Tangent
    from ..access.linearisation import Reading

DIFFERENCE = 1e-6  # of coordinates of frames, to differentiate positions by
MOST = 60  # freedoms: of mechanisms with many rigid bodies or other elements the matrices here were large
BETWEEN = 2  # instants that are looked at from one reading to the next


class _Rows(NamedTuple):
    """What outputs of a body see at an instant: of rigid coordinates (r, all), of its modes and vectors (r, k).

    other (r, R) : of rows C of other deformations. shown : which of the outputs as shown they are.
    """

    rigid: np.ndarray
    own: np.ndarray
    other: np.ndarray
    shown: slice


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
            self._others.append((OtherDeformations(body), others))
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
        self._t, self._motion, self.failure = before._t, copy.copy(before._motion), before.failure

    def start(self, t: float, readings: Sequence[Reading], g: float, rests: bool) -> None:
        """Begin at a reading with the energy g, without error or in static equilibrium."""
        self._t, tangent = t, self._extended(readings)[0]
        self._motion.start(_equations(tangent, tangent, 0.0, self._rigid), g, rests)
        if self._motion.freedoms > MOST:
            self.failure = MANY.format(self._motion.freedoms, MOST)

    def _extended(self, readings: Sequence[Reading]) -> ExtendedTangents:
        return ExtendedTangents(readings, self._size, [*self._parts, *self._others])

    def opened(self, q: np.ndarray, g: float) -> list[np.ndarray]:
        """Return what is left (1, r) of every body's outputs as shown, at coordinates q (1, all)."""
        direct, freed = self._looked_at(q[0])
        return [(g * a + b)[None] for a, b in zip(direct, freed, strict=True)]

    def advance(
        self, readings: Sequence[Reading], t: np.ndarray, q: np.ndarray, g: np.ndarray, impulses: np.ndarray
    ) -> list[np.ndarray]:
        """Go on to t (S,); return what is left (S, r) of every body's outputs as shown.

        q (S, all) : coordinates. g, impulses (S,) : energy at the ends of the steps, integral of |F|_{M^-1} in them.
        """
        tangents = self._extended(readings)
        nodes, at = self._nodes(tangents.t, t), [self._looked_at(q[0])]
        for a, b, j in nodes:
            step = slice(np.searchsorted(t, a, side="right"), np.searchsorted(t, b, side="right"))
            if not self.failure and t[step].size:
                ends = (_at(tangents, x, j, self._rigid) for x in (a, b))
                if not self._motion.advance(b - a, tuple(ends), g[step][-1], impulses[step].sum()):
                    self.failure = CHANGED.format(a)
            at.append(self._looked_at(q[max(step.stop - 1, 0)]))
        self._t = float(t[-1])
        times = np.array([nodes[0][0], *(b for _, b, _ in nodes)])
        after = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
        share = ((t - times[after - 1]) / (times[after] - times[after - 1]))[:, None]
        left = []
        for i in range(len(self._parts)):
            direct, freed = (np.array([one[k][i] for one in at]) for k in (0, 1))
            followed = (1 - share) * direct[after - 1] + share * direct[after]
            left.append(g[:, None] * followed + np.maximum(freed[after - 1], freed[after]))
        return left

    def _nodes(self, readings: np.ndarray, t: np.ndarray) -> list[tuple[float, float, int]]:
        """Intervals from here to the last of t that begin and end at samples; the reading before each."""
        inside = readings[(readings > self._t) & (readings < t[-1])]
        borders = np.array([self._t, *inside, t[-1]])
        shares = np.linspace(0, len(borders) - 1, BETWEEN * (len(borders) - 1) + 1)
        fine = np.interp(shares, np.arange(len(borders)), borders)
        ends = t[np.unique(np.searchsorted(t, fine[1:] - 1e-9 * (t[-1] - self._t)))]
        starts = np.array([self._t, *ends[:-1]])
        before = np.searchsorted(readings, (starts + ends) / 2) - 1
        return list(zip(starts.tolist(), ends.tolist(), np.maximum(before, 0).tolist(), strict=True))

    def _looked_at(self, q: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Of every body's outputs: factors (r,) of the energy g, and what freedoms are off by (r,)."""
        direct, freed = [], []
        for (body, _), place in zip(self._parts, self._places, strict=True):
            count = body.offline.shown_slices[-1].stop if body.offline.outputs else 0
            parts, rest = np.zeros((2, count)), body.deformations.rest
            parts[1] = np.inf
            for rows in [] if self.failure else self._rows(body, q):
                followed = rows.rigid @ self._motion.follows
                whole, inertia = followed.copy(), followed[:, place][:, -RIGID_INERTIA:]
                whole[:, place][:, : rows.own.shape[1]] += rows.own
                own, other = (np.einsum("ij,jk,ik->i", x, self._flexibility, x) for x in (whole, followed))
                beside = np.hstack([rows.other, 2 * inertia]) @ rest[:, : rows.other.shape[1]]
                own += np.einsum("ij,ij->i", beside, rows.other)
                parts[0, rows.shown] = np.sqrt(np.maximum(own, 0.0)) + np.sqrt(other)
                parts[1, rows.shown] = self._motion.sizes(rows.rigid)
            direct.append(parts[0])
            freed.append(parts[1])
        return direct, freed

    def _rows(self, body: EnrichedBody, q: np.ndarray) -> list[_Rows]:
        """What the outputs of a body see at coordinates q (all,)."""
        offline, size = body.offline, body.frame_size
        frame, modal = q[body.columns[:size]], q[body.modal]
        steps = DIFFERENCE * np.vstack([np.zeros(size), np.eye(size), -np.eye(size)])
        still = np.zeros_like(steps)
        moved = body.sampler.frame.motion(frame + steps, still, still).rows()
        own = np.searchsorted(self._rigid, body.columns[:size])
        found = []
        for out, part, view, shown in zip(
            offline.outputs, offline.slices, offline.views, offline.shown_slices, strict=True
        ):
            if view is None or out.of == "velocity":
                continue
            rows = offline.value_rows[part]
            base = np.broadcast_to(rows[:, : len(modal)] @ modal, (len(moved), len(rows)))
            at = view.values(base, moved, offline.scene.pose)
            rigid = np.zeros((at.shape[1], len(self._rigid)))
            rigid[:, own] = ((at[1 : size + 1] - at[size + 1 :]) / (2 * DIFFERENCE)).T
            H = view.matrices(moved[:1])[0]
            other = np.zeros((len(H), len(offline.value_rows)))
            other[:, part] = H
            found.append(_Rows(rigid, H @ rows, other, shown))
        return found


class OtherDeformations(EnrichedBody):
    """What couples to the mechanism of deformations w beside modes and vectors: sums m w and m x w, in their place.

    In the order of inertia_columns: sum m w_i (3), sum m x_j w_i (9).
    """

    def __init__(self, body: EnrichedBody):
        vars(self).update(vars(body))
        n, self.m, none = len(body.modal), RIGID_INERTIA, np.zeros((RIGID_INERTIA,) * 2)
        self.M_PP = self.K_PP = self.D_PP = none
        self._M_VP = self.K_VP = self.D_VP = np.zeros((n, self.m))
        unit = np.eye(self.m)
        self._pull, self._arms = unit[:3], unit[3:].reshape(3, 3, self.m).swapaxes(0, 1)
        self._of_V, self._of_P = np.zeros((3, 3, n, self.m)), np.zeros((3, 3, self.m, self.m))
        self._moved_loads = [np.zeros((3, self.m)) for _ in self._moved_loads]
        self._forcing = np.zeros((self.m, self._forcing.shape[1]))


def _asked(body: EnrichedBody) -> bool:
    outputs = zip(body.offline.outputs, body.offline.views, strict=True)
    return any(view is not None and out.of != "velocity" for out, view in outputs)


def _at(tangents: ExtendedTangents, t: float, j: int, rigid: np.ndarray) -> Equations:
    """The equations at t between readings j and j + 1; after the last one, with what it changes by."""
    first, last = tangents[j], tangents[min(j + 1, len(tangents.t) - 1)]
    return _equations(first, last, t - first.t, rigid)


def _equations(first: Tangent, last: Tangent, after: float, rigid: np.ndarray) -> Equations:
    """The equations a time after the first of two tangents: cubic between them."""
    h = last.t - first.t
    found = []
    for name in Equations._fields:
        rows = rigid if name in "MDK" else slice(None)
        y, z = (getattr(x, name)[rows] for x in (first, last))
        y_t, z_t = (np.zeros_like(y) if x.rate is None else getattr(x.rate, name)[rows] for x in (first, last))
        if h == 0:
            found.append(np.array([y + after * y_t, y_t, np.zeros_like(y)]))
            continue
        s, change = after / h, z - y
        slope, cube = h * y_t, h * (y_t + z_t) - 2 * change
        square = change - slope - cube
        value, rate = y + s * (slope + s * (square + s * cube)), slope + s * (2 * square + 3 * s * cube)
        found.append(np.array([value, rate / h, (2 * square + 6 * s * cube) / h**2]))
    return Equations(*found)


MANY = "the mechanism has {} freedoms; up to {} are gone through"
CHANGED = "the number of freedoms of the mechanism changes at t = {:g} s"
