"""The march: its states obey the equations and generalised-alpha; C and NumPy are one; blocks do not matter."""

from itertools import pairwise

import numpy as np
import pytest

from exudyn_romerr.compiled.loops import loops
from exudyn_romerr.mechanism import tangents
from exudyn_romerr.mechanism.scheme import Scheme
from exudyn_romerr.mechanism.tangents import block_of
from exudyn_romerr.mechanism_errors import factors as of_factors
from exudyn_romerr.mechanism_errors import march as module
from exudyn_romerr.mechanism_errors.factors import factors_of
from exudyn_romerr.mechanism_errors.march import March
from tests.helpers.small_mechanism import H, SmallMechanism

SCHEME = Scheme.of_radius(0.6)


def marched(mechanism, f, cuts=(), rests=False, g=None):
    """E (T, 3, n, columns) and lam (T, c, columns) of a march in pieces, with constraints C e = g."""
    g = np.zeros((len(f), 1, f.shape[2])) if g is None else g
    march, found = March(mechanism.unknowns, SCHEME), []
    whole = block_of(mechanism.rows, mechanism.unknowns, mechanism.rest)
    h = np.full(len(f), H)
    factors = factors_of(whole, h, mechanism.unknowns, SCHEME)
    found.append(march.begin(whole, f[0], rests))
    edges = [1, *cuts, len(f)]
    for a, b in pairwise(edges):
        found.append(march(whole[a:b], factors[a:b], f[a:b], g[a:b]))
    return tuple(np.concatenate(x) for x in zip(*found, strict=True))


def kicks(mechanism, columns, seed=3):
    return np.random.default_rng(seed).normal(size=(len(mechanism.rows), mechanism.unknowns.n, columns))


def left(mechanism, f, e, lam):
    """What e and lam leave of the equations of motion, and of constraints."""
    u, block = mechanism.unknowns, block_of(mechanism.rows, mechanism.unknowns, mechanism.rest)
    n, r = u.n_a, f.copy()
    for X, order in ((block.M, 2), (block.D, 1), (block.K, 0)):
        r[:, :n] -= X @ e[:, order, :n]
    r[:, :n] -= block.G.swapaxes(1, 2) @ lam
    body, at, own, w = u.bodies[0], u.blocks[0], u.waves[0], block.couplings[0]
    for X, back, order in ((w.M, w.M, 2), (w.D, w.D_back, 1), (w.K, w.K_back, 0)):
        r[:, at] -= X @ e[:, order, own]
        r[:, own] -= back.swapaxes(1, 2) @ e[:, order, at]
    for S, order in zip(block.sampled, (0, 1), strict=False):
        r[1:, :n] -= S[1:] @ e[:-1, order, :n]
    r[:, own] -= e[:, 2, own] + body.dampers[:, None] * e[:, 1, own] + body.springs[:, None] * e[:, 0, own]
    return r, block.C @ e[:, 0, :n]


@pytest.mark.parametrize("first_order", [0, 2])
@pytest.mark.parametrize("samples", [False, True])
@pytest.mark.parametrize("turns", [False, True])
def test_every_row_obeys_the_equations(turns, samples, first_order):
    mechanism = SmallMechanism(turns=turns, samples=samples, first_order=first_order)
    assert len(mechanism.rest.sampled(mechanism.rows)) == 2 * samples
    f = kicks(mechanism, 2)
    there = 1e-6 * np.random.default_rng(5).normal(size=(len(f), 1, 2))
    there[0] = 0.0
    e, lam = marched(mechanism, f, g=there)
    r, g = left(mechanism, f, e, lam)
    assert np.abs(r).max() < 1e-8 * np.abs(f).max()  # rounding of terms that are 1e5 times as large
    assert 1e-3 * np.abs(e[:, 0]).max() < np.abs(there).max()
    np.testing.assert_allclose(g, there, rtol=0, atol=1e-10 * np.abs(e[:, 0]).max())


