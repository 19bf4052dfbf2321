"""The step error by the exact flow: exact where loads are cubic in time; series and matrix exponentials are one."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as la

from exudyn_romerr.compiled.loops import loops
from exudyn_romerr.mechanism.rows import Rows
from exudyn_romerr.mechanism.unknowns import Unknowns
from exudyn_romerr.mechanism_errors import flow as module
from exudyn_romerr.mechanism_errors.flow import Flow, Series
from exudyn_romerr.mechanism_errors.reduced_system import ReducedSystem

M, D, K = np.diag([1.0, 2.0]), np.diag([0.2, 0.1]), np.array([[30.0, -10.0], [-10.0, 20.0]])
H, T = 0.1, 40


class NoLoads:
    """Nothing is known between samples, and nobody asks."""

    is_shifting = False


def load(t):
    return np.array([1.0 + t - t**2, 0.3 * t**3])


def trapezoidal():
    """Rows of the trapezoidal rule under the load."""
    q, v = np.zeros(2), np.array([0.3, 0.0])
    a = np.linalg.solve(M, load(0.0) - D @ v - K @ q)
    rows = [(0.0, q, v, a)]
    for i in range(1, T):
        t = H * i
        left = load(t) - D @ (v + H / 2 * a) - K @ (q + H * v + H**2 / 4 * a)
        new = np.linalg.solve(M + H / 2 * D + H**2 / 4 * K, left)
        q, v, a = q + H * v + H**2 / 4 * (a + new), v + H / 2 * (a + new), new
        rows.append((t, q, v, a))
    return Rows(*(np.array(x) for x in zip(*rows, strict=True)), np.zeros((T, 0)))


def exact():
    """Q (T, 2) by one matrix exponential a step, the load as a cubic, in closed form."""
    A = np.zeros((12, 12))
    A[:2, 2:4], A[2:4, :2], A[2:4, 2:4] = np.eye(2), -np.linalg.solve(M, K), -np.linalg.solve(M, D)
    A[2:4, 4:] = np.linalg.solve(M, np.array([[1.0, 1, -1, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 0, 0.3]]))
    for k in range(3):  # powers of t: (t^k)' = k t^(k - 1); 4..7 of the first, 8..11 of the second
        for first in (4, 8):
            A[first + k + 1, first + k] = k + 1.0
    x = np.zeros(12)
    x[2], x[4], x[8] = 0.3, 1.0, 1.0
    E, found = la.expm(H * A), [x]
    for _ in range(T - 1):
        found.append(E @ found[-1])
    return np.array(found)[:, :4]


def flowed(rows):
    u = Unknowns([], [(np.arange(2), None)], 2)
    flow = Flow(u, np.zeros(0, int), 0, NoLoads(), None)
    whole = ReducedSystem(*(np.tile(x, (T, 1, 1)) for x in (M, D, K)), np.zeros((T, 0, 2)), np.zeros((T, 0, 2)))
    return flow, flow(rows, whole, 0, T)[0]


def test_the_error_of_steps_is_exact_where_loads_are_cubic():
    rows, truth = trapezoidal(), exact()
    _, e = flowed(rows)
    size = np.abs(rows.q - truth[:, :2]).max()
    assert size > 0.01
    np.testing.assert_allclose(e[:, 0, :, 0], rows.q - truth[:, :2], rtol=0, atol=1e-9 * size)
    np.testing.assert_allclose(e[:, 1, :, 0], rows.v - truth[:, 2:], rtol=0, atol=1e-8 * size)


def test_linear_loads_are_a_worse_second_opinion():
    rows, truth = trapezoidal(), exact()
    _, e = flowed(rows)
    off = np.abs(e[:, 0] - (rows.q - truth[:, :2])[..., None]).max(axis=(0, 1))
    assert off[1] > 1e3 * off[0]


@pytest.mark.skipif(loops is None, reason="no compiler")
def test_series_and_exponentials_are_one(monkeypatch):
    rows = trapezoidal()
    one, fast = flowed(rows)
    monkeypatch.setattr(module, "loops", None)
    _, slow = flowed(rows)
    np.testing.assert_allclose(fast, slow, rtol=0, atol=1e-12 * np.abs(slow).max())
    omega = np.sqrt(la.eigh(K, M)[0].max())
    assert one.fastest == pytest.approx(H * omega, rel=0.05)  # to what the dampers change


SPECTRA = {
    "nothing": [0.0],
    "rings": [8.0j, 0.3j],
    "rings fast": [150.0j, -0.1 + 20.0j],
    "damped by its stiffness": [-53.0, -42.0, -15.0 + 8.4j, -3.0 + 7.1j, -0.2 + 2.0j],
    "far overdamped": [-400.0, 50.0j],
    "grows a little": [0.3 + 1.0j, -20.0],
}


@pytest.mark.parametrize("name", SPECTRA)
def test_the_series_is_the_exponential_for_all_that_is_in_its_ellipse(name):
    values = np.array(SPECTRA[name], complex)
    values = np.concatenate([values, values.conj()])
    series = Series.of(values)
    assert len(series.factors) < 30 + 1.7 * np.abs(values).max()
    x = np.concatenate([values, 0.5 * values, [0.0]])
    z = (x - series.centre) / series.gamma
    f, now = [np.ones_like(x), z], z * z - 2 * series.r / series.gamma
    while len(f) < len(series.factors):
        f.append(now)
        now = z * now - series.r / series.gamma * f[-2]
    np.testing.assert_allclose(
        np.tensordot(series.factors, f[: len(series.factors)], 1), np.exp(x), rtol=0, atol=1e-12
    )


def test_what_no_narrow_ellipse_holds_has_no_series():
    """Seed 40 of the random mechanisms: some modes are damped to nothing in a step, others ring as fast undamped."""
    assert Series.of(np.array([-296.0, 0.01, 210.0j, -210.0j])) is None
    assert Series.of(np.array([1e9j, -1e9j])) is None
    assert Series.of(np.array([800.0, -800.0])) is None


@pytest.mark.skipif(loops is None, reason="no compiler")
def test_what_is_faster_than_the_series_is_found(monkeypatch):
    """Eigenvalues are those of a few steps of a block: others are told by matrix exponentials."""
    rows, of = trapezoidal(), Series.of
    _, wanted = flowed(rows)
    monkeypatch.setattr(Series, "of", lambda values: of(0.01 * values))
    monkeypatch.setattr(module, "ABOVE", 1.0)
    _, found = flowed(rows)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.skipif(loops is None, reason="no compiler")
def test_terms_that_overflow_have_not_converged():
    """Of a step a hundred times as fast as the ellipse of 160 terms: 1e320."""
    none, one = np.zeros((1, 0, 1)), np.ones((1, 2))
    frozen = SimpleNamespace(A=np.array([[[-1e8, 0.0]]]), C=none, C1=none, W=np.zeros((1, 1, 0)))
    series = Series.of(np.array([100.0j, -100.0j]))
    assert module.by_series(np.zeros((1, 2)), one, one, np.ones(1), frozen, np.zeros((1, 1, 0, 1)), series) is None


def test_what_a_run_begins_with_is_carried_on():
    """Errors of two halves of a run are those of the whole."""
    rows = trapezoidal()
    _, whole = flowed(rows)
    u, half = Unknowns([], [(np.arange(2), None)], 2), T // 2
    system = ReducedSystem(*(np.tile(x, (T, 1, 1)) for x in (M, D, K)), np.zeros((T, 0, 2)), np.zeros((T, 0, 2)))
    first = Flow(u, np.zeros(0, int), 0, NoLoads(), None)
    first(rows[: half + 1], system[: half + 1], 0, half + 1)
    second = Flow(u, np.zeros(0, int), 0, NoLoads(), first.e)
    e, _ = second(rows[half:], system[half:], 0, T - half)
    np.testing.assert_allclose(e[:, 0, :, 0], whole[half:, 0, :, 0], rtol=0, atol=1e-4 * np.abs(whole[:, 0]).max())
    np.testing.assert_array_equal(e[0, 0, :, 0], first.e[0, :2])
