"""Residual norms in any weight G (paper, 33-35)."""

import numpy as np
import pytest

import exudyn_romerr as romerr
from models import linkage
from models.matrix_exponential import residual_norm


def weights(body, name):
    """Mass matrix, identity, or a seeded random symmetric positive definite weight."""
    n = body.free.size
    if name == "random":
        root = np.random.default_rng(5).standard_normal((n, n))
        return root @ root.T + n * np.eye(n)
    return None if name == "mass" else np.eye(n)


@pytest.mark.parametrize("residual", ["direct", "expanded", "orthonormal"])
@pytest.mark.parametrize("weight", ["mass", "identity", "random"])
def test_norm_of_the_residual_in_any_weight_is_that_of_its_definition(weight, residual):
    """|M^-1 R|_G equals the norm formed from the full matrices at random states, by each of the three ways."""
    body, B, _ = linkage.build()
    basis, G = romerr.krylov_basis(body, B, 4), weights(body, weight)
    layout, norm = residual_norm(body, basis, B, residual, G)
    rng = np.random.default_rng(6)
    q, q_t, q_tt, u = (rng.standard_normal((3, n)) for n in (4, 4, 4, 1))
    V, weight_matrix = basis.V[body.free], body.M.toarray() if G is None else G
    R = body.M @ V @ q_tt.T + body.D @ V @ q_t.T + body.K @ V @ q.T - B[body.free] @ u.T
    Rt = np.linalg.solve(body.M.toarray(), R)
    # random states: no cancellation between the terms, so the ten-term form loses nothing either
    np.testing.assert_allclose(
        norm(layout(q, q_t, q_tt, u)), np.sqrt(np.sum(Rt * (weight_matrix @ Rt), axis=0)), rtol=1e-8
    )


def test_weight_must_be_symmetric_positive_definite():
    """An indefinite or unsymmetric G is wrong input."""
    body, B, _ = linkage.build()
    basis = romerr.krylov_basis(body, B, 2)
    for G in (-np.eye(body.free.size), np.triu(np.ones((body.free.size,) * 2))):
        with pytest.raises(romerr.InputError, match="G is not"):
            residual_norm(body, basis, B, G=G)
