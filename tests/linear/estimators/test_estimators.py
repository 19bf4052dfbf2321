"""Parts of the total bounds one by one: oscillators, Bezier curves, forgetting rates, auxiliary modes, reports."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from numpy.polynomial import polynomial as poly

from exudyn_romerr import AssumptionError, Basis, ElasticBody, Output, Trajectory, evaluate, modal_basis
from exudyn_romerr.linalg.bezier import DEGREE, hermite_controls, subdivided
from exudyn_romerr.linalg.eigenmodes import check_no_mode_missed
from exudyn_romerr.linalg.modal_oscillators import ModalOscillators
from exudyn_romerr.linear.residual.decay_rates import body_rates
from exudyn_romerr.linear.residual.modal_split import above
from exudyn_romerr.linear.residual.problem import BoundOptions, Problem
from tests.helpers import tolerances as tol
from tests.helpers.bodies import DAMPINGS, model
from tests.helpers.total_truth import Exact, bezier_curve, oscillator_step, piecewise_linear, signal

MODAL = [d for d in DAMPINGS if d not in ("matrix", "gyroscopic")]
RNG = np.random.default_rng(4)


@pytest.mark.parametrize(
    ("wh", "zeta"), [(0.3, 0.0), (0.3, 1.0), (2.0, 1e3), (500.0, 0.0), (500.0, 0.4), (1e-6, 0.1)]
)
@pytest.mark.parametrize("degree", [1, 5])
def test_oscillators_against_the_matrix_exponential(degree, wh, zeta):
    """Undamped, critical, overdamped, stiff, nearly rigid; control points of degree 1 and 5."""
    h, steps = 0.01, 6
    F = RNG.standard_normal((steps, degree + 1, 1))
    state = np.array([[0.3], [0.2 * wh / h]])
    oscillator = ModalOscillators(np.array([wh / h]), np.array([float(zeta)]))
    found = oscillator.advance(state, h * np.arange(1, 7), np.full(6, h), F)
    x, scale = state[:, 0], np.abs(found[:, :, 0]).max(axis=0) + np.abs(state[:, 0])
    for k in range(steps):
        x = oscillator_step(wh / h, zeta, h, F[k, :, 0], x)
        # six exponentials of matrices of norm w h (1 + zeta), each losing 1e-14 of that
        assert np.max(np.abs(found[k, :, 0] - x) / scale) < 1e-13 * (1 + wh * (1 + zeta))


@pytest.mark.parametrize("degree", [1, 5])
def test_oscillators_take_variable_steps_as_constant_ones(degree):
    """Unequal steps are solved one by one: the same as the scan, where they are split or a little unequal."""
    omega, zeta, h = np.array([1.0, 30.0, 4e3]), np.array([0.0, 1.0, 3.0]), 0.02
    F, state = RNG.standard_normal((40, degree + 1, 3)), RNG.standard_normal((2, 3))
    t = h * np.arange(1, 41)
    equal = ModalOscillators(omega, zeta).advance(state, t, np.full(40, h), F)
    uneven = np.full(40, h)
    uneven[0] *= 1 + 1e-9  # above the rounding of t: one by one
    assert np.max(np.abs(ModalOscillators(omega, zeta).advance(state, t, uneven, F) - equal)) < 1e-7
    parts = ((0.0, 0.5), (0.5, 1.0))
    halves = np.concatenate([subdivided(_raised(F), np.full(40, a), np.full(40, b)) for a, b in parts])
    order = np.ravel(np.column_stack([np.arange(40), 40 + np.arange(40)]))
    ends = h / 2 * np.arange(1, 81)
    split = ModalOscillators(omega, zeta).advance(state, ends, np.full(80, h / 2), halves[order])
    assert np.max(np.abs(split[1::2] - equal)) < 1e-11 * np.max(np.abs(equal))


def _raised(c):
    for d in range(c.shape[1], DEGREE + 1):
        share = (np.arange(1, d) / d)[:, None]
        c = np.concatenate([c[:, :1], share * c[:, :-1] + (1 - share) * c[:, 1:], c[:, -1:]], axis=1)
    return c


def test_hermite_reproduces_polynomials_of_degree_5():
    """Position, velocity and acceleration, at uneven steps; parts of the curves too."""
    a, t = RNG.standard_normal((DEGREE + 1, 3)), np.array([0.0, 0.3, 0.35, 1.0])
    states = [poly.polyval(t, poly.polyder(a, k)).T for k in range(3)]
    lo, hi = np.array([0.0, 0.2, 0.7]), np.array([0.5, 0.3, 1.0])
    s = np.linspace(0, 1, 9)
    for k, controls in enumerate(hermite_controls(np.diff(t), *states)):
        for i, part in enumerate(subdivided(controls, lo, hi)):
            h = t[i + 1] - t[i]
            wanted = poly.polyval(t[i] + h * (lo[i] + (hi[i] - lo[i]) * s), poly.polyder(a, k)).T
            assert np.max(np.abs(bezier_curve(part, s) - wanted)) < 1e-11


def test_hermite_is_continuous_to_the_last_bit():
    """First and last control points are the samples themselves: R has no jump between steps."""
    states = RNG.standard_normal((3, 20, 4)) * np.array([1.0, 1e3, 1e7])[:, None, None]
    for controls, x in zip(hermite_controls(RNG.uniform(0.1, 1, 19), *states), states, strict=True):
        np.testing.assert_array_equal(controls[:, 0], x[:-1])
        np.testing.assert_array_equal(controls[:, -1], x[1:])


@pytest.mark.parametrize("damping", MODAL)
@pytest.mark.parametrize("kind", ["chain", "pencil", "beam"])
def test_forgetting_rates_are_admissible(kind, damping):
    """D - 2 r M >= 0 and K_r > 0; c, per_mass, velocity are what follows, by dense eigenvalues."""
    full = model(kind, damping, 2)
    D, rates = full.D, body_rates(full.body)
    assert rates[0].r == 0
    assert len(rates) > 1 or damping == "none"
    for rate in rates:
        K_r = full.K - rate.r * D + rate.r**2 * full.M
        left = la.eigvalsh(D - 2 * rate.r * full.M, full.M)
        assert left[0] > -1e-9 * max(left[-1], 1)
        lowest = la.eigvalsh(K_r, full.M)[0]
        assert lowest > 0
        assert np.sqrt(la.eigvalsh(full.K, K_r)[-1]) <= rate.c * (1 + tol.ROOT)
        assert 1 / np.sqrt(lowest) <= rate.per_mass * (1 + tol.ROOT)
        assert np.sqrt(1 + rate.r**2 / lowest) <= rate.velocity * (1 + tol.ROOT)


@pytest.mark.parametrize("m", [1, 4, 10])
def test_split_leaves_the_modes_above(m):
    """|C|_rest and |R_rest| against sums over the modes above m; nothing is left above all of them."""
    full = model("chain", "under", 3)
    omega, shapes = full.modes
    C, B, V = RNG.standard_normal((2, full.N)), RNG.standard_normal((full.N, 1)), RNG.standard_normal((full.N, 3))
    problem = Problem(full.body, Basis(V), BoundOptions(inputs=B, outputs=[Output("y", C)], auxiliary_modes=m))
    split, higher = problem.split, slice(m, None)
    rows = above(problem.rows, split.modes)
    size = problem.rows.C_K.max()
    assert np.max(np.abs(rows.C_K - la.norm(C @ shapes[:, higher] / omega[higher], axis=1))) < 1e-12 * size
    assert np.max(np.abs(rows.C_M - la.norm(C @ shapes[:, higher], axis=1))) < 1e-11 * problem.rows.C_M.max()
    z = RNG.standard_normal((5, problem.map.coordinates.k))
    rest = z @ problem.map.L.T @ shapes[:, higher]
    for norm, weight in ((split.norm_K, omega[higher]), (split.norm_static, omega[higher] ** 2), (split.norm_M, 1.0)):
        assert np.max(np.abs(norm(z) - la.norm(rest / weight, axis=1))) < 1e-11 * np.max(
            norm(z) + problem.dual.norm_M(z)
        )
    static = z @ problem.map.L.T @ shapes[:, higher] / omega[higher] ** 2 @ shapes[:, higher].T @ C.T
    assert np.max(np.abs(z @ rows.static_rows.T - static)) < 1e-11 * np.max(np.abs(z @ problem.rows.static_rows.T))


@pytest.mark.parametrize("gone", [0, 3, 7])
def test_a_missed_mode_is_found(gone):
    full = model("pencil", "none", 4)
    modes = full.body.modes(8)
    check_no_mode_missed(full.body.M, full.body.K, modes)
    left = np.delete(np.arange(8), gone)
    lacking = replace(modes, omega=modes.omega[left], shapes=modes.shapes[:, left])
    with pytest.raises(AssumptionError, match=f"1 of the modes below {modes.cut:.6g} rad/s are missing"):
        check_no_mode_missed(full.body.M, full.body.K, lacking)


def test_lanczos_proves_that_no_mode_is_missing():
    """A long chain of pairs of equal frequencies, above the size of the dense solver."""
    n = 700
    K = sp.diags_array([np.full(n, 2.0), -np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1, -1])
    body = ElasticBody(sp.eye_array(2 * n), sp.block_diag([K, K]))
    exact = np.repeat(2 * np.sin(np.pi * np.arange(1, 11) / (2 * (n + 1))), 2)
    found = body.modes(20).omega
    assert np.max(np.abs(found / exact - 1)) < tol.EIGEN
    assert body.modes(20).cut <= exact[-1]


def test_auxiliary_modes_refuse_a_damping_matrix():
    full = model("chain", "matrix", 1)
    with pytest.raises(AssumptionError, match="Rayleigh"):
        _evaluate(full, estimators=("auxiliary",))
    assert list(_evaluate(full).position_bound) == ["fast", "energy"]


def test_auto_takes_the_fewest_modes_that_leave_5_percent_of_every_output():
    full = model("pencil", "under", 5)
    omega, shapes = full.modes
    C = RNG.standard_normal((2, full.N)) @ np.linalg.inv(shapes)
    split = Problem(full.body, modal_basis(full.body, 2), BoundOptions(outputs=[Output("y", C)])).split
    share = [la.norm(C @ shapes[:, m:] / omega[m:], axis=1) / la.norm(C @ shapes / omega, axis=1) for m in range(13)]
    enough = [m for m in range(1, 13) if np.all(share[m] <= 0.05)]
    assert split.modes.omega.size == enough[0]


def _evaluate(full, u=None, steps=60, h=None, initial=None, **options):
    """Bounds of an exact solution in the span of two modes."""
    h = 0.3 / full.modes[0][0] if h is None else h
    u, V = signal(1, size=[1.0], W=full.modes[0][0] / 2) if u is None else u, full.modes[1][:, :2]
    t, B = h * np.arange(steps + 1), np.ones((full.N, 1))
    q0, q0_t = (np.zeros(full.N),) * 2 if initial is None else initial
    start = V.T @ full.M @ q0, V.T @ full.M @ q0_t
    M, D, K = (V.T @ A @ V for A in (full.M, full.D, full.K))
    q, q_t = Exact(np.eye(2), D, np.diag(np.diag(K)), full.rayleigh).motion(V.T @ B, u, *start, t)
    traj = Trajectory(t, q, q_t, la.solve(M, V.T @ B @ u.at(t).T - D @ q_t.T - K @ q.T).T)
    options = {"outputs": [Output("y", np.eye(full.N)[:2]), Output("v", np.eye(full.N)[0], of="velocity")], **options}
    common = {"inputs": B, "input_function": u, "jumps": u.jumps, "initial": initial}
    return evaluate(full.body, Basis(V), traj, **common, **options)


def _truth(full, u, report, initial=None):
    q0, q0_t = (np.zeros(full.N),) * 2 if initial is None else initial
    return Exact(full.M, full.D, full.K, full.rayleigh).motion(np.ones((full.N, 1)), u, q0, q0_t, report.t)


LOADS = {
    "jump at a sample": signal(1, knots=[0, 3.0], start=[0.5, -1.0]),
    "jump next to a sample": signal(1, knots=[0, 3.0 * (1 + 1e-15)], start=[0.5, -1.0]),
    "jump inside a step": signal(1, knots=[0, 3.1], start=[0.5, -1.0]),
    "pulse inside a step": signal(1, knots=[0, 3.1, 3.15], start=[0.0, 1.0, 0.0]),
    "kinks": piecewise_linear(np.array([0, 0.7, 3.33, 4.1]), np.array([[0.0], [1.0], [-1.0], [0.0]])),
    "sine": signal(1, size=[1.0], W=[2.0], phase=[0.3]),
}


@pytest.mark.parametrize("start", [False, True])
@pytest.mark.parametrize("damping", ["none", "overdamped"])
@pytest.mark.parametrize("load", LOADS)
def test_causes_sum_to_best_and_the_corrected_output_is_as_close_as_it_says(load, damping, start):
    """Steps of 0.3; loads at, next to and between samples."""
    full, u = model("pencil", damping, 6), LOADS[load]
    initial = tuple(RNG.standard_normal((2, full.N)) * [[1e-3], [1e-3]]) if start else None
    report = _evaluate(full, u, h=0.3, initial=initial)
    states = _truth(full, u, report, initial)
    for name, x in zip("yv", (states[0][:, :2], states[1][:, :1]), strict=True):
        out, floor = report.output(name), 1e-12 * np.max(np.abs(x))
        assert np.all(np.abs(sum(out.causes.values()) - out.bound["best"]) <= 1e-12 * np.max(out.bound["best"]))
        assert np.all(np.abs(x - out.value) <= out.bound["best"] + floor)
        assert np.all(np.abs(x - out.corrected) <= out.corrected_bound + floor)
        assert np.all(out.corrected_bound <= out.bound["auxiliary"] + floor)
    assert (np.max(report.output("y").causes["initial"]) > 0) == start
    assert (np.max(report.output("y").causes["jumps"]) > 0) == bool(u.jumps)
