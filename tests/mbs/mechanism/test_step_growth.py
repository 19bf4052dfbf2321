"""Steps that grow by more than twice at once, by an integrator with numerical damping: no bound, and why."""

import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
from exudyn_romerr.estimates.march import Scheme
from exudyn_romerr.online import coupled_runs
from exudyn_romerr.online.coupled_runs import FirstSteps
from exudyn_romerr.report.scope import NOT_CERTIFIED

LONG = 41


def opened(radius, t=0.0):
    steps, first = FirstSteps(Scheme.of_radius(radius)), SimpleNamespace(t=np.array([t]))
    steps.open([], [SimpleNamespace(first=first, start=None)])
    return steps


def test_growth_is_seen_within_a_block_and_between_two():
    steps = opened(0.6)
    first, none = steps.lost(np.array([1.0, 2.0, 2.1]))
    second, why = steps.lost(np.array([2.3, 2.8, 2.9]))
    third, again = steps.lost(np.array([3.0, 3.1]))
    assert not first.any()
    assert second.tolist() == [False, True, True]
    assert third.all()
    assert none == again == []
    assert len(why) == 1
    assert "t = 2.3 s" in why[0]


@pytest.mark.parametrize(("radius", "factor"), [(0.9, 2.0), (1.0, 10.0), (0.9, 0.1)])
def test_other_steps_are_bounded(radius, factor):
    is_lost, why = opened(radius).lost(np.array([1.0, 2.0, 2.0 + factor]))
    assert not is_lost.any()
    assert why == []


def test_report_says_so(monkeypatch):
    """From there on all bounds are inf, those in global axes too; estimates go on. Every step counts as one here."""
    monkeypatch.setattr(coupled_runs, "GREW", 0.5)
    scene, monitors = built(replace(drawn(9), steps=LONG - 1, rho=0.6)), []
    for fem, items, sensors in zip(scene.fems, scene.bodies, scene.sensors, strict=True):
        flex = romerr.floating_body(fem, items)
        outputs = [*sensors.values(), romerr.node_displacement("global", node=5, component="z", frame="global")]
        monitors.append(romerr.attach(scene.mbs, flex, outputs=outputs))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene.solve()
        reports = [monitor.report() for monitor in monitors]
        text = str(reports[0])
    for report in reports:
        assert sum("the step grew by a factor of 1 at once" in message for message in report.messages) == 1
        for out in report.outputs.values():
            assert all(np.isinf(bound[2:]).all() for bound in out.bound.values())
            assert out.name == "global" or np.isfinite(out.bound["best"][:2]).all()
            assert np.isfinite([out.estimate, out.uncertainty]).all()
    assert "not bounded at 39 instants" in text


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