def test_without_rotation_it_is_newmarks():
    """What is no Euler parameter: e and e' from the scheme's own accelerations."""
    mechanism = SmallMechanism(turns=False)
    e, _ = marched(mechanism, kicks(mechanism, 1))
    s, a = SCHEME, e[0, 2].copy()
    for i in range(1, len(e)):
        own = ((1 - s.alpha_f) * e[i, 2] + s.alpha_f * e[i - 1, 2] - s.alpha_m * a) / (1 - s.alpha_m)
        q = e[i - 1, 0] + H * e[i - 1, 1] + H**2 * ((0.5 - s.beta) * a + s.beta * own)
        v = e[i - 1, 1] + H * ((1 - s.gamma) * a + s.gamma * own)
        np.testing.assert_allclose(e[i, 0], q, rtol=0, atol=1e-11 * np.abs(e[:, 0]).max())
        np.testing.assert_allclose(e[i, 1], v, rtol=0, atol=1e-11 * np.abs(e[:, 1]).max())
        a = own


@pytest.mark.parametrize("radius", [0.0, 0.6, 1.0])
def test_coordinates_of_first_order_go_by_the_trapezoidal_rule(radius, monkeypatch):
    """Whatever the scheme is, as Exudyn integrates them."""
    monkeypatch.setitem(globals(), "SCHEME", Scheme.of_radius(radius))
    mechanism = SmallMechanism(first_order=2)
    e, _ = marched(mechanism, kicks(mechanism, 2), cuts=(5,))
    x, rate = (e[:, order, mechanism.unknowns.first_order] for order in (1, 2))
    assert mechanism.unknowns.first_order.stop - mechanism.unknowns.first_order.start == 2
    np.testing.assert_allclose(x[1:] - x[:-1], H / 2 * (rate[1:] + rate[:-1]), rtol=0, atol=1e-12 * np.abs(x).max())


def test_a_start_at_rest_is_the_static_answer():
    mechanism = SmallMechanism(turns=False)
    f = kicks(mechanism, 1)
    e, lam = marched(mechanism, f, rests=True)
    assert not e[0, 1:].any()
    r, g = left(mechanism, f, e, lam)
    assert np.abs(r[0]).max() < 1e-8 * np.abs(f).max()
    assert np.abs(g[0]).max() < 1e-10 * np.abs(e[0, 0]).max()


@pytest.mark.parametrize("cuts", [(2,), (4, 5, 9)])
def test_blocks_do_not_matter(cuts):
    mechanism = SmallMechanism()
    f = kicks(mechanism, 3)
    for one, two in zip(marched(mechanism, f), marched(mechanism, f, cuts), strict=True):
        np.testing.assert_array_equal(one, two)


@pytest.mark.skipif(loops is None, reason="no compiler")
@pytest.mark.parametrize("first_order", [0, 2])
@pytest.mark.parametrize(("columns", "samples"), [(1, False), (2, False), (3, False), (5, False), (3, True)])
def test_compiled_and_numpy_are_one(columns, samples, first_order, monkeypatch):
    """Also of numbers that are almost zero: nothing turns them off."""
    mechanism = SmallMechanism(samples=samples, first_order=first_order)
    f = kicks(mechanism, columns)
    f[:, :, 0] *= 1e-305
    g = 1e-6 * np.ones((len(f), 1, columns)) * f[:, :1]
    fast = marched(mechanism, f, g=g)
    for each in (module, of_factors, tangents):
        monkeypatch.setattr(each, "loops", None)
    slow = marched(mechanism, f, g=g)
    for one, two in zip(fast, slow, strict=True):
        for column in range(columns):
            scale = np.abs(two[..., column]).max()
            assert scale > 0
            off = np.abs(one[..., column] - two[..., column]).max()
            assert off <= 1e-10 * scale + 64 * np.finfo(float).smallest_subnormal


