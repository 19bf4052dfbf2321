"""The table of reasons why bounds are not certified: what each says to do is done, on a small scene, and works.

Those that are missing here are in test_not_certified_runs.py, in the same way.
"""

from dataclasses import replace
from functools import cache

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import _face, built
from exudyn_romerr.report.scope import Reason
from models import floating
from models.controlled_arm import add_spring, arm, pd
from tests.helpers.mbs_scenes import scene as chain
from tests.helpers.mbs_scenes import settings
from tests.mbs.control.test_controllers import watched
from tests.mbs.floating.test_floating_scene import HINGE, run, supported
from tests.mbs.mechanism import test_not_certified_runs as others
from tests.mbs.mechanism.test_repeated_steps import ALL, solved
from tests.mbs.mechanism.test_sudden_starts import mechanism
from tests.mbs.mechanism.test_where_solves_go_on import in_equilibrium, of_one_bar

RK44, VERLET = exu.DynamicSolverType.RK44, exu.DynamicSolverType.VelocityVerlet


def of_chain(solver):
    """Report of a damped chain under a known load, by an explicit solver."""
    mbs, _, monitor = chain()
    mbs.SolveDynamic(settings(steps=200), solverType=solver)
    return monitor.report()


def of_motor(limit):
    """Report of an arm whose motor is a spring that saturates, or does not."""
    scene = arm(steps=40)
    add_spring(scene, pd(2e3, 20.0, limit=limit))
    return watched(scene)


def of_bars(kind):
    """Report of two bars under a torque that is there at once, or grows; all that can be damped is at once."""
    scene = built(mechanism(104, 0.0, kind, steps=4))
    monitor = romerr.attach(scene.mbs, scene.flexible(), estimators=("energy", "auxiliary"))
    scene.solve()
    return monitor.report()


def of_index(*by_velocities):
    """Report of the second of two solves of a pendulum, with constraints of velocities or of positions."""
    scene = floating.pendulum(2, h=1e-3, t_end=0.01)
    flex = romerr.floating_body(scene.fem, scene.items)
    monitor = romerr.attach(scene.mbs, flex, outputs=[scene.sensors["tip"]])
    scene.mbs.Assemble()
    time, start = scene.settings.timeIntegration, 0.0
    time.generalizedAlpha.spectralRadius = 1.0
    for is_on in by_velocities:
        time.startTime, time.endTime = start, start + 0.01
        time.generalizedAlpha.useIndex2Constraints = time.generalizedAlpha.useNewmark = is_on
        scene.mbs.SolveDynamic(scene.settings, updateInitialValues=True)
        start = time.endTime
    return monitor.report()


def of_loads(share):
    """Report of a bar on springs after its equilibrium, which it finds under a share of its load."""
    one = replace(of_one_bar(425, base="bushing"), loads=())
    scene = built(one)
    scene.mbs.variables["share"] = share
    load = {"loadVectorUserFunction": lambda mbs, t, vector: [0.0, 0.0, -100.0 * mbs.variables["share"]]}
    scene.mbs.AddLoad(itemInterface.LoadForceVector(markerNumber=_face(scene, 0, "right"), **load))
    flex = romerr.floating_body(scene.fems[0], scene.bodies[0])
    monitor = romerr.attach(scene.mbs, flex, outputs=list(scene.sensors[0].values()))
    in_equilibrium(scene)
    scene.mbs.variables["share"] = 1.0
    scene.settings.timeIntegration.numberOfSteps, scene.settings.timeIntegration.endTime = 5, 5 * one.h
    scene.mbs.SolveDynamic(scene.settings)
    return monitor.report()


def of_modes(n):
    """Report of a bar on a hinge, by eigenmodes alone."""
    return run(supported(HINGE, kind="free", n=n), h=1e-4, steps=5).report()


CASES = {  # reason -> a run that has it, words of the cure, the same run after it
    "UNBALANCED": (lambda: of_chain(VERLET), "solverType=exu.DynamicSolverType.RK44", lambda: of_chain(RK44)),
    "UNCHECKED": (lambda: of_modes(6), "add eigenmodes", lambda: of_modes(12)),
    "CONTROLLER": (lambda: of_motor(5.0), "let the user function be smooth", lambda: of_motor(np.inf)),
    "REPEATED": (
        lambda: solved(0.8, ALL, attached=True)[1].report(),
        "generalizedAlpha.spectralRadius = 1",
        lambda: solved(1.0, ALL, attached=True)[1].report(),
    ),
    "THIRD_ORDER": (lambda: of_bars("at once"), "let loads and motion begin smoothly", lambda: of_bars("smooth")),
    "OTHER_LOADS": (lambda: of_loads(0.0), "the same value in both", lambda: of_loads(1.0)),
    "OTHER_INDEX": (
        lambda: of_index(False, True),
        "set useIndex2Constraints in both solves",
        lambda: of_index(True, True),
    ),
}
NOT_TRIED = {  # and why
    Reason.GOES_ON: "of romerr run, which has no bound to certify: tests/mbs/mirror/test_told_solve.py",
    Reason.UNSEEN: "no user function is known that fails so: test_kept_equations.py has it by hand",
}
made = cache(lambda reason: CASES[reason][0]())


@pytest.mark.parametrize("reason", CASES)
def test_the_cure_is_told(reason):
    report = made(reason)
    assert reason in {doubt.reason for doubt in report.uncertified}
    (doubt,) = [doubt for doubt in report.uncertified if doubt.reason == reason]
    assert CASES[reason][1] in doubt.cure
    assert doubt.cure in str(report)


@pytest.mark.parametrize("reason", CASES)
def test_the_cure_works(reason):
    report = CASES[reason][2]()
    assert report.uncertified == ()
    assert all(np.isfinite(out.bound["best"]).all() for out in report.outputs.values() if out.bound)


def test_every_reason_is_tried():
    tried = {*CASES, *(doubt.reason for _, doubt, _ in others.CASES.values()), *(one.name for one in NOT_TRIED)}
    assert tried == {reason.name for reason in Reason}
