"""Rotations: Euler parameters, what small and finite rotations do to them."""

import numpy as np

from exudyn_romerr.mechanism.rotations import (
    body_rates,
    exponential,
    global_rates,
    parameter_rates,
    rotation_matrix,
    skew,
    times,
    times_transposed,
    turned_parameters,
)

RNG = np.random.default_rng(0)
P = RNG.normal(size=(6, 4))
P /= np.linalg.norm(P, axis=1, keepdims=True)
PHI = np.concatenate([RNG.normal(size=(5, 3)), np.zeros((1, 3))])  # no rotation, too


def test_rates_of_a_rotation():
    """A^T A' = w~ with w = B p' in axes of the body, A w in global ones."""
    p1 = RNG.normal(size=P.shape)
    p1 -= P * (P * p1).sum(axis=1, keepdims=True)
    dt = 1e-6
    A1 = (rotation_matrix(P + dt * p1) - rotation_matrix(P - dt * p1)) / (2 * dt)
    A, w = rotation_matrix(P), times(body_rates(P), p1)
    np.testing.assert_allclose(np.swapaxes(A, 1, 2) @ A1, skew(w), atol=1e-8)
    np.testing.assert_allclose(times(global_rates(P), p1), times(A, w), atol=1e-12)


def test_a_small_rotation_is_one_of_the_parameters():
    dphi = 1e-7 * PHI
    moved = rotation_matrix(P + times(parameter_rates(P), dphi))
    np.testing.assert_allclose(moved, exponential(dphi) @ rotation_matrix(P), atol=1e-12)
    np.testing.assert_allclose(global_rates(P) @ parameter_rates(P), np.tile(np.eye(3), (6, 1, 1)), atol=1e-14)


def test_a_finite_rotation_keeps_their_length():
    phi = 0.5 * PHI / np.linalg.norm(PHI, axis=1, keepdims=True).max()
    (moved,) = turned_parameters([P], [phi])
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 1.0, atol=2e-10)  # (0.5 / 2)^8 / 8! of the series
    np.testing.assert_allclose(rotation_matrix(moved), exponential(phi) @ rotation_matrix(P), atol=1e-9)
    np.testing.assert_array_equal(moved[-1], P[-1])


def test_rates_of_a_finite_rotation_are_derivatives():
    rng, dt = np.random.default_rng(3), 1e-3
    p, phi = rng.normal(size=(3, 6, 4)), 0.3 * rng.normal(size=(3, 6, 3))
    found = turned_parameters(p, phi)

    def at(s):
        return turned_parameters(*([x[0] + s * x[1] + s**2 / 2 * x[2]] for x in (p, phi)))[0]

    before, now, after = (at(s) for s in (-dt, 0.0, dt))
    np.testing.assert_allclose(found[1], (after - before) / (2 * dt), rtol=0, atol=1e-5)  # dt^2 of third derivatives
    np.testing.assert_allclose(found[2], (after - 2 * now + before) / dt**2, rtol=0, atol=1e-5)


def test_products_of_stacks():
    A, v = RNG.normal(size=(2, 3, 3, 4)), RNG.normal(size=(2, 3, 4))
    np.testing.assert_allclose(times(A, v), np.einsum("abij,abj->abi", A, v))
    np.testing.assert_allclose(times_transposed(A, v[..., :3]), np.einsum("abji,abj->abi", A, v[..., :3]))
