"""Steps that grow by more than twice at once, by an integrator with numerical damping: bounds grow by a factor."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
from exudyn_romerr.decay.passive_steps import step_change
from exudyn_romerr.online import coupled_runs
from exudyn_romerr.online.coupled_runs import FirstSteps
from exudyn_romerr.report.scope import NOT_CERTIFIED
from exudyn_romerr.trajectory.scheme import Scheme


def opened(radius, t=0.0):
    steps, first = FirstSteps(Scheme.of_radius(radius)), SimpleNamespace(t=np.array([t]))
    steps.open([], [SimpleNamespace(first=first, start=None)])
    return steps


def test_growth_counts_within_a_block_and_between_two():
    steps = opened(0.6)
    first, second, third = (steps.grown(np.array(t)) for t in ([1.0, 2.0, 2.1], [2.3, 2.8, 2.9], [3.0, 4.0]))
    assert first.tolist() == [1.0] * 3
    assert second == pytest.approx([1.0, step_change(2.5), step_change(2.5)], rel=1e-9)
    assert third == pytest.approx([step_change(2.5), step_change(2.5) * step_change(10.0)], rel=1e-9)


@pytest.mark.parametrize(("radius", "factor"), [(0.9, 2.0), (1.0, 10.0), (0.9, 0.1)])
def test_other_steps_are_taken_as_they_are(radius, factor):
    assert opened(radius).grown(np.array([1.0, 2.0, 2.0 + factor])).tolist() == [1.0] * 3


def test_bounds_grow_by_the_factor(monkeypatch):
    """Of all but what is known, in the frame and in global axes. Every step counts as one of three times the size."""
    found = []
    for factor in (1.0, 20.0):
        monkeypatch.setattr(coupled_runs, "GREW", 0.5)
        monkeypatch.setattr(coupled_runs, "step_change", lambda ratio, factor=factor: factor)
        scene, monitors = built(replace(drawn(9), steps=3, rho=0.6)), []
        for fem, items, sensors in zip(scene.fems, scene.bodies, scene.sensors, strict=True):
            flex = romerr.floating_body(fem, items)
            outputs = [*sensors.values(), romerr.node_displacement("global", node=5, component="z", frame="global")]
            monitors.append(romerr.attach(scene.mbs, flex, outputs=outputs))
        scene.solve()
        outputs = [out for monitor in monitors for out in monitor.report().outputs.values()]
        found.append([out.bound["best"].max(axis=-1) for out in outputs])
    for plain, grown in zip(*found, strict=True):
        assert np.isfinite(grown).all()
        assert np.all(grown[2:] > plain[2:])
        assert grown[1] == plain[1]


@pytest.mark.parametrize(("rho", "certified"), [(0.6, False), (1.0, True)])
def test_a_solve_that_goes_on_is_certified_without_numerical_damping(rho, certified):
    """What the solver makes of the accelerations that it begins anew with is in no bound."""
    scene = built(replace(drawn(22), steps=5, rho=rho))
    monitor = romerr.attach(scene.mbs, scene.flexible(), outputs=list(scene.sensors[0].values()))
    scene.mbs.Assemble()
    one = scene.settings.timeIntegration
    scene.mbs.SolveDynamic(scene.settings, updateInitialValues=True)
    one.startTime, one.endTime = one.endTime, 2 * one.endTime
    scene.mbs.SolveDynamic(scene.settings)
    first, second = (monitor.report(i) for i in (0, 1))
    assert not first.scope_reason.endswith(NOT_CERTIFIED)
    assert second.scope_reason.endswith(NOT_CERTIFIED) != certified
