"""Compiled loops beside those in NumPy, which are the reference, on random numbers."""

from importlib.util import find_spec, module_from_spec
from types import SimpleNamespace

import numpy as np
import pytest

import exudyn_romerr.compiled
from exudyn_romerr.compiled.loops import VERSION
from exudyn_romerr.linalg import bezier, blocked_products, modal_oscillators
from exudyn_romerr.linalg.blocked_products import norms_times, polygon_lengths, rows_times
from exudyn_romerr.linalg.modal_oscillators import ModalOscillators
from exudyn_romerr.linear.residual.residual import Coordinates

# Random numbers: products of up to 60 in another order, 1e-16 each, added up over 20 steps that do not grow.
SAME = 1e-12


def off(one, other):
    """Largest difference, of the largest number."""
    return np.max(np.abs(one - other), initial=0.0) / np.max(np.abs(one), initial=1e-300)


def both(module, loops, monkeypatch, of):
    """What NumPy and the loops find."""
    found = []
    for one in (None, loops):
        monkeypatch.setattr(module, "loops", one)
        found.append(of())
    return found


def test_source_has_the_version_that_is_asked_for(compiled):
    """Where one of the two is forgotten, nothing is compiled for anybody."""
    assert compiled.VERSION == VERSION


@pytest.mark.parametrize("found", [{}, {"VERSION": VERSION - 1}, {"VERSION": VERSION}])
def test_loops_of_another_version_are_left_out(found, monkeypatch):
    """Those that an editable installation has from before an update lack functions, the first ones a version, too."""
    built = SimpleNamespace(flow=None, **found)
    monkeypatch.setattr(exudyn_romerr.compiled, "_loops", built, raising=False)
    anew = module_from_spec(spec := find_spec("exudyn_romerr.compiled.loops"))
    spec.loader.exec_module(anew)
    assert anew.loops is (built if built == SimpleNamespace(flow=None, VERSION=VERSION) else None)


@pytest.mark.parametrize(("degree", "count"), [(0, 1), (5, 3), (3, 20)])
def test_oscillators_find_the_same(degree, count, compiled, monkeypatch):
    """In two blocks; the last step of the second is shorter, and always NumPy's."""
    rng = np.random.default_rng(degree)
    omega, zeta = np.geomspace(1.0, 1e4, count), rng.uniform(0, 0.2, count)
    F, h = rng.standard_normal((300, degree + 1, count)), np.append(np.full(299, 1e-3), 3e-4)
    found = []
    for one in (None, compiled):
        monkeypatch.setattr(modal_oscillators, "loops", one)
        oscillators, state = ModalOscillators(omega, zeta), rng.standard_normal((2, count)) * (one is None)
        if one is not None:
            state = found[0][0]
        found.append([state])
        for part in (slice(100), slice(100, 300)):
            found[-1] += [*oscillators.advance(found[-1][-1], np.cumsum(h)[part], h[part], F[part])]
    assert off(*(np.array(one)[:, 0] for one in found)) < SAME
    assert off(*(np.array(one)[:, 1] for one in found)) < SAME


@pytest.mark.parametrize("m", [1, 3, 14])
@pytest.mark.parametrize("k", [1, 4, 39])
@pytest.mark.parametrize("count", [1, 2, 3, 5, 8, 101])
def test_products_find_the_same(count, k, m, compiled, monkeypatch):
    """Of every remainder of what is multiplied at once; rows are a part of wider ones, matrices in any order."""
    monkeypatch.setattr(blocked_products, "ONE_THREAD", 0)  # one row at a time is NumPy's
    rng = np.random.default_rng([count, k, m])
    rows, matrix = rng.standard_normal((count, 2, 2 * k))[..., :k], rng.standard_normal((m, k))
    for columns in (matrix.T, matrix.T.copy()):
        assert (
            off(*both(blocked_products, compiled, monkeypatch, lambda columns=columns: rows_times(rows, columns)))
            < SAME
        )


@pytest.mark.parametrize("size", [1.0, 1e-200, 1e200])
def test_norms_are_those_of_numpy(monkeypatch, compiled, size):
    """Of any shape, of triangles, and where squares vanish or overflow."""
    rng = np.random.default_rng(4)
    for shape, k, m in (((0,), 3, 2), ((1,), 1, 1), ((7, 5), 34, 34), ((9,), 13, 25), ((4, 3), 5, 0)):
        rows, matrix = size * rng.standard_normal((*shape, k)), rng.standard_normal((k, m))
        for of in (matrix, np.tril(matrix)):
            found = both(blocked_products, compiled, monkeypatch, lambda rows=rows, of=of: norms_times(rows, of))
            assert found[0].shape == shape
            np.testing.assert_allclose(found[1], found[0], rtol=SAME)


@pytest.mark.parametrize("straight", [True, False])
@pytest.mark.parametrize(("n", "p"), [(1, 0), (7, 3), (14, 6)])
def test_control_points_are_those_of_numpy(n, p, straight, compiled, monkeypatch):
    """Those at samples to the last bit, or every step would seem to begin with a jump."""
    rng, S = np.random.default_rng([n, p]), 21
    h, samples = rng.uniform(0.5, 1.0, S), (*rng.standard_normal((3, S + 1, n)), rng.standard_normal((S + 1, p)))
    controls = None if straight else rng.standard_normal((S, 6, p))
    if not straight:
        controls[:, 0], controls[:, -1] = samples[-1][:-1], samples[-1][1:]
    layout = Coordinates(n, p, (0.3, 0.02), has_damping=False)
    of = (layout, h, samples, controls)
    found = both(bezier, compiled, monkeypatch, lambda: bezier.hermite_rows(*of))
    assert off(*found) < SAME
    ends = layout(*samples)
    np.testing.assert_array_equal(found[1][:, 0], ends[:-1])
    np.testing.assert_array_equal(found[1][:, -1], ends[1:])


@pytest.mark.parametrize("size", [1.0, 1e-200, 1e200])
def test_lengths_of_polygons_are_those_of_numpy(size, compiled, monkeypatch):
    """Also where squares vanish or overflow."""
    rng = np.random.default_rng(8)
    for S, d, k in ((1, 1, 4), (9, 5, 34), (20, 3, 13)):
        c, matrix = size * rng.standard_normal((S, d + 1, k)), np.tril(rng.standard_normal((k, 25)))
        found = both(blocked_products, compiled, monkeypatch, lambda c=c, matrix=matrix: polygon_lengths(c, matrix))
        np.testing.assert_allclose(found[1], found[0], rtol=SAME)


@pytest.mark.parametrize(("degree", "count"), [(1, 3), (5, 20)])
def test_what_oscillators_do_within_steps_is_the_same(degree, count, compiled, monkeypatch):
    """Slow and fast ones; and nan stays nan, wherever it is."""
    rng = np.random.default_rng(degree)
    oscillators = ModalOscillators(np.geomspace(1.0, 1e5, count), np.zeros(count))
    h, state, F = np.full(30, 1e-3), rng.standard_normal((2, count)), rng.standard_normal((30, degree + 1, count))
    states = rng.standard_normal((30, 2, count))
    F[3, -1, 0], F[4, 0, 1], states[7, 1, 2] = np.nan, np.nan, np.nan
    of = state, states, h, F
    found = both(modal_oscillators, compiled, monkeypatch, lambda: np.array(oscillators.inside(*of)))
    assert np.isnan(found[0]).sum() == 6
    np.testing.assert_allclose(found[1], found[0], rtol=SAME)
