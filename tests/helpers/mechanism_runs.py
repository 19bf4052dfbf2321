"""Short runs of mechanisms with a monitor on each flexible bar, for the tests of coupled bounds."""

import numpy as np
import pytest
from exudyn import itemInterface

from exudyn_romerr import attach, floating_body
from models import mechanisms

COUPLED, FROZEN = "coupled (linearised)", "inputs frozen"
BOTH = ("energy", "auxiliary")
STEP = 2e-3  # s
LIE = "NodeType.LieGroupWithDirectUpdate"


def pendulum(n=1, steps=10, **options):
    """Two bars that fall, of 6 static modes and n eigenmodes each."""
    return mechanisms.double_pendulum(n, h=STEP, t_end=steps * STEP, **options)


def watch(scene, *bars, outputs="middle {} local", **options):
    """Attach monitors to bars, numbered from 1, or to all; one output "probe" each, of the sensor so named."""
    monitors = []
    for bar in bars or range(1, 1 + len(scene.bodies)):
        sensor = scene.sensors[outputs.format(bar)]
        scene.mbs.SetSensorParameter(sensor, "name", "probe")
        flex = floating_body(scene.fem, scene.bodies[bar - 1])
        monitors.append(attach(scene.mbs, flex, outputs=[sensor], **options))
    return monitors


def solve(scene, **options):
    """Assemble if that was not done, and solve."""
    if not scene.mbs.systemIsConsistent:
        scene.mbs.Assemble()
    scene.mbs.SolveDynamic(scene.settings, **options)


def reports(scene, *bars, **options):
    """Attach, solve, and return the reports."""
    monitors = watch(scene, *bars, **options)
    solve(scene)
    return [monitor.report() for monitor in monitors]


def from_to(scene, start, end):
    """Let the next solve go from one step to another."""
    integration = scene.settings.timeIntegration
    integration.startTime, integration.endTime = start * STEP, end * STEP
    integration.numberOfSteps = end - start


def with_frames(node, make, **options):
    """A scene whose floating frames have another type of node."""
    original = mechanisms.ObjectFFRFreducedOrderInterface
    mechanisms.ObjectFFRFreducedOrderInterface = lambda fem: original(fem, rigidBodyNodeType=node)
    try:
        return make(**options)
    finally:
        mechanisms.ObjectFFRFreducedOrderInterface = original


def ground_marker(scene, position):
    """A rigid marker on the ground."""
    ground = scene.mbs.AddObject(itemInterface.ObjectGround(referencePosition=position))
    return scene.mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=ground))


def add_spring(scene, bar=2, stiffness=1e4, **options):
    """Hang the end of a bar on a spring, unstretched at first."""
    markers = [ground_marker(scene, [0.4 * bar, 0.02, 0.03]), scene.markers[f"right {bar}"]]
    spring = itemInterface.CartesianSpringDamper
    return scene.mbs.AddObject(spring(markerNumbers=markers, stiffness=[stiffness] * 3, **options))


def add_load(scene, bar=2, vector=(0.0, 100.0, 0.0), **options):
    """Load the end of a bar by a force."""
    load = itemInterface.LoadForceVector
    return scene.mbs.AddLoad(load(markerNumber=scene.markers[f"right {bar}"], loadVector=list(vector), **options))


def steps_of(monitor):
    """Number of instants of every run that was kept."""
    return [len(run.report().t) for run in monitor.runs]


def assert_same(one, other, off):
    """Estimates and bounds of two reports of "probe" are equal, but for a share of the largest."""
    one, other = one.output("probe"), other.output("probe")
    for x, y in ((one.estimate, other.estimate), (one.bound["best"], other.bound["best"])):
        assert np.isfinite(x).all() == np.isfinite(y).all()
        if np.isfinite(x).all():
            np.testing.assert_allclose(y, x, rtol=0, atol=off * np.abs(x).max())


def raised(monitor):
    """The error that the report is refused with; asked twice."""
    errors = []
    for _ in range(2):
        with pytest.raises(Exception) as caught:
            monitor.report()
        errors.append(caught.value)
    assert errors[0] is errors[1]
    return errors[0]


def ran_to_its_end(scene):
    """Whether nothing stopped the solve."""
    end = scene.settings.timeIntegration.endTime
    return bool(np.isclose(scene.mbs.systemData.GetTime(), end, rtol=1e-9))  # solvers add up their steps
