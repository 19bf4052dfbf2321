"""Faults in mid-run: what was bounded is kept, the user's function stays in place, the next solve is sound."""

import os
import signal
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import exudyn as exu
import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.linear.run.run import Run
from exudyn_romerr.mbs.floating import moving_subject as moving
from exudyn_romerr.mbs.mirror import told_solve as told
from exudyn_romerr.mbs.monitoring import step_hook as hook
from models import floating
from tests.helpers import mbs_scenes
from tests.helpers import tolerances as tol
from tests.helpers.mechanism_runs import FROZEN, STEP, add_load, pendulum, raised, solve, steps_of, watch

STEPS, FAULT = 40, 25  # of every run, and the step at which something fails
H = {"linear": 5e-3, "floating": 2e-4}  # s
INTERRUPT = KeyboardInterrupt("mine")


@dataclass
class Bench:
    """A monitored body whose load and functions fail at step FAULT, once they are told to."""

    kind: str
    faults: dict[str, Any] = field(default_factory=dict)  # where -> exception to raise or value to return
    calls: list[float] = field(default_factory=list)  # of the user's PostStep function

    def __post_init__(self):
        self.h = H[self.kind]
        self.fault_time = (FAULT + 0.5) * self.h
        make = {"linear": self._linear, "floating": self._floating}[self.kind]
        make()
        self.mbs.SetPreStepUserFunction(lambda mbs, t: self.at("PreStep", t, True))

    def _linear(self):
        self.mbs, _, self.monitor = mbs_scenes.scene(
            input_function=lambda t: self.at("load", t, mbs_scenes.force(t)), hook=self._post_step
        )
        self.settings, self.output = mbs_scenes.settings(STEPS, STEPS * self.h), "tip"

    def _floating(self):
        scene = floating.clamped_bar(2, h=self.h, t_end=STEPS * self.h)
        load = lambda mbs, t, vector: [0, 0, self.at("load", t, 100 * np.sin(900 * t))]  # noqa: E731
        scene.mbs.SetLoadParameter(1, "loadVectorUserFunction", load)
        tip = romerr.node_displacement("tip", node=floating.interface(scene.fem, "tip")[0][0], component="z")
        flex = romerr.floating_body(scene.fem, scene.items)
        self.mbs, self.settings, self.output = scene.mbs, scene.settings, "tip"
        self.mbs.SetPostStepUserFunction(self._post_step)
        self.monitor = romerr.attach(self.mbs, flex, outputs=[tip])
        self.mbs.Assemble()

    def _post_step(self, mbs, t):
        self.calls.append(t)
        return self.at("PostStep", t, True)

    def at(self, where, t, value):
        """Return the value, or do what is wrong there."""
        if where not in self.faults or t < self.fault_time:
            return value
        wrong = self.faults[where]
        if isinstance(wrong, BaseException):
            raise wrong
        return wrong() if callable(wrong) else wrong

    def solve(self):
        """Solve from t = 0 on; return the times of the accepted steps."""
        self.calls.clear()
        self.mbs.SolveDynamic(self.settings)
        return list(self.calls)

    def stop(self):
        """Do what the button in Exudyn's window does."""
        self.mbs.SetRenderEngineStopFlag(True)
        return True

    def bound(self, i=-1):
        """The best bound of run i, (T,)."""
        return self.monitor.report(i).output(self.output).bound["best"][:, 0]


@pytest.fixture(params=list(H))
def bench(request):
    """A bench, not solved yet."""
    return Bench(request.param)


