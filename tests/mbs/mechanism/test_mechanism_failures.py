"""Solvers that do not give what coupled bounds need, failures in mid-run: a clear message, what was bounded stays."""

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

from exudyn_romerr import AssumptionError
from exudyn_romerr.estimates.mechanism_feedback import Feedback
from exudyn_romerr.mbs.access.equations import Equations
from exudyn_romerr.mbs.derivatives.linearisation import Tangents
from exudyn_romerr.mbs.derivatives.reader import TangentReader
from exudyn_romerr.mbs.monitoring import step_hook as hook
from exudyn_romerr.online.run import Run
from exudyn_romerr.report.scope import NOT_CERTIFIED
from models import floating, mechanisms
from tests.helpers.mechanism_runs import (
    BOTH,
    COUPLED,
    FROZEN,
    LIE,
    STEP,
    add_load,
    pendulum,
    raised,
    ran_to_its_end,
    reports,
    solve,
    steps_of,
    watch,
    with_frames,
)

# --- solvers ----------------------------------------------------------------


def test_solver_that_is_not_kept_is_refused_where_it_is_needed():
    scene = pendulum()
    monitors = watch(scene)
    solve(scene, storeSolver=False)
    for monitor in monitors:
        assert type(raised(monitor)) is AssumptionError
        assert "storeSolver=False" in str(raised(monitor))


def test_solver_kept_from_a_solve_before_is_not_taken_for_this_one():
    scene = pendulum()
    monitors = watch(scene)
    solve(scene)
    scene.settings.timeIntegration.generalizedAlpha.spectralRadius = 0.3
    solve(scene, storeSolver=False)
    for monitor in monitors:
        assert "storeSolver=False" in str(raised(monitor))


def test_energy_alone_needs_no_solver():
    scene = pendulum()
    monitors = watch(scene, estimators="energy")
    solve(scene, storeSolver=False)
    assert [monitor.report().scope for monitor in monitors] == [{"energy": COUPLED}] * 2


@pytest.mark.parametrize(
    ("estimators", "bar"), [("energy", 1), ("energy", 2), ("auxiliary", 1), ("auxiliary", 2), (BOTH, 2)]
)
def test_solve_without_initial_accelerations_is_bounded_late_in_all_bars(estimators, bar):
    """Though the other bar is in balance at its start."""
    scene = pendulum(force=lambda t: (0.0, 0.0, 0.0))
    middle = itemInterface.MarkerSuperElementPosition
    at = {"meshNodeNumbers": [mechanisms.MIDDLE], "weightingFactors": [1.0]}
    marker = scene.mbs.AddMarker(middle(bodyNumber=scene.bodies[bar - 1]["oFFRFreducedOrder"], **at))
    scene.mbs.AddLoad(itemInterface.LoadForceVector(markerNumber=marker, loadVector=[0.0, 100.0, 0.0]))
    scene.settings.timeIntegration.generalizedAlpha.computeInitialAccelerations = False
    for report in reports(scene, estimators=estimators):
        assert set(report.scope.values()) == {COUPLED}
        assert report.t[0] == pytest.approx(STEP)
        assert any("no accelerations at its start" in message for message in report.messages)
        assert report.scope_reason.endswith(NOT_CERTIFIED)
        assert "not certified" in str(report)
        assert report.assess("probe", 1e9).answer == "unknown"  # whatever is small enough is not known to be so


def test_diverged_simulation_is_bounded_up_to_there():
    scene = with_frames(LIE, two_free_bars)
    monitors = watch(scene)
    solve(scene, solverType=exu.DynamicSolverType.ExplicitEuler)
    for monitor in monitors:
        assert steps_of(monitor) == [11]
        assert any("diverged" in message for message in monitor.report().messages)


def two_free_bars():
    scene = mechanisms._scene((0, "RBE3"), (1e-6, 2e-5))
    for place in (0.0, 1.0):
        mechanisms._add_bar(scene, floating.RAYLEIGH, position=[place, 0, 0])
    add_load(scene, loadVectorUserFunction=lambda mbs, t, f: [0, 0, 1e4 * t if t < 1.05e-5 else np.nan])
    return scene


# --- what happens in mid-run ------------------------------------------------


@pytest.mark.parametrize("estimators", ["auxiliary", BOTH])
def test_joint_that_is_switched_off_ends_the_bounds(estimators):
    """By the user's PostStep function; energy alone would not notice, and a PreStep function is refused."""
    scene = pendulum(steps=100)

    def switch(mbs, t):
        mbs.SetObjectParameter(scene.objects["hinge 2"], "activeConnector", t < 50.5 * STEP)
        return True

    scene.mbs.SetPostStepUserFunction(switch)
    monitors = watch(scene, estimators=estimators)
    solve(scene)
    assert ran_to_its_end(scene)
    for monitor in monitors:
        error = raised(monitor)
        assert type(error) is AssumptionError
        assert all(word in str(error) for word in ("switched", FROZEN))
        kept = monitor.runs[-1].report()
        assert 10 * STEP < kept.t[-1] < 51.5 * STEP
        assert len(kept.output("probe").bound["best"]) == len(kept.t)


