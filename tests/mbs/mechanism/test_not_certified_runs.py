"""Real runs that are not certified: each says so in every sentence, names its cause, and what mends it does."""

from dataclasses import replace
from functools import cache
from unittest import mock

import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
from exudyn_romerr.mbs.shadow.measured import OF_THIRD_ORDER
from exudyn_romerr.online import coupled_runs, run_messages
from exudyn_romerr.online.initial_condition import begins_late
from exudyn_romerr.report.formats import html_page
from exudyn_romerr.report.report_rows import of_estimates
from exudyn_romerr.report.verdicts import NONE
from models import mechanisms
from tests.helpers.mechanism_runs import STEP, pendulum, solve
from tests.mbs.mechanism.test_sudden_starts import mechanism

BOTH = ("energy", "auxiliary")
STEPS = 40


def monitored(scene, flexes=None, **options):
    """One monitor of all bodies, with all sensors."""
    flexes = flexes or [romerr.floating_body(scene.fem, body) for body in scene.bodies]
    return romerr.attach(scene.mbs, flexes, **{"estimators": BOTH} | options)


def sudden(rho, kind="at once", gamma=None):
    """Two bars on damped hinges, a torque at once; gamma: by Newmark's scheme."""
    scene = built(mechanism(110, rho, kind, steps=4))
    if gamma is not None:
        scheme = scene.settings.timeIntegration.generalizedAlpha
        scheme.useNewmark, scheme.newmarkGamma, scheme.newmarkBeta = True, gamma, (gamma + 0.5) ** 2 / 4
    monitor = monitored(scene, scene.flexible())
    scene.solve()
    return monitor.report()


def changed(factor=20.0):
    """A spring is stiffer for two of the steps, by a PostStep function."""
    scene = mechanisms.sprung_body(n=4, h=STEP, t_end=STEPS * STEP)
    scene.settings.timeIntegration.generalizedAlpha.spectralRadius = 1.0  # steps are repeated: a cause of its own
    mbs, spring, stiffness = scene.mbs, scene.objects["right spring"], np.array([2e5, 1e5, 1e5])

    def stiffen(mbs, t):
        within = 0.745 < t / (STEPS * STEP) < 0.8
        mbs.SetObjectParameter(spring, "stiffness", (stiffness * (factor if within else 1.0)).tolist())
        return True

    mbs.SetPostStepUserFunction(stiffen)
    monitor = monitored(scene)
    scene.solve()
    return monitor.report()


def solved_twice(*radii, of=None):
    """The second of two solves, with spectral radii."""
    scene = built(of or replace(drawn(22), steps=5, rho=radii[0]))
    monitor = monitored(scene, scene.flexible(), estimators="auxiliary")
    solve(scene, updateInitialValues=True)
    one = scene.settings.timeIntegration
    one.startTime, one.endTime = one.endTime, 2 * one.endTime
    one.generalizedAlpha.spectralRadius = radii[-1]
    solve(scene)
    return monitor.report()


def falling(accelerations=True, store=True, **options):
    """Two bars that fall, one of them with a load in its middle."""
    scene = pendulum(force=lambda t: (0.0, 0.0, 0.0))
    place = {"meshNodeNumbers": [mechanisms.MIDDLE], "weightingFactors": [1.0]}
    of = itemInterface.MarkerSuperElementPosition(bodyNumber=scene.bodies[0]["oFFRFreducedOrder"], **place)
    load = itemInterface.LoadForceVector(markerNumber=scene.mbs.AddMarker(of), loadVector=[0.0, 100.0, 0.0])
    scene.mbs.AddLoad(load)
    monitor = monitored(scene, **options)
    scene.settings.timeIntegration.generalizedAlpha.computeInitialAccelerations = accelerations
    solve(scene, storeSolver=store)
    return monitor.report()