def test_a_run_that_goes_on_is_one_run():
    """Where accelerations are those of the equations anew: the scheme's own are another's, for a step or two."""
    mechanism = SmallMechanism(T=40, turns=True)
    f = np.ones_like(kicks(mechanism, 1)) * np.linspace(0, 1, 40)[:, None, None]
    e, _ = marched(mechanism, f)
    march = March(mechanism.unknowns, SCHEME)
    whole = block_of(mechanism.rows, mechanism.unknowns, mechanism.rest)
    factors = factors_of(whole, np.full(40, H), mechanism.unknowns, SCHEME)
    march.begin(whole, f[0], False)
    none = np.zeros((40, 1, 1))
    march(whole[1:21], factors[1:21], f[1:21], none[1:21])
    before, march = march.state, March(mechanism.unknowns, SCHEME)
    begun, _ = march.go_on(whole[20:], f[20], before)
    np.testing.assert_allclose(begun[0, :2], e[20, :2], rtol=0, atol=1e-12 * np.abs(e).max())
    np.testing.assert_allclose(begun[0, 2], e[20, 2], rtol=0, atol=0.05 * np.abs(e[:, 2]).max())
    on, _ = march(whole[21:], factors[21:], f[21:], none[21:])
    np.testing.assert_allclose(on[:, 0], e[21:, 0], rtol=0, atol=0.02 * np.abs(e[:, 0]).max())


@pytest.mark.skipif(loops is None, reason="no compiler")
def test_wrong_sizes_are_refused():
    mechanism = SmallMechanism()
    with pytest.raises((ValueError, TypeError)):
        loops.march_mechanism(
            (1, 2, 3, 4, 5, 0, 0), np.zeros(4), np.zeros(1, np.int64), [], (np.zeros(1),) * 12, (np.zeros(1),) * 4
        )
    with pytest.raises((ValueError, TypeError)):
        loops.flow((1, 2, 0, 1, 9, 40), (0.0, 1.0, 0.0), (np.zeros(1),) * 9, np.zeros(4), np.zeros(4))
    with pytest.raises(ValueError, match="rotations that there are not"):
        loops.step_matrices(
            (1, 2, 2), np.array([0]), [], (*[np.zeros(1)] * 2, *[np.zeros(4)] * 3, np.zeros(70)), np.zeros(4)
        )
    for row, column in ((-1, 1), (3, -1), (-2, 0)):
        with pytest.raises(ValueError, match="rows or columns"):
            loops.turn_frames(1, 6, 6, row, column, np.eye(3), np.zeros((6, 6)))
    with pytest.raises(ValueError, match="in place of"):
        loops.bordered_inverses(1, 2, 1, 0.0, np.eye(2), np.zeros(2), np.zeros(3), np.zeros((3, 3)))
    assert mechanism.unknowns.n == 6 + 7 + 3


@pytest.mark.skipif(loops is None, reason="no compiler")
@pytest.mark.parametrize("n", [1, 4, 7, 30, 149])
def test_bordered_inverses_are_lapacks(n):
    """Whatever units rows have; of panels of four rows, and what is left of these."""
    rng = np.random.default_rng(n)
    units = 10.0 ** rng.integers(-4, 4, n)
    A = rng.normal(size=(3, n, n)) * units * units[:, None]
    for c in {0, min(3, n)}:
        G, C = rng.normal(size=(2, 3, c, n)) * units
        found, wanted = of_factors.bordered_inverses(A, G, C), of_factors._bordered_inverses(A, G, C)
        scale = np.concatenate([units, np.ones(c)])
        off = np.abs(found - wanted) * scale * scale[:, None]
        assert off.max() <= 1e-10 * np.abs(wanted * scale * scale[:, None]).max()


@pytest.mark.skipif(loops is None, reason="no compiler")
def test_what_has_no_inverse_is_said():
    with pytest.raises(np.linalg.LinAlgError, match="Singular"):
        of_factors.bordered_inverses(np.ones((2, 3, 3)), np.zeros((2, 0, 3)), np.zeros((2, 0, 3)))
