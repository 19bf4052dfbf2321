"""Linear and floating bodies in one attach list: each is bounded as alone."""

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from models import floating
from tests.helpers.mechanism_runs import COUPLED, pendulum, solve

SAME = 1e-3  # of the largest: bounds and estimates of 1e-10 m, beside what Newton leaves of 4e-4 m in two solves
COMPLETE = "complete"


def linear_bar(mbs):
    """A bar whose left face is fixed, under a force at its right face."""
    fem = floating.load_fem("bar")
    fixed = [3 * node + axis for node in floating.interface(fem, "left")[0] for axis in range(3)]
    body = romerr.ElasticBody.from_fem(fem, rayleigh=floating.RAYLEIGH, fixed=fixed)
    nodes, weights = floating.interface(fem, "right")
    inputs = np.zeros((body.N, 3))
    for axis in range(3):
        inputs[3 * nodes + axis, axis] = weights
    force = floating.ramped_force
    return romerr.add_reduced_body(mbs, body, romerr.modal_basis(body, 4), inputs=inputs, input_function=force)


def solved(linear, first=False):
    """Report of a double pendulum, of a linear bar, or of both; first: where this is in the list."""
    scene = pendulum(steps=20)
    bodies, outputs = [romerr.floating_body(scene.fem, items) for items in scene.bodies], []
    for name in ("tip 1", "tip 2 local"):
        scene.mbs.SetSensorParameter(scene.sensors[name], "name", name)
        outputs.append(scene.sensors[name])
    if linear:
        flex = linear_bar(scene.mbs)
        node = itemInterface.SensorNode(
            name="modes",
            nodeNumber=flex.items["nGenericODE2"],
            outputVariableType=exu.OutputVariableType.Coordinates,
        )
        outputs += [(flex, romerr.node_displacement("linear tip", node=5)), scene.mbs.AddSensor(node)]
        bodies.insert(0 if first else 2, flex)
    monitor = romerr.attach(scene.mbs, bodies, outputs=outputs)
    solve(scene)
    return monitor.report()


@pytest.fixture(scope="module")
def alone():
    """Reports of the pendulum, and of the linear bar in an mbs of its own."""
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    monitor = romerr.attach(mbs, linear_bar(mbs), outputs=[romerr.node_displacement("linear tip", node=5)])
    mbs.Assemble()
    mbs.SolveDynamic(pendulum(steps=20).settings)
    return solved(linear=False), monitor.report()


@pytest.mark.parametrize("first", [True, False])
def test_bodies_of_both_kinds_are_bounded_as_alone(alone, first):
    """The linear body has no joint, and its load sees the time alone: it leaves the mechanism what it is."""
    both, (pendulums, bar) = solved(linear=True, first=first), alone
    scopes = [body.scope["auxiliary"] for body in both.bodies]
    assert scopes == ([COMPLETE, COUPLED, COUPLED] if first else [COUPLED, COUPLED, COMPLETE])
    for report, name in ((pendulums, "tip 1"), (pendulums, "tip 2 local"), (bar, "linear tip")):
        one, other = report.output(name), both.output(name)
        for wanted, found in ((one.estimate, other.estimate), (one.bound["best"], other.bound["best"])):
            finite = np.isfinite(wanted)
            assert np.array_equal(finite, np.isfinite(found))
            allowed = SAME * np.max(np.abs(wanted[finite]), initial=0.0)
            np.testing.assert_allclose(found[finite], wanted[finite], rtol=0, atol=allowed)
    most = 1.01 * np.max(bar.output("linear tip").bound["best"] + bar.output("linear tip").round_off)
    assert both.assess("linear tip", most).answer == bar.assess("linear tip", most).answer == "proven"
    assert "modes" not in both.outputs  # of the linear body's own coordinates
