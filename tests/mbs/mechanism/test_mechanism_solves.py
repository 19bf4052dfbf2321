"""Coupled bounds over several solves, blocks of steps and steps of other lengths."""

import warnings
from dataclasses import replace
from pathlib import Path

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import SensorSuperElement

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
from models.floating import interface
from tests.helpers.mechanism_runs import (
    COUPLED,
    FROZEN,
    STEP,
    add_spring,
    assert_same,
    from_to,
    pendulum,
    reports,
    solve,
    steps_of,
    watch,
)
from tests.helpers.observed import attached

SAME = 1e-5  # of the largest: what Newton's iterations leave, and modes that start at random
OFF = 0.06  # of the error
TASKS = Path("/proc/self/task")  # a folder for each thread
TRAPEZOIDAL = exu.DynamicSolverType.TrapezoidalIndex2


def test_continued_solve_is_as_one():
    scene = pendulum(steps=20)
    monitors = watch(scene)
    solve(scene, solverType=TRAPEZOIDAL)  # its accelerations are not made anew by a solve that goes on
    from_to(scene, 0, 8)
    solve(scene, solverType=TRAPEZOIDAL, updateInitialValues=True)
    from_to(scene, 8, 20)
    solve(scene, solverType=TRAPEZOIDAL)
    for monitor in monitors:
        whole, first, second = (monitor.report(i) for i in range(3))
        once, *twice = (report.output("probe").estimate_parts["basis"] for report in (whole, first, second))
        np.testing.assert_allclose(
            np.concatenate([twice[0], twice[1][1:]]), once, rtol=0, atol=1e-3 * np.abs(once).max()
        )


def in_two_solves(scene):
    """Solve ten steps, and ten more."""
    scene.mbs.Assemble()
    one = scene.settings.timeIntegration
    one.numberOfSteps, one.endTime = 10, 10 * scene.mechanism.h
    scene.mbs.SolveDynamic(scene.settings, updateInitialValues=True)
    one.startTime, one.endTime = one.endTime, 2 * one.endTime
    scene.mbs.SolveDynamic(scene.settings)
    return scene.motion()


@pytest.mark.parametrize("seed", [22, 45])
def test_a_solve_that_goes_on_begins_with_accelerations_of_its_own(seed):
    """Joints make them others: multipliers ring from step to step. The truth: all modes, the same two solves."""
    mechanism = replace(drawn(seed), steps=20)
    truth, looser = (in_two_solves(built(mechanism, True, factor)) for factor in (0.1, 1.0))
    scene, few = built(mechanism), in_two_solves(built(mechanism, iterate=0.1))
    monitor = attached(scene, outputs=list(scene.sensors[0].values()))
    computed = in_two_solves(scene)
    for name, out in monitor.report().outputs.items():
        floor = np.max(np.abs(truth[name] - looser[name])) + np.max(np.abs(computed[name] - few[name]))
        error = truth[name] - out.value
        left = np.abs(error - out.estimate_parts["basis"]).max(axis=0)
        assert np.all(left <= OFF * np.abs(error).max() + floor)
        assert np.all(left <= 2 * out.uncertainty.max(axis=0) + floor)


def test_every_solve_starts_anew_and_keeps_its_run():
    scene = pendulum(steps=3)
    monitors = watch(scene)
    for _ in range(5):
        solve(scene)
    for monitor in monitors:
        assert steps_of(monitor) == [4] * 5
        assert_same(monitor.report(0), monitor.report(1), SAME)


def test_reports_during_a_run_change_nothing():
    asked, wanted = [], [False]

    def ask(mbs, t):
        if wanted[0] and t > 0:
            asked.append([len(monitor.report().t) for monitor in (*monitors, monitors[0])])
        return True

    scene = pendulum()
    monitors = watch(scene, hook=ask)
    solve(scene)
    wanted[0] = True
    solve(scene)
    assert asked == [[i, i, i] for i in range(2, 12)]
    for monitor in monitors:
        assert_same(*(monitor.report(i) for i in range(2)), SAME)