@pytest.mark.parametrize("estimators", ["auxiliary", BOTH])
@pytest.mark.parametrize(
    ("of", "work"), [(Equations, "mass"), (TangentReader, "_forces"), (TangentReader, "_constraints")]
)
def test_tangent_that_fails_keeps_what_was_bounded(monkeypatch, of, work, estimators):
    original, late = getattr(of, work), 21 * STEP

    def fail(self, at, *rest):
        if getattr(at, "mbs", at).systemData.GetTime() > late:
            raise AssumptionError("mine")
        return original(self, at, *rest)

    monkeypatch.setattr(of, work, fail)
    scene = pendulum(steps=200)
    monitors = watch(scene, estimators=estimators)
    solve(scene)
    assert ran_to_its_end(scene)
    for monitor in monitors:
        assert "mine" in str(raised(monitor))
        assert monitor.runs[-1].report().t[-1] >= 5 * STEP  # at least up to a tangent read before


def test_load_function_that_raises_while_the_tangent_is_read(monkeypatch):
    original, reading = Tangents.read, []

    def read(self, mbs, t):
        reading.append(t)
        try:
            return original(self, mbs, t)
        finally:
            reading.clear()

    def force(mbs, t, f):
        if reading and reading[0] > 20 * STEP:
            raise ValueError("mine")
        return [0.0, 10.0, 0.0]

    monkeypatch.setattr(Tangents, "read", read)
    scene = pendulum(steps=200)
    add_load(scene, loadVectorUserFunction=force)
    monitors = watch(scene, estimators=BOTH)
    solve(scene)
    for monitor in monitors:
        assert type(raised(monitor)) is AssumptionError
        assert all(word in str(raised(monitor)) for word in ("tangent could not be computed", "mine"))
        assert monitor.runs[-1].report().t[-1] >= 5 * STEP


FAILING = [
    *[(Run, name, when, "energy") for name in ("extension", "advance") for when in (3, 4)],  # of two bodies
    *[(Run, name, when, BOTH) for name in ("extension", "advance") for when in (5, 6, 7, 8)],  # and companions
    (Feedback, "advance", 2, "auxiliary"),
]


@pytest.mark.parametrize(("kind", "name", "when", "estimators"), FAILING)
def test_failure_in_any_phase_keeps_the_block_before(monkeypatch, kind, name, when, estimators):
    original, calls = getattr(kind, name), []

    def fail(self, *arguments):
        calls.append(self)
        if len(calls) == when:
            raise ArithmeticError("mine")
        return original(self, *arguments)

    monkeypatch.setattr(hook, "BLOCK", 4)
    monkeypatch.setattr(kind, name, fail)
    scene = pendulum(steps=20)
    monitors = watch(scene, estimators=estimators)
    solve(scene)
    assert ran_to_its_end(scene)
    for monitor in monitors:
        assert "mine" in str(raised(monitor))
        kept = monitor.runs[-1].report()
        assert {len(bound) for bound in kept.output("probe").bound.values()} == {len(kept.t)}
        assert len(kept.t) >= 5


@pytest.mark.parametrize("when", [1, 2, 3, 4])
def test_failure_when_runs_open_does_not_reach_the_solver(monkeypatch, when):
    original, calls = Run.open, []

    def fail(self, opening):
        calls.append(self)
        if len(calls) == when:
            raise ArithmeticError("mine")
        original(self, opening)

    monkeypatch.setattr(Run, "open", fail)
    scene = pendulum()
    monitors = watch(scene)
    solve(scene)
    assert ran_to_its_end(scene)
    for monitor in monitors:
        assert "mine" in str(raised(monitor))
        for run in monitor.runs:
            assert len(run.report().t) == 1


def test_exception_of_the_users_hook_keeps_every_step():
    def mine(mbs, t):
        if t > 4.5 * STEP:
            raise KeyError("mine")
        return True

    scene = pendulum()
    monitors = watch(scene, estimators=BOTH, hook=mine)
    with pytest.raises(exu.ExudynError):
        solve(scene)
    assert [len(monitor.report().t) for monitor in monitors] == [6, 6]


def test_error_of_one_solve_does_not_stay_for_the_next(monkeypatch):
    scene = pendulum()
    monitors = watch(scene)
    with monkeypatch.context() as patch:
        patch.setattr(TangentReader, "_forces", lambda self, *rest: 1 / 0)
        solve(scene)
    for monitor in monitors:
        assert type(raised(monitor)) is ZeroDivisionError
    solve(scene)
    assert [len(monitor.report().t) for monitor in monitors] == [11, 11]
