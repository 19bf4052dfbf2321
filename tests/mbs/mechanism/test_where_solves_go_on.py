"""What a solve goes on from: the equilibrium of a static one, errors of one whose joint is driven."""

from dataclasses import replace

import exudyn as exu
import numpy as np

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
from tests.helpers.mechanism_runs import COUPLED

STEPS = 5
TRAPEZOIDAL = exu.DynamicSolverType.TrapezoidalIndex2
STATIC = 1e-9  # of displacements: ten times what Newton's iterations may leave
ESTIMATED = 1e-2  # of the error; 1e-3 was seen


def of_one_bar(seed, **options):
    """A bar of random_mechanisms on springs, under one load."""
    one = drawn(seed)
    load = replace(one.loads[0], bar=0)
    return replace(one, bars=one.bars[:1], links=one.links[:1], loads=(load,), end="springs", **options)


def in_equilibrium(scene):
    """Solve for it in one load step, Exudyn's default."""
    scene.mbs.Assemble()
    static = scene.settings.staticSolver
    static.verboseMode, static.newton.relativeTolerance = 0, 0.1 * STATIC
    scene.mbs.SolveStatic(scene.settings, updateInitialValues=True)
    return scene


def test_one_load_step_leaves_an_equilibrium_to_go_on_from():
    """It was taken for a solve that failed: certified bounds were 0 at first, up to 1e5 times too small.

    The truth: the equilibrium of the bar with all its modes.
    """
    one = of_one_bar(425, base="bushing")
    full, scene = in_equilibrium(built(one, True)), built(one)
    flex = romerr.floating_body(scene.fems[0], scene.bodies[0])
    monitor = romerr.attach(scene.mbs, flex, outputs=list(scene.sensors[0].values()))
    in_equilibrium(scene)
    scene.settings.timeIntegration.numberOfSteps, scene.settings.timeIntegration.endTime = STEPS, STEPS * one.h
    scene.mbs.SolveDynamic(scene.settings)
    report = monitor.report()
    assert set(report.scope.values()) == {COUPLED}
    for name, number in full.sensors[0].items():
        truth, out = full.mbs.GetSensorValues(number), report.outputs[name]
        error = np.abs(truth - out.value[0])
        assert error.max() > 10 * STATIC * np.abs(truth).max() or "velocity" in name
        if "velocity" not in name:
            np.testing.assert_allclose(out.estimate[0], truth - out.value[0], rtol=0, atol=ESTIMATED * error.max())


def in_two_solves(scene, h):
    """Solve ten steps by the trapezoidal rule, and ten more."""
    scene.mbs.Assemble()
    times = scene.settings.timeIntegration
    times.numberOfSteps = 10
    for begin in (0.0, 10 * h):
        times.startTime, times.endTime = begin, begin + 10 * h
        scene.mbs.SolveDynamic(scene.settings, solverType=TRAPEZOIDAL, updateInitialValues=True)


def test_a_driven_joint_that_lags_keeps_no_error_from_being_carried_over():
    """The trapezoidal rule holds rates of joints: the second solve does not begin where the function is."""
    one = of_one_bar(428)
    assert one.base == "driven"
    scene = built(one)
    flex = romerr.floating_body(scene.fems[0], scene.bodies[0])
    monitor = romerr.attach(scene.mbs, flex, outputs=list(scene.sensors[0].values()))
    in_two_solves(scene, one.h)
    before, after = monitor.report(0), monitor.report(1)
    assert set(after.scope.values()) == {COUPLED}
    for out, last in zip(after.outputs.values(), before.outputs.values(), strict=True):
        one, other = (x.estimate_parts["basis"] for x in (out, last))
        np.testing.assert_allclose(one[0], other[-1], rtol=0, atol=1e-6 * np.abs(other).max())
        assert one[0].any()