def test_body_attached_between_solves_completes_the_mechanism():
    scene = pendulum()
    monitors = watch(scene, 1)
    solve(scene)
    monitors += watch(scene, 2)
    solve(scene)
    assert set(monitors[0].report(0).scope.values()) == {FROZEN}
    assert {scope for monitor in monitors for scope in monitor.report().scope.values()} == {COUPLED}
    for monitor, report in zip(monitors, reports(pendulum()), strict=True):
        assert_same(report, monitor.report(), SAME)


def test_items_added_between_solves_are_used():
    scene = pendulum()
    monitors = watch(scene)
    solve(scene)
    add_spring(scene, stiffness=1e6)
    solve(scene)
    other = pendulum()
    add_spring(other, stiffness=1e6)
    for monitor, report in zip(monitors, reports(other), strict=True):
        assert_same(report, monitor.report(), SAME)


def test_order_of_attaching_does_not_matter():
    second, first = reports(pendulum(), 2, 1)
    for report, other in zip((first, second), reports(pendulum()), strict=True):
        assert_same(report, other, SAME)


def test_steps_of_other_lengths():
    failures = [
        True
    ] * 12  # in a list, which is put back where the force is asked beside the run; of an iterator, none

    def force(t):  # the solver halves its step until all failures are used up
        return (0.0, np.nan, 0.0) if t > 5.5 * STEP and failures and failures.pop() else (0.0, 1e3 * t, 0.0)

    scene = pendulum(force=force)
    integration = scene.settings.timeIntegration
    integration.adaptiveStep, integration.minimumStepSize, integration.adaptiveStepRecoverySteps = True, 1e-6, 1
    for report, other in zip(
        reports(scene),
        reports(pendulum(force=lambda t: (0.0, 1e3 * t, 0.0))),
        strict=True,
    ):
        assert report.t[-1] == pytest.approx(10 * STEP)
        assert np.ptp(np.diff(report.t)) >= STEP / 2
        sizes = [np.abs(one.output("probe").estimate_parts["basis"]).max() for one in (report, other)]
        assert sizes[0] == pytest.approx(sizes[1], rel=0.05)
        assert not np.isfinite(report.output("probe").bound["best"]).any()


def own_force(mbs, t, number, u, v, stiffness, damping, offset):
    return [0.0, 0.0, -10.0 * u[2]]


def switch_off(scene):
    scene.mbs.SetObjectParameter(scene.objects["hinge 2"], "activeConnector", False)


def control(scene):
    scene.mbs.SetObjectParameter(scene.objects["spring"], "springForceUserFunction", own_force)


CHANGES = {
    "a joint less": switch_off,
    "a controller": control,
    "nothing": lambda s: None,
}


@pytest.mark.parametrize("change", CHANGES)
def test_mechanism_changed_before_a_solve_goes_on(change):
    """What is told goes on; nothing breaks."""
    scene, edit = pendulum(), CHANGES[change]
    scene.objects["spring"] = add_spring(scene)
    monitors = watch(scene)
    solve(scene, updateInitialValues=True)
    edit(scene)
    from_to(scene, 10, 15)
    solve(scene)
    for monitor in monitors:
        assert set(monitor.report().scope.values()) == {COUPLED}
        assert steps_of(monitor) == [11, 6]


def test_body_attached_before_a_solve_goes_on():
    scene = pendulum()
    monitors = watch(scene, 1)
    solve(scene, updateInitialValues=True)
    monitors += watch(scene, 2)
    from_to(scene, 10, 15)
    solve(scene)
    assert [steps_of(monitor) for monitor in monitors] == [[11, 6], [6]]


