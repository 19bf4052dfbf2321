"""Monitor: runs, reports, tolerances and failures, along solves of every kind."""

import os
import signal
from contextlib import nullcontext
from dataclasses import replace
from unittest import mock

import exudyn as exu
import numpy as np
import pytest

from exudyn_romerr import add_reduced_body, attach
from exudyn_romerr.errors import AssumptionError, InputError, RunError
from exudyn_romerr.linear.run.run import BLOCK, Run
from exudyn_romerr.mbs.monitoring import body_monitor as watch
from exudyn_romerr.mbs.monitoring import step_hook as hooks
from exudyn_romerr.mbs.monitoring.body_monitor import FEWEST, MOST, MonitoredBody
from exudyn_romerr.mbs.monitoring.monitor import MechanismMonitor
from exudyn_romerr.model.outputs import Output
from exudyn_romerr.report.mechanism_report import load_report
from models import floating
from tests.helpers.mbs_scenes import (
    SOLVERS,
    TIP,
    N,
    Recorder,
    added,
    chain_body,
    force,
    new_mbs,
    random_basis,
    scene,
    settings,
)
from tests.helpers.observed import attached_all


def solve(mbs, steps=20, end=0.1, start=0.0, solver=None, **options):
    return mbs.SolveDynamic(settings(steps, end, start), solverType=solver, **options)


def starts(monitor):
    return [run.report().t[0] for run in monitor.runs]


# --- attach -----------------------------------------------------------------


@pytest.mark.parametrize("assemble_first", [True, False])
def test_attach_before_or_after_assemble(assemble_first):
    mbs, flex = added()
    if assemble_first:
        mbs.Assemble()
    monitor = attach(mbs, flex, outputs=[TIP])
    if not assemble_first:
        mbs.Assemble()
    solve(mbs)
    assert len(monitor.report().t) == 21


def test_what_attach_refuses():
    mbs, flex, _ = scene()
    sensor = mbs.AddSensor(
        exu.itemInterface.SensorNode(nodeNumber=0, outputVariableType=exu.OutputVariableType.Coordinates)
    )
    with pytest.raises(InputError, match=r"sensor 0.*pass romerr.Output"):
        attach(mbs, flex, outputs=[sensor])
    with pytest.raises(InputError, match="outputs is a Output; needed: a list"):
        attach(mbs, flex, outputs=TIP)
    with pytest.raises(InputError, match="flex is a dict; needed: what add_reduced_body or floating_body returned"):
        attach(mbs, flex.items, outputs=[TIP])
    with pytest.raises(InputError, match="another mbs"):
        attach(new_mbs(), flex, outputs=[TIP])


def test_initial_state_of_the_body_is_the_monitors_unless_another_is_given(monkeypatch):
    given = []

    def prepare(body, basis, options):
        given.append(options.initial)
        raise InputError("seen")

    monkeypatch.setattr("exudyn_romerr.mbs.access.reduced_body.prepare", prepare)
    state, other = (np.ones(N), np.zeros(N)), (np.zeros(N), np.ones(N))
    for initial in (None, other):
        with pytest.raises(InputError, match="seen"):
            scene(initial=state) if initial is None else attach_with(state, initial)
    assert given == [state, other]


def attach_with(state, initial):
    mbs = new_mbs()
    flex = add_reduced_body(mbs, chain_body(), random_basis(), initial=state)
    attach(mbs, flex, outputs=[TIP], initial=initial)


def test_plan_needs_assemble_and_report_a_run():
    mbs, flex = added()
    monitor = attach(mbs, flex, outputs=[TIP])
    with pytest.raises(RunError, match=r"plan was asked before mbs\.Assemble"):
        monitor.plan  # noqa: B018
    mbs.Assemble()
    assert str(monitor.plan)
    with pytest.raises(RunError, match="report was asked before a run"):
        monitor.report()


def test_report_of_a_run_that_does_not_exist():
    mbs, _, monitor = scene()
    solve(mbs)
    solve(mbs)
    assert monitor.report(0).t[-1] == monitor.report(-2).t[-1]
    for i in (2, -3, "last"):
        with pytest.raises(InputError, match=r"allowed: -2\.\.1"):
            monitor.report(i)


# --- runs -------------------------------------------------------------------


