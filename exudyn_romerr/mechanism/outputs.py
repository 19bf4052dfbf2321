"""Outputs: what errors of unknowns, rates, accelerations and multipliers do to what sensors show.

Sensors of a node of a floating body in closed form, for their gradients ring with the body: dx of -x~ dphi is U c.
All others by gradients that are asked for in few rows, linear in time between them, in axes of bodies; more rows
where that is not true.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .body import Body
from .rotations import along_screw, body_rates, cross, rotation_matrix, times
from .rows import Rows
from .unknowns import Unknowns

WITHIN, MOST = 2e-3, 65  # of the largest entry of a sensor; rows that are looked at
ORDERS = ("coordinates", "rates", "accelerations", "multipliers")  # what sensors may know


@dataclass(frozen=True)
class NodeSensor:
    """Three rows from `first` on that show a mesh node of body number `body`.

    kind : one of CLOSED. shapes (3, k), position (3,) m : of the node, or of the mean of several.
    """

    first: int
    body: int
    kind: str
    shapes: np.ndarray
    position: np.ndarray

    @property
    def rows(self) -> slice:
        """The rows."""
        return slice(self.first, self.first + 3)

    def values(self, body: Body, rows: Rows) -> np.ndarray:
        """Return what it shows in rows of the reduced run, (T, 3)."""
        c, c1 = (x[:, body.place.modal] @ self.shapes[:, : body.n].T for x in (rows.q, rows.v))
        frame, reference = body.place.frame, body.place.reference
        p = reference[3:] + rows.q[:, frame[3:]]
        A = rotation_matrix(p)
        if self.kind == "Velocity":
            w = times(body_rates(p), rows.v[:, frame[3:]])
            return rows.v[:, frame[:3]] + times(A, cross(w, self.position + c) + c1)
        place = reference[:3] + rows.q[:, frame[:3]] + times(A, self.position + c)
        if self.kind == "Position":
            return place
        return place - reference[:3] - rotation_matrix(reference[3:]) @ self.position

    def changes(self, body: Body, rows: Rows, e: np.ndarray) -> np.ndarray:
        """Return changes (T, 3, columns) in axes of the body by e (T, 3, 6 + k, columns) in these, too.

        Of rotations that are not small, too: along the screw of the frame as in Motion.moved.
        """
        e = np.moveaxis(e, 2, -1)
        du, du1 = e[:, 0, :, 6:] @ self.shapes.T, e[:, 1, :, 6:] @ self.shapes.T
        y = (self.position + rows.q[:, body.place.modal] @ self.shapes[:, : body.n].T)[:, None]
        (dr, dr1), (phi, phi1) = (np.moveaxis(e[:, :2, :, part], 1, 0) for part in (slice(0, 3), slice(3, 6)))
        shift = dr + cross(phi, y + du)
        if self.kind != "Velocity":
            return (du + along_screw([phi], [shift])[0]).swapaxes(1, 2)
        p = body.place.reference[3:] + rows.q[:, body.place.frame[3:]]
        w = times(body_rates(p), rows.v[:, body.place.frame[3:]])[:, None]
        rate = cross(w, y) + (rows.v[:, body.place.modal] @ self.shapes[:, : body.n].T)[:, None]
        stretch = cross(w, du) + du1
        shifting = dr1 + cross(phi1, y + du) + cross(phi, rate + stretch)
        return (stretch + along_screw([phi, phi1], [shift, shifting])[1]).swapaxes(1, 2)


CLOSED = "Displacement", "Position", "Velocity"  # kinds of NodeSensor


@dataclass(frozen=True)
class RowsInFrame:
    """Rows from `first` on of what the frame of body number `body` sees: shapes (r, k) of displacements, or of rates.

    Strains, stresses, rotations: whatever is linear in displacements of the mesh.
    """

    first: int
    body: int
    shapes: np.ndarray
    is_rate: bool

    @property
    def rows(self) -> slice:
        """The rows."""
        return slice(self.first, self.first + len(self.shapes))

    def values(self, body: Body, rows: Rows) -> np.ndarray:
        """Return what they show in rows of the reduced run, (T, r)."""
        return (rows.v if self.is_rate else rows.q)[:, body.place.modal] @ self.shapes[:, : body.n].T

    def changes(self, body: Body, rows: Rows, e: np.ndarray) -> np.ndarray:
        """Return changes (T, r, columns) by e (T, 3, 6 + k, columns) in axes of the body."""
        return self.shapes @ e[:, int(self.is_rate), 6:]


InClosedForm = NodeSensor | RowsInFrame


class Gradients(Protocol):
    """What knows gradients of sensors. uses (4,) : whether sensors know ORDERS at all."""

    uses: Sequence[bool]

    def gradients(self, i: int) -> list[np.ndarray]:
        """Return of row i the gradients (R, n or all) by each of ORDERS, in axes of bodies."""


class Outputs:
    """Gradients of R rows of sensors over time.

    axes (R,) : number of the body whose axes a row's gradients are in, or -1. at : rows that were looked at.
    """

    def __init__(
        self,
        unknowns: Unknowns,
        rows: Rows,
        axes: np.ndarray,
        nodes: Sequence[InClosedForm],
        asked: Sequence[slice] = (),
        source: Gradients | None = None,
    ):
        """Look at gradients.

        Parameters
        ----------
        nodes : sensors in closed form
        asked : rows of each of all others, whose gradients the source knows
        """
        self._unknowns, self._rows, self.axes, self._nodes, self._asked = unknowns, rows, axes, nodes, asked
        self._read: dict[int, list[np.ndarray]] = {}
        if asked:
            self._uses = source.uses
            self._look(source)
        self.at = np.array(sorted(self._read) or [0, len(rows) - 1])

    def _look(self, source: Gradients) -> None:
        """Look at halves of spans until they are straight."""
        last = len(self._rows) - 1
        self._read = {i: source.gradients(i) for i in {0, last}}
        spans = [(0, last)]
        while spans and len(self._read) < MOST:
            a, b = spans.pop(0)
            c = (a + b) // 2
            if c > a:
                self._read[c] = source.gradients(c)
                if not self._is_straight(a, c, b):
                    spans += [(a, c), (c, b)]

    def _is_straight(self, a: int, c: int, b: int) -> bool:
        share = (c - a) / (b - a)
        for one, now, two in zip(self._read[a], self._read[c], self._read[b], strict=True):
            off = np.abs((1 - share) * one + share * two - now)
            for rows in self._asked:
                if off[rows].max(initial=0.0) > WITHIN * np.abs(now[rows]).max(initial=0.0):
                    return False
        return True

    def __call__(self, first: int, e: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """Return changes (T, R, columns) by e (T, 3, n, columns) in global axes, multipliers (T, all, columns).

        first : row of the run that e begins at.
        """
        u, T = self._unknowns, len(e)
        rows, y = self._rows[first : first + T], np.zeros((T, len(self.axes), e.shape[-1]))
        e = np.moveaxis(u.in_body_axes(np.moveaxis(e, 2, -1), rows.q[:, None, None]), -1, 2)
        if self._read:
            self._add_asked(first, e, multipliers, y)
        for node in self._nodes:
            own = np.concatenate([e[:, :, u.blocks[node.body]], e[:, :, u.waves[node.body]]], axis=2)
            y[:, node.rows] = node.changes(u.bodies[node.body], rows, own)
        for b in set(self.axes[self.axes >= 0]):
            A, own = rotation_matrix(u.nodes[b].parameters(rows.q)), np.flatnonzero(self.axes == b)
            turned = A[:, None] @ y[:, own].reshape(T, -1, 3, y.shape[-1])
            y[:, own] = turned.reshape(T, len(own), -1)
        return y

    def _add_asked(self, first: int, e: np.ndarray, multipliers: np.ndarray, y: np.ndarray) -> None:
        """Add what gradients tell, linear between the rows in which they were asked for."""
        numbers = np.arange(first, first + len(e))
        spans = np.clip(np.searchsorted(self.at, numbers, "right") - 1, 0, max(len(self.at) - 2, 0))
        for k in np.unique(spans):
            own, (i, *more) = np.flatnonzero(spans == k), self.at[k : k + 2]
            j = more[0] if more else i
            s = ((numbers[own] - i) / max(j - i, 1))[:, None, None]
            for share, row in ((1 - s, i), (s, j)):
                for order, G in enumerate(self._read[row]):
                    if self._uses[order]:
                        y[own] += share * (G @ (e[own, order] if order < 3 else multipliers[own]))
