"""The time-step error of linear systems from samples of a run, against runs with 32 times smaller steps."""

import numpy as np
import pytest
import scipy.linalg as la

from exudyn_romerr.estimates import time_step_error as module
from exudyn_romerr.estimates.local_errors import defects, in_the_middle, shared, within
from exudyn_romerr.estimates.march import Columns, Tangent
from exudyn_romerr.estimates.time_step_error import TimeStepError
from exudyn_romerr.estimates.track import Track
from exudyn_romerr.trajectory.estimate import PROVISIONAL
from exudyn_romerr.trajectory.scheme import Scheme
from tests.helpers import tolerances as tol

SIZE, RADIUS, FINER = 6, 0.8, 32


def system(seed, constraints, highest, damping=0.005):
    """Modes of 1 rad/s to `highest`, damped by K alone, some motions held; a load's direction."""
    rng = np.random.default_rng([seed, 18])
    X = la.inv(la.qr(rng.standard_normal((SIZE, SIZE)))[0] * np.sqrt(rng.uniform(0.5, 2, SIZE)))
    omega = np.exp(np.linspace(0, np.log(highest), SIZE))
    K, G = X.T @ np.diag(omega**2) @ X, rng.standard_normal((constraints, SIZE))
    return Tangent(0.0, X.T @ X, 2 * damping * K, K, G, G), rng.standard_normal(SIZE)


def smooth(t):
    return np.sin(2 * t) ** 4


def sudden(t):
    return np.ones_like(t)


def even(h, end):
    return np.linspace(0, end, round(end / h) + 1)


def uneven(h, end):
    steps = h * np.random.default_rng(5).uniform(0.5, 1.5, round(end / h))
    return np.append(0.0, np.cumsum(steps))


def all_steps(scheme, t, tangent):
    return [steps.kept() for _, steps in Track(scheme).steps(t[0], t[1:], np.zeros(1), lambda _: tangent)]


def run(scheme, t, tangent, force):
    """Q, v, a (3, T, SIZE) of a run from rest under forces (T, SIZE)."""
    steps = all_steps(scheme, t, tangent)
    moving = np.zeros((4, SIZE, 1))
    moving[2:] = steps[0].pushed(force[0][:, None])
    found = [moving[None]]
    for part, f in zip(steps, np.split(force[1:, :, None], np.cumsum([len(s) for s in steps])[:-1]), strict=True):
        found += part.march(Columns(found[-1][-1], f))
    return np.concatenate(found)[:, :3, :, 0].swapaxes(0, 1)


def case(made, times, load, h, end):
    """Samples t, q, v, a, and the error of q, v, a (3, T, SIZE)."""
    (tangent, b), t = made, times(h, end)
    fine = np.append(t[0], (t[:-1, None] + np.diff(t)[:, None] * np.arange(1, FINER + 1) / FINER).ravel())
    states = run(Scheme.of_radius(RADIUS), t, tangent, np.outer(load(t), b))
    truth = run(Scheme.of_radius(1.0), fine, tangent, np.outer(load(fine), b))[:, ::FINER]
    return (t, *states), states - truth


def residuals(made, load, rows):
    """What the equations leave in the middle of all steps, but for constraints."""
    (tangent, b), (t, *states) = made, rows
    q, v, a = (in_the_middle(t, x) for x in states)
    force = a @ tangent.M.T + v @ tangent.D.T + q @ tangent.K.T - np.outer(load((t[1:] + t[:-1]) / 2), b)
    N = la.null_space(tangent.G) if len(tangent.G) else np.eye(SIZE)
    return force @ N @ N.T


def estimated(made, rows, borders, load=None, values=None):
    """X and x2 (3, T, SIZE), fed in blocks that end before rows `borders`."""
    error, track = TimeStepError(SIZE), Track(Scheme.of_radius(RADIUS))
    found = error.open([x[:1] for x in rows])
    x, x2 = found.x, found.x2
    for first, end in zip([1, *borders], [*borders, len(rows[0])], strict=True):
        error.add([y[first:end] for y in rows], None if values is None else values[first:end])
        error.begin(None if load is None else residuals(made, load, error.rows)[error.first :])
        for _, steps in track.steps(rows[0][first - 1], rows[0][first:end], np.zeros(1), lambda _: made[0]):
            error.take(steps, *steps.march(error.columns(steps)))
        found = error.found()
        known = x.shape[1] - found.replaced
        x, x2 = (np.concatenate([a[:, :known], b], axis=1) for a, b in ((x, found.x), (x2, found.x2)))
    return x, x2


