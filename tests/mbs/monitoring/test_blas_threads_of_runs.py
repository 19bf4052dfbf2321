"""Threads of BLAS beside a run: one while bounds are evaluated, the user's own in all else, and the same numbers."""

from contextlib import nullcontext
from itertools import count

import exudyn as exu
import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.mbs.floating import moving_subject
from exudyn_romerr.mbs.monitoring import step_hook
from exudyn_romerr.mbs.monitoring.mechanism_run import MechanismRun
from exudyn_romerr.process import blas_threads
from models import floating
from tests.helpers.blas import THREADS, counts, several_threads  # noqa: F401

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
    monitor = romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.items), hook=hook)
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
    monitor = romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.items))
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
