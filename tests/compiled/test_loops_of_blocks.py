"""Compiled loops over blocks of steps beside NumPy: interpolants of inputs, sums that decay, largest sizes."""

import numpy as np
import pytest

from exudyn_romerr.linalg import bezier, blocked_products
from tests.compiled.test_loops import SAME, both, off

EVERY = np.arange(1, 10) / 10  # of a step: checks and inner nodes in turn


def polynomials(rng, S, p, degree):
    """Values at 0, at EVERY and at 1, (S, 11, p), of random polynomials."""
    powers = np.linspace(0, 1, 11)[:, None] ** np.arange(degree + 1)
    return np.einsum("ij,sjp->sip", powers, rng.standard_normal((S, degree + 1, p)))


@pytest.mark.parametrize(("S", "p"), [(1, 1), (20, 3), (9, 7)])
def test_interpolants_are_those_of_numpy(S, p, compiled, monkeypatch):
    """Of numbers of any kind; their ends to the last bit."""
    values = np.random.default_rng([S, p]).standard_normal((S, 11, p))
    given = values[:, 0], values[:, -1], values[:, 1:-1]
    numpy, other = both(bezier, compiled, monkeypatch, lambda: bezier.interpolated(*given))
    assert max(map(off, numpy, other)) < SAME
    np.testing.assert_array_equal(other[0][:, [0, -1]], values[:, [0, -1]])


@pytest.mark.parametrize("is_compiled", [False, True])
def test_polynomials_of_degree_5_are_hit_and_others_are_not(is_compiled, compiled, monkeypatch):
    """What is missed of t^6 at the checks is known: the product of distances from the nodes."""
    monkeypatch.setattr(bezier, "loops", compiled if is_compiled else None)
    values = polynomials(np.random.default_rng(3), 8, 2, degree=5)
    controls, largest, summed, size = bezier.interpolated(values[:, 0], values[:, -1], values[:, 1:-1])
    assert size == np.abs(values[:, ::2]).max()
    assert summed.max() < SAME * size
    np.testing.assert_array_equal(controls[:, 0], values[:, 0])
    more = values + (np.linspace(0, 1, 11) ** 6)[:, None]
    _, largest, summed, _ = bezier.interpolated(more[:, 0], more[:, -1], more[:, 1:-1])
    missed = np.abs(np.prod(bezier.CHECKS[:, None] - bezier.NODES, axis=1))
    np.testing.assert_allclose(largest, missed.max(), rtol=1e-9)  # 1e-4 of values that are rounded at 1e-16
    np.testing.assert_allclose(summed, missed.sum(), rtol=1e-9)


def test_sums_decay_as_those_of_numpy(compiled, monkeypatch):
    """From the first number on that is not finite all of its row are inf, as where the start is."""
    rng = np.random.default_rng(6)
    decays, added, starts = (
        rng.uniform(0.5, 1.0, (6, 50)),
        rng.uniform(0, 1, (6, 50)),
        [0.0, 1.0, np.inf, 2.0, 3.0, 4.0],
    )
    added[3, 20], added[4, 0], decays[5, 7] = np.inf, np.nan, 1e308
    found = both(
        blocked_products, compiled, monkeypatch, lambda: blocked_products.decaying_sums(decays, added, starts)
    )
    for x in found:
        assert [np.isinf(row).sum() for row in x] == [0, 0, 50, 30, 50, 43]
    np.testing.assert_allclose(found[1], found[0], rtol=SAME)
    x = starts[1]
    for k in range(50):
        x = decays[1, k] * x + added[1, k]
    np.testing.assert_allclose(found[1][1, -1], x, rtol=SAME)


@pytest.mark.parametrize("k", [1, 4, 7, 186])
def test_largest_sizes_are_those_of_numpy(k, compiled, monkeypatch):
    """To the last bit; nan stays nan, wherever it is."""
    rows = np.random.default_rng(k).standard_normal((30, k))
    rows[4, 0], rows[7, -1] = -9.0, np.inf
    numpy, other = both(blocked_products, compiled, monkeypatch, lambda: blocked_products.largest_sizes(rows))
    np.testing.assert_array_equal(numpy, np.abs(rows).max(axis=0))
    np.testing.assert_array_equal(other, numpy)
    for place in (0, 12, 29):
        spoilt = rows.copy()
        spoilt[place, 0] = np.nan
        assert np.isnan(blocked_products.largest_sizes(spoilt)[0])