@pytest.mark.parametrize("solver", ["GeneralizedAlpha", "DOPRI5"])
def test_every_solve_is_a_run_with_the_same_bound(solver):
    mbs, _, monitor = scene()
    for _ in range(3):
        solve(mbs, solver=getattr(exu.DynamicSolverType, solver))
    for i in (1, 2):
        bounds = (run.report().output("tip").bound["best"] for run in (monitor.runs[0], monitor.runs[i]))
        np.testing.assert_array_equal(*bounds)
    assert starts(monitor) == [0.0, 0.0, 0.0]
    assert [len(run.report().t) for run in monitor.runs] == [21, 21, 21]


@pytest.mark.parametrize("store", [True, False])
def test_start_time_after_the_last_end_is_a_new_run(store):
    mbs, _, monitor = scene()
    solve(mbs, end=0.1, start=0.05, storeSolver=store)
    solve(mbs, end=0.4, start=0.3, storeSolver=store)
    assert starts(monitor) == [0.05, 0.3]


@pytest.fixture
def continued(monkeypatch):
    """What each dynamic run was told to continue."""
    seen = []

    class Recording(Run):
        def start(self, *args, after=None, **options):
            if not self.is_static:
                seen.append(after)
            super().start(*args, after=after, **options)

    monkeypatch.setattr(watch, "Run", Recording)
    return seen


@pytest.mark.parametrize("solver", ["GeneralizedAlpha", "DOPRI5"])
def test_continued_solve_continues_the_bound(continued, solver):
    mbs, _, monitor = scene()
    kind = getattr(exu.DynamicSolverType, solver)
    solve(mbs, end=0.1, solver=kind, updateInitialValues=True)
    solve(mbs, end=0.2, start=0.1, solver=kind)
    assert continued == [None, monitor.runs[0]]
    assert starts(monitor) == [0.0, 0.1]


def test_other_state_or_time_does_not_continue(continued):
    mbs, _, _ = scene()
    solve(mbs, end=0.1, updateInitialValues=True)
    solve(mbs, end=0.3, start=0.2)
    solve(mbs, end=0.2, start=0.1)  # starts in the state of the first run's end, but is the third
    solve(mbs, end=0.1)
    for name in ("initialCoordinates", "initialCoordinates_t"):
        mbs.SetNodeParameter(0, name, [1e-3, 0, 0])
        mbs.Assemble()
        solve(mbs, end=0.2, start=0.1)
    assert continued == [None] * 6


def test_other_velocity_does_not_continue(continued):
    mbs, _, _ = scene()
    solve(mbs, end=0.1, updateInitialValues=True)
    mbs.systemData.SetODE2Coordinates_t([1.0, 0.0, 0.0], exu.ConfigurationType.Initial)
    solve(mbs, end=0.2, start=0.1)
    assert continued == [None, None]


def test_static_solves_are_runs_of_their_own_kind(continued):
    mbs, _, monitor = scene()
    SOLVERS["static"](mbs, settings())
    solve(mbs)
    SOLVERS["static"](mbs, settings())
    mbs.SolveStatic(settings(), updateInitialValues=True)
    solve(mbs, start=1.0, end=1.1)  # begins in the state and at the "time" that the static solve ended with
    assert kinds(monitor) == ["static", "dynamic", "static", "static", "dynamic"]
    np.testing.assert_allclose(monitor.report(0).t, [0, 0.25, 0.5, 0.75, 1.0])
    assert continued[0] is None
    assert continued[1] is monitor.runs[3]  # released from the static solve's equilibrium


def kinds(monitor):
    return ["static" if run.is_static else "dynamic" for run in monitor.runs]


def failing_load(fails):
    def load(t):
        if fails and t > 0:
            raise ArithmeticError("mine")
        return force(t)

    return {"input_function": load}


def failing_hook(fails):
    """At the first call."""

    def hook(mbs, t):
        if fails:
            raise ArithmeticError("mine")
        return True

    return {"hook": hook}


@pytest.mark.parametrize("make", [failing_load, failing_hook, lambda fails: {"tolerance": 1e-30}])
def test_static_solver_that_failed_or_was_stopped_is_not_taken_for_the_next(make):
    fails = [True]
    mbs, _, monitor = scene(**(options := make(fails)))
    with nullcontext() if "tolerance" in options else pytest.raises(exu.ExudynError):
        mbs.SolveStatic(settings())
    fails.clear()
    solve(mbs)
    assert kinds(monitor) == ["static", "dynamic"]


def test_static_solve_before_attach_is_not_taken_for_the_next():
    mbs, flex = added()
    mbs.Assemble()
    mbs.SolveStatic(settings())
    monitor = attach(mbs, flex, outputs=[TIP])
    solve(mbs)
    assert kinds(monitor) == ["dynamic"]


