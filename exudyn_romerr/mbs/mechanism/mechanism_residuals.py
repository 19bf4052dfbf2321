"""MechanismResiduals: what the bodies of a mechanism leave in the motion that the linearised mechanism corrects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...linalg.blocked_products import row_norms
from ...model.floating_frame import Veer, moment_of, skew

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .enriched_body import EnrichedBody

PROBED, SELDOM = 8, 4  # of so many steps one is looked at, whether passes pay; of so many times as many far from it
FAR = 0.1  # of what pays: less is far from it
PAYS = 0.5  # of what stays of R outside the span of modes and vectors
MATTERS = 1e-3  # of the energy that vectors add: less is nothing beside the error
EULER_PARAMETERS = 4  # other rotations are increments: sums of states are no states there


class MechanismResiduals:
    """Residuals (estimates/residual_passes.py) of bodies, and where their vectors are among all coordinates.

    Attributes
    ----------
    rows : t (S,), q, q_t, q_tt (S, coordinates of the mbs) of the run. is_far : whether passes were far from paying
    when that was asked last.
    """

    def __init__(self, parts: Sequence[tuple[EnrichedBody, slice]]):
        self._parts, self.rows, self.is_far = parts, (), False
        self._roots = [np.linalg.cholesky(_stiffness(body)) for body, _ in parts]
        self._nets: list[NetInertia] = []  # made when they are needed
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
        self._nets = self._nets or [NetInertia(body) for body, _ in self._parts]
        for (body, own), net in zip(self._parts, self._nets, strict=True):
            here, there, back = (body.moved(own, states, x) for x in (0 * e, e, -e))
            force[:, body.frame] = net.second_order(body.sampler.actions.gravity_at(t), here, there, back)
        return force

    def size_beside(self, i: int, force: np.ndarray) -> np.ndarray | None:
        """Return |.|_{M^-1} (S,) of forces (S, all coordinates) on the frame of body i; None if there are none."""
        body, _ = self._parts[i]
        return self._nets[i].size(self.rows[1][:, body.frame], force[:, body.frame]) if self._nets else None

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
        if not e[:2].any():  # linear equations leave nothing of where a run starts, and rounding is not asked
            return False
        squares, times = np.zeros((3, 1)), self.rows[0][part]
        every = PROBED * (SELDOM if self.is_far else 1)
        probed = slice((len(times) - 1) % every, None, every)  # the last one, too
        (t, *states), e = (x[part][probed] for x in self.rows), e[:, probed]
        for (body, own), root in zip(self._parts, self._roots, strict=True):
            here, moved = (body.moved(own, states, x) for x in (0 * e, e))
            squares = squares + _sizes(body, root, t, here, moved) ** 2
        inside, outside, force = np.sqrt(squares).max(axis=1, initial=0.0)
        self._removed += inside + np.ptp(times) * len(times) / max(len(times) - 1, 1) * force
        self._stays += outside
        enough = max(PAYS * self._stays, MATTERS * self.largest(e))
        self.is_far = self._removed < FAR * enough
        return self._removed > enough


def _sizes(body: EnrichedBody, root: np.ndarray, t: np.ndarray, here: Sequence, moved: Sequence) -> np.ndarray:
    """|.|_{K^-1} of R in the span of modes and vectors and outside, |.|_{M^-1} of forces of second order, (3, S)."""
    q, q_t, q_tt, u, frame = body.sampler(t, *moved)
    (layout, rows), bound, size = body.offline.balance, body.offline.estimators["auxiliary"], body.frame_size
    inside = row_norms(np.linalg.solve(root, rows @ layout(q, q_t, q_tt, u).T).T)
    if body.offline.packing is not None:
        u, _ = body.offline.packing(u)
    whole = bound.norm(body.offline.coordinates(q, q_t, q_tt, u))
    before = body.sampler.held_frame(*here)
    veer = Veer.between(u[:, :3], moved[2][:, :3] - here[2][:, :3], before, frame)
    added = (row_norms((x - y)[:, size:] @ bound.root.T) for x, y in zip(moved[:2], here, strict=False))
    force = veer.unbalanced(*added, bound.arm, bound.mass)
    return np.array([inside, np.sqrt(np.maximum(whole**2 - inside**2, 0.0)), force])


def _stiffness(body: EnrichedBody) -> np.ndarray:
    """K of modes and vectors."""
    layout, rows = body.offline.balance
    return rows[:, layout.stiffness_slot]


class NetInertia:
    """Forces of a body's inertia and weight on the coordinates of its frame, and how they are of second order.

    The body's residual does not show these: there the wrench of one interface balances the body, whatever it is.
    """

    def __init__(self, body: EnrichedBody):
        self._frame, sums = body.sampler.frame, body.sums
        self._total, self._first, self._pull = sums.rigid[0, 0], sums.x, sums.pull
        self._root = np.linalg.inv(np.linalg.cholesky(sums.rigid))
        # sums of x_i M x_j, x_i M u_j, u_i M u_j
        self._xx, self._xu = sums.xx, sums.of_x
        self._uu = np.ascontiguousarray(sums.of_U.transpose(2, 0, 1, 3))

    @property
    def is_known(self) -> bool:
        """Whether the frame's coordinates are such that forces of second order can be told."""
        return self._frame.size == 3 + EULER_PARAMETERS

    def second_order(
        self,
        gravity: np.ndarray,
        here: Sequence[np.ndarray],
        there: Sequence[np.ndarray],
        back: Sequence[np.ndarray],
    ) -> np.ndarray:
        """Return what forces (S, size) are of second order in states moved there less those here; gravity (S, 3).

        States q, q_t, q_tt (S, size + k) are those of frame, modes and vectors; back : moved the other way. What is
        of even order, in fact.
        """
        if not self.is_known:
            return np.zeros((len(gravity), self._frame.size))
        there, back, own = (self._forces(gravity, states) for states in (there, back, here))
        force, moment = np.split((there + back) / 2 - own, [3], axis=1)
        q, *still = here[0][:, : self._frame.size], *np.zeros((2, len(gravity), self._frame.size))
        A, rates = self._frame.motion(q, *still).A, self._frame.rates(q)
        return np.hstack([np.einsum("sij,sj->si", A, force), np.einsum("sij,si->sj", rates, moment)])

    def size(self, q: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return |.|_{M^-1} (S,) of the rigid body's inertia that does such forces (S, size) at q; nan: unknown."""
        if not self.is_known:
            return np.full(len(q), np.nan)
        still = np.zeros_like(q)
        local = np.einsum("sji,sj->si", self._frame.motion(q, still, still).A, force[:, :3])
        moment = np.einsum("sij,sj->si", self._frame.rates(q), force[:, 3:]) / EULER_PARAMETERS
        return row_norms(np.hstack([local, moment]) @ self._root.T)

    def _forces(self, gravity: np.ndarray, states: Sequence[np.ndarray]) -> np.ndarray:
        """Force and moment (S, 6) in axes of the frame: what holds it turns with it."""
        size = self._frame.size
        (q, q_t, q_tt), (c, c_t, c_tt) = ([x[:, part] for x in states] for part in (slice(size), slice(size, None)))
        motion = self._frame.motion(q, q_t, q_tt)
        b, weight, S, w = motion.local(motion.r_tt), motion.local(-gravity), motion.S, 2 * skew(motion.w)
        first, by_c = self._first + c @ self._pull.T, self._xu + np.tensordot(c, self._uu, axes=1)
        of_c, of_rates, of_accelerations = (np.einsum("sijm,sm->sij", by_c, x) for x in (c, c_t, c_tt))
        second = self._xx + of_c + np.einsum("ijm,sm->sji", self._xu, c)
        turned = lambda turning, x: np.einsum("sjk,sk->sj", turning, x)  # noqa: E731
        force = self._total * (b + weight) + turned(S, first) + turned(w, c_t @ self._pull.T) + c_tt @ self._pull.T
        arms = first[:, :, None] * b[:, None] + self._first[:, None] * weight[:, None]
        arms += second @ S.swapaxes(1, 2) + of_rates @ w.swapaxes(1, 2)
        arms += of_accelerations
        return np.hstack([force, moment_of(arms)])
