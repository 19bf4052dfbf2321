"""The tests' own truth: a manufactured solution is met; test_total_error.py has a second truth beside it."""

import numpy as np
import pytest
from numpy.polynomial import polynomial as poly

from tests.helpers import tolerances as tol
from tests.helpers.bodies import DAMPINGS, model
from tests.helpers.truth import MAX_DEGREE, state_form


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
