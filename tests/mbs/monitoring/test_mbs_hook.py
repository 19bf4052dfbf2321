"""The shared PostStep function: what it gathers, and how it lives with the user's own."""

import exudyn as exu
import numpy as np
import pytest

from exudyn_romerr.errors import InputError, RunError
from exudyn_romerr.linear.run.run import BLOCK
from exudyn_romerr.mbs import attach
from exudyn_romerr.mbs.monitoring import body_monitor as watch
from exudyn_romerr.mbs.monitoring.step_hook import LONGEST, block_rows
from tests.helpers.mbs_scenes import SOLVERS, TIP, Recorder, added, new_mbs, random_basis, scene, settings


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


def test_without_users_hook_the_solve_goes_on():
    mbs, _, monitor = scene()
    mbs.SolveDynamic(settings(steps=20, end=0.1))
    assert not mbs.sys["dynamicSolver"].output.simulationStoppedByUserFunction
    assert monitor.report().t[-1] == pytest.approx(0.1)
    assert not monitor.runs[0].messages


@pytest.mark.parametrize("error", [KeyError("mine"), KeyboardInterrupt()])
def test_error_in_users_hook_arrives_and_the_step_is_kept(error):
    mbs, _, monitor = scene(hook=Recorder(stop_at=0.05, error=error))
    with pytest.raises(exu.ExudynError) as caught:
        mbs.SolveDynamic(settings(steps=20, end=0.1))
    assert isinstance(caught.value.__cause__, type(error))
    assert len(monitor.report().t) == 11
    assert monitor.report().t[-1] == pytest.approx(0.05)


def test_replaced_hook_is_told_and_earlier_runs_are_kept():
    mbs, _, monitor = scene()
    mbs.SolveDynamic(settings(steps=20))
    mbs.SetPostStepUserFunction(Recorder())
    mbs.SolveDynamic(settings(steps=30))
    with pytest.raises(RunError, match="set yours first, or pass hook=yours"):
        monitor.report()
    assert [len(run.report().t) for run in monitor.runs] == [21]


def test_removed_hook_is_told():
    mbs, _, monitor = scene()
    mbs.SetPostStepUserFunction(0)
    mbs.SolveDynamic(settings())
    with pytest.raises(RunError, match="replaced"):
        monitor.report()


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
