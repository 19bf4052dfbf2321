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


def test_oscillators_refuse_other_shapes(compiled):
    """Nothing is read or written beyond the end of an array."""
    right = [np.zeros(shape) for shape in ((2, 3), (2, 2, 3), (2, 4, 3), (5, 4, 3), (5, 2, 3))]
    compiled.oscillators(5, 4, 3, *right)
    for i in range(5):
        wrong = [*right]
        wrong[i] = right[i][:-1]
        with pytest.raises(ValueError, match="in place of"):
            compiled.oscillators(5, 4, 3, *wrong)


@pytest.mark.parametrize("m", [1, 3, 14])
@pytest.mark.parametrize("k", [1, 4, 39])
@pytest.mark.parametrize("count", [1, 2, 3, 5, 8, 101])
def test_products_find_the_same(count, k, m, compiled, monkeypatch):
    """Of every remainder of what is multiplied at once; rows are a part of wider ones, matrices in any order."""
    monkeypatch.setattr(blocked_products, "ONE_THREAD", 0)  # one row at a time is NumPy's
    rng = np.random.default_rng([count, k, m])
    rows, matrix = rng.standard_normal((count, 2, 2 * k))[..., :k], rng.standard_normal((m, k))
    for columns in (matrix.T, matrix.T.copy()):
        found = []
        for one in (None, compiled):
            monkeypatch.setattr(blocked_products, "loops", one)
            found.append(rows_times(rows, columns))
        assert off(*found) < SAME


@pytest.mark.parametrize("size", [1.0, 1e-200, 1e200])
def test_norms_are_those_of_numpy(monkeypatch, compiled, size):
    """Of any shape, of triangles, and where squares vanish or overflow."""
    rng = np.random.default_rng(4)
    for shape, k, m in (((0,), 3, 2), ((1,), 1, 1), ((7, 5), 34, 34), ((9,), 13, 25), ((4, 3), 5, 0)):
        rows, matrix = size * rng.standard_normal((*shape, k)), rng.standard_normal((k, m))
        for of in (matrix, np.tril(matrix)):
            found = []
            for one in (None, compiled):
                monkeypatch.setattr(blocked_products, "loops", one)
                found.append(norms_times(rows, of))
            assert found[0].shape == shape
            np.testing.assert_allclose(found[1], found[0], rtol=SAME)


def test_products_refuse_other_shapes(compiled):
    """Nothing is read or written beyond the end of an array."""
    for i in range(3):
        wrong = [np.zeros((7, 5)), np.zeros((3, 5)), np.zeros(7)]
        wrong[i] = wrong[i][:-1]
        with pytest.raises(ValueError, match="in place of"):
            compiled.squares(7, 5, 3, *wrong)
    right = [np.zeros((7, 5)), np.zeros((3, 5)), np.zeros((7, 3))]
    compiled.rows_times(7, 5, 3, *right)
    for i in range(3):
        wrong = [*right]
        wrong[i] = right[i][:-1]
        with pytest.raises(ValueError, match="in place of"):
            compiled.rows_times(7, 5, 3, *wrong)


@pytest.mark.parametrize("straight", [True, False])
@pytest.mark.parametrize(("n", "p"), [(1, 0), (7, 3), (14, 6)])
def test_control_points_are_those_of_numpy(n, p, straight, compiled, monkeypatch):
    """Those at samples to the last bit, or every step would seem to begin with a jump."""
    rng, S = np.random.default_rng([n, p]), 21
    h, samples = rng.uniform(0.5, 1.0, S), (*rng.standard_normal((3, S + 1, n)), rng.standard_normal((S + 1, p)))
    controls = None if straight else rng.standard_normal((S, 6, p))
    if not straight:
        controls[:, 0], controls[:, -1] = samples[-1][:-1], samples[-1][1:]
    layout, found = Coordinates(n, p, (0.3, 0.02), has_damping=False), []
    for one in (None, compiled):
        monkeypatch.setattr(bezier, "loops", one)
        found.append(bezier.hermite_rows(layout, layout.rayleigh, h, samples, controls))
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
        found = []
        for one in (None, compiled):
            monkeypatch.setattr(blocked_products, "loops", one)
            found.append(polygon_lengths(c, matrix))
        np.testing.assert_allclose(found[1], found[0], rtol=SAME)


@pytest.mark.parametrize(("degree", "count"), [(1, 3), (5, 20)])
def test_what_oscillators_do_within_steps_is_the_same(degree, count, compiled, monkeypatch):
    """Slow and fast ones; and nan stays nan, wherever it is."""
    rng = np.random.default_rng(degree)
    oscillators = ModalOscillators(np.geomspace(1.0, 1e5, count), np.zeros(count))
    h, state, F = np.full(30, 1e-3), rng.standard_normal((2, count)), rng.standard_normal((30, degree + 1, count))
    states = rng.standard_normal((30, 2, count))
    F[3, -1, 0], F[4, 0, 1], states[7, 1, 2] = np.nan, np.nan, np.nan
    found = []
    for one in (None, compiled):
        monkeypatch.setattr(modal_oscillators, "loops", one)
        found.append(np.array(oscillators.inside(state, states, h, F)))
    assert np.isnan(found[0]).sum() == 6
    np.testing.assert_allclose(found[1], found[0], rtol=SAME)


def test_loops_over_steps_refuse_other_shapes(compiled):
    """Nothing is read or written beyond the end of an array."""
    of_curves = [(5,), (6, 2), (6, 2), (6, 2), (6, 3), (5, 6, 3), (6, 7), (5, 6, 7)]
    for call, shapes in (
        (lambda *x: compiled.curves(5, 2, 3, 0.1, 0.2, *x), of_curves),
        (lambda *x: compiled.lengths(5, 2, 4, 7, *x), [(5, 3, 4), (7, 4), (5,)]),
        (lambda *x: compiled.inside(5, 4, 3, *x), [(3,), (5,), (5, 2, 3), (5, 4, 3), (5, 2, 3)]),
    ):
        right = [np.zeros(shape) for shape in shapes]
        call(*right)
        for i in range(len(right)):
            with pytest.raises(ValueError, match="in place of"):
                call(*right[:i], right[i][:-1], *right[i + 1 :])
    for wrong in ((5, -1, 4, 7), (-5, 2, 4, 7)):
        with pytest.raises(ValueError, match="negative"):
            compiled.lengths(*wrong, np.zeros(60), np.zeros(21), np.zeros(5))