def test_report_in_mid_run():
    lengths = []

    def mine(mbs, t):
        lengths.append(len(monitor.report().t))
        return True

    mbs, _, monitor = scene(hook=mine)
    solve(mbs, steps=5)
    assert lengths == [1, 2, 3, 4, 5, 6]
    assert len(monitor.report().t) == 6


# --- tolerance --------------------------------------------------------------


def best(monitor, name="tip"):
    return monitor.report().output(name).bound["best"][:, 0]


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_tolerance_stops_at_the_step_above_it_or_soon_after(share):
    """Some steps are made before they are compared; the one where it was exceeded is told."""
    mbs, _, free = scene()
    solve(mbs, steps=200, end=0.4)
    bound, t = best(free), free.report().t
    limit = share * bound.max()
    mbs, _, monitor = scene(tolerance=limit)
    solve(mbs, steps=200, end=0.4)
    report, first = monitor.report(), int(np.argmax(bound > limit))
    assert mbs.sys["dynamicSolver"].output.simulationStoppedByUserFunction
    assert first < len(report.t) <= 1 + first + FEWEST
    np.testing.assert_allclose(best(monitor), bound[: len(report.t)], rtol=1e-9)
    said = f"stopped at t = {report.t[-1]:g}: tolerance on 'tip' exceeded"
    said += "" if first == len(report.t) - 1 else f" at t = {t[first]:g}"
    assert f"{said}, {bound[first]:.3g} > {limit:g}" in monitor.runs[0].messages[0]
    assert said in str(report)


def test_tolerance_takes_few_blocks_where_the_bound_is_far_below():
    mbs, _, monitor = scene(tolerance=1e9)
    with mock.patch.object(Run, "advance", autospec=True, side_effect=Run.advance) as advance:
        solve(mbs, steps=4 * MOST, end=0.4)
    assert len(monitor.report().t) == 1 + 4 * MOST
    assert advance.call_count <= 5 + np.log2(MOST)


def test_tolerance_exceeded_when_the_run_is_over_has_not_stopped_it():
    mbs, _, free = scene()
    solve(mbs)
    largest = best(free)
    assert np.argmax(largest) == len(largest) - 1  # the bound rises until the end
    mbs, _, monitor = scene(tolerance=float(np.mean(largest[-2:])))
    assert solve(mbs)
    report = monitor.report()
    assert len(report.t) == len(largest)
    assert [message.partition(":")[0] for message in report.messages] == ["the run ended at t = 0.1"]
    assert report.output("tip").stopped is report.planned_end is None
    assert report.assess("tip", 1e9).answer == "proven"


def test_a_run_that_ends_early_says_so_where_it_is_assessed(tmp_path):
    """Of the user's function, in a file too; where it was to go is known again when it goes on."""
    mbs, _, monitor = scene(hook=Recorder(result=False, stop_at=0.05))
    solve(mbs)
    monitor.report().save(tmp_path / "run.npz")
    for report in (monitor.report(), load_report(tmp_path / "run.npz")):
        assert report.planned_end == 0.1
        assert report.on_purpose  # a complete run, until then
        assert report.assess("tip", 1e9).answer == "proven"
        assert "Until 0.05 of 0.1 s: a user function that returned False stopped it" in report.summary(1e9)
        unknown = replace(report, on_purpose=False, ended_by="")
        found = unknown.assess("tip", 1e9)
        assert found.answer == "unknown"
        assert "(known until 0.05 of 0.1 s: it went no farther): let it run to its end." in found.text
    mbs, _, monitor = scene()
    solve(mbs)
    assert monitor.report().planned_end is None
    assert monitor.report().assess("tip", 1e9).answer == "proven"


def test_tolerance_that_holds_changes_nothing():
    mbs, _, monitor = scene(tolerance={"tip": 1e9})
    solve(mbs)
    report = monitor.report()
    assert len(report.t) == 21
    assert not monitor.runs[0].messages
    assert "\nEnough: the error of every output is within its tolerance.\n" in str(report)


def test_users_hook_is_still_called_at_the_step_that_stops():
    mine = Recorder()
    mbs, _, _ = scene(tolerance=1e-30, hook=mine)
    solve(mbs)
    assert mine.t == [0.0] or mine.t[:2] == [0.0, 0.005]
    assert mbs.sys["dynamicSolver"].output.simulationStoppedByUserFunction


