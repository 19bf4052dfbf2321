"""Feedback: generalised-alpha with constraints against exact motions, and bounds of mechanisms by way of it."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from unittest import mock

import numpy as np
import pytest
import scipy.linalg as la
from scipy.integrate import solve_ivp

from exudyn_romerr import AssumptionError
from exudyn_romerr.basis.enrichment import Enrichment
from exudyn_romerr.estimates import track as module
from exudyn_romerr.estimates.march import Columns, Tangent
from exudyn_romerr.estimates.mechanism_feedback import Feedback
from exudyn_romerr.trajectory.estimate import LINEARISED
from exudyn_romerr.trajectory.scheme import Scheme
from tests.helpers import tolerances as tol
from tests.mbs.mechanism.test_mechanism_energy import Reduced, norms, scenario, violations

SIZE, END = 6, 4.0


def scheme(radius):
    """Chung and Hulbert's parameters of a spectral radius."""
    alpha_m, alpha_f = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    gamma = 0.5 + alpha_f - alpha_m
    return Scheme(alpha_m, alpha_f, (gamma + 0.5) ** 2 / 4, gamma)


def tangents(seed, count, constraints, changing=0.3):
    """`count` tangents in [0, END] with K and D that change, M and G that do not; frequencies of 2 to 5 rad/s."""
    rng = np.random.default_rng([seed, 31])
    G, (A, B, C) = rng.standard_normal((constraints, SIZE)), rng.standard_normal((3, SIZE, SIZE))
    turns = [changing * np.sin(2 * t) * (B - B.T) + C for t in np.linspace(0, END, count)]
    M, t = np.eye(SIZE) + 0.1 * A @ A.T, np.linspace(0, END, max(count, 2))
    return [Tangent(t[i], M, 0.1 * T, 4 * np.eye(SIZE) + T @ T.T, G, G) for i, T in enumerate(turns)]


def forces(t):
    return np.cos(np.multiply.outer(t, np.linspace(0.5, 2.0, SIZE)))


def grid(steps):
    return np.linspace(0, END, steps + 1)


def solved(made, t, radius=0.8, parts=()):
    """E, e', e'' (3, T, SIZE) and the speed (T,) at times t; advanced in parts."""
    feedback, times = Feedback(scheme(radius)), np.array([tangent.t for tangent in made])
    feedback.start(made[0], forces(t[0]))
    found, speed = [feedback.state[:, None]], [np.zeros(1)]
    for part in np.split(np.arange(1, len(t)), parts):
        first = np.searchsorted(times, t[part[0] - 1], side="right") - 1
        e, v = feedback.advance(t[part], forces(t[part]), times[first:], lambda j, first=first: made[first + j])
        found.append(e)
        speed.append(v)
    return np.concatenate(found, axis=1), np.concatenate(speed)


def exact(made, t):
    """E, e' (2, T, SIZE) in the null space of G, matrices linear between tangents, by a Runge-Kutta method."""
    N = la.null_space(made[0].G) if len(made[0].G) else np.eye(SIZE)
    seen = np.array([[N.T @ A @ N for A in (m.M, m.D, m.K)] for m in made])
    times = [m.t for m in made]
    ends = times if len(made) > 1 else [0.0, END]

    def rates(now, y):
        i = int(np.clip(np.searchsorted(times, now) - 1, 0, max(len(made) - 2, 0)))
        change = (now - times[i]) * (seen[i + 1] - seen[i]) / (times[i + 1] - times[i]) if len(made) > 1 else 0.0
        (M, D, K), (x, v) = seen[i] + change, np.split(y, 2)
        return np.concatenate([v, la.solve(M, N.T @ forces(now) - D @ v - K @ x)])

    states = [np.zeros((2 * N.shape[1], 1))]
    for first, last in pairwise(ends):  # kinks at the tangents
        ask = np.append(t[(t > first) & (t < last)], last)
        run = solve_ivp(rates, (first, last), states[-1][:, -1], "DOP853", ask, rtol=1e-11, atol=1e-12)
        states.append(run.y)
    x, v = np.split(np.hstack(states).T, 2, axis=1)
    return np.array([x @ N.T, v @ N.T])


