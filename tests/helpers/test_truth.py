"""The tests' own truth: two independent exact solutions agree, and a manufactured solution is met."""

import numpy as np
import pytest
import scipy.linalg as la
from numpy.polynomial import polynomial as poly

from tests.helpers import tolerances as tol
from tests.helpers.bodies import BODIES, DAMPINGS, model
from tests.helpers.truth import MAX_DEGREE, modal_solution, state_form

MODAL = [d for d in DAMPINGS if d not in ("matrix", "gyroscopic")]


@pytest.mark.parametrize("damping", MODAL)
@pytest.mark.parametrize("kind", BODIES)
def test_exponential_and_modal_solution_agree(kind, damping):
    """Expm of the state form against closed forms of the modes, piecewise linear load, uneven steps, stiff bodies."""
    full = model(kind, damping, 5)
    omega = full.modes[0]
    rng = np.random.default_rng(5)
    B, h, F = (
        rng.standard_normal((full.N, 2)),
        np.tile([0.1, 0.03, 0.2], 15) / omega[0],
        rng.standard_normal((45, 2, 2)),
    )
    q0 = la.solve(full.K, rng.standard_normal(full.N))
    found = state_form(full.M, full.D, full.K, B).propagate(h, F, q0, omega[0] * q0)
    q, q_t = modal_solution(full.M, full.K, full.rayleigh, B, h, F, q0, omega[0] * q0)
    allowed = tol.PROPAGATED + tol.PENCIL * (omega[-1] / omega[0]) ** 2
    energy = np.max(energy_norm(full, q, q_t))
    assert np.max(energy_norm(full, 0 * q, q_t - found.q_t)) < allowed * energy
    assert omega[0] * np.max(energy_norm(full, 0 * q, q - found.q)) < allowed * energy


def energy_norm(full, q, q_t):
    """Root of twice the energy at every time."""
    return np.sqrt(np.einsum("ti,ij,tj->t", q, full.K, q) + np.einsum("ti,ij,tj->t", q_t, full.M, q_t))


@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("degree", range(1, MAX_DEGREE + 1))
def test_a_polynomial_motion_is_met(degree, damping):
    """q(t) = sum a_j t^j is the solution for u = M q'' + D q' + K q, which has the same degree: q, q_t and q_tt."""
    full = model("chain", damping, 6)
    rng = np.random.default_rng(degree)
    a = rng.standard_normal((degree + 1, full.N))
    h = rng.choice([0.05, 0.1, 0.02], 20)
    t = np.concatenate([[0], np.cumsum(h)])
    motion = [poly.polyval(t, poly.polyder(a, k)).T for k in range(3)]
    F = np.array([local_load(full, a, start, length) for start, length in zip(t, h, strict=False)])
    found = state_form(full.M, full.D, full.K, np.eye(full.N)).propagate(h, F, a[0], a[1])
    for wanted, x in zip(motion, (found.q, found.q_t, found.q_tt), strict=True):
        scale = np.max(np.abs(motion)) * full.modes[0][-1] ** 2  # q_tt comes from K q
        assert np.max(np.abs(x - wanted)) < tol.PROPAGATED * scale


def local_load(full, a, start, h):
    """Coefficients in s = (t - start)/h of M q'' + D q' + K q, (d + 1, N)."""
    shifted = poly.polyfit(
        np.linspace(0, 1, len(a)), poly.polyval(start + h * np.linspace(0, 1, len(a)), a).T, len(a) - 1
    )
    load = shifted @ full.K
    load[:-1] += poly.polyder(shifted) @ full.D.T / h
    if len(a) > 2:
        load[:-2] += poly.polyder(shifted, 2) @ full.M / h**2
    return load


def test_unsymmetric_matrices_take_the_other_scaling():
    """A Petrov-Galerkin form T (M, D, K, B) has the solution of (M, D, K, B)."""
    full = model("pencil", "gyroscopic", 7)
    rng = np.random.default_rng(7)
    T, B = rng.standard_normal((full.N, full.N)) + 3 * np.eye(full.N), rng.standard_normal((full.N, 1))
    h, F, q0 = np.full(50, 0.02), rng.standard_normal((50, 2, 1)), rng.standard_normal(full.N)
    wanted = state_form(full.M, full.D, full.K, B).propagate(h, F, q0, 0 * q0)
    found = state_form(T @ full.M, T @ full.D, T @ full.K, T @ B).propagate(h, F, q0, 0 * q0)
    assert np.max(np.abs(found.q - wanted.q)) < tol.REPEATED * np.max(np.abs(wanted.q))
