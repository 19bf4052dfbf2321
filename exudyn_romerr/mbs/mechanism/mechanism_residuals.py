"""MechanismResiduals: what the bodies of a mechanism leave in the motion that the linearised mechanism corrects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...linalg.blocked_products import row_norms
from ...model.floating_frame import Veer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .enriched_body import EnrichedBody

PROBED = 8  # of so many steps one is looked at, whether passes pay
PAYS = 0.5  # of what stays of R outside the span of modes and vectors
MATTERS = 1e-3  # of the energy that vectors add: less is nothing beside the error


class MechanismResiduals:
    """Residuals (estimates/residual_passes.py) of bodies, and where their vectors are among all coordinates.

    Attributes
    ----------
    rows : t (S,), q, q_t, q_tt (S, coordinates of the mbs) of the run.
    """

    def __init__(self, parts: Sequence[tuple[EnrichedBody, slice]]):
        self._parts, self.rows = parts, ()
        self._roots = [np.linalg.cholesky(_stiffness(body)) for body, _ in parts]
        self._removed = self._stays = 0.0  # by passes, and with them, of what bounds add up

    def left(self, part: slice, e: np.ndarray) -> np.ndarray:
        """Return -(V, P)^T R (S, all coordinates) in rows that e (3, S, all coordinates) corrects."""
        force, (t, *states) = np.zeros(e.shape[1:]), (x[part] for x in self.rows)
        for body, own in self._parts:
            layout, rows = body.offline.balance
            found = -layout(*body.sampler(t, *body.moved(own, states, e))[:4]) @ rows.T
            force[:, body.modal], force[:, own] = np.split(found, [len(body.modal)], axis=1)
        return force

    def second_order(self, part: slice, e: np.ndarray) -> np.ndarray:
        """Return inertia forces (S, all coordinates) on frames, those of second order in e."""
        force, (t, *states) = np.zeros(e.shape[1:]), (x[part] for x in self.rows)
        for body, own in self._parts:
            here, moved = (body.moved(own, states, x) for x in (0 * e, e))
            force[:, body.frame] = body.net.second_order(body.gravity(t), here, moved)
        return force

    def size_beside(self, body: EnrichedBody, force: np.ndarray) -> np.ndarray:
        """Return |.|_{M^-1} (S,) of forces (S, all coordinates) on the frame of a body."""
        return body.net.size(self.rows[1][:, body.frame], force[:, body.frame])

    def largest(self, e: np.ndarray) -> float:
        """Return the largest energy norm of modes and vectors in e."""
        if not self._parts:
            return 0.0
        sizes = [
            row_norms(np.hstack([e[0][:, body.modal], e[0][:, own]]) @ root)
            for (body, own), root in zip(self._parts, self._roots, strict=True)
        ]
        return float(np.linalg.norm(sizes, axis=0).max(initial=0.0))

    def pay(self, part: slice, e: np.ndarray) -> bool:
        """Return whether so far much of what bounds add up would not be there with passes."""
        squares, times = np.zeros((3, 1)), self.rows[0][part]
        probed = slice((len(times) - 1) % PROBED, None, PROBED)  # the last one, too
        (t, *states), e = (x[part][probed] for x in self.rows), e[:, probed]
        for (body, own), root in zip(self._parts, self._roots, strict=True):
            here, moved = (body.moved(own, states, x) for x in (0 * e, e))
            squares = squares + _sizes(body, root, t, here, moved) ** 2
        inside, outside, force = np.sqrt(squares).max(axis=1, initial=0.0)
        self._removed += inside + np.ptp(times) * len(times) / max(len(times) - 1, 1) * force
        self._stays += outside
        return self._removed > max(PAYS * self._stays, MATTERS * self.largest(e))


def _sizes(body: EnrichedBody, root: np.ndarray, t: np.ndarray, here: Sequence, moved: Sequence) -> np.ndarray:
    """|.|_{K^-1} of R in the span of modes and vectors and outside, |.|_{M^-1} of forces of second order, (3, S)."""
    q, q_t, q_tt, u, frame = body.sampler(t, *moved)
    (layout, rows), bound, size = body.offline.balance, body.offline.estimators["auxiliary"], body.frame_size
    inside = row_norms(np.linalg.solve(root, rows @ layout(q, q_t, q_tt, u).T).T)
    if body.offline.packing is not None:
        u, _ = body.offline.packing(u)
    whole = bound.norm(body.offline.coordinates(q, q_t, q_tt, u))
    before = body.sampler.frame.motion(*(x[:, :size] for x in here)).rows()
    veer = Veer.between(u[:, :3], moved[2][:, :3] - here[2][:, :3], before, frame)
    added = (row_norms((x - y)[:, size:] @ bound.root.T) for x, y in zip(moved[:2], here, strict=False))
    force = veer.unbalanced(*added, bound.arm, bound.mass)
    return np.array([inside, np.sqrt(np.maximum(whole**2 - inside**2, 0.0)), force])


def _stiffness(body: EnrichedBody) -> np.ndarray:
    """K of modes and vectors."""
    layout, rows = body.offline.balance
    return rows[:, layout.stiffness_slot]