@pytest.mark.skipif(not TASKS.exists(), reason="counts threads as Linux shows them")
def test_threads_of_the_run_stay(capfd):
    """Exudyn has one task manager; a solver of ours that was initialised without threads ended it for the run."""
    found, threads = [], []
    for is_watched in (False, True):
        scene = pendulum(0, steps=10)  # eigenmodes differ in the last bits each time they are computed
        scene.settings.parallel.numberOfThreads = 2
        threads.clear()

        def count(mbs, t):
            threads.append(len(list(TASKS.iterdir())))
            return True

        scene.mbs.SetPostStepUserFunction(count)
        if is_watched:
            watch(scene)
        solve(scene)
        found.append([threads[0], threads[-1], scene.mbs.systemData.GetODE2Coordinates().tolist()])
    assert found[0] == found[1]
    assert "TaskManager" not in capfd.readouterr().out


def test_after_a_solve_that_failed_in_its_first_step():
    """As if there had been none."""
    found = []
    for fails in (False, True):
        scene = built(replace(drawn(37), steps=10))
        monitor = romerr.attach(scene.mbs, scene.flexible(), outputs=list(scene.sensors[0].values()))
        if fails:
            newton = scene.settings.timeIntegration.newton
            newton.maxIterations, before = 1, newton.maxIterations
            with pytest.raises(exu.SolverError):
                scene.solve()
            newton.maxIterations = before
        scene.solve()
        report = monitor.report()
        found.append([*report.messages, *(x.tobytes() for x in report.output("tip 1").bound.values())])
    assert found[0] == found[1]


# --- what a solve goes on from: the equilibrium of a static one, errors of one whose joint is driven ---


STEPS = 5
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
    monitor = attached(scene, outputs=list(scene.sensors[0].values()))
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


def by_the_trapezoidal_rule(scene, h):
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
    monitor = attached(scene, outputs=list(scene.sensors[0].values()))
    by_the_trapezoidal_rule(scene, one.h)
    before, after = monitor.report(0), monitor.report(1)
    assert set(after.scope.values()) == {COUPLED}
    for out, last in zip(after.outputs.values(), before.outputs.values(), strict=True):
        one, other = (x.estimate_parts["basis"] for x in (out, last))
        np.testing.assert_allclose(one[0], other[-1], rtol=0, atol=1e-6 * np.abs(other).max())
        assert one[0].any()


# --- a load that switches inside a step of a body whose modes ring: the half width "loads" sees it ---


FINER = 16  # the switch is at 0.69 of a step: known to a percent of what the steps do
SENSOR = "tip 1 global"


def scene_of(mechanism):
    """A mechanism with a sensor of the tip in global axes."""
    scene = built(mechanism)
    (items,), (fem,) = scene.bodies, scene.fems
    scene.sensors[0][SENSOR] = scene.mbs.AddSensor(
        SensorSuperElement(
            name=SENSOR,
            bodyNumber=items["oFFRFreducedOrder"],
            meshNodeNumber=interface(fem, "tip")[0][0],
            outputVariableType=exu.OutputVariableType.Displacement,
            storeInternal=True,
        )
    )
    return scene


@pytest.fixture(scope="module")
def free_bar():
    """A bar without supports; a force on it ends inside a step; nothing damps the modes of its steps."""
    return replace(drawn(164), rho=1.0)


def finer(mechanism):
    """What the tip shows at the samples, solved with shorter steps."""
    scene = scene_of(mechanism)
    scene.settings.timeIntegration.numberOfSteps *= FINER
    scene.settings.solution.sensors.writePeriod = mechanism.h
    scene.solve()
    return scene.motion()[SENSOR]


def test_half_width_covers_a_switch(free_bar):
    """Off by a sixth of the error."""
    scene = scene_of(free_bar)
    (items,), (fem,) = scene.bodies, scene.fems
    monitor = romerr.attach(scene.mbs, romerr.floating_body(fem, items))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene.solve()
    out = monitor.report().output(SENSOR)
    error = finer(free_bar) - scene.motion()[SENSOR]
    off = np.abs(out.estimate_parts["time step"] - error)
    assert off.max() > 0.1 * np.abs(error).max()
    assert (off.max(axis=0) <= out.uncertainty.max(axis=0)).all()