def off(found, wanted):
    return np.max(np.abs(found - wanted)) / np.max(np.abs(wanted))


@pytest.mark.parametrize("radius", [0.6, 0.9, 1.0])
@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize("constraints", [0, 1, 3])
def test_second_order_of_exact_motions(constraints, count, radius):
    """In the null space of G, matrices constant or linear in time between tangents."""
    made = tangents(constraints, count, constraints)
    errors = []
    for steps in (160, 320, 640):
        t = grid(steps)
        e, wanted = solved(made, t, radius)[0], exact(made, t)
        assert np.abs(e[0] @ made[0].G.T).max(initial=0.0) < tol.ENTRIES * np.abs(e[0]).max()
        errors.append([off(e[0], wanted[0]), off(e[1], wanted[1])])
    assert np.all(np.array(errors[-1]) < tol.SMALL_STEPS)
    assert np.array(errors[0]) / errors[1] == pytest.approx(4 * np.ones(2), rel=0.2)
    assert np.array(errors[1]) / errors[2] == pytest.approx(4 * np.ones(2), rel=0.1)


def test_modes_without_damping_in_closed_form():
    """Of mass one: x'' + W^2 x = a cos(w t): x = a (cos(w t) - cos(W t)) / (W^2 - w^2)."""
    made = [replace(tangents(4, 1, 0)[0], D=np.zeros((SIZE, SIZE)))]
    squares, modes = la.eigh(made[0].K, made[0].M)
    t, W, w = grid(1000), np.sqrt(squares), np.linspace(0.5, 2.0, SIZE)
    waves = np.cos(np.outer(t, w))[:, None] - np.cos(np.outer(t, W))[:, :, None]
    x = np.sum(modes.T * waves / (squares[:, None] - w**2), axis=2)
    assert off(solved(made, t)[0][0], x @ modes.T) < tol.SMALL_STEPS


@pytest.mark.parametrize("constraints", [0, 2])
def test_uneven_steps(constraints):
    made, rng = tangents(constraints, 5, constraints), np.random.default_rng(9)
    t = np.unique(np.concatenate([END * rng.beta(1, 1, 700), grid(4)]))
    halved = np.unique(np.concatenate([t, (t[1:] + t[:-1]) / 2]))
    coarse, fine = (off(solved(made, x)[0][:2], exact(made, x)) for x in (t, halved))
    assert fine < tol.SMALL_STEPS
    assert coarse / fine == pytest.approx(4, rel=0.3)


@pytest.mark.parametrize("changing", [0.0, 0.3, 10.0, 300.0, 1e5])
@pytest.mark.parametrize("constraints", [0, 2])
def test_interpolated_inverses_are_solves(constraints, changing, monkeypatch):
    """In as many pieces as it takes: between tangents, beside them, where matrices change little."""
    made, results, counts = tangents(6, 5, constraints, changing), {}, {}
    inverted = mock.Mock(wraps=np.linalg.inv)
    monkeypatch.setattr(np.linalg, "inv", inverted)
    for many in (module.INTERPOLATED_FROM, 10**9):
        monkeypatch.setattr(module, "INTERPOLATED_FROM", many)
        inverted.reset_mock()
        results[many], counts[many] = solved(made, grid(400))[0], inverted.call_count
    few, many = results
    assert counts[few] == 9 if changing <= 0.3 else 9 < counts[few] < counts[many]  # tangents are five
    assert off(results[few], results[many]) < tol.INTERPOLATED


