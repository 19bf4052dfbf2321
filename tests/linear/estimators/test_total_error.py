"""Total error, time integration included: no true error above its bound, and bounds close to it on the linkage."""

from dataclasses import replace

import numpy as np
import pytest

import exudyn_romerr as romerr
from benchmarks.sweep import FLOOR, PENCIL, measure_seed
from models import linkage
from models.exact import full_solution, reduced_solution, reduced_trajectory
from tests.helpers.bodies import BODIES, DAMPINGS, model
from tests.helpers.mbs_scenes import SOLVERS, Recorder, new_mbs, settings
from tests.helpers.total_truth import Exact, piecewise_linear, signal
from tests.helpers.truth import linear_inputs, state_form

QUICK = range(2000, 2040)
W = 2 * np.pi * linkage.FREQUENCY
AIM = 1.2  # the issue: max bound / max true total error on the linkage, 20 auxiliary modes


@pytest.mark.parametrize("seed", QUICK)
def test_no_total_error_is_above_its_bound(seed):
    """A small part of benchmarks/sweep.py, all estimators, position, velocity, outputs and corrected outputs."""
    result = measure_seed(seed)
    assert result.error is None, f"{result.pick}: {result.error!r}"
    assert not result.violations, f"{result.pick}: {result.violations}"


@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("kind", BODIES)
def test_the_truth_agrees_with_matrix_exponentials(kind, damping):
    """Closed forms on straight pieces against the state form of truth.py, kinks and initial state included."""
    full = model(kind, damping, 1)
    exact, rng = Exact(full.M, full.D, full.K, full.rayleigh), np.random.default_rng(0)
    knots = np.concatenate([[0], np.cumsum(rng.choice([0.1, 0.3, 0.7], 8))]) / exact.omega[0]
    u, B = piecewise_linear(knots, rng.standard_normal((9, 2))), full.M @ rng.standard_normal((full.N, 2))
    q0, q0_t = np.linalg.solve(full.K, full.M @ rng.standard_normal((full.N, 2))).T * [[1], [exact.omega[0]]]
    t = np.sort(np.concatenate([knots, (knots[1:] + knots[:-1]) / 2]))
    values = u.at(t)
    wanted = state_form(full.M, full.D, full.K, B).propagate(
        np.diff(t), linear_inputs(values[:-1], values[1:]), q0, q0_t
    )
    for found, other in zip(exact.motion(B, u, q0, q0_t, t), (wanted.q, wanted.q_t), strict=True):
        left, size = (np.sqrt(np.max(np.einsum("ti,ij,tj->t", x, full.M, x))) for x in (found - other, other))
        assert left < (FLOOR + PENCIL * (exact.omega[-1] / exact.omega[0]) ** 2) * size


@pytest.fixture(scope="module")
def bar():
    body, inputs, output = linkage.build()
    return body, inputs, output, full_solution(body, inputs, linkage.AMPLITUDE, W)


def linkage_run(bar, n, h, solver="generalised-alpha"):
    """Report of 2 s of the linkage in Exudyn, compared with the exact solution; the states it saw."""
    body, inputs, output, truth = bar
    mbs, seen = new_mbs(), Recorder()
    basis = romerr.krylov_basis(body, inputs, n)
    flex = romerr.add_reduced_body(mbs, body, basis, inputs=inputs, input_function=linkage.force)
    monitor = romerr.attach(mbs, flex, outputs=[output], auxiliary_modes=20, hook=seen)
    mbs.Assemble()
    SOLVERS[solver](mbs, settings(steps=round(2 / h), end=2.0))
    return compared(monitor.report(), output, body, truth), (basis, seen)


def compared(report, output, body, truth):
    return report.compare(output.name, report.t, truth.output(output.resolve(body), report.t))


def assert_sharp(out, aim):
    floor = FLOOR * np.max(np.abs(out.value))
    assert np.all(np.abs(out.error) <= out.bound["best"] + floor)
    assert 1 - floor / np.max(np.abs(out.error)) <= out.effectivity["best"][0] <= aim


@pytest.mark.parametrize("h", [1e-3, 5e-3])
@pytest.mark.parametrize("n", [6, 12, 24])
def test_total_bound_of_the_linkage_is_sharp(bar, n, h):
    """Generalised-alpha with Exudyn's default spectral radius 0.9."""
    assert_sharp(linkage_run(bar, n, h)[0], AIM)


