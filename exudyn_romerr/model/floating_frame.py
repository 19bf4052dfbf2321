"""The moving frame of a flexible body: its inertia terms in the residual, its samples along a run (theory.md 7).

Acceleration of node i in the frame: a_i = b + S (x_i + u_i) + 2 w~ u_i' + u_i'', b = A^T (r'' - g), S = al~ + w~ w~.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ..errors import AssumptionError

ROWS = {"r": 3, "r_t": 3, "A": 9, "w": 3, "al": 3, "r_tt": 3}  # parts of a frame's row: how many numbers
RIGID_INERTIA = 12  # columns M e_j and M E_ij x; the 9 n columns M E_ij V follow
ISOTROPY = 1e-9  # of the largest entry of M: solid elements meet it to rounding
HELD = 1e-12  # of the size of a body, and rad: some thousand roundings; what moves on purpose is far above
# e_i~, one behind the other: one product with them takes a seventh of the time of six assignments, and is as exact
CROSS = np.cross(np.eye(3)[:, None, :], np.eye(3)).swapaxes(1, 2).reshape(3, 9)
SERIES = 1e-3  # rad; below, two terms of a Taylor series are exact to 1e-14, the quotients are not


@dataclass(frozen=True)
class FrameMotion:
    """Motion of the frame at S samples.

    r, r_t, r_tt : (S, 3) of its origin in global axes; A (S, 3, 3), body to global axes; w, al : (S, 3) angular
    velocity and acceleration in body axes.
    """

    r: np.ndarray
    r_t: np.ndarray
    r_tt: np.ndarray
    A: np.ndarray
    w: np.ndarray
    al: np.ndarray

    def local(self, vectors: np.ndarray) -> np.ndarray:
        """Return global vectors (S, 3) or (3,) in body axes (S, 3)."""
        if self.A.strides[0] == 0 and len(self.A):  # of a frame at rest: the same at all samples
            return np.broadcast_to(vectors @ self.A[0], self.r.shape)
        return np.einsum("sji,sj->si", self.A, np.broadcast_to(vectors, self.r.shape))

    @property
    def S(self) -> np.ndarray:
        """al~ + w~ w~, (S, 3, 3)."""
        return skew(self.al) + (turning := skew(self.w)) @ turning

    def rows(self) -> np.ndarray:
        """Return r, r_t, A, w, al, r_tt side by side, (S, 24), as samples carry them."""
        return np.hstack([getattr(self, name).reshape(-1, size) for name, size in ROWS.items()])

    @classmethod
    def of(cls, rows: np.ndarray) -> FrameMotion:
        """Cut rows (S, 24) into r, r_t, A, w, al, r_tt."""
        parts = dict(zip(ROWS, np.split(rows, np.cumsum([*ROWS.values()])[:-1], axis=1), strict=True))
        return cls(**parts | {"A": parts["A"].reshape(-1, 3, 3)})


class FramePose(NamedTuple):
    """Place r (3,) and axes A (3, 3) of a frame."""

    r: np.ndarray
    A: np.ndarray


class Jitter(NamedTuple):
    """What a solver leaves of the accelerations of a frame at rest, in the balance W^T R = 0 of its body.

    A frame that is held is where it was but for rounding of positions; over the square of a short step that is an
    acceleration, which the solver's equations hold, and which is no load that is missing.

    rows : (n, 6), W^T M times unit accelerations. size : of the body and of its place, a length.
    """

    rows: np.ndarray
    size: float

    @classmethod
    def of(cls, mass: sp.csc_matrix, positions: np.ndarray, V: np.ndarray, pose: FramePose) -> Jitter:
        """Make it of M (N, N), positions (nodes, 3), V (N, n)."""
        turned = [np.cross(axis, positions).reshape(-1) for axis in np.eye(3)]
        units = np.column_stack([translations(mass), mass @ np.array(turned).T])
        return cls(V.T @ units, float(np.linalg.norm(pose.r) + np.linalg.norm(positions, axis=1).max()))

    def accelerations(self, frame: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Return A^T r'' and al (S, 6) at samples (S, 24); zero where it has left `start` (24,): there it moves."""
        rows, first = FrameMotion.of(frame), FrameMotion.of(start[None])
        far, turned = np.abs(rows.r - first.r), np.abs(rows.A - first.A)
        found = np.hstack([np.einsum("sji,sj->si", rows.A, rows.r_tt), rows.al])
        if far.max() / self.size + turned.max() > HELD:  # else nowhere, which takes less time to find
            found[far.max(axis=1) / self.size + turned.max(axis=(1, 2)) > HELD] = 0.0
        return found


