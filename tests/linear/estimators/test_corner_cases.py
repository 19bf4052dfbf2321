"""Cases that a review and a new user broke once: small bodies, extreme damping and loads, starts, inf."""

import numpy as np
import pytest
import scipy.linalg as la

import exudyn_romerr as romerr
from exudyn_romerr.linear.run.prepare import BoundOptions, prepare
from exudyn_romerr.linear.run.run import Run

ALL = ("fast", "convolution", "energy", "auxiliary")
ROUNDING = 1e-9  # of the largest value: matrix exponentials of these small, well conditioned systems reach 1e-12


def chain(n, stiffness=100.0, **damping):
    """Masses of 1 kg in a row between two walls."""
    K = stiffness * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    return romerr.ElasticBody(np.eye(n), K, **damping)


def step_response(M, D, K, load, x0, t):
    """Return q, q_t, q_tt (T, n) under a constant load from rest at x0, by matrix exponentials."""
    n = len(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
    end = np.concatenate([np.linalg.solve(K, load), np.zeros(n)])
    x = np.array([end + la.expm(A * s) @ (np.concatenate([x0, np.zeros(n)]) - end) for s in t])
    return x[:, :n], x[:, n:], (x - end) @ A.T[:, n:]


def released(body, basis, before, t):
    """Full motion, trajectory from their own equilibria under `before` to the load 1 at the last mass, and B."""
    B = np.eye(body.N)[:, -1:]
    M, K, D = body.M.toarray(), body.K.toarray(), body.D.toarray()
    V = basis.V
    full = step_response(M, D, K, B[:, 0], before * np.linalg.solve(K, B[:, 0]), t)[0]
    Mr, Dr, Kr, g = V.T @ M @ V, V.T @ D @ V, V.T @ K @ V, V.T @ B[:, 0]
    motion = step_response(Mr, Dr, Kr, g, before * np.linalg.solve(Kr, g), t)
    return full, romerr.Trajectory(t, *motion, np.ones(len(t))), B


def resting(t):
    """A trajectory of one coordinate that does not move."""
    return romerr.Trajectory(t, *np.zeros((3, len(t), 1)))


def test_indefinite_damping_is_refused_although_its_factorisation_breaks_down():
    """D has the eigenvalue -1.6 and a leading block that is singular: no pivot says so."""
    D = np.array([[1.0, 2, -1, -2], [2, 1, 0, -1], [-1, 0, 1, 0], [-2, -1, 0, 1]])
    with pytest.raises(romerr.AssumptionError, match="damping feeds energy in"):
        romerr.ElasticBody(np.eye(4), 4 * np.eye(4), damping=D)


@pytest.mark.parametrize("initial", [None, "equilibrium"])
def test_input_function_without_inputs_is_refused(initial):
    """A load that cannot act must not be ignored."""
    body = chain(3, rayleigh=(0.1, 0.0))
    traj = resting(np.arange(5.0))
    with pytest.raises(romerr.InputError, match="input_function was given without inputs"):
        romerr.evaluate(body, romerr.modal_basis(body, 1), traj, input_function=lambda t: 1.0, initial=initial)


def test_equilibrium_before_a_jump_at_the_start():
    """The body is in equilibrium under the load before the jump at t0, not under the one after it."""
    body, t = chain(5, rayleigh=(0.1, 1e-3)), np.linspace(0, 0.5, 201)
    basis = romerr.krylov_basis(body, np.eye(5)[:, -1:], 1)
    full, traj, B = released(body, basis, 0.5, t)
    report = romerr.evaluate(
        body,
        basis,
        traj,
        inputs=B,
        outputs=[romerr.Output("x", np.eye(5)[0])],
        input_function=lambda t: 1.0 if t >= 0 else 0.5,
        jumps=(0.0,),
        initial="equilibrium",
        estimators=ALL,
        auxiliary_modes=3,
    )
    error = np.abs(full[:, 0] - traj.q @ basis.V[0])
    for e, bound in report.output("x").bound.items():
        assert np.all(error <= bound[:, 0] + ROUNDING * np.abs(full).max()), e


def test_cancelled_norm_is_inf_and_said_so():
    """residual='expanded' on the complete basis: where its square is negative, the bound is inf and never nan."""
    body, t = chain(6, rayleigh=(0.1, 1e-3)), np.linspace(0, 1, 201)
    basis = romerr.modal_basis(body, 6)
    _, traj, B = released(body, basis, 0.0, t)
    options = {"inputs": B, "outputs": [romerr.Output("x", np.eye(6)[0])], "estimators": ALL, "auxiliary_modes": 3}
    report = romerr.evaluate(body, basis, traj, residual="expanded", **options)
    out = report.output("x")
    for arrays in (out.bound, out.reduction_bound, out.causes, report.position_bound):
        assert not any(np.isnan(x).any() for x in arrays.values())
    spoilt = [e for e, bound in report.position_bound.items() if np.isinf(bound).any()]
    assert spoilt
    assert all("inf from t =" in report.reason(e) for e in spoilt)


def test_auto_count_ignores_an_output_that_sees_nothing():
    """An output row on a fixed coordinate is zero; it neither warns nor asks for more modes."""
    body = romerr.ElasticBody(np.eye(4), 100 * np.eye(4) + np.ones((4, 4)), fixed=[0], rayleigh=(0.1, 0.0))
    held = romerr.Output("held", np.eye(4)[0])
    report = romerr.evaluate(body, romerr.modal_basis(body, 1), resting(np.arange(3.0)), outputs=[held])
    assert np.all(report.output("held").bound["best"] == 0)


@pytest.mark.parametrize("scale", [1e-160, 1e160])
def test_bounds_are_linear_in_extreme_loads(scale):
    """Squares of norms would vanish or overflow; the bounds scale with the load."""
    body, t = chain(6, rayleigh=(0.1, 1e-3)), np.linspace(0, 1, 101)
    basis = romerr.modal_basis(body, 2)
    _, once, B = released(body, basis, 0.0, t)

    def bounds(factor):
        traj = romerr.Trajectory(t, *(factor * x for x in (once.q, once.q_t, once.q_tt, once.u)))
        options = {"outputs": [romerr.Output("x", np.eye(6)[0])], "estimators": ("fast", "energy", "auxiliary")}
        return romerr.evaluate(body, basis, traj, inputs=B, auxiliary_modes=3, **options).output("x").bound

    for e, bound in bounds(1.0).items():
        np.testing.assert_allclose(bounds(scale)[e] / scale, bound, rtol=1e-9)


@pytest.mark.parametrize("mask", [np.array([True, False, False]), [True, False, False]])
def test_masks_are_no_coordinate_numbers(mask):
    """A boolean mask would fix coordinates 0 and 1."""
    with pytest.raises(romerr.InputError, match="fixed holds bools"):
        romerr.ElasticBody(np.eye(3), np.eye(3), fixed=mask)


def test_too_long_a_run_for_sums_over_all_steps_is_refused():
    """A table of the kernel over 1e6 rad would take gigabytes."""
    body, traj = chain(2, rayleigh=(0.1, 0.0)), resting(np.linspace(0, 1e5, 4))
    options = {"estimators": "convolution", "kernels": "spectrum"}
    with pytest.raises(romerr.AssumptionError, match="run of more than"):
        romerr.evaluate(body, romerr.modal_basis(body, 1), traj, **options)


@pytest.mark.parametrize(("block", "steps"), [(1, 500), (1024, 3000), pytest.param(1, 3000, marks=pytest.mark.slow)])
def test_rounding_of_times_far_from_zero_does_not_add_up(block, steps):
    """Steps of 0.1 ms across t = 2048 s, summed up as solvers do: rounding changes all lengths the same way."""
    omega, t = 1e3, np.cumsum(np.r_[2048 - 1e-4 * (steps // 3), np.full(steps, 1e-4)])
    body = romerr.ElasticBody(np.eye(2), np.diag([1.0, omega**2]))
    options = {"outputs": [romerr.Output("x", np.eye(2)[1])], "estimators": ("auxiliary",), "auxiliary_modes": 2}
    options = BoundOptions(initial=(np.array([0, 1e-3]), np.zeros(2)), **options)
    run = Run(prepare(body, romerr.Basis(np.eye(2)[:, :1]), options))
    zero = np.zeros((len(t), 1))
    run.start(t[0], *zero[:3])
    for first in range(1, len(t), block):
        part = slice(first, first + block)
        run.extend(t[part], *[zero[part]] * 3)
    out, truth = run.report().output("x"), 1e-3 * np.cos(omega * (t - t[0]).astype(np.longdouble))
    assert np.all(np.abs(truth) <= out.bound["auxiliary"][:, 0])
    assert np.all(np.abs(truth - out.corrected[:, 0]) <= out.corrected_bound[:, 0])
    # 1000 rad/s times the spacing of times near 2048 s, 4.5e-13 s, over some blocks: measured 8e-8 of the amplitude
    assert np.max(out.corrected_bound) < 1e-6 * 1e-3