def one_mode_run(u, h, steps, estimators=("energy", "auxiliary")):
    """Only mode 2 is loaded and the basis holds mode 1 alone: the reduced body rests; true y and its report."""
    full = model("chain", "none", 1)
    exact = Exact(full.M, full.D, full.K, full.rayleigh)
    shape, h = full.M @ exact.shapes[:, 1], h / exact.omega[1]
    u = replace(u, knots=h * u.knots, slope=u.slope / h, W=u.W * exact.omega[1])
    t, rest, zero = h * np.arange(steps + 1), np.zeros((steps + 1, 1)), np.zeros(full.N)
    traj = romerr.Trajectory(t, rest, rest, rest)
    common = {"inputs": shape[:, None], "input_function": u, "jumps": u.jumps, "auxiliary_modes": 4}
    outputs = [romerr.Output("y", shape)]
    report = romerr.evaluate(
        full.body, romerr.Basis(exact.shapes[:, :1]), traj, outputs=outputs, estimators=estimators, **common
    )
    return np.abs(exact.motion(shape[:, None], u, zero, zero, t)[0] @ shape), report


def assert_covered(true, report):
    out = report.output("y")
    for e, bound in out.bound.items():
        assert np.all(true <= bound[:, 0] + 1e-12 * np.max(true)), f"{e}: {np.max(true - bound[:, 0]):.2e}"


def spike(first, middle, last):
    """A triangle of height 1, times in steps."""
    return piecewise_linear(np.array([0, first, middle, last]), np.array([[0.0], [0.0], [1.0], [0.0]]))


@pytest.mark.parametrize("steps", [100, 700])
@pytest.mark.parametrize(("first", "last"), [(2.02, 2.82), (2.05, 2.21), (0.13, 0.49), (2.3, 3.7)])
def test_kinks_inside_steps_stay_covered_in_later_blocks(first, last, steps):
    """Violated once: what one block's inputs missed was forgotten by "auxiliary" in the next, resolved one."""
    assert_covered(*one_mode_run(spike(first, (first + last) / 2, last), 1.6, steps))


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("spacing", [0.05, 0.3, 1.3, 7.7])
def test_noise_with_kinks_everywhere_is_covered(spacing, seed):
    rng = np.random.default_rng(seed)
    knots = np.concatenate([[0], np.cumsum(spacing * rng.uniform(0.3, 1.7, 40))])
    for h in (0.3, 3.0, 30.0):
        assert_covered(*one_mode_run(piecewise_linear(knots, rng.standard_normal((41, 1))), h, 60))


@pytest.mark.parametrize("Wh", [3.0, 10.0, 25.0])
def test_sines_in_resonance_are_covered_up_to_four_periods_a_step(Wh):
    assert_covered(*one_mode_run(signal(1, size=[1.0], W=[1.001]), Wh, 60))


UNSEEN = [(spike(2.51, 2.55, 2.59), 1.6), (signal(1, size=[1.0], W=[1.0001], phase=[0.4]), 20 * np.pi / 1.0001)]


@pytest.mark.xfail(strict=True, reason="stated assumption: inputs are looked at 11 times a step, at equal distances")
@pytest.mark.parametrize(("u", "h"), UNSEEN)
def test_inputs_that_no_check_point_sees(u, h):
    """A spike between two check points; a sine with ten whole periods a step: no bound, and no message either."""
    assert_covered(*one_mode_run(u, h, 40))


@pytest.mark.parametrize("seed", [437, 466, 704, 822, 1375, 1743])
def test_rounding_of_auxiliary_modes_is_covered(seed):
    """Were violated once by up to 2e-6 of the output: all modes auxiliary, residual 1e6 to 1e8 times the error.

    Inexact eigenvectors couple eta_i to the whole error, and the terms of the forcing P^T L z cancel.
    """
    result = measure_seed(seed)
    assert result.error is None
    assert not result.violations, result.violations


@pytest.mark.parametrize("h", [1e-5, 1e-6])
@pytest.mark.parametrize("n", [6, 12])
def test_very_short_steps_stay_near_the_floor(bar, n, h):
    """Knots at every s-th sample: the energy bound does not grow with h^-3 (8.8e-3 of the motion without, n = 12)."""
    body, inputs, output, truth = bar
    basis = romerr.krylov_basis(body, inputs, n)
    t = 0.25 + h * np.arange(3000)
    traj = reduced_trajectory(reduced_solution(body, basis, inputs, linkage.AMPLITUDE, W), t, linkage.AMPLITUDE)
    q0, q0_t = (x[0] for x in truth.motion(t[:1])[:2])
    common = {"inputs": inputs, "input_function": linkage.force, "outputs": [output], "auxiliary_modes": 20}
    out = compared(romerr.evaluate(body, basis, traj, initial=(q0, q0_t), **common), output, body, truth)
    size = np.max(np.abs(out.value))
    assert np.all(np.abs(out.error) <= out.bound["best"])
    assert np.max(out.bound["energy"]) < {6: 2e-2, 12: 2e-3}[n] * size
    assert np.max(out.bound["best"]) < 1.01 * np.max(np.abs(out.error)) + 2 * np.max(out.round_off)
