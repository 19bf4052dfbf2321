"""The shared PostStep function: what it gathers, and how it lives with the user's own."""

from contextlib import nullcontext
from itertools import count

import exudyn as exu
import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr import attach
from exudyn_romerr.errors import InputError, RunError
from exudyn_romerr.linear.run.run import BLOCK
from exudyn_romerr.mbs.floating import moving_subject
from exudyn_romerr.mbs.monitoring import body_monitor as watch
from exudyn_romerr.mbs.monitoring import step_hook
from exudyn_romerr.mbs.monitoring.mechanism_run import MechanismRun
from exudyn_romerr.mbs.monitoring.step_hook import LONGEST, block_rows
from exudyn_romerr.process import blas_threads
from models import floating
from tests.helpers.blas import THREADS, counts, several_threads  # noqa: F401
from tests.helpers.mbs_scenes import SOLVERS, TIP, Recorder, added, new_mbs, random_basis, scene, settings
from tests.helpers.observed import attached


@pytest.fixture
def gathered(monkeypatch):
    """Rows given to runs, one list of (t, q, q_t, q_tt) blocks per run."""
    runs = []

    class Recording(watch.Run):
        def start(self, t, *states, **options):
            self.given_rows = [([t], *(state[None] for state in states))]
            runs.append(self.given_rows)
            super().start(t, *states, **options)

        def extension(self, t, *states):
            self.given_rows.append((t, *states))
            return super().extension(t, *states)

    monkeypatch.setattr(watch, "Run", Recording)
    return runs


def joined(blocks, k):
    return np.concatenate([block[k] for block in blocks])


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_accepted_step_is_gathered_exactly(gathered, solver):
    mine = Recorder()
    mbs, _, monitor = scene(hook=mine)
    SOLVERS[solver](mbs, settings(steps=600, end=0.6))
    np.testing.assert_array_equal(monitor.report().t, mine.t)
    for k in range(3):
        rows = joined(gathered[0], k + 1)
        first = 1 if k == 2 else 0  # initial accelerations: next test
        np.testing.assert_array_equal(rows[first:], mine.rows(k)[first:])


def test_adaptive_steps_are_uneven_and_accepted_ones_only(gathered):
    mbs, _, monitor = scene()
    SOLVERS["DOPRI5"](mbs, settings(steps=4, end=0.4))
    t = monitor.report().t
    assert np.diff(t).min() > 0
    assert np.ptp(np.diff(t)) > 1e-3


def test_initial_acceleration_is_consistent_though_explicit_solvers_leave_it_unset(gathered):
    for solver in ("generalised-alpha", "DOPRI5"):
        mine = Recorder()
        mbs, _, _ = scene(hook=mine)
        SOLVERS[solver](mbs, settings())
    implicit, explicit = (blocks[0][3][0] for blocks in gathered)
    assert np.abs(mine.rows(2)[0]).max() == 0.0
    assert np.abs(explicit).max() > 0.1
    np.testing.assert_allclose(explicit, implicit, rtol=1e-9)


def test_rows_come_in_few_blocks_and_the_first_at_once(gathered):
    """Longer ones where bounds compute with few numbers a step."""
    mbs, _, monitor = scene()
    longest = block_rows(12, monitor._watch.subject.read(mbs).width)
    assert BLOCK < longest == LONGEST * BLOCK
    mbs.SolveDynamic(settings(steps=longest + 88, end=0.6))
    assert len(monitor.runs) == 1
    assert [len(block[0]) for block in gathered[0]] == [1, longest, 88]


def test_blocks_are_shorter_where_they_would_not_fit_in_the_cache():
    rows = [block_rows(12, width) for width in (1, 300, 9999)]
    assert rows == [LONGEST * BLOCK, 2 * BLOCK, BLOCK]
    assert block_rows(10_000) < 30


def test_two_bodies_get_their_own_coordinates(gathered):
    mine = Recorder()
    mbs, _, first = scene(basis=random_basis(3), hook=mine)
    _, _, second = scene(random_basis(2, seed=4), mbs=mbs)
    mbs.SolveDynamic(settings(steps=300))
    assert len(first.report().t) == len(second.report().t) == 301
    np.testing.assert_array_equal(joined(gathered[0], 1), mine.rows(0)[:, :3])
    np.testing.assert_array_equal(joined(gathered[1], 2), mine.rows(1)[:, 3:])


