"""Compiled loops beside those in NumPy, which are the reference: of a mechanism's run, and of random numbers."""

from importlib.util import find_spec, module_from_spec
from types import SimpleNamespace

import numpy as np
import pytest

import exudyn_romerr as romerr
import exudyn_romerr.compiled
from exudyn_romerr.compiled.loops import VERSION
from exudyn_romerr.estimates import march
from exudyn_romerr.estimates.march import Columns, Steps
from exudyn_romerr.linalg import bezier, blocked_products, modal_oscillators
from exudyn_romerr.linalg.blocked_products import norms_times, polygon_lengths, rows_times
from exudyn_romerr.linalg.modal_oscillators import ModalOscillators
from exudyn_romerr.residual.packed_residual import PackedCoordinates
from exudyn_romerr.residual.residual import Coordinates
from exudyn_romerr.trajectory.scheme import Scheme
from models import floating
from tests.helpers import tolerances as tol

# Random numbers: products of up to 60 in another order, 1e-16 each, added up over 20 steps that do not grow.
SAME = 1e-12


class Both:
    """Steps.march by NumPy and compiled: what both find is kept, the run goes on with the former."""

    def __init__(self, compiled, monkeypatch):
        self.compiled, self.of_steps, self.kinds, self.off = compiled, Steps.march, set(), []
        self.monkeypatch = monkeypatch

    def march(self, steps, *parts, multipliers=False):
        found = []
        for one in (None, self.compiled):
            self.monkeypatch.setattr(march, "loops", one)
            found.append(self.of_steps(steps, *parts, multipliers=True))
        for part, (numpy, other) in zip(parts, zip(*found, strict=True), strict=True):
            of_kinds = zip(numpy[0].swapaxes(0, 1), other[0].swapaxes(0, 1), strict=True)  # e, e', e'', a
            self.off += [off(x, y) for x, y in of_kinds]
            self.off.append(off(numpy[1], other[1]))
            self.kinds |= {name for name in ("force", "values", "kicks") if getattr(part, name) is not None}
            self.kinds |= {"held" for J in part.held if J.size}
        self.kinds |= {len(parts), *("once" if once else "corrected" for once in steps.once)}
        return found[0] if multipliers else [states for states, _ in found[0]]


def off(one, other):
    """Largest difference, of the largest number."""
    return np.max(np.abs(one - other), initial=0.0) / np.max(np.abs(one), initial=1e-300)


def test_a_run_finds_the_same(compiled, monkeypatch):
    """The pendulum with auxiliary modes, midpoint residuals and all that goes with these."""
    both = Both(compiled, monkeypatch)
    monkeypatch.setattr(Steps, "march", lambda *given, **options: both.march(*given, **options))
    scene = floating.pendulum(8, h=1e-4, t_end=0.03)
    node = int(floating.interface(scene.fem, "tip")[0][0])
    output = romerr.node_displacement("tip", node=node, component="z")
    options = {"estimators": ("auxiliary",), "auxiliary_modes": 20, "scope": "coupled (linearised)"}
    monitor = romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.items), outputs=[output], **options)
    scene.mbs.Assemble()
    scene.mbs.SolveDynamic(scene.settings)
    monitor.report()
    # all there is: of one and of several parts, corrected or not
    assert {"force", "values", "kicks", "held", 1, 3, "once", "corrected"} <= both.kinds
    assert max(both.off) < tol.MARCHED


def random_steps(rng, k, c, S=20):
    """Steps with matrices of random numbers, every third of them to be corrected."""
    n = k + c
    moved = 0.3 * rng.standard_normal((S, n, 2 * k)) / n
    whole = np.eye(n) + 0.3 * rng.standard_normal((S, n, n)) / n
    inverses = np.linalg.inv(whole) + 1e-4 * rng.standard_normal((S, n, n)) / n
    return Steps(Scheme.of_radius(0.8), np.full(S, 1.0), moved, whole, inverses, np.arange(S) % 3 > 0)


