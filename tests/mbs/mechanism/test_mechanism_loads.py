"""Loads that a coupled bound cannot cover: controllers, and jumps after a static solve."""

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

from exudyn_romerr import AssumptionError
from models import mechanisms
from tests.helpers.mechanism_runs import (
    BOTH,
    FROZEN,
    STEP,
    add_load,
    pendulum,
    raised,
    reports,
    solve,
    steps_of,
    was_stopped,
    watch,
)


def with_controller(start=0.0, gain=1.0):
    """Double pendulum whose force along the hinges follows the deflection of its first bar from `start` on."""
    scene = pendulum(steps=40)
    sensor = scene.sensors["tip 1 local"]

    def force(mbs, t, vector):
        return [0.0, 0.0 if t < start else 1.0 - gain * 1e6 * mbs.GetSensorValues(sensor)[1], 0.0]

    add_load(scene, loadVectorUserFunction=force, name="motor")
    return scene


@pytest.mark.parametrize("estimators", ["energy", "auto"])
def test_controller_in_a_load_is_frozen_and_named(estimators):
    for report in reports(with_controller(), estimators=estimators):
        assert set(report.scope.values()) == {FROZEN}
        assert "motor" in report.scope_reason
        assert "controller" in report.scope_reason


@pytest.mark.parametrize("estimators", ["auxiliary", BOTH])
def test_controller_that_begins_in_mid_run_stops_the_solve(estimators):
    """It is found when the next tangent is read; what was bounded before stays."""
    scene = with_controller(start=20.5 * STEP)
    monitors = watch(scene, estimators=estimators)
    solve(scene)
    assert was_stopped(scene)
    for monitor in monitors:
        error = raised(monitor)
        assert type(error) is AssumptionError
        assert "motor" in str(error)
        assert 1 < steps_of(monitor)[0] <= 21


def test_trying_loads_moves_nothing():
    """Functions of time alone are tried too; states and sensors stay the same bit for bit."""
    found = []
    for attached in (False, True):
        scene = pendulum(0, steps=40)  # eigenmodes differ in the last bits each time they are computed
        add_load(scene, loadVectorUserFunction=lambda mbs, t, vector: [0.0, 1e3 * t, 0.0])
        if attached:
            watch(scene, estimators=BOTH)
        solve(scene)
        found.append([scene.mbs.GetSensorStoredData(number) for number in scene.sensors.values()])
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("same", [True, False])
def test_other_loads_than_in_the_static_solve_before_are_said(same):
    """A jump at the start rings in every mode: the report says so, and does not where there is none."""
    dynamic = [False]
    scene = mechanisms.sprung_body(0, t_end=5e-3, force=lambda t: (0.0, 0.0, 1e3 * (same or not dynamic[0])))
    for i in range(scene.mbs.systemData.NumberOfLoads()):
        if scene.mbs.GetLoad(i)["loadType"] == "MassProportional":
            scene.mbs.SetLoadParameter(i, "loadVectorUserFunction", 0)
    (monitor,) = watch(scene, 1, estimators="auxiliary")
    scene.mbs.Assemble()
    scene.settings.staticSolver.verboseMode = 0
    scene.mbs.SolveStatic(scene.settings, updateInitialValues=True)
    dynamic[0] = True
    scene.mbs.SolveDynamic(scene.settings)
    report = monitor.report()
    assert report.scope["auxiliary"] == "coupled (linearised)"
    assert any("static solve before ended with" in message for message in report.messages) != same


def test_solve_that_is_stopped_is_announced(capfd):
    """SolveDynamic does not raise then: who looks at sensors before the report must not be left in the dark."""
    scene = pendulum()
    load = itemInterface.LoadForceVector(markerNumber=scene.markers["right 2"], loadVector=[0, 1, 0], bodyFixed=True)
    scene.mbs.AddLoad(load)
    watch(scene, scope="coupled (linearised)")
    solve(scene)
    exu.Print("end")
    out = capfd.readouterr().out
    assert "exudyn_romerr stops the solve" in out
    assert "bodyFixed" in out
