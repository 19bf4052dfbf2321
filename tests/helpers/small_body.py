"""A floating body of few nodes with random shapes, and motions of it, as arrays."""

import numpy as np
import scipy.linalg as la

from exudyn_romerr.mechanism.body import Body, Motion, Place
from exudyn_romerr.mechanism.rotations import exponential, skew

NODES = 5


def on_its_screw(e):
    """Where a frame goes by e (6, ...) = (dr, dphi, ...), by scipy: its turn (3, 3), its shift (3,)."""
    screw = np.zeros((4, 4))
    screw[:3, :3], screw[:3, 3] = skew(e[3:6]), e[:3]
    moved = la.expm(screw)
    return moved[:3, :3], moved[:3, 3]


class SmallBody:
    """positions (NODES, 3), masses (NODES,), shapes (3 NODES, k), stiffness; body : in closed form.

    counts : modes; modes and kept vectors; all shapes, the last of which are oscillators.
    """

    def __init__(self, seed=0, counts=(2, 4, 7), first=0):
        rng, (n, kept, k) = np.random.default_rng(seed), counts
        self.positions, self.masses = rng.uniform(-1, 1, (NODES, 3)), rng.uniform(0.5, 1.5, NODES)
        half = rng.normal(size=(3 * NODES, 3 * NODES))
        self.mass, self.stiffness = np.kron(np.diag(self.masses), np.eye(3)), half @ half.T + 50 * np.eye(3 * NODES)
        self.shapes = rng.normal(size=(3 * NODES, k))
        P = self.shapes[:, kept:]
        if kept < k:
            self.shapes[:, kept:] = P @ la.eigh(P.T @ self.stiffness @ P, P.T @ self.mass @ P)[1]
        self.gravity = np.array([0.0, 1.0, -9.81])
        reference = np.array([0.1, -0.2, 0.3, 1.0, 0, 0, 0])
        self.body = Body(
            Place(0, first + np.arange(7), first + 7 + np.arange(n), reference),
            (self.mass, self.stiffness),
            self.positions,
            self.shapes,
            (n, kept),
            lambda M, K: 0.1 * M + 1e-3 * K,
            lambda t: self.gravity,
        )

    def motion(self, T=3, count=None, seed=1):
        """T random samples of a motion by the first `count` shapes, all modes by default."""
        rng, count = np.random.default_rng(seed), self.body.n if count is None else count
        A = exponential(rng.normal(size=(T, 3)))
        w, alpha, b = rng.normal(size=(3, T, 3))
        c, c1, c2 = rng.normal(size=(3, T, count))
        return Motion(A, w, alpha, b, np.einsum("tji,j->ti", A, self.gravity), c, c1, c2)

    def node_sums(self, m):
        """Residual rows (T, 6 + k) of a motion by sums over the nodes, written out."""
        U, T = self.shapes.reshape(NODES, 3, -1), len(m.c)
        j, S = m.c.shape[1], skew(m.alpha) + skew(m.w) @ skew(m.w)
        y, u1, u2 = (np.einsum("pik,tk->tpi", U[..., :j], x) for x in (m.c, m.c1, m.c2))
        a = np.einsum("tij,tpj->tpi", S, self.positions + y) + 2 * np.cross(m.w[:, None], u1) + u2
        forces = self.masses[:, None] * (a + m.b[:, None])
        weight = self.masses[:, None] * m.g[:, None]
        force = (forces - weight).sum(axis=1)
        moment = np.cross(self.positions + y, forces).sum(axis=1) - np.cross(self.positions, weight).sum(axis=1)
        modal = np.einsum("pik,tpi->tk", U, forces - weight)
        modal += m.c @ self.body.K[:j] + m.c1 @ self.body.D[:j]
        return np.concatenate([force, moment, modal.reshape(T, -1)], axis=1)
