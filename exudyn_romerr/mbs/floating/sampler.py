"""Sampler: rows of an mbs's coordinates to samples of one floating body, with the wrenches that they imply."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...errors import AssumptionError

if TYPE_CHECKING:
    from ...linear.run.offline import Offline
    from ...model.floating_frame import FrameMotion
    from .actions import Actions
    from .frame_node import FrameNode
    from .input_terms import InputTerms

UNSET = 1e-3  # of the largest term of V^T R: with accelerations of zero a loaded body is out of balance by far more
TOLD_APART = 1e-8  # smallest singular value of the wrenches in V^T R = 0, of the largest, that still tells them


@dataclass(frozen=True)
class Sampler:
    """What a body's inputs are made of: its frame, what acts on it, and its balance V^T R = 0."""

    frame: FrameNode
    actions: Actions
    terms: InputTerms
    offline: Offline
    wrench_rows: np.ndarray

    @classmethod
    def of(cls, frame: FrameNode, actions: Actions, terms: InputTerms, offline: Offline) -> Sampler:
        """Make the wrenches follow from the balance; AssumptionError if they do not."""
        return cls(frame, actions, terms, offline, _wrenches_from_balance(offline, terms, actions))

    def __call__(self, t: np.ndarray, *states: np.ndarray) -> tuple:
        """Return q, q_t, q_tt (S, n), u (S, p), None if it is a function of time, and the frame (S, 24)."""
        motion, held = self._frames(states)
        q, q_t, q_tt = (state[:, self.frame.size :] for state in states)
        motion = held if self.terms.at_rest else motion
        u = None if self.terms.by_function else self._inputs(t, motion, q, q_t, q_tt)
        return q, q_t, q_tt, u, held.rows()

    def _frames(self, states: tuple[np.ndarray, ...]) -> tuple[FrameMotion, FrameMotion]:
        """Motion of the frame of the mbs, and of the one that the reference conditions hold."""
        size = self.frame.size
        motion = self.frame.motion(*(state[:, :size] for state in states))
        if self.terms.rigid is None:
            return motion, motion
        return motion, self.terms.rigid.frame(motion, *(state[:, size:] for state in states))

    def accelerated(self, t: float, rows: tuple) -> tuple | None:
        """Return the rows of one instant with accelerations that are in balance, where the solver has set none.

        None: they are the solver's to tell, for the frame moves or joints act.
        """
        q, q_t, q_tt, u, frame = rows
        known = self.offline.signal(np.array([t])) if u is None else u
        layout, G = self.offline.coordinates, self.offline.balance_rows
        terms = layout(q, q_t, q_tt, known)[0] * G
        left = terms.sum(axis=1)
        if np.max(np.abs(left)) <= UNSET * np.max(np.abs(terms).sum(axis=1)):
            return rows
        if not self.terms.by_function:
            return None
        return q, q_t, q_tt - np.linalg.solve(G[:, layout.mass_slot], left), u, frame

    def weight(self, carried: np.ndarray) -> float:
        """Largest entry of V^T M e_j (n, 3) times the size of gravity at the start: terms that may cancel."""
        return float(np.max(np.abs(carried) @ self.actions.sizes_of_gravity(), initial=0.0))

    def _inputs(self, t: np.ndarray, motion: FrameMotion, q, q_t, q_tt) -> np.ndarray:
        """Inertia, loads, and the wrenches that V^T R = 0 leaves."""
        return self.balanced(q, q_t, q_tt, self.terms.values(self.actions, t, motion, q, q_t, q_tt))

    def balanced(self, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Put into u (S, p), whose wrenches are zero, those that the balance asks for."""
        if self.terms.unknown:
            left = self.offline.coordinates(q, q_t, q_tt, u) @ self.offline.balance_rows.T
            u[:, -self.terms.unknown :] = left @ self.wrench_rows
        return u


def _wrenches_from_balance(offline: Offline, terms: InputTerms, actions: Actions) -> np.ndarray:
    """Return rows (n, unknown): V^T R without wrenches to the wrenches that make it least, in the norm of V^T K V."""
    layout, G = offline.coordinates, offline.balance_rows
    if not terms.unknown:
        return np.zeros((len(G), 0))
    root = np.linalg.cholesky(G[:, layout.stiffness_slot])
    columns = np.linalg.solve(root, -G[:, -terms.unknown :])
    size = np.linalg.norm(columns, axis=0)
    values = np.linalg.svd(columns / np.where(size > 0, size, 1.0), compute_uv=False)
    if len(values) < terms.unknown or not size.all() or values[-1] < TOLD_APART * values[0]:
        raise AssumptionError(
            f"the wrenches at {', '.join(place.name for place in actions.wrenches)} cannot be told from "
            f"the motion of {len(root)} modes: joints need interfaces with static modes "
            "(Craig-Bampton, fem.ComputeHurtyCraigBamptonModes), or more modes than their wrenches have components"
        )
    return np.linalg.solve(root.T, np.linalg.pinv(columns).T)
