"""Coupled bounds over several solves, blocks of steps and steps of other lengths."""

from dataclasses import replace
from pathlib import Path

import exudyn as exu
import numpy as np
import pytest

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
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
    flex = romerr.floating_body(scene.fems[0], scene.bodies[0])
    monitor = romerr.attach(scene.mbs, flex, outputs=list(scene.sensors[0].values()))
    computed = in_two_solves(scene)
    for name, out in monitor.report().outputs.items():
        floor = np.max(np.abs(truth[name] - looser[name])) + np.max(np.abs(computed[name] - few[name]))
        error = truth[name] - out.value
        left = np.abs(error - out.estimate_parts["basis"]).max(axis=0)
        assert np.all(left <= OFF * np.abs(error).max() + floor)
        assert np.all(left <= 2 * out.uncertainty.max(axis=0) + floor)


def test_second_solve_starts_anew():
    scene = pendulum()
    monitors = watch(scene)
    solve(scene)
    solve(scene)
    for monitor in monitors:
        assert_same(*(monitor.report(i) for i in range(2)), SAME)


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


def test_every_solve_keeps_its_run():
    scene = pendulum(steps=3)
    monitors = watch(scene)
    for _ in range(5):
        solve(scene)
    assert [steps_of(monitor) for monitor in monitors] == [[4] * 5] * 2


def own_force(mbs, t, number, u, v, stiffness, damping, offset):
    return [0.0, 0.0, -10.0 * u[2]]


def attach_the_other(scene):
    return watch(scene, 2)


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
    for attached in (False, True):
        scene = pendulum(0, steps=10)  # eigenmodes differ in the last bits each time they are computed
        scene.settings.parallel.numberOfThreads = 2
        threads.clear()

        def count(mbs, t):
            threads.append(len(list(TASKS.iterdir())))
            return True

        scene.mbs.SetPostStepUserFunction(count)
        if attached:
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
