"""A load that switches inside a step of a body whose modes ring: the half width "loads" sees it.

Found by benchmarks/search_estimates.py: residuals between samples were looked at closer only where they moved all
coordinates together by as much as the largest local error does, which is that of the ringing.
"""

import warnings
from dataclasses import replace

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import SensorSuperElement

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
from models.floating import interface

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