def test_few_steps_between_tangents_or_many():
    """Tangents on the lines between others change nothing."""
    made = tangents(7, 5, 2)
    times = grid(200)
    close = []
    for t in times:
        i = min(int(np.searchsorted([m.t for m in made], t, side="right")) - 1, 3)
        share = (t - made[i].t) / (made[i + 1].t - made[i].t)
        parts = ((1 - share) * getattr(made[i], x) + share * getattr(made[i + 1], x) for x in "MDK")
        close.append(Tangent(t, *parts, made[0].G, made[0].C))
    assert off(solved(close, grid(400))[0], solved(made, grid(400))[0]) < tol.INTERPOLATED


@pytest.mark.parametrize("parts", [(1,), (7, 100, 101, 250), range(1, 400)])
def test_several_calls_are_one(parts):
    made = tangents(8, 5, 2)
    once, often = (solved(made, grid(400), parts=x) for x in ((), parts))
    for x, y in zip(once, often, strict=True):
        assert off(y, x) < tol.INTERPOLATED


@pytest.mark.parametrize("forces_turn", [True, False])
def test_constraints_that_turn_hold_at_every_step(forces_turn):
    """Whether or not their forces, G^T l, turn with them; up to what interpolated inverses leave."""
    made = [replace(m, C=m.G + np.sin(m.t) * np.roll(m.G, 1, axis=1)) for m in tangents(12, 5, 2)]
    made = [replace(m, G=m.C) for m in made] if forces_turn else made
    times, t = [m.t for m in made], grid(400)
    C = [[np.interp(t, times, x) for x in row] for row in np.moveaxis([m.C for m in made], 0, -1)]
    e = solved(made, t)[0][0]
    assert np.abs(np.einsum("ckt,tk->tc", C, e)).max() < module.INVERSE_ERROR**2 * np.abs(e).max()


def test_speed_is_the_root_of_twice_the_kinetic_energy():
    made = tangents(9, 5, 2)
    e, speed = solved(made, grid(100))
    assert speed[1:] == pytest.approx(norms(made[0].M, e[1])[1:], rel=tol.ENTRIES)


def test_a_start_in_equilibrium_stays_there():
    """Of a constant force, which is that of before."""
    made, force = tangents(10, 1, 2)[0], np.arange(1.0, 1 + SIZE)
    feedback, t = Feedback(scheme(0.8)), grid(50)[1:]
    feedback.start(made, force, force)
    e, speed = feedback.advance(t, np.tile(force, (50, 1)), np.zeros(1), lambda j: made)
    N = la.null_space(made.G)
    assert e[0] == pytest.approx(np.tile(N @ la.solve(N.T @ made.K @ N, N.T @ force), (50, 1)), rel=tol.CLOSED_FORM)
    assert speed.max() < tol.CLOSED_FORM


def held(tangent, G):
    """The same with other constraints."""
    return replace(tangent, G=G, C=G)


def changed(name):
    """A tangent whose equations are singular."""
    good = tangents(11, 1, 2)[0]
    light = np.diag([1.0] * (SIZE - 1) + [0.0])
    return {
        "twice": held(good, good.G[[0, 0, 1]]),
        "empty": held(good, 0 * good.G),
        "too many": held(good, np.vstack([np.eye(SIZE), np.ones(SIZE)])),
        "massless": held(replace(good, M=light, D=0 * good.D, K=light), good.G[:0]),
    }[name]


@pytest.mark.parametrize("name", ["twice", "empty", "too many", "massless"])
def test_singular_equations_are_said(name):
    """At the start; and where they become so later, with interpolated inverses and without."""
    bad, good = changed(name), tangents(11, 1, 2)[0]
    with pytest.raises(AssumptionError, match="linearised equations of the mechanism are singular"):
        solved([bad], grid(10))
    for steps in (2, 50) if name in ("empty", "massless") else ():
        feedback = Feedback(scheme(0.8))
        feedback.start(good, forces(0.0))
        t = grid(steps)[1:]
        with pytest.raises(AssumptionError, match="scope='inputs frozen'"):
            feedback.advance(t, forces(t), np.zeros(1), lambda j: bad)


