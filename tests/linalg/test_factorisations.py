"""Two factorisations of one matrix: what each says alone, and that bounds do not depend on which one it was."""

import importlib.util

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

import exudyn_romerr as romerr
from exudyn_romerr.linalg import symmetric_factor
from exudyn_romerr.linalg.eigenmodes import count_below
from exudyn_romerr.linalg.pardiso import SplitMatrix
from exudyn_romerr.linalg.symmetric_factor import SINGULAR_PIVOT, SymmetricFactor, negative_eigenvalues
from exudyn_romerr.model import body
from models.hex_bar import hex_bar
from tests.helpers import tolerances

INSTALLED = {"superlu": True, "pardiso": importlib.util.find_spec("pymklpardiso") is not None}
KINDS = [
    pytest.param(kind, marks=pytest.mark.skipif(not there, reason=f"{kind}: pip install .[large]"))
    for kind, there in INSTALLED.items()
]
RNG = np.random.default_rng(22)


@pytest.fixture(params=KINDS)
def kind(request, monkeypatch):
    """Let one of them factorise matrices of any size."""
    monkeypatch.setattr(symmetric_factor, "solver", lambda n: request.param)
    return request.param


def bar(free=False):
    """M and K of a bar of 30 crooked elements, clamped at one end; 360 coordinates."""
    fem = hex_bar(30, shifts=1e-3 * np.random.default_rng(0).standard_normal((31, 3)))
    kept = np.arange(0 if free else 12, fem.massMatrix.shape[0])
    return tuple(A[kept][:, kept].tocsc() for A in (fem.massMatrix, fem.stiffnessMatrix))


def test_norms_and_solves_of_a_definite_matrix(kind):
    """|half_solve| = |.|_{K^-1}, |half_multiply| = |.|_K, both in the same coordinates."""
    _, K = bar()
    factor, dense = SymmetricFactor(K), K.toarray()
    forces, motions = RNG.standard_normal((2, K.shape[0], 3))
    solved = factor.solve(forces)
    assert factor.definite
    np.testing.assert_allclose(solved, la.solve(dense, forces, assume_a="pos"), rtol=0, atol=1e-9 * abs(solved).max())
    np.testing.assert_array_equal(factor.solve(forces[:, 0]), factor.solve(forces[:, :1])[:, 0])
    energy, halves = forces.T @ solved, factor.half_solve(forces)
    np.testing.assert_allclose(halves.T @ halves, energy, rtol=0, atol=tolerances.ROOT * abs(energy).max())
    moved = factor.half_multiply(motions)
    np.testing.assert_allclose(np.sum(moved**2, axis=0), np.sum(motions * (K @ motions), axis=0), rtol=1e-12)
    np.testing.assert_allclose(halves.T @ moved, forces.T @ motions, rtol=0, atol=1e-9 * abs(energy).max() ** 0.5)


def test_inertia_next_to_eigenvalues(kind):
    """Counts are right 1e-9 beside an eigenvalue, where proofs that no mode is missed stand, and in clusters."""
    M, K = bar()
    squares = la.eigh(K.toarray(), M.toarray(), eigvals_only=True)
    for i in np.linspace(1, len(squares) - 1, 25).astype(int):
        for shift in squares[i] * (1 + np.array([-1e-3, -2e-9, 2e-9])):
            assert count_below(M, K, np.sqrt(shift)) == np.sum(squares < shift)
    twice = sp.block_diag([K, K]), sp.block_diag([M, M])
    assert negative_eigenvalues(twice[0] - 0.5 * (squares[4] + squares[5]) * twice[1]) == 10


def test_matrices_that_are_not_definite(kind):
    """A free body, one with a free part, one that is indefinite; a slender beam is definite all the same."""
    M, free = bar(free=True)
    _, K = bar()
    part = sp.block_diag([K, free, K])
    for singular in (free, part, K - sp.diags(np.where(np.arange(K.shape[0]) == 5, 1e12, 0.0))):
        assert SymmetricFactor(singular).smallest_pivot <= SINGULAR_PIVOT
    slender = sp.diags([np.full(2999, -1.0), np.full(3000, 2.0), np.full(2999, -1.0)], [-1, 0, 1])
    beam = sp.csc_matrix(slender @ slender)  # condition 1e13
    assert SymmetricFactor(beam).smallest_pivot > SINGULAR_PIVOT
    assert negative_eigenvalues(M) == 0