def test_body_attached_after_a_solve_gets_none_of_its_rows():
    mbs, _, first = scene()
    mbs.SolveDynamic(settings(steps=20))
    _, _, second = scene(random_basis(2), mbs=mbs)
    assert len(first.report().t) == 21
    with pytest.raises(RunError, match="before a run"):
        second.report()
    mbs.SolveDynamic(settings(steps=20))
    assert len(first.runs) == 2
    assert len(second.runs) == 1


def test_one_hook_is_shared():
    mbs, _, _ = scene()
    shared = mbs.GetPostStepUserFunction()["function"]
    scene(mbs=mbs)
    assert mbs.GetPostStepUserFunction()["function"] is shared


def test_users_hook_set_before_is_called_every_step_with_its_arguments():
    mine = Recorder()
    mbs = new_mbs()
    mbs.SetPostStepUserFunction(mine)
    _, _, monitor = scene(mbs=mbs)
    scene(random_basis(2), mbs=mbs)
    mbs.SolveDynamic(settings(steps=20))
    assert len(mine.t) == 21
    np.testing.assert_array_equal(monitor.report().t, mine.t)


@pytest.mark.parametrize("result", [False, None])
def test_users_hook_stops_the_solve_and_the_report_says_so(result):
    mine = Recorder(result, stop_at=0.05)
    mbs, _, monitor = scene(hook=mine)
    mbs.SolveDynamic(settings(steps=20, end=0.1))
    assert mbs.sys["dynamicSolver"].output.simulationStoppedByUserFunction
    assert monitor.report().t[-1] == mine.t[-1] == pytest.approx(0.05)
    why = f"the PostStep function returned {result}; it must return True to go on"
    assert f"stopped at t = 0.05: {why}" in monitor.runs[0].messages


@pytest.mark.parametrize("other", [Recorder(), 0])
def test_replaced_hook_is_told_and_earlier_runs_are_kept(other):
    mbs, _, monitor = scene()
    mbs.SolveDynamic(settings(steps=20))
    mbs.SetPostStepUserFunction(other)
    mbs.SolveDynamic(settings(steps=30))
    with pytest.raises(RunError, match="set yours first, or pass hook=yours"):
        monitor.report()
    assert [len(run.report().t) for run in monitor.runs] == [21]


def test_function_that_wraps_the_hook_is_accepted():
    mbs, _, monitor = scene()
    inner = mbs.GetPostStepUserFunction()["function"]
    mbs.SetPostStepUserFunction(lambda mbs, t: inner(mbs, t))
    mbs.SolveDynamic(settings(steps=20))
    assert len(monitor.report().t) == 21


def test_attach_after_replacement_chains_the_new_function():
    mbs, flex, _ = scene()
    mine = Recorder()
    mbs.SetPostStepUserFunction(mine)
    monitor = attach(mbs, flex, outputs=[TIP])
    mbs.SolveDynamic(settings(steps=20))
    assert len(monitor.report().t) == len(mine.t) == 21


def test_hook_keyword_with_the_same_function_is_fine_with_another_refused():
    mine = Recorder()
    mbs = new_mbs()
    mbs.SetPostStepUserFunction(mine)
    scene(mbs=mbs, hook=mine)
    mbs.SolveDynamic(settings(steps=20))
    assert len(mine.t) == 21
    with pytest.raises(InputError, match="another PostStep function already"):
        scene(mbs=mbs, hook=Recorder())


def test_hook_that_is_no_function_is_refused():
    with pytest.raises(InputError, match="hook=3"):
        scene(hook=3)


def test_reset_removes_the_hook_and_keeps_the_runs():
    mbs, _, old = scene()
    mbs.SolveDynamic(settings(steps=20))
    mbs.Reset()
    _, _, new = scene(random_basis(2), mbs=mbs)
    mbs.SolveDynamic(settings(steps=30))
    assert len(new.report().t) == 31
    assert [len(run.report().t) for run in old.runs] == [21]
    for question in (old.report, lambda: old.plan):
        with pytest.raises(RunError, match=r"mbs\.Reset\(\) removed it"):
            question()


def test_assembling_again_with_another_body_before_keeps_coordinates_right(gathered):
    mine = Recorder()
    mbs, _, monitor = scene(hook=mine)
    mbs.SolveDynamic(settings(steps=20))
    added(mbs, random_basis(2))
    mbs.Assemble()
    mine.t.clear(), mine.states.clear()
    mbs.SolveDynamic(settings(steps=20))
    assert len(monitor.runs) == 2
    np.testing.assert_array_equal(joined(gathered[1], 1), mine.rows(0)[:, :3])


