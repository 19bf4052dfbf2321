"""Loads are tried without a trace; what is asked for and cannot be had is said."""

import exudyn as exu
import numpy as np

from exudyn_romerr import AssumptionError
from tests.helpers.mechanism_runs import (
    BOTH,
    add_load,
    pendulum,
    raised,
    ran_to_its_end,
    solve,
    watch,
)


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


def test_what_cannot_be_told_is_announced_once(capfd):
    """SolveDynamic does not raise then: who looks at sensors before the report must not be left in the dark."""
    scene = pendulum()
    (monitor,) = watch(scene, 1, scope="coupled (linearised)")
    solve(scene)
    exu.Print("end")
    out = capfd.readouterr().out
    assert out.count("The simulation goes on") == 1
    assert "are not attached" in out
    assert ran_to_its_end(scene)
    assert type(raised(monitor)) is AssumptionError
