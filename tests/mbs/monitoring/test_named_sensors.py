"""Outputs by the name of their sensor; the plan names all that is known, watched and left out."""

import re

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from models import floating, mechanisms
from tests.helpers import mbs_scenes
from tests.helpers.mechanism_runs import solve

STEPS = {"h": 1e-3, "t_end": 0.004}


def one_bar(**options):
    """A pendulum with sensors "the tip", "the right" and, of its joint, "force"; its body."""
    scene = floating.pendulum(0, **STEPS, **options)  # eigenmodes differ in their last digits each time
    for name in ("tip", "right"):
        scene.mbs.SetSensorParameter(scene.sensors[name], "name", f"the {name}")
    joint = next(i for i in range(scene.mbs.systemData.NumberOfObjects()) if is_joint(scene.mbs.GetObject(i)))
    shows = exu.OutputVariableType.ForceLocal
    scene.mbs.AddSensor(itemInterface.SensorObject(name="force", objectNumber=joint, outputVariableType=shows))
    return scene, romerr.floating_body(scene.fem, scene.items)


def is_joint(item):
    return item["objectType"] == "JointGeneric"


def reported(outputs, in_a_list=False):
    scene, flex = one_bar()
    monitor = romerr.attach(scene.mbs, [flex] if in_a_list else flex, outputs=outputs)
    solve(scene)
    return monitor.report()


@pytest.fixture(scope="module")
def by_number():
    scene, flex = one_bar()
    monitor = romerr.attach(scene.mbs, flex, outputs=[scene.sensors["tip"]])
    solve(scene)
    return monitor.report().output("the tip")


@pytest.mark.parametrize("outputs", ["the tip", ["the tip"], ("the tip",)])
def test_a_name_means_its_sensor(outputs, by_number):
    """Alone, or in a list: bounds are those of the number, to the last bit."""
    report = reported(outputs)
    assert list(report.outputs) == ["the tip"]
    np.testing.assert_array_equal(report.output("the tip").bound["best"], by_number.bound["best"])


@pytest.mark.parametrize("in_a_list", [False, True])
def test_what_a_report_calls_in_the_frame_can_be_asked_for(in_a_list):
    """Under the name that it has where sensors were not asked for."""
    scene, flex = one_bar()
    monitor = romerr.attach(scene.mbs, [flex] if in_a_list else flex)
    solve(scene)
    name = "the right in the frame"
    asked, found = reported([name], in_a_list).output(name), monitor.report().output(name)
    np.testing.assert_allclose(asked.value, found.value, rtol=1e-12)  # a product with fewer rows rounds otherwise
    assert np.isfinite(asked.bound["best"]).all()


def test_names_of_sensors_on_no_flexible_body():
    report = reported(["force", "the tip"], in_a_list=True)
    assert set(report.outputs) == {"force", "the tip"}
    scene, flex = one_bar()
    with pytest.raises(romerr.InputError, match=r"\(force\), of type 'Object', .*; attach\(mbs, \[flex\]\)"):
        romerr.attach(scene.mbs, flex, outputs=["force"])


def test_what_the_message_says_of_a_node_set_works():
    """Its code is run as it stands."""
    scene, flex = one_bar()
    with pytest.raises(romerr.InputError, match="'right' is a node set") as caught:
        romerr.attach(scene.mbs, flex, outputs="right")
    code = re.search(r"pass (romerr\..*)$", str(caught.value))[1]
    output = eval(code, {"romerr": romerr, "fem": scene.fem})
    monitor = romerr.attach(scene.mbs, flex, outputs=[output])
    solve(scene)
    assert np.isfinite(monitor.report().output("right").bound["best"]).all()


def test_a_name_that_several_sensors_have():
    scene, flex = one_bar()
    scene.mbs.SetSensorParameter(scene.sensors["right"], "name", "the tip")
    tip, right = scene.sensors["tip"], scene.sensors["right"]
    with pytest.raises(romerr.InputError, match=f"'the tip', which sensors {tip}, {right} are called: pass"):
        romerr.attach(scene.mbs, flex, outputs=["the tip"])


def test_a_linear_body_has_no_sensors():
    """The message has the code with the name that was asked for."""
    mbs = mbs_scenes.new_mbs()
    body = romerr.ElasticBody(np.eye(6), np.eye(6), positions=np.zeros((2, 3)))
    flex = romerr.add_reduced_body(mbs, body, romerr.Basis(np.eye(6)[:, :2]))
    for outputs in ("last", ["last"]):
        with pytest.raises(romerr.InputError, match=r"pass romerr.Output\('last', rows\) or"):
            romerr.attach(mbs, flex, outputs=outputs)


def test_a_plan_has_gravity_and_what_is_not_on_the_body():
    scene, flex = one_bar()
    monitor = romerr.attach(scene.mbs, flex)
    scene.mbs.Assemble()
    loads = [scene.mbs.GetLoad(i) for i in range(scene.mbs.systemData.NumberOfLoads())]
    gravity = next(i for i, load in enumerate(loads) if load["loadType"] == "MassProportional")
    assert f"known: gravity, load {gravity} ({loads[gravity]['name']})" in monitor.plan.computed
    assert "attach(mbs, [flex])" in dict(monitor.plan.left_out)["sensor 'force'"]


def test_a_plan_of_a_mechanism_lists_all_that_is_watched():
    """Before the run and after it; what the plans of all bodies leave out is there once."""
    scene = mechanisms.double_pendulum(1, **STEPS)
    joint = next(i for i in range(scene.mbs.systemData.NumberOfObjects()) if is_joint(scene.mbs.GetObject(i)))
    for name in ("ForceLocal", "TorqueLocal"):
        shows = getattr(exu.OutputVariableType, name)
        scene.mbs.AddSensor(itemInterface.SensorObject(name=name, objectNumber=joint, outputVariableType=shows))
    monitor = romerr.attach(scene.mbs, [romerr.floating_body(scene.fem, items) for items in scene.bodies])
    scene.mbs.Assemble()
    before = monitor.plan
    solve(scene)
    report = monitor.report()
    for plan in (before, report.plan):
        assert "output 'ForceLocal': force, estimated, no bound" in plan.computed
        assert "output 'TorqueLocal': torque, estimated, no bound" in plan.computed
        assert all(any(f"output {name!r}: " in line for line in plan.computed) for name in report.outputs)


def test_a_plan_has_the_number_of_vectors():
    scene = floating.pendulum(2, **STEPS)
    for asked, count in (("auto", 26), (30, 30)):
        flex = romerr.floating_body(scene.fem, scene.items)
        scene.mbs.SetPostStepUserFunction(0)
        monitor = romerr.attach(scene.mbs, flex, auxiliary_modes=asked)
        scene.mbs.Assemble()
        assert f"modes by {count} vectors" in monitor.plan.computed[0]
