"""Estimates of linear bodies: what auxiliary modes know, by cause; truth: closed forms of all modes."""

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.report.scope import SMOOTHLY
from models.exact import full_solution, reduced_solution, reduced_trajectory
from tests.helpers import tolerances as tol
from tests.helpers.bodies import model

MODES = 10  # of the body: all are carried
W = 4.0  # rad/s
LINEAR_STEPS = 1e-5  # R linear between 250 samples a period of the highest mode; measured 3e-7


@pytest.fixture(scope="module")
def run():
    """A body that starts away from its reduced state, under a sine: report, truth, its initial error's own part."""
    rng, of = np.random.default_rng(18), model("chain", "under", 3)
    body = romerr.ElasticBody(of.M, of.K, rayleigh=of.rayleigh)
    basis, rows = romerr.modal_basis(body, 2), rng.standard_normal((2, body.N))
    B = of.M @ rng.standard_normal((body.N, 1))
    start = tuple(np.linalg.solve(of.K, of.M @ rng.standard_normal(body.N)) * size for size in (0.1, 0.5))
    t = np.linspace(0, 2.0, 4001)
    reduced = reduced_solution(body, basis, B, [1.0], W, [basis.V.T @ of.M @ x for x in start])
    traj = reduced_trajectory(reduced, t, [1.0])
    outputs = [romerr.Output("y", rows), romerr.Output("v", rows, unit="m/s", of="velocity")]
    known = {"inputs": B, "outputs": outputs, "initial": start, "estimators": "auxiliary", "auxiliary_modes": MODES}
    report = romerr.evaluate(body, basis, traj, input_function=lambda s: np.sin(W * s), **known)
    full = full_solution(body, B, [1.0], W, start).motion(t)
    offset = tuple(x - basis.V @ q[0] for x, q in zip(start, (traj.q, traj.q_t), strict=True))
    free = full_solution(body, B, [0.0], W, offset).motion(t)
    truth, of_start = ({"y": q @ rows.T, "v": q_t @ rows.T} for q, q_t, _ in (full, free))
    return report, truth, of_start


@pytest.mark.parametrize(
    ("beta", "start", "helps"), [(0.0, 1.0, (SMOOTHLY,)), (1e-3, 1.0, (SMOOTHLY,)), (0.0, 0.0, ())]
)
def test_what_starts_at_once_is_told_from_a_load_that_grows(beta, start, helps):
    """A body that is let go where its load, a slow sine, would not hold it, and one that only follows that load."""
    of = model("chain", "under", 3)
    body = romerr.ElasticBody(of.M, of.K, rayleigh=(0.0, beta))
    basis, rows = romerr.modal_basis(body, 2), np.eye(body.N)[:1]
    omega, B = of.modes[0][0], of.M @ np.ones((body.N, 1))
    initial = [start * np.ones(2), np.zeros(2)]
    reduced = reduced_solution(body, basis, B, [1.0], 0.05 * omega, initial)
    trajectory = reduced_trajectory(reduced, np.linspace(0, 60 / omega, 601), [1.0])
    report = romerr.evaluate(body, basis, trajectory, inputs=B, outputs=[romerr.Output("y", rows)])
    assert report.output("y").beside_steps == helps


def test_estimate_is_the_error(run):
    report, truth, _ = run
    for name, y in truth.items():
        out = report.output(name)
        error = y - out.value
        np.testing.assert_allclose(out.estimate, error, rtol=0, atol=tol.CLOSED_FORM * np.max(np.abs(error)))
        assert out.estimate_scope == "complete"
        np.testing.assert_allclose(out.value + out.estimate, out.corrected, rtol=0, atol=tol.SUMS * np.max(out.value))
        np.testing.assert_array_equal(out.uncertainty, out.corrected_bound)
        assert list(out.uncertainty_parts) == ["proved"]
        assert (np.abs(error - out.estimate) <= out.uncertainty + out.round_off).all()


def test_parts_are_those_of_their_causes(run):
    """The initial error's own part is the free motion that it makes; the reduced motion is exact at the samples."""
    report, truth, of_start = run
    for name, free in of_start.items():
        out = report.output(name)
        error = truth[name] - out.value
        assert set(out.estimate_parts) == {"basis", "interfaces", "time step", "initial", "jumps"}
        largest = np.max(np.abs(error))
        np.testing.assert_allclose(sum(out.estimate_parts.values()), out.estimate, rtol=0, atol=tol.SUMS * largest)
        np.testing.assert_allclose(out.estimate_parts["initial"], free, rtol=0, atol=tol.CLOSED_FORM * largest)
        np.testing.assert_allclose(out.estimate_parts["basis"], error - free, rtol=0, atol=LINEAR_STEPS * largest)
        assert min(np.max(np.abs(free)), np.max(np.abs(error - free))) > 0.01 * largest
        assert not out.estimate_parts["jumps"].any()
