"""Static and dynamic solves in turn: what was prepared for both is kept, and changes nothing."""

import tracemalloc

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

from exudyn_romerr import add_reduced_body, attach, krylov_basis
from exudyn_romerr.linear.run import prepare
from exudyn_romerr.mbs.floating import moving_subject
from models import linkage
from tests.helpers import mbs_scenes
from tests.helpers.observed import attached
from tests.mbs.floating.test_floating_scene import HINGE, TIP, Quantity, add_load, add_spring, settings, supported

FORCE = [0.0, 20.0, 30.0]
KEPT = 400  # bytes a step: 5 numbers of 4 bounds, 5 of samples, and q (12,) of blocks where a bound is largest: 300


@pytest.fixture
def made(monkeypatch):
    """Count what is prepared."""
    counted, one = [], prepare.prepare

    def counting(*given, **options):
        counted.append(given)
        return one(*given, **options)

    monkeypatch.setattr(prepare, "prepare", counting)  # of a run that begins in a static equilibrium
    monkeypatch.setattr(moving_subject, "prepare", counting)
    return counted


def hinged(outputs=(TIP,)):
    """A hinged bar held by a spring, with bounds under frozen inputs."""
    scene = supported(HINGE, n=2)
    add_spring(scene, scene.right)
    scene.load = add_load(scene, scene.right, FORCE)
    node = itemInterface.SensorSuperElement(
        bodyNumber=scene.items["oFFRFreducedOrder"], meshNodeNumber=20, outputVariableType=Quantity.Displacement
    )
    scene.mbs.AddSensor(node)
    scene.monitor = attached(scene, outputs=outputs, scope="inputs frozen")
    return scene


def turn(scene, anew=False):
    """Solve for the equilibrium and from there on; return bounds and estimates. anew: nothing is kept of before."""
    mbs, simulation = scene.mbs, settings(1e-3, 6)
    if not mbs.systemIsConsistent:
        mbs.Assemble()
        scene.begin = mbs.systemData.GetODE2Coordinates(configuration=exu.ConfigurationType.Initial)
    for solve in (mbs.SolveStatic, mbs.SolveDynamic):
        if anew:
            subject = scene.monitor.subject
            subject._made = {}
        if solve == mbs.SolveStatic:
            mbs.systemData.SetODE2Coordinates(scene.begin, configuration=exu.ConfigurationType.Initial)
            solve(simulation, updateInitialValues=True)
        else:
            solve(simulation)
    rows = []
    for report in (scene.monitor.report(-2), scene.monitor.report(-1)):
        for out in report.outputs.values():
            rows += [out.value, *(out.bound[name] for name in sorted(out.bound))]
            rows += [] if out.estimate is None else [out.estimate, out.uncertainty]
    return rows


def assert_same(found, expected):
    assert any(np.any(x) for x in expected)
    for x, y in zip(found, expected, strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("outputs", [(TIP,), None], ids=["asked for", "of sensors"])
def test_what_both_solves_need_is_prepared_once(made, outputs):
    scene = hinged(outputs)
    expected = turn(scene, anew=True)
    assert made
    turn(scene)
    made.clear()
    for _ in range(2):
        assert_same(turn(scene), expected)
    assert not made


def test_what_changed_between_is_prepared_anew(made):
    scene = hinged()
    turn(scene)
    made.clear()
    scene.mbs.SetLoadParameter(scene.load, "loadVector", [0.0, 10.0, -5.0])  # values are no part of what is prepared
    found = turn(scene)
    assert not made
    assert_same(found, turn(scene, anew=True))
    scene.mbs.SetLoadParameter(scene.load, "bodyFixed", True)
    made.clear()
    found = turn(scene)
    assert made
    assert_same(found, turn(scene, anew=True))


def test_a_run_before_keeps_its_bounds_and_no_blocks():
    """Control points and oscillators of its last block, and of those where a bound was largest, were kept, too."""
    body, inputs, output = linkage.build()
    mbs, steps, held = exu.SystemContainer().AddSystem(), 1000, []
    flex = add_reduced_body(
        mbs, body, krylov_basis(body, inputs, 12), inputs=inputs, input_function=linkage.force, initial=None
    )
    monitor = attach(mbs, flex, outputs=[output], auxiliary_modes=40)
    mbs.Assemble()
    tracemalloc.start()
    for _ in range(3):
        mbs.SolveDynamic(mbs_scenes.settings(steps, 1e-3 * steps))
        assert len(monitor.report().t) == steps + 1
        held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert (held[2] - held[1]) / steps < KEPT
