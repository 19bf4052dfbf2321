"""What passive steps let grow: single oscillators by the scheme itself, beside the sums that bound them."""

import numpy as np
import pytest

from exudyn_romerr.mechanism.scheme import Scheme
from exudyn_romerr.mechanism_bounds.passive_steps import PassiveSteps
from exudyn_romerr.mechanism_bounds.sums import Sums


def marched(scheme, h, omega, zeta, f):
    """Displacements (T,) of an oscillator of unit mass that begins at rest without acceleration, under f (T,)."""
    (a_m, a_f), (beta, gamma) = (scheme.alpha_m, scheme.alpha_f), (scheme.beta, scheme.gamma)
    k, d = omega**2, 2 * zeta * omega
    x = v = acceleration = a = 0.0
    found = [0.0]
    for now in f[1:]:
        # (1 - a_m) a_new + a_m a = (1 - a_f) acceleration_new + a_f acceleration, solved for a_new
        known = (a_f * acceleration - a_m * a) / (1 - a_m)
        share = (1 - a_f) / (1 - a_m)
        x0, v0 = x + h * v + h**2 * (0.5 - beta) * a, v + h * (1 - gamma) * a
        x0, v0 = x0 + h**2 * beta * known, v0 + h * gamma * known
        acceleration = (now - d * v0 - k * x0) / (1 + share * (h * gamma * d + h**2 * beta * k))
        a = known + share * acceleration
        x, v = x0 + h**2 * beta * share * acceleration, v0 + h * gamma * share * acceleration
        found.append(x)
    return np.array(found)


@pytest.mark.parametrize("radius", [0.0, 0.6, 0.9, 1.0])
@pytest.mark.parametrize("zeta", [0.0, 0.02, 0.5])
def test_no_oscillator_is_farther_off_than_the_sum(radius, zeta):
    """|x - f/k| k^1/2 <= c g, f the mean of two forces that a step feels, for slow and fast ones, sudden forces."""
    shares = []
    scheme, h, rng = Scheme.of_radius(radius), 1e-3, np.random.default_rng(4)
    steps = PassiveSteps.of(scheme.alpha_m, scheme.alpha_f, scheme.beta, scheme.gamma)
    for omega in 10.0 ** rng.uniform(1, 5, 20):
        f = np.concatenate([np.zeros(5), rng.standard_normal(60) * (rng.random(60) < 0.3)])
        felt = f - scheme.alpha_f * np.diff(f, prepend=0.0)
        y = felt / omega
        beta = max(2 * zeta / omega, np.finfo(float).tiny)
        variation = np.abs(np.diff(y, prepend=0.0))
        g = Sums().take(variation, 0 * y, h * y**2 / (2 * beta), np.abs(y))
        off = np.abs(marched(scheme, h, omega, zeta, f) - felt / omega**2) * omega
        assert np.all(off <= steps.norms[0] * g * (1 + 1e-12))
        shares.append(off.max() / g.max())
    assert 0.1 < max(shares)  # and it is no number that all are far below


def test_damping_ends_the_growth():
    """A force that comes and goes for ever: with damping the sum stays, without it grows with every change."""
    y, none = np.tile([1.0, -1.0], 500), np.zeros(1000)
    change = np.abs(np.diff(y, prepend=0.0))
    undamped = Sums().take(change, none, none + np.inf, np.abs(y))
    damped = Sums().take(change, none, none + 1e-3, np.abs(y))
    assert undamped[-1] == change.sum()
    assert damped[-1] <= np.sqrt(1e-3 * 1000) + 1 + 1e-12


def test_it_begins_with_what_the_start_holds():
    sums = Sums()
    sums.begin(2.0)
    assert sums.take(*np.array([[1.0], [0.5], [np.inf], [1.0]])) == [3.5]
