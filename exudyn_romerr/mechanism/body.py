"""A floating body in closed form: residual and tangent of its inertia, weight and elasticity on modes and vectors.

Exact for ObjectFFRFreducedOrder. With nodes x, shapes U, y = x + U c, u1 = U c', u2 = U c'', b = A^T r'', all in axes
of the body, a node has the acceleration a = b + S y + 2 w~ u1 + u2, S = alpha~ + w~ w~. Rows: force, moment about the
frame's origin, modal forces. Columns of tangents: (A^T dr, A^T dphi, dc), dphi a small rotation in global axes. Sums
made once stand for the nodes: nothing here has their number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..compiled.loops import loops
from .rotations import (
    CYCLE,
    along_screw,
    body_rates,
    cross,
    exponential,
    rotation_matrix,
    skew,
    times,
    times_transposed,
)
from .rows import Rows, Samples

UNIT_TURNS = skew(np.eye(3))


@dataclass(frozen=True)
class Motion(Samples):
    """Samples of a body: A (T, 3, 3), w, alpha, b, g (T, 3) in its axes, c, c1, c2 (T, j) of its first j shapes.

    b : A^T r''. g : A^T times gravity, which is no part of b: Exudyn turns a body by its undeformed mass centre.
    """

    A: np.ndarray
    w: np.ndarray
    alpha: np.ndarray
    b: np.ndarray
    g: np.ndarray
    c: np.ndarray
    c1: np.ndarray
    c2: np.ndarray

    def moved(self, e: np.ndarray, e1: np.ndarray, e2: np.ndarray) -> Motion:
        """Return the motion moved by e, e', e'' (T, 6 + k) of the unknowns.

        A frame moves along the screw of its dr and dphi: what turns about a fixed point stays at its distance.
        """
        if loops is None:
            return self._moved(e, e1, e2)
        (T, j), k = self.c.shape, e.shape[1] - 6
        moved = [np.empty((T, *shape)) for shape in ((3, 3), *[(3,)] * 4, *[(k,)] * 3)]
        loops.moved_motion(T, j, k, *_whole(*vars(self).values(), e, e1, e2), *moved)
        return Motion(*moved)

    def _moved(self, *e: np.ndarray) -> Motion:
        """Where no loops are compiled."""
        shift, phi = ([times_transposed(self.A, x[:, part]) for x in e] for part in (slice(0, 3), slice(3, 6)))
        *_, bent = along_screw(phi, shift)
        turned, turned_rate = along_screw([-x for x in phi], phi[1:])
        k, E = e[0].shape[1] - 6, exponential(phi[0])
        b, g = times_transposed(E, self.b + bent), times_transposed(E, self.g)
        alpha = self.alpha + turned_rate - cross(self.w, turned)
        shapes = (padded(own, k) + x[:, 6:] for own, x in zip((self.c, self.c1, self.c2), e, strict=True))
        return Motion(self.A @ E, self.w + turned, alpha, b, g, *shapes)


def _whole(*arrays: np.ndarray) -> list[np.ndarray]:
    """Return arrays as compiled loops take them."""
    return [np.ascontiguousarray(x, dtype=float) for x in arrays]


def padded(x: np.ndarray, k: int) -> np.ndarray:
    """Return x (T, j) with zeros behind, (T, k)."""
    return np.concatenate([x, np.zeros((len(x), k - x.shape[1]))], axis=1)


@dataclass
class Coupling(Samples):
    """What couples a body's s unknowns to its m oscillators.

    M, D, K (T, s, m) : rows of unknowns. D_back, K_back (T, s, m) : transposes of what oscillators' rows have of
    unknowns; their M is that of the columns.
    """

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    D_back: np.ndarray
    K_back: np.ndarray


@dataclass(frozen=True)
class Place:
    """Where a body's coordinates are among those of the mbs: frame (7,), modal (n,).

    reference (7,) : of its frame's node. number : of its object.
    """

    number: int
    frame: np.ndarray
    modal: np.ndarray
    reference: np.ndarray


class Body:
    """Sums over the nodes of a floating body; its shapes are n modes, vectors that are kept, oscillators.

    Attributes
    ----------
    n, na, k, m : modes; modes and kept vectors; all shapes; oscillators.
    M, D, K (k, k) : of shapes. mass, X (3,), XX (3, 3) : sums of 1, x, x x^T. Ux (3, k) : of U. xU (3, 3, k) : of
    x_i U_j. H (k, 9 k), G (9, k, k) : of U_i^lam U_j^k, by lam and by (i, j). springs, dampers (m,) : of oscillators.
    gravity : m/s^2 of time, (3,). size : m, of the body. largest (k,) : m, of a node by each shape.
    """

    def __init__(
        self,
        place: Place,
        matrices: tuple,
        positions: np.ndarray,
        shapes: np.ndarray,
        counts: tuple[int, int],
        damping: Callable[[np.ndarray, np.ndarray], np.ndarray],
        gravity: Callable[[float], np.ndarray],
    ):
        """Sum over nodes.

        Parameters
        ----------
        matrices : mass, stiffness (N, N), sparse
        positions : (N / 3, 3)
        shapes : (N, k)
        counts : n, na
        damping : D (k, k) of M and K (k, k) of shapes
        """
        mass, stiffness = matrices
        self.place, (self.n, self.na) = place, counts
        self.k = shapes.shape[1]
        self.m = self.k - self.na
        self.gravity, self.size = gravity, float(np.ptp(positions, axis=0).max())
        self.largest = np.abs(shapes).max(axis=0)
        weighted = np.ascontiguousarray(mass @ shapes)
        of, by_mass = ([U[i::3] for i in range(3)] for U in (shapes, weighted))
        G = np.array([[of[i].T @ by_mass[j] for j in range(3)] for i in range(3)])
        self.M, self.K = np.einsum("iikl->kl", G), shapes.T @ (stiffness @ shapes)
        self.D = np.ascontiguousarray(damping(self.M, self.K))
        Mx = (mass @ positions.ravel()).reshape(-1, 3)
        self.mass = float((mass @ np.tile([1.0, 0.0, 0.0], len(positions))).sum())
        self.X, self.XX = Mx.sum(0), positions.T @ Mx
        self.Ux = np.array([by_mass[j].sum(0) for j in range(3)])
        self.xU = np.stack([positions.T @ by_mass[j] for j in range(3)], axis=1)
        self.H = np.ascontiguousarray(G.transpose(2, 0, 1, 3).reshape(self.k, -1))
        self.G = np.ascontiguousarray(G.reshape(9, self.k, self.k))
        self._twists = np.array([G[i, j] - G[j, i] for i, j in CYCLE])
        self._G_back = np.ascontiguousarray(self.G[:, self.na :, : self.na].swapaxes(1, 2))
        self.springs, self.dampers = np.diag(self.K)[self.na :].copy(), np.diag(self.D)[self.na :].copy()

    def motion(self, rows: Rows) -> Motion:
        """Return samples of rows in coordinates of the mbs."""
        f, r = self.place.frame, self.place.modal
        p = self.place.reference[3:] + rows.q[:, f[3:]]
        A, B = rotation_matrix(p), body_rates(p)
        w, alpha = times(B, rows.v[:, f[3:]]), times(B, rows.a[:, f[3:]])
        g = np.array([self.gravity(t) for t in rows.t]).reshape(-1, 3)
        b, g = times_transposed(A, rows.a[:, f[:3]]), times_transposed(A, g)
        return Motion(A, w, alpha, b, g, rows.q[:, r], rows.v[:, r], rows.a[:, r])

    def _sums(self, m: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sums of y_i U_j, u1_i U_j (T, 3, 3, k), and of y_i y_j (T, 3, 3)."""
        j, T = m.c.shape[1], len(m.c)
        YU = self.xU + (m.c @ self.H[:j]).reshape(T, 3, 3, self.k)
        U1 = (m.c1 @ self.H[:j]).reshape(T, 3, 3, self.k)
        yc = (YU[..., :j] @ m.c[:, None, :, None])[..., 0]
        xc = (m.c @ self.xU[..., :j].reshape(9, j).T).reshape(T, 3, 3)
        return YU, U1, self.XX + yc + xc.swapaxes(1, 2)

    def residual(self, m: Motion) -> np.ndarray:
        """Return force, moment, modal rows (T, 6 + k) of inertia and elasticity less weight, in axes of the body."""
        if loops is None:
            return self._residual(m)
        (T, j), rows = m.c.shape, np.empty((len(m.c), 6 + self.k))
        loops.body_residual(T, j, self.k, self.mass, *self._given(m), rows)
        return rows

    def _given(self, m: Motion) -> list[np.ndarray]:
        """Return arrays that compiled loops take."""
        motion = _whole(m.w, m.alpha, m.b, m.g, m.c, m.c1, m.c2)
        return [*motion, self.X, self.XX, self.Ux, self.xU, self.G, self._twists, self.M, self.D, self.K]

    def _residual(self, m: Motion) -> np.ndarray:
        """Where no loops are compiled."""
        j, T = m.c.shape[1], len(m.c)
        W, (YU, U1, YY) = 2 * skew(m.w), self._sums(m)
        S = skew(m.alpha) + W @ W / 4
        Y = self.X + m.c @ self.Ux[:, :j].T
        force = self.mass * (m.b - m.g) + times(S, Y)
        force += times(W, m.c1 @ self.Ux[:, :j].T) + m.c2 @ self.Ux[:, :j].T
        Yu1, Yu2 = ((YU[..., :j] @ x[:, None, :, None])[..., 0] for x in (m.c1, m.c2))
        arms = YY @ S.swapaxes(1, 2) + Yu1 @ W.swapaxes(1, 2) + Yu2
        moment = cross(Y, m.b) - cross(self.X, m.g) + crossed(arms)
        modal = (m.b - m.g) @ self.Ux + m.c2 @ self.M[:j] + m.c1 @ self.D[:j] + m.c @ self.K[:j]
        for turn, of in ((S, YU), (W, U1)):
            modal += (turn.swapaxes(1, 2).reshape(T, 1, 9) @ of.reshape(T, 9, self.k))[:, 0]
        return np.concatenate([force, moment, modal], axis=1)

    def tangent(self, m: Motion) -> tuple[list[np.ndarray], Coupling]:
        """Return M, D, K (T, s, s) of the residual at samples of a motion by modes, s = 6 + na, and the coupling.

        Does not cover: oscillators with oscillators, of which springs and dampers are kept.
        """
        if loops is None:
            return self._tangent(m)
        (T, j), s = m.c.shape, 6 + self.na
        own, coupled = ([np.empty((T, s, n)) for _ in range(count)] for n, count in ((s, 3), (self.m, 5)))
        loops.body_tangent(T, j, self.na, self.k, self.mass, *self._given(m), self._G_back, *own, *coupled)
        return own, Coupling(*coupled)

    def _tangent(self, m: Motion) -> tuple[list[np.ndarray], Coupling]:
        """Where no loops are compiled."""
        j, T, k, na, s = m.c.shape[1], len(m.c), self.k, self.na, 6 + self.na
        W, (YU, U1, YY) = skew(m.w), self._sums(m)
        S, b, g = skew(m.alpha) + W @ W, skew(m.b), skew(m.g)
        U2 = (m.c2 @ self.H[:j]).reshape(T, 3, 3, k)
        Y, u1 = self.X + m.c @ self.Ux[:, :j].T, m.c1 @ self.Ux[:, :j].T
        y, J = skew(Y), np.trace(YY, axis1=1, axis2=2)[:, None, None] * np.eye(3) - YY
        M, D, K = (np.zeros((T, s, 6 + k)) for _ in range(3))
        M[:, [0, 1, 2], [0, 1, 2]] = self.mass
        M[:, :3, 3:6], M[:, 3:6, :3], M[:, 3:6, 3:6] = -y, y, J
        D[:, :3, 3:6] = y @ W - W @ y - skew(times(W, Y) + 2 * u1)
        D[:, 3:6, 3:6] = _spin(YY, (YU[..., :j] @ m.c1[:, None, :, None])[..., 0], W) - J @ W
        K[:, :3, 3:6] = self.mass * (b - g)
        K[:, 3:6, 3:6] = y @ b - skew(self.X) @ g
        M[:, :3, 6:], D[:, :3, 6:], K[:, :3, 6:] = self.Ux, 2 * W @ self.Ux, S @ self.Ux
        M[:, 3:6, 6:] = crossed(YU)
        D[:, 3:6, 6:] = 2 * crossed(_on_second(W, YU))
        a = self.Ux[None, :, None] * m.b[:, None, :, None]  # sum of U_i a_j without U_i (S y + 2 W u1 + u2)_j
        rest = _on_second(S, YU.swapaxes(1, 2)) + 2 * _on_second(W, U1.swapaxes(1, 2)) + U2.swapaxes(1, 2)
        K[:, 3:6, 6:] = crossed(_on_second(S, YU) + a + rest)
        D_r = crossed(_on_second(W.swapaxes(1, 2), YU)) - crossed(_on_second(W, YU.swapaxes(1, 2)))
        D_r += 2 * crossed(U1) + W @ M[:, 3:6, 6:]  # of modal rows, columns of rotations: (T, 3, k)
        K_r = (b - g).swapaxes(1, 2) @ self.Ux
        turn = (2 * W.reshape(T, 9) @ self.G[:, :na].reshape(9, -1)).reshape(T, na, k)
        both = np.concatenate([self.G[:, :na], self.G[:, :, :na].swapaxes(1, 2)], 1)
        lift = (S.reshape(T, 9) @ both.reshape(9, -1)).reshape(T, 2, na, k)
        M[:, 6:, :6], M[:, 6:, 6:] = M[:, :6, 6:s].swapaxes(1, 2), self.M[:na]
        D[:, 6:, 3:6], D[:, 6:, 6:] = D_r[..., :na].swapaxes(1, 2), self.D[:na] + turn
        K[:, 6:, 3:6], K[:, 6:, 6:] = K_r[..., :na].swapaxes(1, 2), self.K[:na] + lift[:, 0]
        D_back, K_back = np.zeros((T, s, self.m)), np.zeros((T, s, self.m))
        D_back[:, 3:6], K_back[:, 3:6] = D_r[..., na:], K_r[..., na:]
        D_back[:, 6:] = self.D[:na, na:] - turn[..., na:]
        K_back[:, 6:] = self.K[:na, na:] + lift[:, 1, :, na:]
        return [x[..., :s] for x in (M, D, K)], Coupling(*(x[..., s:] for x in (M, D, K)), D_back, K_back)


def _spin(YY: np.ndarray, Yu1: np.ndarray, W: np.ndarray) -> np.ndarray:
    """Moments of v x (w x y) + w x (v x y) + 2 v x u1 for unit v, (T, 3, 3)."""
    columns = [crossed(YY @ (V @ W + W @ V).swapaxes(1, 2) + 2 * Yu1 @ V.T) for V in UNIT_TURNS]
    return np.stack(columns, axis=2)


def crossed(z: np.ndarray) -> np.ndarray:
    """Return the sum of y x z (T, 3, ...) of sums y_i z_j (T, 3, 3, ...)."""
    found = np.empty((len(z), *z.shape[2:]))
    for r, (i, j) in enumerate(CYCLE):
        found[:, r] = z[:, i, j] - z[:, j, i]
    return found


def _on_second(L: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Sums y_i (L z)_j of L (T, 3, 3) and sums y_i z_j (T, 3, 3, k)."""
    return L[:, None] @ z