@pytest.mark.parametrize("columns", [1, 2, 3, 4, 5, 9])
@pytest.mark.parametrize(("k", "c"), [(1, 0), (3, 1), (12, 2), (17, 4), (30, 0)])
def test_any_shape_finds_the_same(k, c, columns, compiled, monkeypatch):
    """Fewer numbers than are summed at once, and remainders of these; more columns than are."""
    rng = np.random.default_rng([k, c, columns])
    both, steps, force = Both(compiled, monkeypatch), random_steps(rng, k, c), rng.standard_normal((20, k, columns))
    held = [rng.permutation(k)[: j % (k + 1)] for j in range(columns)]
    moving, values = rng.standard_normal((4, k, columns)), rng.standard_normal((20, c, columns))
    both.march(steps, Columns(moving, force, values, tuple(rng.standard_normal((2, 20, k, columns))), held))
    both.march(steps, Columns(moving, force))
    assert max(both.off) < SAME


@pytest.mark.parametrize("kicked", [False, True])
def test_columns_that_are_equal_or_zero_find_the_same(kicked, compiled, monkeypatch):
    """They are not marched again, or not at all; those that differ in what they hold or in one number only, are."""
    rng, both = np.random.default_rng(5), Both(compiled, monkeypatch)
    steps, k, c = random_steps(rng, 12, 2), 12, 2
    like = np.array([0, -1, 0, 1, 0, -1, 2, 1, -1])  # which of three each of the columns is; -1: 0
    moving, force, values = (rng.standard_normal((*n, 4)) for n in ((4, k), (20, k), (20, c)))
    kicks = rng.standard_normal((2, 20, k, 4))
    for x in (moving, force, values, kicks):
        x[..., 3] = 0.0
    force[..., 2] = force[..., 0]
    moving[..., 2], values[..., 2], kicks[..., 2] = moving[..., 0], values[..., 0], kicks[..., 0]
    force[-1, -1, 2] += 1.0  # the last two columns that are compared differ here only
    held = [np.array([1, 4]) if j in (4, 8) else np.array([], dtype=int) for j in range(len(like))]
    given = [x[..., like] for x in (moving, force, values)]
    columns = Columns(*given, tuple(kicks[..., like]) if kicked else None, held)
    both.march(steps, columns)
    assert max(both.off) < SAME
    monkeypatch.setattr(march, "loops", compiled)
    [(found, forces)] = steps.march(columns, multipliers=True)
    for x in (found, forces):
        np.testing.assert_array_equal(x[..., 2], x[..., 0])
        np.testing.assert_array_equal(x[..., 7], x[..., 3])
        assert not x[..., [1, 5, 8]].any()
        assert np.any(x[..., 4] != x[..., 0])
        np.testing.assert_array_equal(x[:-1, ..., 6], x[:-1, ..., 0])
        assert np.any(x[-1, ..., 6] != x[-1, ..., 0])


def test_source_has_the_version_that_is_asked_for(compiled):
    """Where one of the two is forgotten, nothing is compiled for anybody."""
    assert compiled.VERSION == VERSION


@pytest.mark.parametrize("found", [{}, {"VERSION": VERSION - 1}, {"VERSION": VERSION}])
def test_loops_of_another_version_are_left_out(found, monkeypatch):
    """Those that an editable installation has from before an update lack functions, the first ones a version, too."""
    built = SimpleNamespace(march=None, **found)
    monkeypatch.setattr(exudyn_romerr.compiled, "_loops", built, raising=False)
    anew = module_from_spec(spec := find_spec("exudyn_romerr.compiled.loops"))
    spec.loader.exec_module(anew)
    assert anew.loops is (built if built == SimpleNamespace(march=None, VERSION=VERSION) else None)


def test_what_cannot_be_held_is_told(compiled, monkeypatch):
    """By both; as where the shapes are not what they are said to be, which would be read beyond the end."""
    steps = random_steps(np.random.default_rng(1), 4, 0)
    steps.inverses[7, 2] = steps.inverses[7, :, 2] = 0.0
    for one in (None, compiled):
        monkeypatch.setattr(march, "loops", one)
        with pytest.raises(np.linalg.LinAlgError, match="Singular matrix"):
            steps.march(Columns(np.ones((4, 4, 1)), held=[np.array([1, 2])]))


