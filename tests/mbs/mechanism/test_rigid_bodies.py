"""Rigid bodies with Tait-Bryan angles beside a flexible one: the same errors as with Euler parameters."""

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.rigidBodyUtilities import InertiaCuboid

from exudyn_romerr import attach, floating_body
from models import floating, mechanisms

EULER, ANGLES = exu.NodeType.RotationEulerParameters, exu.NodeType.RotationRxyz
BALL, ARM, STEP, END = [1, 1, 1, 0, 0, 0], np.array([0.08, 0.02, 0.03]), 1e-3, 0.05
SHOWN = exu.OutputVariableType.Position, exu.OutputVariableType.AngularVelocity


def push(t):
    return 0.0, 60 * np.sin(60 * t) ** 2, 40 * np.sin(60 * t) ** 2


def hung(node, n=2, h=STEP, is_told=False):
    """A hinged bar, a block that turns about all axes on a ball joint at its end: what it shows, errors if told."""
    scene = mechanisms._scene((n, "RBE3"), (h, END))
    mbs, (left, right) = scene.mbs, mechanisms._faces(scene.fem)
    mechanisms._add_bar(scene, floating.RAYLEIGH)
    inertia = InertiaCuboid(density=7.8e3, sideLengths=[0.1, 0.05, 0.08])
    block = mbs.CreateRigidBody(referencePosition=right + ARM, inertia=inertia, nodeType=node)
    mechanisms.join(scene, "left", mechanisms._ground_marker(mbs, left), scene.markers["left 1"], mechanisms.HINGE)
    mechanisms.join(scene, "ball", scene.markers["right 1"], mechanisms._body_marker(mbs, block, -ARM), BALL)
    at = {"bodyNumber": block, "localPosition": ARM, "storeInternal": True}
    sensors = [mbs.AddSensor(itemInterface.SensorBody(outputVariableType=kind, **at)) for kind in SHOWN]
    corner = mechanisms._body_marker(mbs, block, ARM)
    mechanisms._finished(scene, itemInterface.LoadForceVector, corner, push, False)
    monitor = attach(mbs, [floating_body(scene.fem, scene.bodies[0])]) if is_told else None
    scene.solve()
    outputs = [monitor.report().output(mbs.GetSensor(one)["name"]) for one in sensors if is_told]
    return [mbs.GetSensorStoredData(sensor)[:, 1:] for sensor in sensors], outputs


def test_errors_are_told_beside_rigid_bodies_with_angles():
    """Modes: the same as with Euler parameters, and as a run with more has it; steps: as a run with shorter ones."""
    (shown, outputs), (_, others) = (hung(node, is_told=True) for node in (ANGLES, EULER))
    (more, _), (finer, _) = hung(ANGLES, n=20), hung(ANGLES, h=STEP / 10)
    for of, out, other, full, fine in zip(shown, outputs, others, more, finer, strict=True):
        modes, steps = out.estimate_parts["basis"], out.estimate_parts["time step"]
        for truth in (other.estimate_parts["basis"], full - of):
            np.testing.assert_allclose(modes, truth, rtol=0, atol=5e-3 * np.abs(modes).max())
        np.testing.assert_allclose(steps, fine[::10] - of, rtol=0, atol=0.02 * np.abs(steps).max())
        assert np.abs(modes).max() > 1e-9 * np.abs(of).max()
