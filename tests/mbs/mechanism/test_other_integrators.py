"""Solves that go on with another integrator than the one before: what is predicted goes on in its steps."""

from dataclasses import replace

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import _face, built
from benchmarks.random_mechanisms import drawn
from exudyn_romerr.online.run_messages import OTHER_INDEX

STEPS = 10
FORCE = [500.0, -1000.0, 700.0]  # N, from the second solve on
GENERALISED_ALPHA, TRAPEZOIDAL = exu.DynamicSolverType.GeneralizedAlpha, exu.DynamicSolverType.TrapezoidalIndex2


def in_two_solves(scene, second):
    """Solve ten steps at rest, and ten more by another integrator under a force; return what sensors show then."""
    mbs, h = scene.mbs, scene.mechanism.h
    load = mbs.AddLoad(itemInterface.LoadForceVector(markerNumber=_face(scene, 0, "right"), loadVector=[0.0] * 3))
    mbs.Assemble()
    times = scene.settings.timeIntegration
    times.numberOfSteps, times.endTime = STEPS, STEPS * h
    mbs.SolveDynamic(scene.settings, solverType=GENERALISED_ALPHA, updateInitialValues=True)
    mbs.SetLoadParameter(load, "loadVector", FORCE)
    times.startTime, times.endTime = times.endTime, 2 * times.endTime
    times.generalizedAlpha.spectralRadius = 1.0
    mbs.SolveDynamic(scene.settings, solverType=second)
    return scene.motion()


@pytest.mark.parametrize("second", [GENERALISED_ALPHA, TRAPEZOIDAL], ids=lambda solver: solver.name)
def test_errors_are_below_their_bounds(second):
    """Marched on in steps of radius 0.8, errors were up to 18 times their bounds, corrected ones 3400 times.

    Nothing says that these runs are not certified: their integrator has no numerical damping. The truth: all modes,
    the same two solves.
    """
    whole = drawn(19)
    bar = replace(whole, bars=whole.bars[:1], links=whole.links[:1], loads=(), rho=0.8)
    truth, looser = (in_two_solves(built(bar, True, factor), second) for factor in (1.0, 10.0))
    scene, few = built(bar), in_two_solves(built(bar, iterate=10.0), second)
    flex = romerr.floating_body(scene.fems[0], scene.bodies[0])
    monitor = romerr.attach(scene.mbs, flex, outputs=list(scene.sensors[0].values()))
    computed = in_two_solves(scene, second)
    report = monitor.report()
    assert set(report.scope.values()) == {"coupled (linearised)"}
    assert not any("not certified" in message for message in report.messages)
    for name, out in report.outputs.items():
        floor = np.max(np.abs(truth[name] - looser[name])) + np.max(np.abs(computed[name] - few[name]))
        assert floor < 1e-2 * np.max(np.abs(truth[name] - out.value))
        assert np.all(np.abs(truth[name] - out.value) <= out.bound["best"] + floor)
        assert np.all(np.abs(truth[name] - out.corrected) <= out.corrected_bound + floor)


def from_index_3_to_2(scene):
    """Solve 43 steps, and 4 shorter ones with constraints of velocities; return what sensors show then."""
    mbs, h = scene.mbs, scene.mechanism.h
    mbs.Assemble()
    times = scene.settings.timeIntegration
    times.numberOfSteps, times.endTime = 43, 86 * h
    mbs.SolveDynamic(scene.settings, updateInitialValues=True)
    times.numberOfSteps, times.startTime, times.endTime = 4, 86 * h, 90 * h
    times.generalizedAlpha.useIndex2Constraints = times.generalizedAlpha.useNewmark = True
    mbs.SolveDynamic(scene.settings)
    return scene.motion()


def test_after_a_change_of_the_index_nothing_is_certified():
    """Errors are 1.05 times their bounds: velocities jump to where constraints have them. The truth: all modes."""
    whole = drawn(503)
    bars = replace(whole, bars=whole.bars[:2], links=whole.links[:2], loads=whole.loads[:1], rho=1.0)
    truth, scene = from_index_3_to_2(built(bars, True)), built(bars)
    parts = zip(scene.flexible(), scene.sensors, strict=True)
    monitors = [romerr.attach(scene.mbs, flex, outputs=list(sensors.values())) for flex, sensors in parts]
    from_index_3_to_2(scene)
    above = []
    for report in (monitor.report() for monitor in monitors):
        assert OTHER_INDEX in report.uncertified
        above += [np.max(np.abs(truth[y] - out.value) / out.bound["best"]) for y, out in report.outputs.items()]
    assert max(above) > 1.01