FAULTS = {
    "PreStep raises": ({"PreStep": ValueError("mine")}, exu.ModelError, 0),
    "PreStep stops": ({"PreStep": False}, None, 1),  # Exudyn makes that step to its end
    "PostStep raises": ({"PostStep": ValueError("mine")}, exu.ModelError, 1),
    "PostStep stops": ({"PostStep": False}, None, 1),
    "PostStep returns nothing": ({"PostStep": None}, None, 1),
    "load raises": ({"load": ValueError("mine")}, exu.ModelError, 0),
    "load is nan": ({"load": np.nan}, exu.SolverError, 0),
    "interrupt in PreStep": ({"PreStep": INTERRUPT}, exu.ModelError, 0),
    "interrupt in PostStep": ({"PostStep": INTERRUPT}, exu.ModelError, 1),
    "interrupt in the load": ({"load": INTERRUPT}, exu.ModelError, 0),
    "exit": ({"PostStep": SystemExit(1)}, exu.ModelError, 1),
}


@contextmanager
def raises(error):
    """What the solve raises, if anything."""
    if error is None:
        yield
    else:
        with pytest.raises(error):
            yield


@pytest.mark.parametrize("name", FAULTS)
def test_what_was_bounded_is_kept_and_the_next_solve_is_sound(bench, name, tmp_path):
    """Against an undisturbed run: the same bounds up to the fault, and all of them in the next solve."""
    wrong, error, more = FAULTS[name]
    bench.solve()
    whole = bench.bound()
    bench.faults = dict(wrong)
    with raises(error):
        bench.solve()
    accepted = list(bench.calls)
    check_kept(bench, accepted, FAULT + 1 + more, whole, tmp_path / "cut.npz")
    bench.faults.clear()
    assert len(bench.solve()) == STEPS + 1
    np.testing.assert_array_equal(bench.bound(), whole)
    assert bench.monitor.report().messages == bench.monitor.report(0).messages
    assert len(bench.monitor.report(1).t) == len(accepted)


def check_kept(bench, accepted, instants, whole, path):
    """Every accepted step is in the report, which says where the run ended, and can be saved."""
    report = bench.monitor.report()
    np.testing.assert_array_equal(report.t, accepted)  # without convergence Exudyn makes shorter and shorter steps
    assert len(report.t) == len(bench.monitor.runs[-1].report().t) >= instants
    check_shorter(bench.bound()[:instants], whole)
    end = f"the run ends at t = {accepted[-1]:g} s; the solver was to go to {STEPS * bench.h:g} s"
    assert end in report.messages
    assert end in str(report)
    report.save(path)
    np.testing.assert_array_equal(romerr.load_report(path).output("tip").bound["best"][:, 0], bench.bound())


def test_stop_by_exudyns_window(bench):
    """Exudyn makes one step more."""
    bench.faults = {"PostStep": bench.stop}
    accepted = bench.solve()
    assert bench.mbs.sys["dynamicSolver"].output.simulationStoppedByUser
    assert len(bench.monitor.report().t) == len(accepted) == FAULT + 2
    assert "the run ends at t" in str(bench.monitor.report())
    bench.faults.clear()
    bench.mbs.SetRenderEngineStopFlag(False)
    assert len(bench.solve()) == len(bench.monitor.report().t) == STEPS + 1


def test_newton_that_does_not_converge(bench):
    """A tolerance that one iteration does not reach."""
    newton = bench.settings.timeIntegration.newton
    bench.solve()
    whole = bench.bound()
    limits = newton.maxIterations, newton.relativeTolerance, newton.absoluteTolerance
    newton.maxIterations, newton.relativeTolerance, newton.absoluteTolerance = 1, 1e-20, 1e-30
    with pytest.raises(exu.SolverError):
        bench.solve()
    assert len(bench.monitor.report().t) == 1
    assert "the run ends at t = 0 s" in str(bench.monitor.report())
    newton.maxIterations, newton.relativeTolerance, newton.absoluteTolerance = limits
    bench.solve()
    np.testing.assert_array_equal(bench.bound(), whole)


IN_A_MECHANISM = {
    "load raises": (ValueError("mine"), exu.ModelError),
    "load is nan": (np.nan, exu.SolverError),
    "interrupt": (INTERRUPT, exu.ModelError),
}


