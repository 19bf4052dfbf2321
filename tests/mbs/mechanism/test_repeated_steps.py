"""Steps that adaptive solvers repeat with a smaller one: what these begin with, and what is said of bounds then."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import _face, built
from benchmarks.random_mechanisms import drawn
from exudyn_romerr.online.coupled_runs import FirstSteps
from exudyn_romerr.online.run_messages import REPEATED
from exudyn_romerr.trajectory.scheme import Scheme

# how many, between which none of more than a quarter is accepted, and after how many a force sets in
AMID, ALL = (40, (9.5, 20.5), 15), (10, (-1, 11), -1)
FLOOR = 1e-6  # of the largest value: Newton's tolerance is 1e-10, and at rest before the force rounding is all
FORCE = [500.0, -1000.0, 700.0]  # N


def solved(rho, case, complete=False, attached=False):
    """Solve a bar that is hit while steps are repeated; return what sensors show at all steps, and its monitor."""
    whole, (steps, refused, hit) = drawn(19), case
    bar = replace(whole, bars=whole.bars[:1], links=whole.links[:1], loads=(), rho=rho, steps=steps)
    scene, h = built(bar, complete), bar.h
    mbs, times = scene.mbs, scene.settings.timeIntegration
    load = {"loadVectorUserFunction": lambda mbs, t, vector: [x * (t > hit * h) for x in FORCE]}
    mbs.AddLoad(itemInterface.LoadForceVector(markerNumber=_face(scene, 0, "right"), **load))

    def refuse(mbs, t):
        is_long = mbs.sys["dynamicSolver"].it.currentStepSize > 0.3 * h
        return [1e3 * (refused[0] * h < t < refused[1] * h and is_long), -1.0]

    mbs.SetPostNewtonUserFunction(refuse)
    times.adaptiveStep, times.adaptiveStepRecoverySteps, times.minimumStepSize = True, 2, 1e-9
    times.discontinuous.maxIterations, times.discontinuous.iterationTolerance = 2, 1.0
    times.discontinuous.ignoreMaxIterations, times.adaptiveStepRecoveryIterations = False, 50
    scene.settings.solution.sensors.writePeriod = 1e-9
    flex = romerr.floating_body(scene.fems[0], scene.bodies[0])
    monitor = romerr.attach(mbs, flex, outputs=list(scene.sensors[0].values())) if attached else None
    scene.solve()
    return scene.motion(), monitor


@pytest.mark.parametrize("case", [AMID, ALL], ids=["amid", "all"])
@pytest.mark.parametrize("rho", [0.8, 1.0])
def test_no_certified_bound_is_below_the_error(rho, case):
    """With radius 0.8 errors are above: algorithmic accelerations are those that a first try has left.

    Where each longer step is refused, those that are accepted are of one size.
    """
    (truth, _), (_, monitor) = solved(rho, case, complete=True), solved(rho, case, attached=True)
    report = monitor.report()
    sizes = np.diff(report.t)
    assert (sizes.max() > 3.9 * sizes.min()) == (case == AMID)
    above = [
        np.any(np.abs(truth[name] - out.value) > out.bound["best"] + FLOOR * np.max(np.abs(truth[name])))
        for name, out in report.outputs.items()
    ]
    assert (REPEATED in report.messages) == (rho < 1)
    assert any(above) == (rho < 1)


def shown(radius, *times):
    """What samples of blocks say that begin at t = 0, with steps of 1 that are tried."""
    steps = FirstSteps(Scheme.of_radius(radius), step=1.0)
    steps.open([], [SimpleNamespace(first=SimpleNamespace(t=np.zeros(1)), start=None)])
    found = []
    for t in times:
        found.append(steps.repeated(np.array(t)))
        steps.grown(np.array(t))
    return found


@pytest.mark.parametrize(
    ("radius", "times", "found"),
    [
        (0.9, ([1.0, 2.0], [3.0, 4.0]), ([], [])),
        (0.9, ([1.0, 2.0], [2.5, 3.0]), ([], [REPEATED])),
        (0.9, ([0.5, 1.0], [2.0], [2.5]), ([REPEATED], [], [])),  # the first one was repeated
        (0.9, ([], [0.5, 1.0]), ([], [REPEATED])),
        (1.0, ([1.0, 2.0], [2.5, 3.0]), ([], [])),
    ],
)
def test_other_sizes_are_seen_within_blocks_and_between_them_once(radius, times, found):
    assert shown(radius, *times) == list(found)
