"""The residual's norm by three ways, against exact rational arithmetic; initial errors."""

from fractions import Fraction

import numpy as np
import pytest
import scipy.linalg as la

from exudyn_romerr import Basis, initial_coordinates, initial_error
from exudyn_romerr.linear.residual.problem import BoundOptions, Problem
from exudyn_romerr.linear.residual.residual import RESIDUALS, ResidualMap
from tests.helpers import tolerances as tol
from tests.helpers.bodies import model

SIZES = [10.0**-k for k in range(0, 15, 2)]


def exact_product(A, x):
    """A x of floats without any rounding, rounded once at the end."""
    return np.array(
        [float(sum(Fraction(a) * Fraction(b) for a, b in zip(row, x, strict=True))) for row in A.tolist()]
    )


class NearlyComplete:
    """A complete basis: every residual can be made as small as wanted by choosing the acceleration."""

    def __init__(self, damping, seed=0):
        self.full = full = model("chain", damping, seed)
        rng = np.random.default_rng(seed)
        V, self.B = rng.standard_normal((full.N, full.N)), rng.standard_normal((full.N, 1))
        self.q, self.q_t, self.direction = rng.standard_normal((3, full.N))
        self.u = rng.standard_normal(1)
        self.V = V
        self.problems = {n: Problem(full.body, Basis(V), BoundOptions(inputs=self.B, residual=n)) for n in RESIDUALS}

    def coordinates(self, size):
        """Z with R = size * direction, the direction being as large as M V qr'' at size 1."""
        f, V = self.full, self.V
        rest = f.D @ V @ self.q_t + f.K @ V @ self.q - self.B @ self.u
        q_tt = la.solve(f.M @ V, size * la.norm(rest) / la.norm(self.direction) * self.direction - rest)
        return {name: p.map.coordinates(self.q, self.q_t, q_tt, self.u) for name, p in self.problems.items()}

    def norms(self, name, size):
        """(found, exact, largest term) of |R|_{M^-1}."""
        z, problem = self.coordinates(size)[name], self.problems[name]
        exact = exact_product(problem.map.L, z.tolist())
        columns = np.sqrt(np.einsum("ij,ij->j", problem.map.L, la.solve(self.full.M, problem.map.L)))
        found = float(problem.dual.norm_M(z[None])[0])
        return found, np.sqrt(exact @ la.solve(self.full.M, exact)), columns @ np.abs(z)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("damping", ["none", "under", "gyroscopic"])
def test_orthonormal_residual_reaches_rounding(damping, size):
    """However small R is beside its terms, the orthonormal factor errs by less than 1e-12 of them; so does direct."""
    for name in ("orthonormal", "direct"):
        found, exact, terms = NearlyComplete(damping).norms(name, size)
        assert abs(found - exact) < tol.RESIDUAL * terms


@pytest.mark.parametrize("damping", ["under", "gyroscopic"])
def test_ten_term_residual_stalls(damping):
    """Small residuals: the expanded form errs by 1e-10 to 1e-7 of its terms, or its square is negative (inf)."""
    case = [NearlyComplete(damping, seed).norms("expanded", 1e-14) for seed in range(30)]
    finite = [abs(found - exact) / terms for found, exact, terms in case if np.isfinite(found)]
    assert any(np.isinf(found) for found, _, _ in case)
    assert 1e-10 < np.median(finite) < 1e-7
    assert all(found > 0 for found, _, _ in case)  # never clipped to zero


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("damping", ["none", "under", "overdamped", "matrix", "gyroscopic"])
def test_three_ways_agree_on_moderate_residuals(damping, seed):
    """Random states: R is as large as its terms, and |M V qr'' + D V qr' + K V qr - B u|_{M^-1} by hand is met."""
    full = model("pencil", damping, seed)
    rng = np.random.default_rng(seed)
    V, B = rng.standard_normal((full.N, 3)), rng.standard_normal((full.N, 2))
    q, q_t, q_tt, u = (rng.standard_normal((7, k)) for k in (3, 3, 3, 2))
    R = full.M @ V @ q_tt.T + full.D @ V @ q_t.T + full.K @ V @ q.T - B @ u.T
    wanted = np.sqrt(np.einsum("ij,ij->j", R, la.solve(full.M, R)))
    for name in RESIDUALS:
        problem = Problem(full.body, Basis(V), BoundOptions(inputs=B, residual=name))
        assert problem.dual.norm_M(problem.map.coordinates(q, q_t, q_tt, u)) == pytest.approx(
            wanted, rel=tol.CANCELLED
        )


def test_rayleigh_damping_is_merged():
    """Rayleigh: k = 2 n + p columns; a general matrix: 3 n + p; undamped and expanded: 2 n + p."""
    V, B = np.random.default_rng(0).standard_normal((10, 5))[:, :3], np.ones((10, 2))
    columns = {d: ResidualMap(model("chain", d, 0).body, V, B).coordinates.k for d in ("none", "under", "matrix")}
    assert columns == {"none": 8, "under": 8, "matrix": 11}
    assert ResidualMap(model("chain", "under", 0).body, V, B, merged=False).coordinates.k == 11


@pytest.mark.parametrize("petrov", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_initial_error(seed, petrov):
    """(31)-(32): e0 = (I - V (W^T V)^-1 W^T) q0, e0' = (I - V Mr^-1 W^T M) q0'; zero in the span of V."""
    full = model("chain", "under", seed)
    rng = np.random.default_rng(seed)
    V, W, states = (
        rng.standard_normal((full.N, 3)),
        rng.standard_normal((full.N, 3)),
        rng.standard_normal((2, full.N)),
    )
    basis = Basis(V, W if petrov else None)
    W = basis.W
    eye = np.eye(full.N)
    P0, P1 = eye - V @ la.inv(W.T @ V) @ W.T, eye - V @ la.inv(W.T @ full.M @ V) @ W.T @ full.M
    for found, P, x in zip(initial_error(full.body, basis, *states), (P0, P1), states, strict=True):
        assert np.max(np.abs(found - P @ x)) < tol.PROJECTED * max(la.norm(P), 1)
    qr = rng.standard_normal((2, 3))
    assert initial_coordinates(full.body, basis, *(V @ qr.T).T) == pytest.approx(qr, rel=0, abs=tol.PROJECTED * 1e2)