class Turn(NamedTuple):
    """Largest |w| (rad/s), |al| (rad/s^2) and |S|_2 <= |al| + |w|^2 in every segment of a block, each (S,).

    missed : (S,) mean of |.|_{M^-1} of what the residual leaves out there.
    """

    w: np.ndarray
    al: np.ndarray
    S: np.ndarray
    missed: np.ndarray

    @classmethod
    def between(cls, w: np.ndarray, al: np.ndarray) -> Turn | None:
        """Return what lies between consecutive samples of w, al (S + 1, 3); None if the frame does not turn."""
        w, al = np.linalg.norm(w, axis=1), np.linalg.norm(al, axis=1)
        if not w.any() and not al.any():
            return None
        w, al = np.maximum(w[:-1], w[1:]), np.maximum(al[:-1], al[1:])
        return cls(w, al, al + w**2, np.zeros_like(w))

    def of_curve(self, bent: np.ndarray, moved: np.ndarray, rows: FrameMotion) -> Turn:
        """Return the turn for a curved trajectory, whose terms S u + 2 w~ u' the residual takes as linear in time.

        bent (S, 2): mean of |V q|_M and |V q'|_M less their chords. moved (S, 2): the same of what chords span. With
        w and S linear in time, w~ u' less its chord is w~ (u' less its chord) less s (1 - s) dw~ du', mean 1/6.
        """
        dw = np.linalg.norm(np.diff(rows.w, axis=0), axis=1)
        dS = np.linalg.norm(np.diff(rows.al, axis=0), axis=1) + 2 * self.w * dw
        missed = self.S * bent[:, 0] + 2 * self.w * bent[:, 1] + (dS * moved[:, 0] + 2 * dw * moved[:, 1]) / 6
        return self._replace(missed=missed)


def skew(v: np.ndarray) -> np.ndarray:
    """Return v~ (..., 3, 3) with v~ x = v x x of v (..., 3)."""
    return (v @ CROSS).reshape(*v.shape, 3)


def left_jacobian(theta: np.ndarray) -> np.ndarray:
    """Return the left Jacobian of the rotations exp(theta~): I + theta~/2 + ..., (S, 3, 3) of theta (S, 3)."""
    angle = np.linalg.norm(theta, axis=1)[:, None, None]
    small = angle < SERIES
    x = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(x)) / x**2)
    second = np.where(small, 1 / 6 - angle**2 / 120, (x - np.sin(x)) / x**3)
    T = skew(theta)
    return np.eye(3) + first * T + second * (T @ T)


def translations(mass: sp.csc_matrix) -> np.ndarray:
    """Return M e_j, e_j the unit translation of every node (N, 3)."""
    return mass @ np.tile(np.eye(3), (mass.shape[0] // 3, 1))


def inertia_columns(mass: sp.csc_matrix, positions: np.ndarray, V: np.ndarray) -> sp.csc_matrix:
    """Return M e_j (3), M E_ij x (9), M E_ij V (9 n): what inertia_coordinates multiply, (N, 12 + 9 n), sparse.

    M E_ij = E_ij M, for M is the same in all directions (require_isotropic_mass).
    """
    products = (unit_products(mass @ X) for X in (positions.reshape(-1, 1), V))
    return sp.hstack([translations(mass), *products], format="csc")


def inertia_coordinates(
    b: np.ndarray, motion: FrameMotion, q: np.ndarray, q_t: np.ndarray, out: np.ndarray | None = None
) -> np.ndarray:
    """Return b, S_ij, S_ij q_k + 2 w~_ij q'_k at every sample, (S, 12 + 9 n), in `out`; b (S, 3), q, q_t (S, n)."""
    S, w, n = motion.S.reshape(-1, 9), 2 * skew(motion.w).reshape(-1, 9), q.shape[1]
    out = np.empty((len(q), RIGID_INERTIA + 9 * n)) if out is None else out
    out[:, :RIGID_INERTIA] = np.hstack([b, S])
    both = np.stack([S, w], axis=2), np.stack([q, q_t], axis=1)  # at once: a quarter of the time of two products
    np.matmul(*both, out=out[:, RIGID_INERTIA:].reshape(-1, 9, n))
    return out


def unit_products(X: np.ndarray) -> sp.csc_matrix:
    """Return E_ij X for i, j = 1..3, side by side: component j of every node put in the place of component i."""
    nodes, k = len(X) // 3, X.shape[1]
    values = np.tile(X.reshape(nodes, 3, k).transpose(1, 2, 0), (3, 1, 1, 1))  # of i, j, column, node
    rows = np.broadcast_to(np.int32(np.arange(3)[:, None, None, None] + 3 * np.arange(nodes)), values.shape)
    shape, starts = (3 * nodes, 9 * k), np.arange(0, values.size + 1, nodes)
    return sp.csc_matrix((values.ravel(), rows.ravel(), starts), shape=shape)


def require_isotropic_mass(mass: sp.csc_matrix) -> None:
    """Raise AssumptionError unless M = m (x) I3: no coupling of axes, equal in all three."""
    parts = [[mass[i::3, j::3] for j in range(3)] for i in range(3)]
    coupling = max(abs(parts[i][j]).max() for i in range(3) for j in range(3) if i != j)
    uneven = max(abs(parts[i][i] - parts[0][0]).max() for i in (1, 2))
    if (found := max(coupling, uneven) / abs(mass).max()) > ISOTROPY:
        raise AssumptionError(
            f"mass is not the same in x, y, z at every node ({found:.1e} of its largest entry; allowed "
            f"{ISOTROPY:g}): bounds in a moving frame need solid elements, not beams, shells or point inertias"
        )


def unit_inertia(mass: sp.csc_matrix, positions: np.ndarray) -> np.ndarray:
    """Return M e_j (3) and M E_ij x (9), of unit mass norm each (N, 12)."""
    turns = unit_products(positions.reshape(-1, 1)).toarray()
    motions = np.hstack([np.tile(np.eye(3), (len(positions), 1)), turns])
    columns = mass @ motions
    size = np.sqrt(np.einsum("ij,ij->j", motions, columns))
    return columns / np.where(size > 0, size, 1.0)
