"""The inputs of a floating body seen as a linear one: inertia of its frame, known loads, wrenches of joints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from ...model.floating_frame import RIGID_INERTIA, inertia_columns, inertia_coordinates, translations

if TYPE_CHECKING:
    from ...model.floating_frame import FrameMotion
    from .actions import Actions
    from .floating_body import FloatingBody
    from .frame_node import RigidPart
    from .frame_support import Support


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

    def __init__(
        self, actions: Actions, support: Support, flex: FloatingBody, V: np.ndarray, rigid: RigidPart | None = None
    ):
        self.at_rest = support.at_rest
        self.unknown = sum(place.columns.shape[1] for place in actions.wrenches)
        self.by_function = self.at_rest and not self.unknown and not any(load.follows for load in actions.loads)
        self.weighs = not self.at_rest or bool(actions.gravity)
        self._flex, self._V, self.rigid = flex, V, rigid
        self._loads = [sp.csc_matrix(of.columns) for of in (*actions.loads, *actions.wrenches)]
        self.first_load = 3 * self.weighs if self.at_rest else RIGID_INERTIA + 9 * V.shape[1]
        turned = 0.0 if rigid is None or self.at_rest else rigid.moves[3:]
        self._turns = [load.place.turn_rows @ V + turned if load.follows else None for load in actions.loads]

    @property
    def made_of(self) -> tuple[Any, ...]:
        """What the columns are made of, beside the body and V."""
        return self.at_rest, self.weighs, *self._loads

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