@pytest.mark.parametrize("name", IN_A_MECHANISM)
def test_fault_in_a_mechanism(name):
    """Both bars keep every step, and the next solve is as if undisturbed."""
    (wrong, error), due, times = IN_A_MECHANISM[name], [], []

    def force(mbs, t, vector):
        if due and t > 5.5 * STEP:
            if isinstance(wrong, BaseException):
                raise wrong
            return [wrong, 0.0, 0.0]
        return [0.0, 10.0 * np.sin(200 * t), 0.0]

    scene = pendulum()
    add_load(scene, loadVectorUserFunction=force)
    monitors = watch(scene, hook=lambda mbs, t: times.append(t) or True)
    solve(scene)
    wanted = [monitor.report() for monitor in monitors]
    due.append(True), times.clear()
    with pytest.raises(error):
        solve(scene)
    for monitor, whole in zip(monitors, wanted, strict=True):
        report = monitor.report()
        np.testing.assert_array_equal(report.t, times)
        assert len(times) >= 6
        assert report.planned_end == pytest.approx(10 * STEP)
        # copies of the load go on failing away from the run, where what was bounded has frozen inputs
        is_told = set(report.scope.values()) != {FROZEN}
        if is_told:
            sizes = (np.abs(x.output("probe").estimate_parts["basis"][:6]).max(axis=0) for x in (report, whole))
            np.testing.assert_allclose(*sizes, rtol=tol.LAST_TANGENT)
        assert is_told or "mine" in report.scope_reason or "nan" in report.scope_reason
    due.clear()
    solve(scene)
    check_same(monitors, wanted)


def test_fault_in_a_static_solve():
    """Load steps are kept, too; a dynamic solve after it is none that continues."""
    bench = Bench("floating")
    bench.settings.staticSolver.numberOfLoadSteps = 4
    bench.fault_time, bench.faults = 0.6, {"load": ValueError("mine")}
    with pytest.raises(exu.ModelError):
        bench.mbs.SolveStatic(bench.settings)
    report = bench.monitor.report()
    assert report.time == "static"
    np.testing.assert_allclose(report.t, [0.0, 0.25, 0.5])
    bench.faults.clear()
    assert len(bench.solve()) == len(bench.bound()) == STEPS + 1


# --- the evaluation fails ---------------------------------------------------


@pytest.fixture
def fails_late(bench, monkeypatch):
    """Evaluating steps after the fault raises what is in the list returned."""
    original, wrong = Run._checked, []

    def checked(self, t, *rest):
        if wrong and t[-1] > bench.fault_time:
            raise wrong[0]
        return original(self, t, *rest)

    monkeypatch.setattr(Run, "_checked", checked)
    return wrong


@pytest.mark.parametrize("length", [5, 8, 1024])
def test_failed_evaluation_keeps_every_step_before(bench, fails_late, monkeypatch, capfd, length):
    """At the end, in the middle or anywhere of a block; the run goes on without bounds."""
    monkeypatch.setattr(hook, "BLOCK", length)
    monkeypatch.setattr(hook, "LONGEST", 1)
    bench.solve()
    whole = bench.bound()
    fails_late.append(ArithmeticError("mine"))
    bench.solve()
    error = raised(bench.monitor)
    assert (type(error), str(error)) == (ArithmeticError, "mine")
    kept = bench.monitor.runs[-1].report()
    np.testing.assert_array_equal(kept.t, bench.calls[: FAULT + 1])
    ends = f"bounds end at t = {kept.t[-1]:g}"
    assert f"{ends}: the steps up to t = " in str(kept)
    assert "could not be evaluated, ArithmeticError: mine" in str(kept)
    exu.Print("end")
    told = f": {ends}, report() raises ArithmeticError: mine. The simulation goes on"
    assert capfd.readouterr().out.count(told) == 1
    assert not bench.mbs.sys["dynamicSolver"].output.simulationStoppedByUserFunction
    fails_late.clear()
    assert len(bench.solve()) == len(bench.bound()) == STEPS + 1
    np.testing.assert_array_equal(bench.bound(), whole)
    check_shorter(kept.output("tip").bound["best"][:, 0], whole)


