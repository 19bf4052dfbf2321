"""Bounds beside real Exudyn runs: above the true error, equal to evaluate, continued without a break."""

import exudyn as exu
import numpy as np
import pytest

from exudyn_romerr import Trajectory, evaluate
from exudyn_romerr.basis.basis import Basis
from exudyn_romerr.model.outputs import Output
from tests.helpers.mbs_scenes import (
    INPUTS,
    SOLVERS,
    TIP,
    N,
    Recorder,
    added,
    chain_body,
    force,
    random_basis,
    scene,
    settings,
)

ROUNDING = 1e-9  # relative: other block boundaries sum in another order, and reconstruction multiplies by h^-2
SPEED = Output("speed", np.eye(N)[2], unit="m/s", of="velocity")
PAPER = {"estimators": ("fast", "convolution"), "time": "sampled"}


def full_run(solver, ss, initial=None):
    """Rows of the full model by the same solver."""
    (mbs, _), seen = added(basis=Basis(np.eye(N)), initial=initial), Recorder()
    mbs.SetPostStepUserFunction(seen)
    mbs.Assemble()
    SOLVERS[solver](mbs, ss)
    return seen


def mass_norm(rows):
    return np.sqrt(np.einsum("ti,ij,tj->t", rows, chain_body().mass.toarray(), rows))


@pytest.mark.parametrize("offset", [False, True])
@pytest.mark.parametrize("galerkin", [True, False])
def test_sampled_bounds_are_above_the_reduction_error(galerkin, offset):
    initial = (0.01 * np.sin(np.arange(N)), 0.1 * np.cos(np.arange(N))) if offset else None
    ss = settings(steps=1000, end=1.0)
    full, mine = full_run("RK44", ss, initial), Recorder()
    mbs, flex, monitor = scene(random_basis(4, galerkin=galerkin), hook=mine, initial=initial, **PAPER)
    SOLVERS["RK44"](mbs, ss)
    report = monitor.report()
    error = full.rows(0) - mine.rows(0) @ flex.basis.V.T
    slack = 1e-9 * np.abs(full.rows(0)).max()  # time error of RK44 at 1 ms, which a sampled bound does not cover
    for name in ("fast", "convolution"):
        assert np.all(mass_norm(error) <= report.position_bound[name] + slack)
        assert np.all(np.abs(error[:, 7]) <= report.output("tip").bound[name][:, 0] + slack)
    assert report.output("tip").bound["best"].max() < 100 * np.abs(error[:, 7]).max()


@pytest.mark.parametrize("solver", ["generalised-alpha", "RK44"])
def test_default_bounds_are_above_the_total_error_of_coarse_steps(solver):
    mine = Recorder()
    mbs, flex, monitor = scene(random_basis(4), hook=mine)
    SOLVERS[solver](mbs, settings(steps=40, end=0.8))
    fine = full_run("RK44", settings(steps=8000, end=0.8))
    np.testing.assert_allclose(fine.t[::200], mine.t, atol=1e-9)
    error = np.abs(fine.rows(0)[::200] - mine.rows(0) @ flex.basis.V.T)[:, 7]
    bound = monitor.report().output("tip").bound["best"][:, 0]
    assert np.all(error <= bound * (1 + 1e-6) + 1e-12)
    assert bound.max() < 20 * error.max()


@pytest.mark.parametrize("options", [PAPER, {}])
def test_alongside_and_afterwards_agree_to_rounding(options):
    mine, outputs = Recorder(), [TIP, SPEED]
    mbs, flex, monitor = scene(hook=mine, outputs=outputs, **options)
    mbs.SolveDynamic(settings(steps=700, end=0.7))
    stored = Trajectory(mine.t, *(mine.rows(k) for k in range(3)))
    common = {"inputs": INPUTS, "input_function": force, "outputs": outputs, **options}
    after, beside = evaluate(flex.body, flex.basis, stored, **common), monitor.report()
    np.testing.assert_array_equal(beside.t, after.t)
    assert list(beside.position_bound) == list(after.position_bound)
    for name, bound in after.position_bound.items():
        np.testing.assert_allclose(beside.position_bound[name], bound, rtol=ROUNDING)
    for out in ("tip", "speed"):
        np.testing.assert_allclose(beside.output(out).value, after.output(out).value, rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("galerkin", [True, False])
def test_static_error_is_exact_at_every_load_step(galerkin):
    mbs, flex, monitor = scene(random_basis(4, galerkin=galerkin), hook=(mine := Recorder()))
    SOLVERS["static"](mbs, settings())
    exact = np.array([np.linalg.solve(flex.body.stiffness.toarray(), INPUTS[:, 0] * force(t)) for t in mine.t])
    error = np.abs(exact - mine.rows(0) @ flex.basis.V.T)[:, 7]
    assert error.max() > 1e-6
    np.testing.assert_allclose(monitor.report().output("tip").bound["best"][:, 0], error, rtol=1e-9)


def test_continued_solves_give_the_bound_of_one_long_solve():
    mbs, _, long = scene()
    SOLVERS["RK44"](mbs, settings(steps=200, end=0.2))
    mbs, _, parts = scene()
    kind = exu.DynamicSolverType.RK44
    mbs.SolveDynamic(settings(steps=100, end=0.1), solverType=kind, updateInitialValues=True)
    mbs.SolveDynamic(settings(steps=100, end=0.2, start=0.1), solverType=kind)
    first, second = (parts.report(i).output("tip").bound for i in (0, 1))
    for name, bound in long.report().output("tip").bound.items():
        joined = np.concatenate([first[name], second[name][1:]])
        np.testing.assert_allclose(second[name][0], first[name][-1], rtol=1e-12)
        np.testing.assert_allclose(joined, bound, rtol=ROUNDING)


def test_blocks_or_single_steps_make_no_difference():
    mbs, _, blocks = scene()
    mbs.SolveDynamic(settings(steps=100))
    mbs, _, single = scene(tolerance=1e9)
    mbs.SolveDynamic(settings(steps=100))
    for name, bound in blocks.report().output("tip").bound.items():
        np.testing.assert_allclose(single.report().output("tip").bound[name], bound, rtol=ROUNDING)