@pytest.mark.parametrize(
    ("tolerance", "words"),
    [
        ({"tipp": 1.0}, "tolerance names 'tipp'; allowed: 'tip', 'middle'"),
        (1.0, "tolerance=1.0 for 2 outputs"),
        ([1.0, 2.0], "needed: a dict"),
        ({"tip": 0.0}, "positive finite"),
        ({"tip": -1.0}, "positive finite"),
        ({"tip": np.inf}, "positive finite"),
        ({"tip": np.nan}, "positive finite"),
        ({"tip": "1"}, "positive finite"),
    ],
)
def test_bad_tolerance(tolerance, words):
    with pytest.raises(InputError, match=words):
        scene(outputs=[TIP, Output("middle", np.eye(N)[4])], tolerance=tolerance)


# --- failures ---------------------------------------------------------------


def test_diverged_simulation_is_bounded_up_to_there():
    nan_after = lambda t: force(t) if t < 0.0501 else np.nan  # noqa: E731
    mbs, _, monitor = scene(input_function=nan_after)
    solve(mbs, steps=2000, end=1.0, solver=exu.DynamicSolverType.ExplicitEuler)  # accepts nan without a word
    report = monitor.report()
    assert report.t[-1] == pytest.approx(0.05)
    (message,) = monitor.runs[0].messages
    assert "diverged: nan or inf at t = 0.0505" in message


def test_interrupt_during_evaluation_waits_for_the_block(monkeypatch):
    class Interrupted(Run):
        def advance(self, extension):
            os.kill(os.getpid(), signal.SIGINT)
            super().advance(extension)

    monkeypatch.setattr(watch, "Run", Interrupted)
    monkeypatch.setattr(hooks, "LONGEST", 1)
    mbs, _, monitor = scene()
    before = signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # nohup and some CI start Python with it ignored
    try:
        with pytest.raises(exu.ExudynError) as caught:
            solve(mbs, steps=BLOCK + 88)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert isinstance(caught.value.__cause__, KeyboardInterrupt)
    assert len(monitor.report().t) == BLOCK + 1


def test_error_found_when_the_solve_begins_is_kept_and_the_run_goes_on():
    mbs, flex, monitor = scene()
    marker = mbs.AddMarker(
        exu.itemInterface.MarkerNodeCoordinate(nodeNumber=flex.items["nGenericODE2"], coordinate=0)
    )
    mbs.AddLoad(exu.itemInterface.LoadCoordinate(markerNumber=marker, load=1.0))
    mbs.Assemble()
    solve(mbs)
    assert not mbs.sys["dynamicSolver"].output.simulationStoppedByUserFunction
    for _ in range(2):
        with pytest.raises(AssumptionError, match=r"load 0.*inputs="):
            monitor.report()
    with pytest.raises(AssumptionError, match="load 0"):
        monitor.plan  # noqa: B018
    assert monitor.runs == ()


def test_connector_on_the_body_is_refused_but_not_one_beside_it():
    mbs, flex, monitor = scene()
    items = exu.itemInterface
    ground = mbs.AddNode(items.NodePointGround())
    mass = mbs.AddNode(items.NodePoint(referenceCoordinates=[0, 0, 0]))
    mbs.AddObject(items.MassPoint(nodeNumber=mass, mass=1))
    markers = [
        mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
        for node in (ground, mass, flex.items["nGenericODE2"])
    ]
    mbs.AddObject(items.CoordinateSpringDamper(markerNumbers=markers[:2], stiffness=10))
    mbs.Assemble()
    solve(mbs)
    assert len(monitor.report().t) == 21
    mbs.AddObject(items.CoordinateSpringDamper(markerNumbers=[markers[0], markers[2]], stiffness=10))
    mbs.Assemble()
    solve(mbs)
    with pytest.raises(AssumptionError, match="object 3"):
        monitor.report()
    assert len(monitor.runs) == 1


