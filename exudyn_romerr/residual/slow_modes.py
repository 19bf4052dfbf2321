"""What the slow modes of a body on a joint may answer to what modes and vectors leave of its error (theory.md 8)."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

from ..linalg.blocked_products import rows_times
from ..linalg.orthogonalise import orthonormal, take_out
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
    shapes : SlowShapes
    free : ndarray, (6, f)
        Motions that the joint leaves to the body, in its axes: combinations of rigid_modes.
    """

    def __init__(self, shapes: SlowShapes, free: np.ndarray):
        f, n = free.shape[1], len(shapes.stiffness)
        admissible = la.block_diag(free, np.eye(n))  # of rigid modes and shapes
        stiffness = la.block_diag(np.zeros((f, f)), shapes.stiffness)
        squares, turn = la.eigh(stiffness, admissible.T @ shapes.mass @ admissible)
        slow = np.flatnonzero(squares > (RIGID * shapes.lowest) ** 2)[: max(COUNTS)]
        self._omega, t, bent = np.sqrt(squares[slow]), admissible @ turn[:, slow], turn[f:, slow]
        coupled = np.linalg.norm(shapes.outside @ t, axis=0)  # |t^T M z| <= coupled |z|_K
        self._coupling = self._omega**2 * (1 + shapes.beta * self._omega) * coupled
        self._axes = la.orth(free[3:])
        self._turning = shapes.largest_turned(t, self._axes) + BESIDE * shapes.largest_turned(t, np.eye(3))
        self._driven, self._static = bent.T @ shapes.driven, t.T @ shapes.static
        seen = shapes.seen @ bent
        rests = (shapes.rows - shapes.inertia @ (t[:, :count] @ seen[:, :count].T) for count in COUNTS)
        self._rests = [np.where(shapes.is_velocity, np.inf, np.linalg.norm(rest, axis=0)) for rest in rests]
        self._seen = np.abs(seen)
        self._moved, self._pushed, self._w = np.zeros(len(slow)), np.zeros((1, len(slow))), 0.0

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


class SlowShapes:
    """What SlowModes needs of the full body, whatever its joint: small arrays, of rigid modes and V side by side.

    Combinations x of these have the stiffness, without the rigid ones, and mass x^T stiffness x, x^T mass x; where
    |.|_{K^-1} is the 2-norm, M x is `inertia` x, `outside` x what is orthogonal to K V of it, and C^T is `rows`, but
    for a turn that these have in common. M x and K V as seen by z are `static` and `driven`, V by C is `seen`.
    """

    def __init__(self, problem: Problem):
        body, factor, Y = problem.body, problem.body.stiffness_factor, problem.dual.Y_K[:, : problem.dual.k]
        self.beta, self.lowest = body.rayleigh[1], body.modes(1).omega[0]
        self.is_velocity, self.seen = problem.rows.velocity_rows, problem.rows.C @ problem.V
        held = factor.half_multiply(problem.V)
        self.stiffness, self.driven = held.T @ held, held.T @ Y
        held = orthonormal(held)
        whole = np.hstack([rigid_modes(body.positions), body.expand(problem.V)])
        of_mass = body.mass @ whole
        self.mass, self._turned = whole.T @ of_mass, _turned_products(body.mass, whole)
        inertia = factor.half_solve(body.space.loads(of_mass))
        del whole, of_mass  # of a large body every one of them counts
        self.static, count = inertia.T @ Y, len(problem.rows.C)
        triangle = la.qr(np.hstack([problem.rows.Y_C_K, inertia]), mode="r", overwrite_a=True)[0]
        triangle = triangle[: triangle.shape[1]]
        self.rows, self.inertia = triangle[:, :count], triangle[:, count:]
        triangle = la.qr(take_out(held, inertia), mode="r", overwrite_a=True)[0]
        self.outside = triangle[: triangle.shape[1]]

    def largest_turned(self, t: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Largest |n~ t_i|_M (m,) of unit vectors n in the span of orthonormal axes (3, r), t (6 + n, m)."""
        if not axes.shape[1]:
            return np.zeros(t.shape[1])
        products = np.einsum("xi,abxy,yi->iab", t, self._turned, t, optimize=True)
        return np.sqrt(np.maximum(np.linalg.eigvalsh(axes.T @ products @ axes)[:, -1], 0.0))


class SlowModesOf:
    """free -> SlowModes of a problem, None where damping is not proportional to stiffness; shapes are made once."""

    def __init__(self, problem: Problem):
        self._problem = problem

    @cached_property
    def shapes(self) -> SlowShapes | None:
        """What they are made of."""
        rayleigh = self._problem.body.rayleigh
        return None if rayleigh is None or rayleigh[0] else SlowShapes(self._problem)

    def __call__(self, free: np.ndarray) -> SlowModes | None:
        """Make those of a joint that leaves the motions free (6, f)."""
        return None if self.shapes is None else SlowModes(self.shapes, free)


def _turned_products(mass: sp.spmatrix, whole: np.ndarray) -> np.ndarray:
    """(a~ X)^T M (b~ X) of axes a, b and X (N, k): (3, 3, k, k)."""

    def turned(axis: np.ndarray) -> np.ndarray:
        return (skew(axis) @ whole.reshape(-1, 3, whole.shape[1])).reshape(whole.shape)

    of_axis = [mass @ turned(b) for b in np.eye(3)]
    return np.array([[turned(a).T @ of_b for of_b in of_axis] for a in np.eye(3)])
