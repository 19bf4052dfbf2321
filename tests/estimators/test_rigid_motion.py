"""Rigid coordinates of a mechanism under deformations of bounded energy: small systems, solved exactly.

In coordinates of their own the systems have constant matrices and are solved by matrix exponentials; they are bounded
in coordinates that turn and stretch with time, so that all matrices vary.
"""

import numpy as np
import pytest
from scipy.linalg import expm, null_space

from exudyn_romerr.estimators.rigid_motion import Equations, Instant, RigidMotion

RIGID, ELASTIC, CONSTRAINTS = 5, 6, 2
END, NODES, FINER = 1.5, 30, 20  # s; where matrices are given; steps of the truth between these
DIFFERENCE = 1e-3  # s; of analytic functions with rates of about 1: central differences are exact to 1e-6


class System:
    """M e'' + D e' + K e + G^T l = -R, C e = 0; rigid coordinates f = T(t) f~, T = exp(t rate)."""

    def __init__(self, seed, turning=1.0):
        random = np.random.default_rng(seed)
        k = RIGID + ELASTIC
        root = random.normal(size=(k, k)) / np.sqrt(k)
        self.M = root @ root.T + 0.3 * np.eye(k)
        carried, gyro = random.normal(size=(2, k, k)) * turning
        stiff = random.normal(size=(ELASTIC, ELASTIC))
        self.K_u = 200.0 * (stiff @ stiff.T / ELASTIC + np.eye(ELASTIC))
        self.K, self.D = carried, 0.5 * (gyro - gyro.T)
        self.K[RIGID:, RIGID:] += self.K_u
        self.C = random.normal(size=(CONSTRAINTS, k))
        self.G = self.C + 0.1 * random.normal(size=(CONSTRAINTS, k))
        self.rate = random.normal(size=(RIGID, RIGID)) * 0.7
        self.load = random.normal(size=(2, ELASTIC))
        self.omega = random.uniform(2.0, 20.0)

    def moved(self, t):
        """The matrices in the coordinates that move."""
        k = len(self.M)
        S, S_t, S_tt = np.eye(k), np.zeros((k, k)), np.zeros((k, k))
        S[:RIGID, :RIGID] = T = expm(t * self.rate)
        S_t[:RIGID, :RIGID], S_tt[:RIGID, :RIGID] = self.rate @ T, self.rate @ self.rate @ T
        M, D = S.T @ self.M @ S, S.T @ (2 * self.M @ S_t + self.D @ S)
        K = S.T @ (self.M @ S_tt + self.D @ S_t + self.K @ S)
        return M[:RIGID], D[:RIGID], K[:RIGID], self.G @ S, self.C @ S

    def equations(self, t):
        before, at, after = (self.moved(t + dt) for dt in (-DIFFERENCE, 0.0, DIFFERENCE))
        rows = zip(before, at, after, strict=True)
        return Equations(
            *(np.array([y, (z - x) / (2 * DIFFERENCE), (x - 2 * y + z) / DIFFERENCE**2]) for x, y, z in rows)
        )

    def solved(self, struck=None):
        """Rigid coordinates that move (S, r) and |u|_K (S,), from rest, under R or a force on rigid coordinates."""
        N, free = null_space(self.C), null_space(self.G)
        M, D, K = (free.T @ A @ N for A in (self.M, self.D, self.K))
        n = len(M)
        loads = np.zeros((2, len(self.M)))
        loads[:, RIGID:] = -self.load if struck is None else 0.0
        loads[0, :RIGID] = 0.0 if struck is None else struck
        turning = self.omega * np.array([[0.0, 1.0], [-1.0, 0.0]])  # of sin, cos
        A = np.zeros((2 * n + 2, 2 * n + 2))
        A[:n, n : 2 * n] = np.eye(n)
        A[n : 2 * n] = np.linalg.solve(M, np.hstack([-K, -D, free.T @ loads.T]))
        A[2 * n :, 2 * n :] = turning
        step, x = expm(A * END / (NODES * FINER)), np.append(np.zeros(2 * n + 1), 1.0)
        x[2 * n :] = [0.0, 1.0] if struck is None else [1.0, 0.0]
        states = [x]
        for _ in range(NODES * FINER):
            states.append(step @ states[-1])
        e = np.array(states)[:, :n] @ N.T
        t = np.linspace(0.0, END, NODES * FINER + 1)
        f = np.array([expm(-s * self.rate) @ x for s, x in zip(t, e[:, :RIGID], strict=True)])
        return f, e[:, RIGID:], np.sqrt(np.einsum("si,ij,sj->s", e[:, RIGID:], self.K_u, e[:, RIGID:]))


