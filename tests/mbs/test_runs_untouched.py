"""Beside monitors runs stay what they are, to the last bit, and what is dropped is freed: scenes of every kind."""

import gc
import weakref
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from exudyn_romerr import attach
from models import mechanisms
from models.controlled_arm import arm, controlled
from tests.helpers import mbs_scenes, mechanism_runs
from tests.helpers.mechanism_runs import BOTH, COUPLED, FROZEN, pendulum, solve, watch
from tests.helpers.observed import attached
from tests.mbs.control.test_controllers import by_variables
from tests.mbs.floating.test_floating_scene import FORCE, SCENES, add_load, supported, watched

FROZEN_ONLY = ("fast", *BOTH)


def chain():
    mbs, flex = mbs_scenes.added()
    return SimpleNamespace(mbs=mbs, flex=flex, sensors={}, settings=mbs_scenes.settings())


def of_chain(scene, with_sensor=False):
    monitor = attach(scene.mbs, scene.flex, outputs=[mbs_scenes.TIP])
    if with_sensor:
        scene.mbs.AddSensor(monitor.bound_sensor("tip"))
        scene.mbs.Assemble()
    return [monitor]


def model(name):
    make, h = SCENES[name]
    return make(h=h, t_end=20 * h)


def bar_under_a_function():
    scene = supported()
    add_load(scene, scene.right, FORCE, loadVectorUserFunction=lambda mbs, t, f: f)
    scene.sensors, scene.settings = {}, mbs_scenes.settings(3, 3e-4)
    return scene


def under_a_function():
    scene = pendulum(0, steps=40)
    mechanism_runs.add_load(scene, loadVectorUserFunction=lambda mbs, t, vector: [0.0, 1e3 * t, 0.0])
    return scene


def by_pre_step():
    scene = arm(0, "RBE3", steps=20, h=5e-4)
    by_variables(scene)
    return scene


def of_arm(scene):
    scene.mbs.variables["torque"] = 0.0  # as before the first solve
    return [attached(scene, outputs=list(scene.sensors.values()))]


def of_sensors(scene):
    return [watched(scene, outputs=scene.sensors.values(), estimators="auto")]


MECHANISMS = {
    "double pendulum": lambda: pendulum(2),
    "slider crank": lambda: mechanisms.slider_crank(2, t_end=0.01),
    "sprung body": lambda: mechanisms.sprung_body(2, t_end=0.02),
}
RUNS = {  # scene, monitors of it, scope
    "chain": (chain, of_chain, "complete"),
    "chain with a sensor": (chain, partial(of_chain, with_sensor=True), "complete"),
    "clamped": (partial(model, "clamped"), of_sensors, "complete"),
    "bar under a function": (bar_under_a_function, lambda scene: [watched(scene)], "complete"),
    "pendulum": (partial(model, "pendulum"), of_sensors, COUPLED),
    "rotor": (partial(model, "rotor"), of_sensors, COUPLED),
    **{name: (make, watch, COUPLED) for name, make in MECHANISMS.items()},
    **{
        f"{name}, frozen": (make, partial(watch, estimators=FROZEN_ONLY), FROZEN) for name, make in MECHANISMS.items()
    },
    "load by a function": (under_a_function, watch, COUPLED),
    "controller": (partial(controlled, "load by a node", 0, steps=20), of_arm, COUPLED),
    "PreStep": (by_pre_step, of_arm, COUPLED),
}


def everything(scene):
    """Final coordinates, their rates and accelerations, multipliers; all that sensors stored."""
    system = scene.mbs.systemData
    states = system.GetODE2Coordinates, system.GetODE2Coordinates_t, system.GetODE2Coordinates_tt
    sensors = [scene.mbs.GetSensorStoredData(sensor) for sensor in scene.sensors.values()]
    return [*(read() for read in states), system.GetAECoordinates(), *sensors]


def solved(name):
    make, attach_to, scope = RUNS[name]
    scene = make()
    solve(scene)
    before, monitors = everything(scene), attach_to(scene)
    solve(scene)
    assert all(set(monitor.report().scope.values()) == {scope} for monitor in monitors)
    return before, everything(scene), weakref.ref(scene.mbs), monitors[0].runs


@pytest.mark.parametrize("name", RUNS)
def test_no_bit_of_a_run_changes_and_the_mbs_is_freed(name):
    before, after, mbs, runs = solved(name)
    for one, other in zip(before, after, strict=True):
        np.testing.assert_array_equal(other, one)
    gc.collect()
    assert mbs() is None
    assert len(of_body(runs[-1]).times) > 3


def of_body(run):
    return run[0] if isinstance(run, tuple) else run
