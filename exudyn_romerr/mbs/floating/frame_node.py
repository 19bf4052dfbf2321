"""FrameNode: motion of a floating frame from its node's coordinates; one entry for each type of node.

RigidPart: what modes move the body as a rigid one beside it, which is motion of the frame, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import AssumptionError
from ...mechanism.rotations import body_rates
from ...model.floating_frame import FrameMotion, skew
from ..access.mbs_items import QUATERNIONS

if TYPE_CHECKING:
    from collections.abc import Callable


class FrameNode:
    """A rigid body node: coordinates are displacements, then rotation parameters, without reference values.

    Raises
    ------
    AssumptionError
        A node type whose equations of motion are not those of the floating frame.
    """

    def __init__(self, node: dict[str, Any]):
        if node["nodeType"] not in ROTATIONS:
            raise AssumptionError(
                f"the frame's node is of type {node['nodeType']!r}; supported: {', '.join(map(repr, ROTATIONS))}. "
                "(For RotationRxyz Exudyn 1.13.6 leaves out a term of the angular acceleration.) "
                "Make the body with rigidBodyNodeType='NodeType.RotationEulerParameters', the default"
            )
        self._rotation: Callable = ROTATIONS[node["nodeType"]]
        self.reference = np.asarray(node["referenceCoordinates"], dtype=float)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.reference)

    def motion(self, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray) -> FrameMotion:
        """Return the motion of the frame at S samples of the node's coordinates, each (S, size)."""
        A, w, al = self._rotation(self.reference[3:] + q[:, 3:], q_t[:, 3:], q_tt[:, 3:])
        return FrameMotion(self.reference[:3] + q[:, :3], q_t[:, :3], q_tt[:, :3], A, w, al)

    def at_rest(self, q: np.ndarray, samples: int) -> FrameMotion:
        """Return the motion of a frame that stays at q (size,), as often."""
        one = self.motion(q[None], *np.zeros((2, 1, self.size)))
        return FrameMotion(*(np.broadcast_to(x, (samples, *x.shape[1:])) for x in vars(one).values()))

    def reference_pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Return r (3,) and A (3, 3) of the reference configuration."""
        motion = self.motion(*np.zeros((3, 1, self.size)))
        return motion.r[0], motion.A[0]


@dataclass(frozen=True, eq=False)
class RigidPart:
    """Modes are V + Rg T: reference conditions hold V, Rg T is rigid motion, and moves the frame that they hold.

    moves : T (6, n), translations and rotations about the origin by each mode. share : |Rg T_j|_M over that of the
    mode, largest. alpha : 1/s, Rayleigh's, of Exudyn's damping, which acts on velocities by the modes as they are.
    """

    moves: np.ndarray
    share: float
    alpha: float = 0.0

    def add_inertia(self, u: np.ndarray, motion: FrameMotion, *states: np.ndarray) -> None:
        """Add to b, S of inertia_coordinates (S, 12 + ...) what modes move as a rigid body; states: see `frame`.

        Accelerations of places in axes of the frame: of d + t~ x and its rates, d'' + S d + 2 w~ d' + ... .
        """
        (d, d_t, d_tt), (t, t_t, t_tt) = self._parts(*states)
        S, w = motion.S, 2 * skew(motion.w)
        u[:, :3] += d_tt + self.alpha * d_t + _times(S, d) + _times(w, d_t)
        turned = skew(t_tt + self.alpha * t_t) + S @ skew(t) + w @ skew(t_t)
        u[:, 3:12] += turned.reshape(-1, 9)

    def frame(self, motion: FrameMotion, *states: np.ndarray) -> FrameMotion:
        """Return the motion of the frame that the conditions hold, to first order in the rigid part.

        states : q, q_t, q_tt (S, n).
        """
        from scipy.spatial.transform import Rotation  # here, for it takes long to import, and few bodies need it

        (d, d_t, d_tt), (t, t_t, t_tt) = self._parts(*states)
        A, w, al, W = motion.A, motion.w, motion.al, skew(motion.w)
        r, r_t = motion.r + _times(A, d), motion.r_t + _times(A, _times(W, d) + d_t)
        r_tt = motion.r_tt + _times(A, _times(motion.S, d) + 2 * _times(W, d_t) + d_tt)
        w_0 = w + np.cross(w, t) + t_t
        al_0 = al + np.cross(al, t) + np.cross(w, t_t) + t_tt
        return FrameMotion(r, r_t, r_tt, A @ Rotation.from_rotvec(t).as_matrix(), w_0, al_0)

    def _parts(self, *states: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Translations and rotations, each with its rates (S, 3)."""
        moved = [q @ self.moves.T for q in states]
        return [x[:, :3] for x in moved], [x[:, 3:] for x in moved]


def _times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("sij,sj->si", matrices, vectors)


def _euler_parameters(p, p_t, p_tt) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A = (1 - 2 v.v) I + 2 v v^T + 2 s v~ of p = s, v, also off unit norm; w = G p', al = G p'', G linear in p."""
    s, v = p[..., :1, None], p[..., 1:]
    diagonal = (1 - 2 * np.einsum("...i,...i->...", v, v))[..., None, None] * np.eye(3)
    A, G = diagonal + 2 * v[..., :, None] * v[..., None, :] + 2 * s * skew(v), body_rates(p)
    return A, _times(G, p_t), _times(G, p_tt)


def _rotation_vector(v, v_t, v_tt) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A = exp(v~); the node's velocities and accelerations are the angular ones in body axes."""
    from scipy.spatial.transform import Rotation  # here, for it takes long to import, and few nodes need it

    return Rotation.from_rotvec(v).as_matrix(), v_t, v_tt


ROTATIONS = {QUATERNIONS: _euler_parameters, "RigidBodyRotVecLG": _rotation_vector}