def check_shorter(bound, whole):
    """The first bounds of another run, but for blocks of another length."""
    np.testing.assert_allclose(bound, whole[: len(bound)], atol=tol.SHORTER_BLOCK * whole.max(), rtol=0)


def test_run_after_a_gap_does_not_continue_the_bound(fails_late, bench):
    """It starts in the last state of the solve before, whose bounds end earlier."""
    integration, end = bench.settings.timeIntegration, STEPS * bench.h
    fails_late.append(ArithmeticError("mine"))
    bench.mbs.SolveDynamic(bench.settings, updateInitialValues=True)
    assert bench.monitor.runs[-1].report().t[-1] < bench.mbs.systemData.GetTime() == pytest.approx(end)
    fails_late.clear()
    integration.startTime, integration.endTime = bench.mbs.systemData.GetTime(), 2 * end
    bench.solve()
    report = bench.monitor.report()
    assert len(report.t) == STEPS + 1
    assert not any("continues the run before" in message for message in report.messages)
    assert any("start exactly in the reduced state" in message for message in report.messages)


def test_interrupt_that_the_evaluation_itself_raises(bench, fails_late, monkeypatch):
    """Blocks before are kept, the solve ends at once."""
    monkeypatch.setattr(hook, "BLOCK", 8)
    monkeypatch.setattr(hook, "LONGEST", 1)
    fails_late.append(INTERRUPT)
    with pytest.raises(exu.ModelError) as caught:
        bench.solve()
    assert caught.value.__cause__ is INTERRUPT
    assert len(bench.monitor.report().t) == 25
    fails_late.clear()
    assert len(bench.solve()) == len(bench.monitor.report().t) == STEPS + 1


def test_input_function_that_fails_between_steps(monkeypatch):
    """Exudyn asks at the ends of steps only, the reconstruction between, too."""
    reported, late = mbs_scenes.settings(STEPS, 0.2), [True]
    between = lambda t: np.any(np.abs(t / 5e-3 - np.round(t / 5e-3)) > 1e-3)  # noqa: E731

    def force(t):
        if late[0] and np.any(t > 0.1) and between(t):
            raise LookupError("table ends")
        return mbs_scenes.force(t)

    mbs, _, monitor = mbs_scenes.scene(input_function=force)
    mbs.SolveDynamic(reported)
    assert "table ends" in str(raised(monitor))
    assert monitor.runs[-1].report().t[-1] == pytest.approx(0.1)
    late[0] = False
    mbs.SolveDynamic(reported)
    assert steps_of(monitor) == [21, STEPS + 1]


# --- Ctrl-C -----------------------------------------------------------------


