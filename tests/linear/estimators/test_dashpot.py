"""The energy bound with non-modal damping, a dashpot; truth: matrix exponential of the state form."""

from functools import cache

import numpy as np
import pytest
import scipy.linalg as la

import exudyn_romerr as romerr
from models import linkage
from tests.helpers.truth import linear_inputs, state_form

# Energy alone, random force for 300 ms, linkage with a dashpot: 30 to 600 measured, 6000 where the error is smallest.
LOOSEST = 2e4
# Share of the output or norm that rounding may take: 1e-16 in each of 1500 steps of the exponential, times some
# hundred for the spread of the frequencies.
ROUNDING_FLOOR = 1e-10


T = 2e-4 * np.arange(1501)
KNOTS = T[::25]
VALUES = 100 * np.random.default_rng(0).standard_normal(KNOTS.size)  # N
INPUTS = np.eye(linkage.matrices()[0].shape[0])[:, [linkage.TIP_Z]]
OUTPUTS = (
    romerr.node_displacement("z", node=linkage.TIP, component="z"),
    romerr.node_velocity("v", node=linkage.TIP, component="z"),
)


@cache
def dashpot_body(alpha):
    """The linkage with alpha M and a dashpot at its tip in z: second mode 65 % critical, first nearly undamped."""
    mass, stiffness = (matrix.toarray() for matrix in linkage.matrices())
    damping = alpha * mass
    damping[linkage.TIP_Z, linkage.TIP_Z] += 100.0  # N s/m
    return romerr.ElasticBody(mass, stiffness, damping=damping, fixed=linkage.CLAMPED, positions=linkage.mesh()[0])


def force(t):
    return np.interp(t, KNOTS, VALUES)


def exact(M, D, K, B):
    """The motion by matrix exponentials, exact for a load that is linear between samples."""
    u = force(T)[:, None]
    start = np.linalg.solve(K, B @ u[0])  # equilibrium: the load does not jump at the start
    h = np.full(len(u) - 1, T[1])
    return state_form(M, D, K, B).propagate(h, linear_inputs(u[:-1], u[1:]), start, 0 * start)


@pytest.mark.parametrize("alpha", [0.0, 5.0])
@pytest.mark.parametrize("n", [2, 6])
def test_energy_bound_holds(n, alpha):
    body = dashpot_body(alpha)
    basis = romerr.krylov_basis(body, INPUTS, n)
    V, B = basis.V[body.free], INPUTS[body.free]
    matrices = [matrix.toarray() for matrix in (body.M, body.D, body.K)]
    full, reduced = exact(*matrices, B), exact(*(V.T @ A @ V for A in matrices), V.T @ B)
    trajectory = romerr.Trajectory(T, reduced.q, reduced.q_t, reduced.q_tt)
    options = {"inputs": INPUTS, "input_function": force, "outputs": OUTPUTS, "initial": "equilibrium"}
    report = romerr.evaluate(body, basis, trajectory, estimators="energy", **options)
    e, e_t = full.q - reduced.q @ V.T, full.q_t - reduced.q_t @ V.T
    root, row = la.cholesky(body.M.toarray()), B[:, 0]
    for error, bound, size in (
        (la.norm(e @ root.T, axis=1), report.position_bound["energy"], la.norm(full.q @ root.T, axis=1)),
        (la.norm(e_t @ root.T, axis=1), report.velocity_bound["energy"], la.norm(full.q_t @ root.T, axis=1)),
        (np.abs(e @ row), report.output("z").bound["energy"][:, 0], np.abs(full.q @ row)),
        (np.abs(e_t @ row), report.output("v").bound["energy"][:, 0], np.abs(full.q_t @ row)),
    ):
        assert np.all(error <= bound + ROUNDING_FLOOR * np.max(size))
        assert np.max(bound) < LOOSEST * np.max(error)