def test_other_shapes_are_refused(compiled, monkeypatch):
    """Nothing is read beyond the end of an array."""
    monkeypatch.setattr(march, "loops", compiled)
    steps = random_steps(np.random.default_rng(1), 4, 1)
    columns = Columns(np.ones((4, 4, 1)))
    for name in ("moved", "whole", "inverses", "once"):
        kept = getattr(steps, name)
        for wrong in (kept[:-1], kept[..., :-1].copy(), kept.astype(np.float32)):
            setattr(steps, name, wrong)
            with pytest.raises(ValueError, match=r"in place of|not a matrix of each step"):
                steps.march(columns)
        setattr(steps, name, kept)
    with pytest.raises(ValueError, match="no such column or coordinate"):
        steps.march(Columns(np.ones((4, 4, 1)), held=[np.array([4])]))


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
    """Of both layouts; those at samples to the last bit, or every step would seem to begin with a jump."""
    rng, S = np.random.default_rng([n, p]), 21
    h, samples = rng.uniform(0.5, 1.0, S), (*rng.standard_normal((3, S + 1, n)), rng.standard_normal((S + 1, p)))
    controls = None if straight else rng.standard_normal((S, 6, p))
    if not straight:
        controls[:, 0], controls[:, -1] = samples[-1][:-1], samples[-1][1:]
    plain = Coordinates(n, p, (0.3, 0.02), has_damping=False)
    packed = PackedCoordinates(Coordinates(n, 0, (0.3, 0.02), has_damping=False), rng.standard_normal((p, 2 * n)))
    for layout in (plain, packed):
        found = []
        for one in (None, compiled):
            monkeypatch.setattr(bezier, "loops", one)
            found.append(layout.between(h, samples, controls))
        assert off(*found) < SAME
        ends = layout(*samples)
        np.testing.assert_array_equal(found[1][:, 0], ends[:-1])
        np.testing.assert_array_equal(found[1][:, -1], ends[1:])


@pytest.mark.parametrize("size", [1.0, 1e-200, 1e200])
@pytest.mark.parametrize("first", [0, 3])
def test_lengths_of_polygons_are_those_of_numpy(first, size, compiled, monkeypatch):
    """With a matrix and without, also where squares vanish or overflow."""
    rng = np.random.default_rng(8)
    for S, d, k in ((1, 1, 4), (9, 5, 34), (20, 3, 13)):
        c, matrix = size * rng.standard_normal((S, d + 1, k)), np.tril(rng.standard_normal((k - first, 25)))
        for of in (matrix, None):
            found = []
            for one in (None, compiled):
                monkeypatch.setattr(blocked_products, "loops", one)
                found.append(polygon_lengths(c, of, first))
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
    of_curves = [(5,), (6, 2), (6, 2), (6, 2), (6, 3), (5, 6, 3), (3, 4), (6, 3), (5, 6, 3)]
    for call, shapes in (
        (lambda *x: compiled.curves(5, 2, 3, 0.1, 0.2, *x), of_curves),
        (lambda *x: compiled.lengths(5, 2, 4, 1, 7, *x), [(5, 3, 4), (7, 3), (5,)]),
        (lambda *x: compiled.inside(5, 4, 3, *x), [(3,), (5,), (5, 2, 3), (5, 4, 3), (5, 2, 3)]),
    ):
        right = [np.zeros(shape) for shape in shapes]
        call(*right)
        for i in range(len(right)):
            with pytest.raises(ValueError, match="in place of"):
                call(*right[:i], right[i][:-1], *right[i + 1 :])
    for wrong in ((5, 2, 4, 5, 7), (5, -1, 4, 1, 7), (-5, 2, 4, 1, 7)):
        with pytest.raises(ValueError, match="negative"):
            compiled.lengths(*wrong, np.zeros(60), np.zeros(21), np.zeros(5))