@pytest.fixture
def ctrl_c():
    """Send what Ctrl-C sends; some CI starts Python with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield lambda: os.kill(os.getpid(), signal.SIGINT)
    signal.signal(signal.SIGINT, before)


def interrupting(monkeypatch, ctrl_c, owner, name, when=0):
    """Let a call of a function be interrupted, the next one or a later one."""
    original, calls = getattr(owner, name), []

    def interrupted(*arguments, **options):
        calls.append(name)
        if len(calls) == when + 1:
            ctrl_c()
        return original(*arguments, **options)

    monkeypatch.setattr(owner, name, interrupted)


def test_ctrl_c_while_a_report_is_asked_for(bench, monkeypatch, ctrl_c):
    """It comes when the last block is evaluated; asked again, the report is complete."""
    bench.solve()
    interrupting(monkeypatch, ctrl_c, Run, "advance")
    with pytest.raises(KeyboardInterrupt):
        bench.monitor.report()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert len(bench.monitor.report().t) == STEPS + 1
    assert steps_of(bench.monitor) == [STEPS + 1]


def test_ctrl_c_while_the_mbs_is_read(monkeypatch, ctrl_c):
    """The offline work of a floating body, when its first solve begins."""
    bench = Bench("floating")
    interrupting(monkeypatch, ctrl_c, moving, "prepare")
    with pytest.raises(exu.ModelError) as caught:
        bench.solve()
    assert isinstance(caught.value.__cause__, KeyboardInterrupt)
    assert bench.monitor.runs == ()
    assert len(bench.solve()) == len(bench.monitor.report().t) == STEPS + 1


@pytest.mark.parametrize("place", ["enriched", "estimates"])
def test_ctrl_c_while_a_mechanism_is_told(monkeypatch, ctrl_c, place):
    """In the last step of the solve; all steps are kept, and asked again the report is complete."""
    scene = pendulum()
    monitors = watch(scene)
    solve(scene)
    wanted = [monitor.report() for monitor in monitors]
    interrupting(monkeypatch, ctrl_c, told, place)
    with pytest.raises(exu.ModelError):
        solve(scene)
    for monitor in monitors:
        assert monitor.report().t[-1] == scene.mbs.systemData.GetTime() > 0
    check_same(monitors, wanted)
    solve(scene)
    check_same(monitors, wanted)


def check_same(monitors, wanted):
    """The last run of each is as wanted, to the last bit."""
    for monitor, first in zip(monitors, wanted, strict=True):
        last = monitor.report()
        assert first.scope == last.scope
        np.testing.assert_array_equal(first.output("probe").value, last.output("probe").value)
        np.testing.assert_array_equal(first.output("probe").bound["best"], last.output("probe").bound["best"])


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_attach_that_fails_leaves_the_mbs_as_it_was(monkeypatch, error):
    """The user's function stays in its slot; attaching again works."""
    mbs, mine = mbs_scenes.new_mbs(), mbs_scenes.Recorder()
    mbs.SetPostStepUserFunction(mine)

    def fail(*arguments, **options):
        raise error

    with monkeypatch.context() as patch:
        patch.setattr("exudyn_romerr.mbs.access.reduced_body.prepare", fail)
        with pytest.raises(error):
            mbs_scenes.scene(mbs=mbs)
    assert mbs.GetPostStepUserFunction()["function"] is mine
    mbs.Reset()
    mbs.SetPostStepUserFunction(mine)
    _, _, monitor = mbs_scenes.scene(mbs=mbs)
    mbs.SolveDynamic(mbs_scenes.settings())
    assert len(mine.t) == len(monitor.report().t) == 21


def test_attach_that_is_refused_leaves_the_hook_as_it_was():
    """The function that was passed is not called."""
    mbs, flex, monitor = mbs_scenes.scene()
    mine = mbs_scenes.Recorder()
    with pytest.raises(romerr.InputError, match="attached already"):
        romerr.attach(mbs, flex, outputs=[mbs_scenes.TIP], hook=mine)
    mbs.SolveDynamic(mbs_scenes.settings())
    assert mine.t == []
    assert len(monitor.report().t) == 21


# --- what a fault must not leave behind -------------------------------------


def test_end_of_another_solve_is_not_taken_for_this_ones():
    """A solver kept in mbs.sys from before has another end."""
    mbs, _, monitor = mbs_scenes.scene()
    mbs.SolveDynamic(mbs_scenes.settings(end=0.2))
    mbs.SolveDynamic(mbs_scenes.settings(end=0.1), storeSolver=False)
    assert monitor.report().messages == []


def test_what_a_mechanism_cannot_tell_has_frozen_inputs_and_the_next_solve_is_told(monkeypatch):
    """Whatever goes wrong: the run goes on, the reason is said, and nothing half made is used."""
    scene = pendulum()
    monitors = watch(scene)
    solve(scene)
    wanted = [monitor.report() for monitor in monitors]
    with monkeypatch.context() as patch:
        patch.setattr(told, "enriched", lambda *arguments: 1 / 0)
        solve(scene)
    for monitor in monitors:
        assert set(monitor.report().scope.values()) == {FROZEN}
        assert "no coupled bound: division by zero" in monitor.report().scope_reason
    solve(scene)
    check_same(monitors, wanted)
