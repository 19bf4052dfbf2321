"""|R|_{K^-1} of one body: residuals of its mesh as a few coordinates, by sums over nodes that are made once."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse.linalg as sla

from ..linalg.blocked_products import row_norms
from ..linalg.orthogonalise import without
from ..mechanism.body import Body, Motion
from ..mechanism.rotations import skew
from ..model.body import ElasticBody
from ..model.floating_frame import unit_products
from .free_mass import FreeInterfaces, FreeMass

RANK = 1e-9  # of a column: what rounding leaves of it on the complement
OSCILLATORS = 12  # the lowest, whose turning terms are columns; the others' are bounded together
LANCZOS = 1e-3  # of an eigenvalue
BELOW = 1.01  # on the largest one, which Lanczos finds from below


class ResidualNorm:
    """Residuals R of a body on U = (modes, vectors) and on the K-orthogonal complement of U, where |y| = |R|_{K^-1}.

    idle : largest share of a load or wrench on the complement, where no motion answers it. held : the full body in
    its frame. rayleigh : its (alpha, beta).
    """

    def __init__(
        self,
        body: Body,
        shapes: np.ndarray,
        held_shapes: np.ndarray,
        held: ElasticBody,
        wrenches: np.ndarray,
        loads: np.ndarray,
    ):
        """Make sums over nodes.

        Parameters
        ----------
        shapes : (N, k), all of the body
        held_shapes : (N, k), the same without rigid motions that the frame's reference conditions do not allow
        held : the full body; wrenches, loads : (n_free, p) columns of forces at interfaces, and of loads
        """
        self.body, self.held, self._shapes, self._positions = body, held, shapes, held.positions
        self.rayleigh = held.rayleigh or (0.0, 0.0)
        self._wrenches, self._own = wrenches, min(body.k, body.na + OSCILLATORS)
        factor = held.stiffness_factor
        self._U = held.space.coordinates("shapes", held_shapes)
        self._Q, self._root = la.qr(factor.half_multiply(self._U), mode="economic")  # K on U = root^T root
        self._back = la.solve_triangular(self._root, np.eye(len(self._root)))
        forces = np.hstack([wrenches, loads])
        self.idle = self._outside(factor.half_solve(forces)) if forces.shape[1] else 0.0
        self._mass = np.linalg.cholesky(body.M[self._own :, self._own :])

    @property
    def size(self) -> int:
        """Number of coordinates y: the last k are on modes and vectors."""
        return self._complement[0].shape[1] + self.body.k

    def _outside(self, half: np.ndarray) -> float:
        size = np.maximum(np.linalg.norm(half, axis=0), np.finfo(float).tiny)
        return float((np.linalg.norm(without(self._Q, half), axis=0) / size).max())

    @cached_property
    def _complement(self) -> tuple[np.ndarray, np.ndarray]:
        """Basis (n_free, r) of what inertia does on the complement, and what each input is there, (inputs, r)."""
        ones = np.tile(np.eye(3), (len(self._positions), 1))
        of_places, of_shapes = self._positions.reshape(-1, 1), self._shapes[:, : self._own]
        of_places, of_shapes = (unit_products(X).toarray() for X in (of_places, of_shapes))
        inputs = np.hstack([ones, of_places, self._shapes, of_shapes])
        half = self.held.stiffness_factor.half_solve(self.held.space.loads(self.held.mass @ inputs))
        size = np.maximum(np.linalg.norm(half, axis=0), np.finfo(float).tiny)
        basis, values, turn = la.svd(without(self._Q, half) / size, full_matrices=False)
        r = int(np.sum(values > RANK))
        return basis[:, :r], (values[:r, None] * turn[:r] * size).T

    @cached_property
    def _slowest(self) -> float:
        """Lowest frequency, rad/s, of motions on the complement."""
        held, energies = self.held, self.held.K @ self._U
        inverse = self._back @ self._back.T

        def left(x: np.ndarray) -> np.ndarray:
            return x - self._U @ (inverse @ (energies.T @ x))

        def right(x: np.ndarray) -> np.ndarray:
            return x - energies @ (inverse @ (self._U.T @ x))

        shape = held.K.shape
        mass = sla.LinearOperator(shape, matvec=lambda x: right(held.M @ left(x.ravel())), dtype=float)
        solve = sla.LinearOperator(shape, matvec=lambda x: held.stiffness_factor.solve(x.ravel()), dtype=float)
        start = left(np.random.default_rng(0).standard_normal(shape[0]))
        found = sla.eigsh(mass, k=1, M=held.K, Minv=solve, v0=start, tol=LANCZOS, return_eigenvectors=False)
        return 1 / np.sqrt(BELOW * found[0]) if found[0] > 0 else np.inf  # modes and vectors are all there is

    def coordinates(self, m: Motion, shift: np.ndarray, on_U: np.ndarray) -> np.ndarray:
        """Return y (T, r + k) of R, but for turning terms of fast oscillators.

        m : motion of all shapes. shift (T, 6) : acceleration of the frame, in its axes, that is taken out of it.
        on_U (T, k) : R on modes and vectors.
        """
        T, own = len(m.c), self._own
        S, W = _turning(m, shift)
        turning = S[..., None] * m.c[:, None, :own] + 2 * W[..., None] * m.c1[:, None, :own]
        rates = m.c2 + self.rayleigh[0] * m.c1
        inputs = np.concatenate([m.b - m.g - shift[:, :3], S, rates, turning.reshape(T, -1)], axis=1)
        return np.concatenate([inputs @ self._complement[1], on_U @ self._back], axis=1)

    def turning_parts(self, m: Motion, shift: np.ndarray) -> list[np.ndarray]:
        """Return S (T, 9), w (T, 3), and fast oscillators' c and c' in the mass norm: what `turning` takes."""
        fast = ((x[:, self._own :] @ self._mass) for x in (m.c, m.c1))
        return [_turning(m, shift)[0], m.w, *fast]

    def turning(self, parts: list[np.ndarray]) -> np.ndarray:
        """Return a bound (T,) of |R|_{K^-1} of turning terms of fast oscillators."""
        S, w, p, v = (row_norms(x) for x in parts)
        return (S * p + 2 * w * v) / self._slowest

    def turning_change(self, parts: list[np.ndarray], before: list[np.ndarray]) -> np.ndarray:
        """Return a bound (T,) of how much they change from those before."""
        S, w, p, v = (row_norms(x + y) / 2 for x, y in zip(parts, before, strict=True))
        dS, dw, dp, dv = (row_norms(x - y) for x, y in zip(parts, before, strict=True))
        return (dS * p + S * dp + 2 * (dw * v + w * dv)) / self._slowest

    def rows(self, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return of rows C (R, n_free) |C|_{K^-1} (R,), and C K^-1 as (r + k, R) to multiply y by."""
        half = self.held.stiffness_factor.half_solve(C.T)
        return np.linalg.norm(half, axis=0), np.vstack([self._complement[0].T @ half, self._Q.T @ half])

    def start(self, m: Motion, shift: np.ndarray) -> tuple[float, float]:
        """Return |a|_M, |a|_K at most of what R on the complement accelerates in one row, whatever joints do."""
        held, (S, W) = self.held, (x.reshape(3, 3) for x in (y[0] for y in _turning(m, shift)))
        u, u1, u2 = ((self._shapes @ q[0]).reshape(-1, 3) for q in (m.c, m.c1, m.c2 + self.rayleigh[0] * m.c1))
        a = m.b[0] - m.g[0] - shift[0, :3] + (self._positions + u) @ S.T + 2 * u1 @ W.T + u2
        R = held.space.loads(held.mass @ a.ravel())
        R = R - held.K @ (self._U @ (self._back @ (self._back.T @ (self._U.T @ R))))
        mass = FreeMass.of(held)
        joints = FreeInterfaces(held, mass, self._wrenches)
        stiff, pushed = joints.split(R)
        return float(mass.norms(R[:, None])[0]), stiff + joints.steepest * pushed


def _turning(m: Motion, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """alpha~ + w~ w~ and w~, (T, 9), of a frame from whose acceleration `shift` is taken."""
    W = skew(m.w)
    S = skew(m.alpha - shift[:, 3:]) + W @ W
    return S.reshape(-1, 9), W.reshape(-1, 9)