CASES = {  # a run that is not certified, why, and the same mended
    "dampers": (lambda: sudden(1.0, gamma=0.6), run_messages.STARTS_DAMPED, lambda: sudden(1.0)),
    "dampers, smooth": (
        lambda: sudden(1.0, gamma=0.6),
        run_messages.STARTS_DAMPED,
        lambda: sudden(1.0, "smooth", gamma=0.6),
    ),
    "changed": (changed, run_messages.changed(""), lambda: changed(1.0)),
    "goes on": (lambda: solved_twice(0.6), run_messages.BEGUN_ANEW, lambda: solved_twice(1.0)),
    "late": (lambda: falling(accelerations=False), begins_late(STEP), falling),
    "solver": (
        lambda: falling(store=False, estimators="energy"),
        run_messages.UNKNOWN_SCHEME,
        lambda: falling(estimators="energy"),
    ),
}
made = cache(lambda case: CASES[case][0]())


@pytest.mark.parametrize("case", CASES)
def test_cause_and_cure_are_named(case):
    """In the field, in messages, and, where it is not of bounds alone, by assess."""
    report, doubt = made(case), CASES[case][1]
    others = [
        one for one in report.uncertified if one != OF_THIRD_ORDER
    ]  # a change and a rough start are not linear either
    assert {(one.cause, one.cure) for one in others} == {(doubt.cause, doubt.cure)}
    assert all(out.uncertified == report.bodies[0].uncertified for out in report.bodies[0].outputs.values())
    assert any(message.endswith(f". No bound of this run is certified: {doubt.cure}") for message in report.messages)
    for name in report.outputs:
        found = report.assess(name, 1e9)
        assert found.answer != "proven"
        if of_estimates([doubt]) and report.output(name).verdict["sum"].how != NONE:
            assert found.answer == "unknown"
            assert f"({doubt.cause}" in found.text
            assert f"): {doubt.cure}" in found.text


@pytest.mark.parametrize("case", CASES)
def test_no_sentence_promises(case, tmp_path, monkeypatch):
    """Printed, in short and in rows, loaded again, in HTML, as columns."""
    report, cause = made(case), CASES[case][1].cause
    monkeypatch.setattr(html_page, "figures", lambda *given: ())
    report.save(tmp_path / "run.npz")
    again = romerr.load_report(tmp_path / "run.npz")
    assert (str(again), again.details) == (str(report), report.details)
    assert "at most" not in str(report)
    assert f"not certified: {cause}" in str(report)
    for text in (report.details, html_page.page(report)):
        assert "at most" not in text
        assert cause in text.replace("&#x27;", "'")
    rows = [line for line in report.details.splitlines() if "bounded by" in line]
    assert rows
    assert all("not certified" in line for line in rows)
    assert all("not certified" in name for name in report.to_dict() if "bound" in name)


@pytest.mark.parametrize("case", CASES)
def test_what_is_told_to_do_mends_it(case):
    report = CASES[case][2]()
    assert report.uncertified == ()
    assert "at most" in report.details
    assert "not certified" not in str(report)
    assert not any("not certified" in report.assess(name, 1e9).text for name in report.outputs)


def test_a_solve_that_goes_on_has_the_doubts_of_the_one_before(monkeypatch):
    """A spectral radius of 1 in the second one mends nothing of the first one's error, which it goes on with."""
    assert solved_twice(0.6, 1.0).uncertified == ()
    assert solved_twice(0.9, 1.0, of=mechanism(110, 0.9, steps=4)).uncertified == ()
    monkeypatch.setattr(coupled_runs, "PassiveSteps", mock.Mock(of=lambda **_: None))
    assert solved_twice(0.9, 1.0, of=mechanism(110, 0.9, steps=4)).uncertified == (run_messages.STARTS_DAMPED,)


def test_what_one_body_lacks_concerns_the_coupled_bounds_of_the_other():
    """Watched by two monitors: the bound of each holds what both bodies' residuals do."""
    scene = pendulum()
    monitors = [
        romerr.attach(scene.mbs, romerr.floating_body(scene.fem, body), estimators=BOTH) for body in scene.bodies
    ]
    solve(scene)
    assert [monitor.report().uncertified for monitor in monitors] == [(), ()]
    monitors[0].runs[-1].balance.share = lambda floor: 0.01  # as if a load were not known
    own, other = (monitor.report() for monitor in monitors)
    assert own.uncertified[0].startswith("Galerkin defect")
    assert other.uncertified[0].startswith("another body: Galerkin defect")
    assert other.uncertified[0].cause == own.uncertified[0].cause
    assert other.messages[0] == other.uncertified[0]
