"""Sampler: rows of an mbs's coordinates to samples of one floating body seen as a linear one.

Its inputs are inertia of its frame, known loads, and wrenches of joints, which its balance implies.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from ...errors import AssumptionError
from ...model.floating_frame import RIGID_INERTIA, inertia_columns, inertia_coordinates, translations

if TYPE_CHECKING:
    from ...linear.run.prepare import Offline
    from ...model.floating_frame import FrameMotion
    from .frame_node import FrameNode
    from .loads_and_joints import Actions
    from .reference_search import SeenBody

UNSET = 1e-3  # of the largest term of V^T R: with accelerations of zero a loaded body is out of balance by far more
TOLD_APART = 1e-8  # smallest singular value of the wrenches in V^T R = 0, of the largest, that still tells them


class InputTerms:
    """Columns B and values u(t) with R = M V q'' + D V q' + K V q - B u.

    In this order: M e_j and, unless the frame is at rest, M E_ij x and M E_ij V; loads; wrenches, which are unknown.

    Attributes
    ----------
    unknown : number of trailing columns of wrenches. weighs : whether inertia or gravity comes first; the first three
    values are b then. first_load : number of columns before
    the loads. by_function : all inputs are functions of time alone. rigid : what modes move beside V (N, n), which
    the reference conditions hold; None: nothing.
    """

    def __init__(self, seen: SeenBody, at_rest: bool):
        actions, V, rigid = seen.actions, seen.model.held, seen.model.rigid
        self.at_rest = at_rest
        self.unknown = sum(place.columns.shape[1] for place in actions.wrenches)
        self.by_function = self.at_rest and not self.unknown and not any(load.follows for load in actions.loads)
        self.weighs = not self.at_rest or bool(actions.gravity)
        self._flex, self._V, self.rigid = seen.flex, V, rigid
        self._loads = [sp.csc_matrix(of.columns) for of in (*actions.loads, *actions.wrenches)]
        self.first_load = 3 * self.weighs if self.at_rest else RIGID_INERTIA + 9 * V.shape[1]
        turned = 0.0 if rigid is None or self.at_rest else rigid.moves[3:]
        self._turns = [load.place.columns[:, 3:].T @ V + turned if load.follows else None for load in actions.loads]

    @property
    def columns(self) -> sp.csc_matrix:
        """Columns B (N, p), made anew: of a large body they take more memory than all that a run needs."""
        mass, positions = self._flex.mass, self._flex.positions
        inertia = []
        if self.weighs:
            inertia = [-(translations(mass) if self.at_rest else inertia_columns(mass, positions, self._V))]
        # sparse: two thirds of what turns with the frame are zeros
        return sp.hstack([*inertia, sp.csc_matrix((len(self._V), 0)), *self._loads], format="csc")

    def values(self, actions: Actions, t: np.ndarray, motion: FrameMotion, q, q_t, q_tt) -> np.ndarray:
        """Return u (S, p) of times t (S,) and states q, q_t, q_tt (S, n), with zeros for the wrenches.

        motion : of the frame of the mbs; at rest, of the one that the reference conditions hold. q_tt : needed where
        modes have a rigid part.
        """
        u = np.empty((len(t), self.first_load + 3 * len(self._turns) + self.unknown))
        if self.weighs:
            self._inertia(actions.gravity_at(t), motion, q, q_t, u[:, : self.first_load])
            if self.rigid is not None and not self.at_rest:
                self.rigid.add_inertia(u, motion, q, q_t, q_tt)
        for i, (load, turn) in enumerate(zip(actions.loads, self._turns, strict=True)):
            first = self.first_load + 3 * i
            u[:, first : first + 3] = load.local(t, motion, None if turn is None else q @ turn.T)
        u[:, u.shape[1] - self.unknown :] = 0.0
        return u

    def _inertia(self, gravity: np.ndarray, motion: FrameMotion, q, q_t, out: np.ndarray) -> None:
        if self.at_rest:
            out[:] = motion.local(-(gravity if gravity.strides[0] else gravity[:1]))  # one, where all are the same
        else:
            inertia_coordinates(motion.local(motion.r_tt - gravity), motion, q, q_t, out)


@dataclass(frozen=True)
class Sampler:
    """What a body's inputs are made of: its frame, what acts on it, and its balance V^T R = 0.

    wrench_rows : see wrenches_from_balance.
    """

    frame: FrameNode
    actions: Actions
    terms: InputTerms
    offline: Offline
    wrench_rows: np.ndarray

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

    def _inputs(self, t: np.ndarray, motion: FrameMotion, q, q_t, q_tt) -> np.ndarray:
        """Inertia, loads, and the wrenches that V^T R = 0 leaves, u (S, p)."""
        u = self.terms.values(self.actions, t, motion, q, q_t, q_tt)
        if self.terms.unknown:
            left = self.offline.coordinates(q, q_t, q_tt, u) @ self.offline.balance_rows.T
            u[:, -self.terms.unknown :] = left @ self.wrench_rows
        return u


def wrenches_from_balance(offline: Offline, terms: InputTerms, actions: Actions) -> np.ndarray:
    """Return rows (n, unknown): V^T R without wrenches to the wrenches that make it least, in the norm of V^T K V.

    Raises
    ------
    AssumptionError
        They do not follow from it.
    """
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