def test_load_on_the_object_and_object_on_the_node_are_refused():
    items = exu.itemInterface
    mbs, flex, monitor = scene()
    marker = mbs.AddMarker(
        items.MarkerSuperElementPosition(
            bodyNumber=flex.items["oGenericODE2"], meshNodeNumbers=[0], weightingFactors=[1.0]
        )
    )
    mbs.AddLoad(items.LoadForceVector(markerNumber=marker, loadVector=[1, 0, 0]))
    mbs.AddObject(
        items.ObjectGenericODE2(
            nodeNumbers=[flex.items["nGenericODE2"]], massMatrix=np.eye(3), stiffnessMatrix=np.eye(3)
        )
    )
    mbs.Assemble()
    with pytest.raises(AssumptionError, match=r"load 0, object 1"):
        monitor.plan  # noqa: B018


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda t: np.ones(3), r"input_function\(0\).*\(3,\)"),  # n = 3: Exudyn itself would take it
        (lambda t: 1j, r"input_function\(0\).*complex"),
        (lambda mbs, t: 1.0, r"input_function\(0\) raised TypeError"),
    ],
)
def test_input_function_that_cannot_be_used_shows_when_the_body_is_added(wrong, message):
    with pytest.raises(InputError, match=message):
        scene(input_function=wrong)


def test_error_of_one_solve_does_not_stay_for_the_next():
    wrong = [True]
    mbs, _, monitor = scene(input_function=lambda t: np.ones(3) if wrong[0] and t > 0 else force(t))
    solve(mbs)
    with pytest.raises(InputError, match="input_function's values"):
        monitor.report()
    wrong[0] = False
    solve(mbs)
    assert len(monitor.report().t) == 21


class FailingAdvance(Run):
    def advance(self, extension):
        if extension.new.t[-1] > 0.4:
            raise ArithmeticError("mine")
        super().advance(extension)


def test_error_of_bounds_that_advance_keeps_the_blocks_before(monkeypatch):
    """Of steps that cannot be checked every step before is kept, see test_faults."""
    monkeypatch.setattr(watch, "Run", FailingAdvance)
    monkeypatch.setattr(hooks, "LONGEST", 1)
    mbs, _, monitor = scene()
    solve(mbs, steps=4 * BLOCK, end=1.0)
    with pytest.raises(ArithmeticError, match="mine"):
        monitor.report()
    assert len(monitor.runs[0].report().t) == BLOCK + 1
    assert mbs.systemData.GetTime() == pytest.approx(1.0)


def test_run_that_goes_on_at_a_rounded_time_keeps_its_error():
    """After 1600 steps the solver is at 0.1 - 4e-15; the user writes startTime = 0.1."""
    mbs, _, monitor = scene()
    first = settings(1600)
    mbs.SolveDynamic(first, updateInitialValues=True)
    assert mbs.systemData.GetTime() != 0.1
    mbs.SolveDynamic(settings(160, end=0.11, start=0.1))
    before, after = (monitor.report(i) for i in range(2))
    assert any("continues the run before" in message for message in after.messages)
    for e, bound in after.output("tip").bound.items():
        np.testing.assert_allclose(bound[0], before.output("tip").bound[e][-1], rtol=1e-6)
        assert np.all(bound[0] > 0)


@pytest.mark.parametrize(("kind", "place"), [(hooks.StepHook, "why_not_told"), (MonitoredBody, "_take")])
def test_programming_errors_of_ours_do_not_reach_the_run(monkeypatch, kind, place):
    """Whatever breaks, wherever: said, kept, and the run and the user's function go on."""
    monkeypatch.setattr(kind, place, lambda self, *rest: [][0])
    calls, mbs = [], new_mbs()
    mbs.SetPostStepUserFunction(lambda mbs, t: not calls.append(t))
    _, _, monitor = scene(mbs=mbs)
    solve(mbs)
    assert len(calls) == 21
    with pytest.raises(IndexError):
        monitor.report()


def test_a_monitor_shows_itself_in_one_line():
    """With what to print of it, of several bodies how many."""
    _, _, monitor = scene()
    todo = "print(monitor.plan) after mbs.Assemble(), print(monitor.report()) after a solve>"
    assert repr(monitor) == f"<Monitor of one body; {todo}"
    assert repr(MechanismMonitor(None, (monitor, monitor), None)) == f"<MechanismMonitor of 2 bodies; {todo}"


# --- a run that a user function ended on purpose is a complete one, as long as it was ---


def test_what_a_user_function_ends_on_purpose_is_complete():
    scene = floating.pendulum(4, t_end=0.02)
    scene.mbs.SetPostStepUserFunction(lambda mbs, t: t < 0.01)
    monitor = attached_all(scene)
    scene.solve()
    report = monitor.report()
    said = "Until 0.01 of 0.02 s: a user function that returned False stopped it on purpose. Enough: "
    assert report.summary(1e9).splitlines()[1].startswith(said)
    assert all(body.on_purpose for body in report.bodies)
    assert monitor.report(-1).on_purpose