def bounded(system, g, impulses, u):
    """The error of rigid coordinates beside H u at the nodes, as bounded (NODES, r), and H u."""
    t = np.linspace(0.0, END, NODES + 1)
    motion = RigidMotion(np.arange(RIGID), np.arange(RIGID, RIGID + ELASTIC), np.linalg.inv(system.K_u))
    at = system.equations(t[0])
    motion.start(at, g[0], rests=False)
    sizes, followed = [], []
    for i in range(NODES):
        ends = None if i else at, system.equations(t[i + 1])
        assert motion.advance(t[i + 1] - t[i], ends, g[i + 1], impulses[i])
        sizes.append(motion.sizes(np.eye(RIGID)))
        followed.append(motion.follows @ u[i + 1])
    return np.array(sizes), np.array(followed)


@pytest.mark.parametrize("seed", range(6))
def test_equations_of_freedoms_are_exact(seed):
    """Integrated with the deformations as they are, they give what rigid coordinates do."""
    system, rigid, elastic = System(seed), np.arange(RIGID), np.arange(RIGID, RIGID + ELASTIC)
    f, u, _ = system.solved()
    Z0, Y0 = (null_space(x[:, :RIGID]) for x in (system.C, system.G))
    x, h = np.zeros(2 * Z0.shape[1]), END / (NODES * FINER)
    instants = [Instant(system.equations(i * h), rigid, elastic) for i in range(121)]
    rates = [at.system(Z0, Y0)[:2] for at in instants]
    for i in range(0, 120, 2):  # Runge and Kutta's method, of order four
        k = 0.0
        slopes = []
        for j, share in ((0, 0.0), (1, h), (1, h), (2, 2 * h)):
            A, B = rates[i + j]
            k = A @ (x + share * k) + B @ u[i + j]
            slopes.append(k)
        x = x + h / 3 * (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3])
    last = instants[120]
    found = last.of_C.free @ Z0 @ x[: Z0.shape[1]] + last.follows(Z0, Y0) @ u[120]
    # differences with 1e-3 s are exact to 1e-6 of them
    np.testing.assert_allclose(found, f[120], rtol=0, atol=1e-5 * np.abs(f[120]).max())


@pytest.mark.parametrize("seed", range(12))
def test_freedoms_are_bounded_by_the_energy_of_deformations(seed):
    system = System(seed)
    f, u, size = system.solved()
    at = slice(0, None, FINER)
    g = np.maximum.accumulate(size)[at] / 2  # |u|_K <= 2 g
    bound, followed = bounded(system, g, np.zeros(NODES), u[at])
    error = np.abs(f[at][1:] - followed)
    assert (error <= bound).all()
    assert (error / bound).max() > 0.1  # measured: 0.18 to 0.73


@pytest.mark.parametrize("seed", range(6))
def test_freedoms_are_bounded_under_unbalanced_forces(seed):
    system = System(seed)
    force = np.random.default_rng(100 + seed).normal(size=RIGID)
    f, u, size = system.solved(force)
    at = slice(0, None, FINER)
    weighs = np.sqrt(force @ np.linalg.inv(system.M)[:RIGID, :RIGID] @ force)  # |F|_{M^-1}
    g, impulses = np.maximum.accumulate(size)[at] / 2, np.full(NODES, weighs * END / NODES)
    bound, followed = bounded(system, g, impulses, u[at])
    error = np.abs(f[at][1:] - followed)
    assert (error <= bound).all()
    assert (error / bound).max() > 0.02
