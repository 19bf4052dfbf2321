"""What the slow modes of a body on a joint may answer to what modes and vectors leave of its error (theory.md 8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

from ..linalg.blocked_products import rows_times
from ..linalg.orthogonalise import orthonormal, without
from ..model.admissible_space import rigid_modes
from ..model.floating_frame import skew

if TYPE_CHECKING:
    import scipy.sparse as sp

    from .problem import Problem

COUNTS = (4, 8)  # modes that count as slow: each row takes what is best
RIGID = 1e-6  # of the lowest frequency of the held body: less is a rigid motion
BESIDE = 1e-3  # of the rate at which the frame turns: so much may be about axes that the joint does not leave free
ROUNDING = 1e-9  # of the lowest frequency: rates below are rounding


class SlowModes:
    """Bounds of rows C by slow modes t_i of a body whose joint leaves it the same rigid motions all the time.

        |C e + C K^-1 R| <= |C - sum_i C t_i t_i^T M|_{K^-1} g + sum_i |C t_i| (|p_i| + |t_i^T M K^-1 R|)

    p_i = t_i^T M e, t_i on rigid motions, modes and vectors. What drives p_i is what these leave of R, forces of
    second order, the turning of the frame, and the rest of e, which inertia couples to t_i. e begins with zero.

    Parameters
    ----------
    problem : on modes and vectors V; damping beta K.
    free : ndarray, (6, f)
        Motions that the joint leaves to the body, in its axes: combinations of rigid_modes.
    """

    def __init__(self, problem: Problem, free: np.ndarray):
        body, factor, Y = problem.body, problem.body.stiffness_factor, problem.dual.Y_K[:, : problem.dual.k]
        V, f = problem.V, free.shape[1]
        held = factor.half_multiply(V)
        whole = np.hstack([rigid_modes(body.positions) @ free, body.expand(V)])
        stiffness = la.block_diag(np.zeros((f, f)), held.T @ held)
        squares, turn = la.eigh(stiffness, whole.T @ (body.mass @ whole))
        slow = np.flatnonzero(squares > (RIGID * body.modes(1).omega[0]) ** 2)[: max(COUNTS)]
        self._omega, t, bent = np.sqrt(squares[slow]), whole @ turn[:, slow], turn[f:, slow]
        inertia = factor.half_solve(body.space.loads(body.mass @ t))
        coupled = np.linalg.norm(without(orthonormal(held), inertia), axis=0)  # |t^T M z| <= coupled |z|_K
        self._coupling = self._omega**2 * (1 + body.rayleigh[1] * self._omega) * coupled
        self._axes = la.orth(free[3:])
        self._turning = _largest_turned(body.mass, t, self._axes) + BESIDE * _largest_turned(body.mass, t, np.eye(3))
        self._driven, self._static = (held @ bent).T @ Y, inertia.T @ Y
        seen, is_velocity = problem.rows.C @ V @ bent, problem.rows.velocity_rows
        rests = (problem.rows.Y_C_K - inertia[:, :count] @ seen[:, :count].T for count in COUNTS)
        self._rests = [np.where(is_velocity, np.inf, np.linalg.norm(rest, axis=0)) for rest in rests]
        self._seen = np.abs(seen)
        self._moved, self._pushed, self._w = np.zeros(len(slow)), np.zeros((1, len(slow))), 0.0

    @classmethod
    def of(cls, problem: Problem, free: np.ndarray) -> SlowModes | None:
        """Make it; None where damping is not proportional to stiffness."""
        rayleigh = problem.body.rayleigh
        return None if rayleigh is None or rayleigh[0] else cls(problem, free)

    def cover(self, w: np.ndarray) -> bool:
        """Whether rates w (T, 3) of the frame, in its axes, are about what the joint leaves free."""
        sizes, others = (np.linalg.norm(x, axis=1) for x in (w, w - w @ self._axes @ self._axes.T))
        return bool(np.all(others <= BESIDE * sizes + ROUNDING * self._omega[0])) if self._omega.size else True

    def start(self, z: np.ndarray, w: float) -> None:
        """Begin with the residual z (k,) and a frame that turns at the rate w."""
        self._pushed, self._w = np.abs(self._driven @ z)[None], w

    def advance(
        self,
        motion: tuple[np.ndarray, np.ndarray, np.ndarray],
        impulses: np.ndarray,
        missed: np.ndarray,
        energy: tuple[np.ndarray, np.ndarray],
    ) -> np.ndarray:
        """Return what is left of rows (S, R) at the ends of segments.

        motion : lengths (S,) of segments, z (S, k) and rates w (S,) of the frame at their ends. impulses (S,) :
        integrals of |F|_{M^-1}. missed (S,) : |.|_{K^-1} of what z leaves out of R. energy : the largest in segments,
        |e|_K <= 2 peak, |e'|_M <= peak, and that at their ends (S,), (S,).
        """
        (h, z, w), (peak, g) = motion, energy
        w = np.append(self._w, w)
        pushed = np.vstack([self._pushed, np.abs(rows_times(z, self._driven.T))])
        force = np.maximum(pushed[:-1], pushed[1:]) + np.outer(missed, self._omega)
        force += 2 * peak[:, None] * (self._coupling + np.outer(np.maximum(w[:-1], w[1:]), self._turning))
        moved = self._moved + np.cumsum(h[:, None] * force + impulses[:, None], axis=0)
        self._moved, self._pushed, self._w = moved[-1], pushed[-1:], w[-1]
        each = moved / self._omega + np.abs(rows_times(z, self._static.T))
        left = [
            np.outer(g + missed, rest) + each[:, :count] @ self._seen[:, :count].T
            for count, rest in zip(COUNTS, self._rests, strict=True)
        ]
        return np.minimum(*left)


def _largest_turned(mass: sp.spmatrix, t: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Largest |n~ t_i|_M (m,) of unit vectors n in the span of orthonormal axes (3, r)."""
    turned = [(skew(n) @ t.reshape(-1, 3, t.shape[1])).reshape(t.shape) for n in axes.T]
    if not turned:
        return np.zeros(t.shape[1])
    gram = np.array([[np.sum(x * (mass @ y), axis=0) for x in turned] for y in turned])
    return np.sqrt(np.maximum(np.linalg.eigvalsh(np.moveaxis(gram, 2, 0))[:, -1], 0.0))
