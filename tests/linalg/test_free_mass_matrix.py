"""Bodies M-orthogonal to rigid motions: sparse solves and products against the full matrices of all conditions."""

import tracemalloc
from functools import cache

import numpy as np
import pytest
import scipy.linalg as la

import exudyn_romerr as romerr
from exudyn_romerr.errors import AssumptionError
from exudyn_romerr.linalg.eigenmodes import count_below
from exudyn_romerr.model.admissible_space import Space, mass_orthogonal
from models.hex_block import hex_block

SAME = 1e-10  # rounding of two factorisations of one body, whose stiffness has a condition number of 1e5


@cache
def blocks():
    """The body, and its Space with full Z, with the matrices there."""
    fem = hex_block((6, 3, 3))
    body = romerr.ElasticBody.from_fem(fem, rayleigh=(0.3, 1e-5), reference=mass_orthogonal())
    full = Space(body.N, np.zeros(0, dtype=int), mass_orthogonal().rows(body.positions, body.mass))
    return body, full, full.matrix(body.mass).toarray(), full.matrix(body.stiffness).toarray()


def test_modes_are_those_of_full_matrices_and_none_is_missed():
    body, _, M, K = blocks()
    omega = np.sqrt(la.eigh(K, M, eigvals_only=True))
    np.testing.assert_allclose(body.modes(20).omega, omega[:20], rtol=SAME)
    for limit in (0.5 * omega[0], (omega[10] + omega[11]) / 2):
        assert count_below(body.M, body.K, limit) == np.sum(omega < limit)


def test_norms_and_solutions_are_those_of_full_matrices():
    """In coordinates of their own, which forces and displacements on all coordinates do not see."""
    body, full, *matrices = blocks()
    F = np.random.default_rng(0).standard_normal((body.N, 3))
    own, eliminated = body.space.loads(F), full.loads(F)
    for A, factor in zip(matrices, (body.mass_factor, body.stiffness_factor), strict=True):
        x = la.solve(A, eliminated, assume_a="pos")
        solution, half = factor.solve(own), factor.half_solve(own)
        size = np.abs(full.expand(x)).max()
        np.testing.assert_allclose(body.expand(solution), full.expand(x), rtol=0, atol=SAME * size)
        np.testing.assert_allclose(
            half.T @ half, eliminated.T @ x, rtol=0, atol=SAME * np.abs(eliminated.T @ x).max()
        )
        np.testing.assert_allclose(
            half.T @ factor.half_multiply(solution), half.T @ half, rtol=0, atol=SAME * np.abs(half.T @ half).max()
        )
        assert half.shape == own.shape
    np.testing.assert_allclose(
        body.space.coordinates("x", body.expand(own)), own, rtol=0, atol=SAME * np.abs(own).max()
    )


def test_bodies_of_any_size_keep_sparse_matrices():
    """A full matrix of 8019 coordinates takes 514 MB; allowed is 30 times the entries of K, with modes and norms."""
    fem = hex_block((32, 8, 8))
    K = fem.GetStiffnessMatrix(sparse=True)
    tracemalloc.start()
    try:
        body = romerr.ElasticBody.from_fem(fem, rayleigh=(0.0, 1e-5), reference=mass_orthogonal())
        body.mass_factor.half_solve(body.space.loads(np.ones((body.N, 3))))
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert body.K.nnz <= K.nnz
    assert most < 30 * (8 + 4) * K.nnz


def test_a_body_that_springs_hold_is_no_free_one():
    fem = hex_block((3, 1, 1))
    K = fem.GetStiffnessMatrix(sparse=True).tolil()
    K[0, 0] *= 1.01
    with pytest.raises(AssumptionError, match="stiffness resists rigid motions"):
        romerr.ElasticBody(
            fem.massMatrix, K.tocsc(), positions=fem.GetNodePositionsAsArray(), reference=mass_orthogonal()
        )
