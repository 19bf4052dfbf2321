"""CarriedTurn: forces that change their sign from step to step move no mode further than it says."""

import numpy as np
import pytest

from exudyn_romerr.estimates.march import Scheme
from exudyn_romerr.estimates.overshoot import CarriedTurn

RESOLVED, STIFF = 0.01, 1e5  # omega h
H, STEPS = 2e-3, 400


def swung(omega, forces):
    """Root of twice the energy (S, modes) of modes of unit mass at rest, under mean forces (S,) of steps H.

    Exact for the trapezoidal rule: v' = f - omega^2 x, both averaged over the step.
    """
    x, v, found = np.zeros_like(omega), np.zeros_like(omega), []
    for f in forces:
        change = (H * f - H * omega**2 * (x + H * v / 2)) / (1 + (omega * H / 2) ** 2)
        x, v = x + H * (v + change / 2), v + change
        found.append(np.hypot(omega * x, v))
    return np.array(found)


@pytest.mark.parametrize("seed", range(4))
def test_no_mode_has_more_energy(seed):
    rng = np.random.default_rng(seed)
    turned = 0.1 * np.abs(np.convolve(rng.standard_normal(STEPS + 20), np.ones(21) / 21, "valid"))
    omega = np.geomspace(RESOLVED, STIFF, 300) / H
    bound = CarriedTurn(Scheme.of_radius(1.0), 3.0).advance(np.full(STEPS, H), turned)
    energy = swung(omega, 3.0 * turned / 4 * (-1.0) ** np.arange(STEPS)).max(axis=1)
    assert np.all(energy <= bound)
    assert energy.max() > 0.3 * bound[-1] / 4  # the sum of changes is of the worst case


def test_a_constant_turn_is_nearly_attained():
    omega = np.geomspace(RESOLVED, STIFF, 300) / H
    bound = CarriedTurn(Scheme.of_radius(1.0), 1.0).advance(np.full(STEPS, H), np.full(STEPS, 0.1))
    energy = swung(omega, 0.1 / 4 * (-1.0) ** np.arange(STEPS))
    assert np.all(energy.max(axis=1) <= bound)
    assert energy.max() > 0.4 * bound[-1]


def test_chunks_of_steps_say_the_same():
    turned, h = np.linspace(0.0, 0.1, 50), np.full(50, H)
    whole, parts = (CarriedTurn(Scheme.of_radius(0.8), 1.0) for _ in range(2))
    found = np.concatenate([parts.advance(h[part], turned[part]) for part in (slice(0, 7), slice(7, 50))])
    np.testing.assert_allclose(found, whole.advance(h, turned), rtol=1e-14)  # sums in another order


@pytest.mark.parametrize("radius", [0.0, 0.5, 0.9])
def test_numerical_damping_forgets(radius):
    h, turned = np.full(2000, H), np.full(2000, 0.1)
    bound = CarriedTurn(Scheme.of_radius(radius), 1.0).advance(h, turned)
    assert np.isfinite(bound).all()
    assert bound.max() <= 2 * H * 0.1 / 4  # |f| is largest at first, and only falls
