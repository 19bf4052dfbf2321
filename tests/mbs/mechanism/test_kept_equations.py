"""A mechanism that a PostStep function changes is not certified, for however few steps.

It is another one than bounds are made of: where velocities were set anew they were up to 289 times too low.
"""

import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from exudyn_romerr.mbs.mechanism.kept_equations import KeptEquations
from exudyn_romerr.online.run_messages import CHANGED
from exudyn_romerr.report.scope import COUPLED, NOT_CERTIFIED
from models import mechanisms

STEP, STEPS = 5e-4, 60  # s
KICKED = range(8, 26)  # more steps than are looked at closer, with larger residuals than the pulse has


def kicks(t):
    """A force that rises and falls within single steps, and ends."""
    step = t / STEP
    return 0.0, 0.0, 1e4 * (int(step) % 2) * (KICKED.start < step < KICKED.stop)


def smooth(t):
    return 0.0, 0.0, 10.0 * np.sin(30.0 * t) ** 4


def sprung(force=smooth):
    scene = mechanisms.sprung_body(n=2, h=STEP, t_end=STEPS * STEP, force=force)
    spring, before = scene.objects["right spring"], [2e5, 1e5, 1e5]
    load = itemInterface.LoadForceVector(markerNumber=scene.markers["right 1"], loadVector=[0.0] * 3)
    return scene, spring, before, scene.mbs.AddLoad(load)


def reports(scene, function, **options):
    """Solve with a PostStep function; one report a body, all of coupled scope."""
    scene.mbs.SetPostStepUserFunction(function)
    monitors = [
        romerr.attach(scene.mbs, romerr.floating_body(scene.fem, items), auxiliary_modes=6, **options)
        for items in scene.bodies
    ]
    scene.solve()
    found = [monitor.report() for monitor in monitors]
    assert all(set(report.scope.values()) == {COUPLED} for report in found)
    return found


def failing(*anything):
    raise RuntimeError("a table that ends")


def assert_certified(found, certified):
    for report in found:
        assert any(CHANGED in message for message in report.messages) != certified
        assert report.scope_reason.endswith(NOT_CERTIFIED) != certified


@pytest.mark.parametrize("stiffer", [1.0, 3.0])
def test_a_spring_that_is_another_one_for_a_step_without_residuals_between_samples(stiffer):
    """Nothing but the look at every step tells; without the change the run stays certified."""
    scene, spring, before, _ = sprung()

    def change(mbs, t):
        within = round(t / STEP) == 30
        mbs.SetObjectParameter(spring, "stiffness", [x * (stiffer if within else 1.0) for x in before])
        return True

    assert_certified(reports(scene, change, midpoint_residual=False), certified=stiffer == 1.0)


def test_a_load_of_a_step_among_larger_residuals():
    """The steps that are looked at closer are others."""
    scene, *_, load = sprung(kicks)

    def change(mbs, t):
        mbs.SetLoadParameter(load, "loadVector", [0.0, 0.0, 50.0 * (round(t / STEP) == 50)])
        return True

    assert_certified(reports(scene, change), certified=False)


@pytest.mark.parametrize("share", [0.0, 1e-3])
def test_velocities_that_the_function_sets(share):
    """The equations hold at all samples; the motion between them is none of theirs."""
    scene, *_ = sprung()

    def change(mbs, t):
        if round(t / STEP) == 30:
            mbs.systemData.SetODE2Coordinates_t((1 + share) * mbs.systemData.GetODE2Coordinates_t())
        return True

    assert_certified(reports(scene, change), certified=share == 0.0)


@pytest.mark.parametrize("off", [(), (30, 31)])
def test_a_joint_that_does_not_act_for_two_steps(off):
    """Equations of motion hold without its forces: what shows is that it has moved."""
    scene = mechanisms.double_pendulum(n=2, h=STEP, t_end=STEPS * STEP, force=smooth)
    joint = scene.objects["hinge 2"]

    def change(mbs, t):
        mbs.SetObjectParameter(joint, "activeConnector", round(t / STEP) not in off)
        return True

    assert_certified(reports(scene, change), certified=not off)


def test_what_cannot_be_looked_at_is_not_certified(monkeypatch):
    """A user function that fails in states that it was called in before: nothing would tell of a change."""
    scene, *_ = sprung()
    monkeypatch.setattr(KeptEquations, "_broken", failing)
    for report in reports(scene, lambda mbs, t: True, midpoint_residual=False):
        assert [doubt.cause for doubt in report.uncertified] == ["changes along the run could not be looked for"]
        assert "a table that ends" in report.uncertified[0]