def off(found, truth):
    return np.max(np.abs(found - truth)) / np.max(np.abs(truth))


@pytest.mark.parametrize("times", [even, uneven])
@pytest.mark.parametrize("constraints", [0, 2])
@pytest.mark.parametrize("load", [smooth, sudden])
def test_error_of_resolved_motion(load, constraints, times):
    """To the accuracy of first order in the error, what is left being known from x2."""
    made = system(1, constraints, 5.0)
    rows, e = case(made, times, load, 0.05, 6.0)
    x, x2 = estimated(made, rows, [], load)
    assert off(x[0], e[0]) < tol.FIRST_ORDER
    assert off(x[1], e[1]) < tol.FIRST_ORDER
    assert off(x[0] - x2[0], e[0]) < tol.SECOND_ORDER


def test_error_of_the_estimate_is_of_second_order_in_the_step():
    """That of the run is, so it falls with the fourth power."""
    made = system(2, 2, 5.0)
    left = []
    for h in (0.1, 0.05, 0.025):
        rows, e = case(made, even, smooth, h, 4.0)
        left.append(off(estimated(made, rows, [], smooth)[0][0], e[0]))
    assert np.array(left[:-1]) / left[1:] == pytest.approx(4.0, rel=0.25)


@pytest.mark.parametrize("load", [smooth, sudden])
@pytest.mark.parametrize("highest", [5.0, 20.0, 160.0])
def test_x2_is_a_half_width(highest, load):
    """Of values, running maxima, over 10 seeds, constraints and steps; 160 rad/s: steps do not resolve it."""
    within = []
    for seed in range(10):
        made = system(seed, 2 * (seed % 2), highest)
        rows, e = case(made, (even, uneven)[seed // 2 % 2], load, 0.05, 3.0)
        x, x2 = estimated(made, rows, [], load)
        deviation, half = (np.maximum.accumulate(np.abs(y[0]), axis=0) for y in (x - e, x2))
        within.append(deviation[PROVISIONAL:] <= 2 * half[PROVISIONAL:])
    assert np.mean(within) > 0.97


def test_steps_of_one_size_share_what_rings(monkeypatch):
    """Where steps do not resolve the ringing, sharing keeps rates from being worse than no estimate."""
    made = system(3, 0, 160.0, damping=0.0005)
    rows, e = case(made, even, sudden, 0.05, 3.0)
    x = estimated(made, rows, [])[0]
    monkeypatch.setattr(module, "shared", lambda h, d: d)
    alone = estimated(made, rows, [])[0]
    assert off(x[2], e[2]) < 0.7 * off(alone[2], e[2])


@pytest.mark.parametrize("times", [even, uneven])
@pytest.mark.parametrize("borders", [[2], [5, 6, 7, 30], list(range(2, 61)), [4, 8, 12, 40]])
def test_blocks_are_one(borders, times):
    made = system(4, 2, 20.0)
    rows, _ = case(made, times, smooth, 0.05, 3.0)
    for found, whole in zip(estimated(made, rows, borders, smooth), estimated(made, rows, [], smooth), strict=True):
        assert off(found, whole) < tol.MARCHED


def test_values_that_are_replaced_are_the_last_ones():
    """What is final does not depend on what follows."""
    made = system(4, 2, 20.0)
    rows, _ = case(made, uneven, smooth, 0.05, 3.0)
    part, whole = (estimated(made, [y[:end] for y in rows], [], smooth) for end in (40, 61))
    for found, wanted in zip(part, whole, strict=True):
        assert off(found[:, : 40 - PROVISIONAL], wanted[:, : 40 - PROVISIONAL]) < tol.MARCHED
        assert off(found[:, :40], wanted[:, :40]) > tol.MARCHED


def test_a_run_that_goes_on():
    """It opens with what the run before ended with; ends of series cost little."""
    made = system(1, 2, 5.0)
    rows, e = case(made, even, sudden, 0.05, 6.0)
    error, track, found = TimeStepError(SIZE), Track(Scheme.of_radius(RADIUS)), []
    for part in (slice(0, 61), slice(60, 121)):
        own = [y[part] for y in rows]
        opened = error.open([y[:1] for y in own])
        assert opened.replaced == 0
        error.add([y[1:] for y in own])
        error.begin()
        for _, steps in track.steps(own[0][0], own[0][1:], np.zeros(1), lambda _: made[0]):
            error.take(steps, *steps.march(error.columns(steps)))
        found.append((opened, error.found()))
    assert np.array_equal(found[1][0].x[:, 0], found[0][1].x[:, -1])
    assert off(found[1][1].x[0], e[0, 61:]) < tol.FIRST_ORDER


def test_constraints_that_drift():
    """Positions that the solver has let drift are known to be wrong by that: C e = g."""
    made = system(1, 2, 5.0)
    rows, _ = case(made, even, smooth, 0.05, 3.0)
    drift = 1e-3 * np.outer(rows[0], [1.0, -2.0])
    x, _ = estimated(made, rows, [7], smooth, values=drift)
    np.testing.assert_allclose(x[0, 1:] @ made[0].C.T, drift[1:], atol=tol.MARCHED * np.abs(drift).max())


def test_loads_between_samples_count():
    """Of a load that is sampled five times a period; without its residuals the estimate is no better than none."""
    made = system(1, 0, 3.0)

    def fast(t):
        return np.sin(20.0 * t) ** 2

    rows, e = case(made, even, fast, 0.03, 3.0)
    with_r, without = (estimated(made, rows, [], load)[0] for load in (fast, None))
    assert off(with_r[0], e[0]) < 0.25  # loads at samples are means of two steps: 30 % less at 1.2 rad a step
    assert off(without[0], e[0]) > 1.0


def test_local_errors_of_polynomials():
    """Degree 4 of q is integrated exactly, its a is a parabola; the cubic of the samples is one of degree 3."""
    t = np.array([0.0, 0.3, 0.5, 0.9, 1.4, 1.5])
    powers = np.arange(5)
    q = t[:, None] ** powers
    v = powers * t[:, None] ** np.maximum(powers - 1, 0)
    a = powers * (powers - 1) * t[:, None] ** np.maximum(powers - 2, 0)
    for found in defects(t, q, v, a):
        np.testing.assert_allclose(found, 0.0, atol=tol.ENTRIES * 10)
    for share in (0.25, 0.5):
        inside = t[:-1] + share * np.diff(t)
        np.testing.assert_allclose(within(t, [q[:, :4]], share)[0], inside[:, None] ** powers[:4], atol=1e-13)
        np.testing.assert_allclose(within(t[:3], [q[:3, :3]], share)[0], inside[:2, None] ** powers[:3], atol=1e-13)
        some = np.array([len(t) - 2, 0, 3])
        np.testing.assert_array_equal(within(t, [q], share, some)[0], within(t, [q], share)[0][some])


def test_local_errors_of_a_step_fifth_degree():
    """Of t^5: q is off by h^5/30 of the Hermite rule's remainder, sign and size."""
    h = 0.1
    t = h * np.arange(5)
    dq, dv = defects(t, t**5, 5 * t**4, 20 * t**3)
    assert dq == pytest.approx(np.full(4, h**5 / 6), rel=1e-9)
    np.testing.assert_allclose(dv, 0.0, atol=1e-15)


def test_shared_local_errors_keep_their_sum_and_their_mean():
    d, h = np.array([1.0, -1.0, 1.0, -1.0, 1.0, 5.0, 5.0]), np.array([1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0])
    assert shared(h, d) == pytest.approx([0.5, 0.0, 0.0, 0.0, 0.5, 5.0, 5.0])