def test_bounds_do_not_depend_on_it(monkeypatch):
    """One part in 1e9 of the largest, what the issue asks for."""
    t, found = np.linspace(0, 0.02, 201), {}
    M, K = bar()
    B = np.zeros((M.shape[0], 1))
    B[-1] = 1.0
    for kind in (kind for kind, there in INSTALLED.items() if there):
        monkeypatch.setattr(symmetric_factor, "solver", lambda n, kind=kind: kind)
        body = romerr.ElasticBody(M, K, rayleigh=(1.0, 1e-6))
        out = romerr.Output("tip", B[:, 0])
        basis = romerr.krylov_basis(body, B, 6)
        q = np.sin(300 * t)[:, None] * np.array([1, -0.3, 0.1, 0.02, 0.01, 0.005])
        trajectory = romerr.Trajectory(t, q, np.gradient(q, t, axis=0), -(300**2) * q, np.zeros((len(t), 1)))
        report = romerr.evaluate(body, basis, trajectory, inputs=B, outputs=[out], estimators=("energy", "auxiliary"))
        found[kind] = np.hstack([report.output("tip").bound[e] for e in ("energy", "auxiliary")])
    for values in found.values():
        assert np.all(np.abs(values - found["superlu"]) <= 1e-9 * found["superlu"].max(axis=0))


def test_large_bodies_factorise_the_mass_again(monkeypatch):
    """Between the check and the norms its factor does not stay in memory; norms are the same."""
    (M, K), rows = bar(), np.eye(1, bar()[0].shape[0])
    output, found = romerr.Output("tip", rows), []
    for many in (body.MANY, 10):
        monkeypatch.setattr(body, "MANY", many)
        made = romerr.ElasticBody(M, K)
        assert ("mass_factor" in vars(made)) == (many == symmetric_factor.MANY)
        found.append(output.constant(made))
    np.testing.assert_array_equal(*found)


def test_split_product_has_the_digits_that_cancel():
    """K x of a nearly rigid motion, against integers in which nothing is rounded."""
    n, unit = 40, 2.0**-30
    K = sp.diags([np.full(n - 1, -0.5), np.full(n, 1.0), np.full(n - 1, -0.5)], [-1, 0, 1], format="csr")
    K.data = K.data + unit * np.round(2**8 * np.sin(np.arange(K.nnz)))
    numbers = 3 * 2**44 + np.round(1e3 * np.cos(np.arange(n))).astype(int)
    exact = (K.toarray() / unit).astype(int).astype(object) @ numbers.astype(object)
    x = numbers.astype(float)[:, None]
    found = SplitMatrix(K).times(x)[:, 0] / unit
    np.testing.assert_array_equal(found, exact.astype(float))


def test_a_long_wait_is_announced(monkeypatch):
    """Where nothing better is installed, before it begins, with what to install; not of small bodies."""
    monkeypatch.setattr(symmetric_factor, "find_spec", lambda name: None)
    monkeypatch.setattr(symmetric_factor, "MANY", 300)
    monkeypatch.setattr(symmetric_factor.sys, "platform", "linux")
    monkeypatch.setattr(symmetric_factor.platform, "machine", lambda: "x86_64")
    with pytest.warns(UserWarning, match=r"360 coordinates .* by SuperLU, .* `pip install py-mkl-pardiso`"):
        romerr.ElasticBody(*bar())
    monkeypatch.setattr(symmetric_factor.sys, "platform", "darwin")
    assert symmetric_factor.faster_solver(360) is None
    monkeypatch.setattr(symmetric_factor.sys, "platform", "linux")
    assert symmetric_factor.faster_solver(299) is None
    monkeypatch.setattr(symmetric_factor, "find_spec", lambda name: name)
    monkeypatch.setattr(symmetric_factor, "FEW", 300)
    assert symmetric_factor.faster_solver(360) is None


@pytest.mark.parametrize("dtype", [float, complex])
def test_solves_with_any_matrix(kind, dtype):
    """Without symmetry, as with gyroscopic damping; one column and many."""
    M, K = bar()
    skew = sp.random(*K.shape, 1e-3, random_state=3, data_rvs=RNG.standard_normal) * 1e-2 * K.max()
    A = sp.csc_matrix(K + skew - skew.T - 0.3 * K[0, 0] / M[0, 0] * M, dtype=dtype)
    A = A + (2j * M if dtype is complex else 0 * M)
    right = RNG.standard_normal((A.shape[0], 3)).astype(dtype)
    expected = la.solve(A.toarray(), right)
    solve, accuracy = symmetric_factor.solve_with(A), 1e-16 * np.linalg.cond(A.toarray()) * 10
    for columns in (slice(0, 3), 0):
        found = solve(right[:, columns])
        np.testing.assert_allclose(found, expected[:, columns], rtol=0, atol=accuracy * abs(expected).max())