# --- threads of BLAS beside a run ---


OURS = {(MechanismRun, name) for name in ("append", "tell")} | {(MechanismRun, "told")}


def noting(found, module, name, original):
    """Return original, which notes under a name how many threads it has."""

    def noted(*arguments, **options):
        found.setdefault(name, set()).update(counts(module))
        return original(*arguments, **options)

    return noted


@pytest.fixture
def seen(several_threads, monkeypatch):  # noqa: F811
    """Numbers of threads, by who had them."""
    found = {}
    for owner, name in OURS:
        monkeypatch.setattr(owner, name, noting(found, several_threads, name, getattr(owner, name)))
    read = moving_subject.MovingSubject._seen
    monkeypatch.setattr(moving_subject.MovingSubject, "_seen", noting(found, several_threads, "read", read))
    return found


def solved(hook=None):
    """The pendulum, solved, and its monitor."""
    scene = floating.pendulum(2, h=1e-3, t_end=0.02)
    monitor = attached(scene, hook=hook)
    scene.mbs.Assemble()
    scene.mbs.SolveDynamic(scene.settings)
    return scene, monitor


def test_one_thread_in_all_that_is_ours_and_the_users_own_in_theirs(seen, several_threads):  # noqa: F811
    _, monitor = solved(noting(seen, several_threads, "PostStep", lambda mbs, t: True))
    monitor.report()
    assert seen.pop("PostStep") == {THREADS}
    assert seen == {name: {1} for name in ("read", "append", "tell", "told")}


def test_what_goes_wrong_in_ours_leaves_no_trace(several_threads, monkeypatch):  # noqa: F811
    def fail(*_):
        raise romerr.RunError("on purpose")

    monkeypatch.setattr(MechanismRun, "append", fail)
    after = []
    _, monitor = solved(lambda mbs, t: not after.append(counts(several_threads)))
    assert after == [{THREADS}] * 21
    with pytest.raises(romerr.RunError, match="on purpose"):
        monitor.report()
    assert counts(several_threads) == {THREADS}


def test_the_plan_is_made_with_one_thread_too(seen):
    scene = floating.pendulum(2, h=1e-3, t_end=0.02)
    monitor = attached(scene)
    scene.mbs.Assemble()
    assert monitor.plan
    assert seen["read"] == {1}


def test_bounds_do_not_depend_on_it(several_threads):  # noqa: F811
    scene, monitor = solved()
    with several_threads.threadpool_limits(1):
        scene.mbs.SolveDynamic(scene.settings)
    first, second = monitor.report(0), monitor.report(1)
    for name in first.outputs:
        one, other = first.output(name), second.output(name)
        np.testing.assert_array_equal(one.bound["best"], other.bound["best"])
        np.testing.assert_array_equal(one.estimate, other.estimate)


class Clocks:
    """Other threads take PATIENCE each time that somebody looks."""

    def __init__(self):
        self.of_process = count(step=blas_threads.PATIENCE)

    def process_time(self):
        """CPU time of all threads."""
        return next(self.of_process)

    def thread_time(self):
        """CPU time of this one."""
        return 0.0


class Limiting:
    """Stands for threadpoolctl's controller."""

    def limit(self, limits):
        """Nothing is taken by others."""
        return nullcontext()


@pytest.mark.parametrize(
    ("controller", "told"), [(None, 1), (Limiting(), 0)], ids=["without threadpoolctl", "with it"]
)
def test_runs_tell_once_what_other_threads_take(capfd, monkeypatch, controller, told):
    """Without threadpoolctl alone, on the console, not in reports: it is no matter of their numbers."""
    others = blas_threads.OtherThreads()
    for module in (blas_threads, step_hook):
        monkeypatch.setattr(module, "OTHERS", others)
    monkeypatch.setattr(blas_threads, "time", Clocks())
    monkeypatch.setattr(blas_threads, "threads", lambda: 2)
    monkeypatch.setattr(blas_threads, "_controller", lambda: controller)
    scene, monitor = solved()
    scene.mbs.SolveDynamic(scene.settings)
    reports = [str(monitor.report(i)) for i in range(2)]
    exu.Print("end")
    assert capfd.readouterr().out.count("exudyn_romerr: other threads have taken ") == told
    assert not any("threads" in text for text in reports)