def enriched(part, m):
    """Modes of a body and the vectors beside them."""
    space, V = part.body.space, part.V
    columns = space.loads(part.matrices[0] @ part.Rg), space.loads(part.B), part.wrenches
    return np.hstack([V, space.expand(Enrichment(part.body, space.coordinates("V", V), *columns, m).P)])


@cache
def corrected(seed, m, share=1.0):
    """Scenario.compared of the reduced mechanism; bounds with m vectors a body, told a share of what they add."""
    case = scenario(seed, static=True)
    whole, alone = Reduced(case, [enriched(part, m) for part in case.parts]), case.reduced
    du, added = whole.u - alone.u, []
    speed = share * norms(case.matrices[0][0], du[1])
    for more, less in zip(whole.samples, alone.samples, strict=True):
        q, q_t = (
            x - np.pad(y, [(0, 0), (0, x.shape[1] - y.shape[1])]) for x, y in zip(more[1:3], less[1:3], strict=True)
        )
        added.append((share * q, share * q_t, speed))
    return list(case.compared(case.error(whole.R) + du, whole.bounds(added=added)))


@pytest.mark.parametrize("m", [0, 3, 8, 100])
@pytest.mark.parametrize("seed", range(12))
def test_errors_stay_below_bounds_by_way_of_enriched_trajectories(seed, m):
    """Of the reduced mechanism; vectors added exactly."""
    assert not violations(corrected(seed, m))


@pytest.mark.parametrize("seed", range(12))
def test_all_vectors_leave_the_known_error(seed):
    """And what linearised equations may miss of it, at any time a share of the largest so far."""
    for name, error, bound, size in corrected(seed, 100):
        if not name.startswith("corrected"):
            assert np.max(bound) < tol.ALL_VECTORS * np.max(error)
        if name in "yv":
            missed = LINEARISED * np.maximum.accumulate(error)
            assert np.all(bound >= error + missed - tol.COUPLED * np.max(np.abs(size)))


@pytest.mark.parametrize("seed", range(0, 12, 3))
def test_forgetting_a_part_of_what_is_added_is_noticed(seed):
    found = violations(corrected(seed, 100, share=0.9))
    assert {"position", "velocity", "y", "v", "corrected y", "corrected v"} <= set(found)


def test_columns_are_marches_of_their_own():
    """Forces, values of constraints, kicks: the march is linear in each, and columns do not touch one another."""
    made, t, rng = tangents(9, 5, 2), grid(60), np.random.default_rng(9)
    times = np.array([tangent.t for tangent in made])
    moving, force = rng.standard_normal((4, SIZE, 3)), rng.standard_normal((60, SIZE, 3))
    values, kicks = rng.standard_normal((60, 2, 3)), rng.standard_normal((2, 60, SIZE, 3))
    marched, alone, together = [], [], []
    last, lasts = moving, [moving[..., j : j + 1] for j in range(3)]
    first = 0
    for part, steps in module.Track(scheme(0.8)).steps(t[0], t[1:], times, made.__getitem__):
        assert part.start == first
        first = part.stop
        marched += steps.march(Columns(last, force[part], values[part], kicks[:, part]))
        apart = [
            Columns(x, force[part, :, j], values[part, :, j], kicks[:, part, :, j])
            for x, j in zip(lasts, map(slice, range(3), range(1, 4)), strict=True)
        ]
        alone.append([steps.march(columns)[0] for columns in apart])
        together.append(steps.march(*apart))
        lasts = [x[-1] for x in alone[-1]]
        last = marched[-1][-1]
    assert first == 60
    marched = np.concatenate(marched)
    alone, together = (np.concatenate([np.concatenate(x, axis=-1) for x in of]) for of in (alone, together))
    assert off(marched, alone) < tol.MARCHED
    assert off(together, alone) < tol.MARCHED
    assert off(np.einsum("ck,skj->scj", made[0].C, marched[:, 0]), values) < tol.MARCHED
