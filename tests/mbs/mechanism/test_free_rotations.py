"""Positions in global axes of a body that nothing holds: its bound knows what rigid motions keep for ever."""

import warnings

import exudyn as exu
import numpy as np
from exudyn import itemInterface

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
from models.floating import interface

SEED = 45  # a free bar of hexahedra that turns about all axes; a force on it ends suddenly
NEWTON = 1e-10  # m; two runs with other tolerances of Newton's iteration differ by 4e-11 m


def with_a_sensor(complete):
    scene = built(drawn(SEED), complete)
    sensor = itemInterface.SensorSuperElement(
        bodyNumber=scene.bodies[0]["oFFRFreducedOrder"],
        meshNodeNumber=int(interface(scene.fems[0], "tip")[0][0]),
        outputVariableType=exu.OutputVariableType.Displacement,
        storeInternal=True,
    )
    return scene, scene.mbs.AddSensor(sensor)


def test_positions_keep_what_rigid_motions_were_pushed_by():
    """Part of what was missed is measured, and not added to the prediction: the body drifts on by it."""
    full, sensor = with_a_sensor(True)
    full.solve()
    truth = full.mbs.GetSensorStoredData(sensor)[:, 1:]
    scene, sensor = with_a_sensor(False)
    monitor = romerr.attach(
        scene.mbs, [romerr.floating_body(scene.fems[0], scene.bodies[0])], outputs=[sensor], estimators="auxiliary"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the wrenches' use of all modes
        scene.solve()
    [out] = monitor.report().bodies[0].outputs.values()
    left = np.abs(truth - out.corrected)
    assert (left <= out.corrected_bound + NEWTON).all()  # without the measured part 20 times above
    assert (np.abs(truth - out.value) <= out.bound["auxiliary"] + NEWTON).all()
    assert (left.max(axis=0) > 0.005 * out.corrected_bound.max(axis=0)).all()  # measured 0.016 to 0.31
