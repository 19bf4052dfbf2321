"""What a solve goes on from: the equilibrium of a static one, errors of one whose joint is driven."""

from dataclasses import replace

import exudyn as exu
import numpy as np

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
from exudyn_romerr.online.initial_condition import OTHER_LOADS
from models import driven_bar
from tests.helpers.mechanism_runs import COUPLED

H, STEPS = 1e-3, 5
TRAPEZOIDAL = exu.DynamicSolverType.TrapezoidalIndex2
STATIC = 1e-9  # of displacements: ten times what Newton's iterations may leave
SECOND_ORDER = 1e-4  # of the error: how the bar turns beside how it bends; 1e-5 was seen


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
        assert np.all(error <= out.bound["best"][0] + SECOND_ORDER * error.max())


def test_other_loads_than_in_the_equilibrium_are_not_certified():
    """Corrected errors of a body without loads were 1.75 times their bounds: joints are linearised under others."""
    one = drawn(607)
    loads = tuple(load for load in one.loads if load.bar < 2)
    scene = built(replace(one, bars=one.bars[:2], links=one.links[:2], loads=loads))
    parts = zip(scene.flexible(), scene.sensors, strict=True)
    monitors = [romerr.attach(scene.mbs, flex, outputs=list(sensors.values())) for flex, sensors in parts]
    in_equilibrium(scene)
    scene.settings.timeIntegration.numberOfSteps, scene.settings.timeIntegration.endTime = STEPS, STEPS * one.h
    scene.mbs.SolveDynamic(scene.settings)
    for monitor in monitors:
        assert [doubt.cause for doubt in monitor.report().uncertified][:1] == [OTHER_LOADS.cause]


def in_two_solves(scene, h):
    """Solve ten steps by the trapezoidal rule, and ten more."""
    scene.mbs.Assemble()
    times = scene.settings.timeIntegration
    times.numberOfSteps = 10
    for begin in (0.0, 10 * h):
        times.startTime, times.endTime = begin, begin + 10 * h
        scene.mbs.SolveDynamic(scene.settings, solverType=TRAPEZOIDAL, updateInitialValues=True)


def test_a_driven_joint_that_lags_keeps_no_error_from_being_carried_over():
    """The trapezoidal rule holds rates of joints: the second solve does not begin where the function is.

    The mbs was said to be changed, and certified bounds began at 0 anew. Coupled bounds need no such function.
    """
    one = of_one_bar(428)
    assert one.base == "driven"
    scene = built(one)
    flex = romerr.floating_body(scene.fems[0], scene.bodies[0])
    monitor = romerr.attach(scene.mbs, flex, outputs=list(scene.sensors[0].values()))
    in_two_solves(scene, one.h)
    before, after = monitor.report(0), monitor.report(1)
    assert set(after.scope.values()) == {COUPLED}
    assert any("continues the run before" in message for message in after.messages)
    for out, last in zip(after.outputs.values(), before.outputs.values(), strict=True):
        assert np.all(out.bound["best"][0] >= 0.5 * last.bound["best"][-1])


def test_bounds_of_another_motion_say_so():
    """The first solve takes the frame's motion from its function, and the second cannot: nothing was changed."""
    scene = driven_bar.driven(lambda t: [0.0, 0.0, 0.0, 0.4 * np.sin(40 * t) ** 2, 0.0, 0.0], h=H)
    monitor = romerr.attach(
        scene.mbs, romerr.floating_body(scene.fem, scene.items), outputs=[scene.sensors["displacement"]]
    )
    in_two_solves(scene, H)
    assert set(monitor.report(0).scope.values()) == {"complete"}
    (said,) = [message for message in monitor.report(1).messages if "not carried over" in message]
    assert "does not begin where the bodies are" in said
    assert "changed" not in said
