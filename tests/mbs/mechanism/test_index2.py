"""Coupled bounds where the solver holds constraints at the level of velocities; truth: all modes, the same steps."""

from dataclasses import replace

import exudyn as exu
import numpy as np
import pytest

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
from benchmarks.sweep_mechanisms import ELSEWHERE

# of corrected bounds: seed 9, an error of 4e-16 m, is 1.11 times its own in one of three runs (1.02 with the floor),
# by what joints drift by, as below; 0.4 with steps of h / 16
DRIFT = 1.2
TIGHTER = 0.1  # Newton's tolerances of the truth
ROUNDING = 1e-10  # of the largest value: what Newton's relative tolerance of that leaves


def solved(scene):
    scene.mbs.Assemble()
    scene.mbs.SolveDynamic(scene.settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    return scene.motion()


def worst(seed, finer=1):
    """Largest error over its bound, and corrected error over its own, of 20 steps that are so many times finer.

    An error has to exceed what both runs change by with Newton's own tolerances, and somewhere else in space.
    """
    mechanism = drawn(seed)
    mechanism = replace(mechanism, h=mechanism.h / finer, steps=20 * finer)
    truth, again = solved(built(mechanism, True, TIGHTER)), solved(built(mechanism, True, 1.0, ELSEWHERE))
    reduced_again, scene, monitors = solved(built(mechanism, False, TIGHTER, ELSEWHERE)), built(mechanism), []
    for fem, items, sensors in zip(scene.fems, scene.bodies, scene.sensors, strict=True):
        flex = romerr.floating_body(fem, items)
        monitors.append(romerr.attach(scene.mbs, flex, outputs=list(sensors.values())))
    solved(scene)
    found = []
    for name, out in (pair for monitor in monitors for pair in monitor.report().outputs.items()):
        left = np.abs(truth[name] - again[name]) + np.abs(out.value - reduced_again[name])
        floor = left.max() + ROUNDING * np.max(np.abs(truth[name]))
        pairs = (out.value, out.bound["best"]), (out.corrected, out.corrected_bound)
        found.append([np.max(np.abs(truth[name] - value) / (bound + floor)) for value, bound in pairs])
    return np.max(found, axis=0)


@pytest.mark.parametrize("seed", [9, 22])
def test_vectors_ring_as_the_bodies_do(seed):
    """Seeds of a sudden start; with vectors integrated with numerical damping 1.4 and 97 times the bound."""
    best, corrected = worst(seed)
    assert best <= 1.0
    assert corrected <= DRIFT


@pytest.mark.xfail(strict=True, reason="what a turning hinge drifts by, other with all modes, is in no bound")
def test_drift_of_constraints_is_covered():
    """Seed 45, a hinge that turns at once: 1.06 times the bound, corrected 98 times. The report says what drifts."""
    assert np.all(worst(45) <= 1.0)


def test_it_drifts_less_in_shorter_steps():
    assert np.all(worst(45, finer=16) <= 1.0)
