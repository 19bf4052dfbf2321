"""Threads of BLAS: one inside, what was there before afterwards."""

import os
import sys
from threading import Event, Thread

import pytest

from exudyn_romerr.process import blas_threads
from exudyn_romerr.process.blas_threads import LIMITS, PATIENCE, OtherThreads, one_thread, threads
from tests.helpers.blas import THREADS, counts, several_threads  # noqa: F401


@pytest.fixture
def count(several_threads):  # noqa: F811
    return lambda: counts(several_threads)


def test_one_inside_and_the_users_own_afterwards(count):
    """Of all that are loaded: NumPy's and SciPy's wheels bring one each."""
    assert count() == {THREADS}
    with one_thread():
        assert count() == {1}
    assert count() == {THREADS}


def test_an_exception_puts_it_back(count):
    with pytest.raises(ZeroDivisionError), one_thread():
        1 / 0  # noqa: B018
    assert count() == {THREADS}


def test_one_within_another(count):
    with one_thread():
        with one_thread():
            assert count() == {1}
        assert count() == {1}
    assert count() == {THREADS}


def test_limits_of_the_user(count, several_threads):  # noqa: F811
    with several_threads.threadpool_limits(2):
        with one_thread():
            assert count() == {1}
        assert count() == {2}
    assert count() == {THREADS}


def test_limits_that_the_user_sets_within(count, several_threads):  # noqa: F811
    """In a load function, say."""
    with one_thread():
        with several_threads.threadpool_limits(2):
            assert count() == {2}
        assert count() == {1}
    assert count() == {THREADS}


def test_solves_in_two_threads_of_python(count):
    """Whoever leaves last puts back no 1 that the first one has set."""
    inside, leave = Event(), Event()

    def other():
        with one_thread():
            inside.set()
            assert leave.wait(60)

    thread = Thread(target=other)
    try:
        with one_thread():
            thread.start()
            assert inside.wait(60)
            assert count() == {1}
        assert count() == {THREADS}
    finally:
        leave.set()
        thread.join()
    assert count() == {THREADS}


def test_as_a_decorator_again_and_again(count):
    look = one_thread()(count)
    assert [look(), count(), look(), count()] == [{1}, {THREADS}] * 2


def test_nothing_happens_without_threadpoolctl(count, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "threadpoolctl", None)
        blas_threads._controller.cache_clear()
        with one_thread():
            assert count() == {THREADS}
    blas_threads._controller.cache_clear()


@pytest.fixture
def environment(monkeypatch):
    """Without limits of threads, on a machine of four processors."""
    for name in LIMITS:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2, 3}, raising=False)
    monkeypatch.delitem(sys.modules, "pymklpardiso", raising=False)
    return monkeypatch


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, 4),
        ({"OPENBLAS_NUM_THREADS": "1"}, 1),
        ({"OMP_NUM_THREADS": "1"}, 1),
        ({"OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "1"}, 2),
        ({"OPENBLAS_NUM_THREADS": "0", "OMP_NUM_THREADS": "3"}, 3),
        ({"OPENBLAS_NUM_THREADS": "16"}, 4),
        ({"OPENBLAS_NUM_THREADS": "many"}, 4),
    ],
)
def test_threads_as_openblas_takes_them_from_the_environment(environment, given, expected):
    for name, value in given.items():
        environment.setenv(name, value)
    assert threads() == expected


def test_threads_where_only_the_processors_of_the_machine_are_known(environment):
    environment.delattr(os, "sched_getaffinity")
    environment.setattr(os, "cpu_count", lambda: None)
    assert threads() == 1


def taken(environment, seconds):
    """Other threads, which have taken so much of what was watched; 1 s of ours goes by with it."""
    clocks = iter([5.0, 2.0, 6.0 + seconds, 3.0])  # of process and thread, before and after
    environment.setattr(blas_threads, "time", type("Clocks", (), {"process_time": lambda: next(clocks)}))
    blas_threads.time.thread_time = blas_threads.time.process_time
    others = OtherThreads()
    with pytest.raises(ZeroDivisionError), others.watched():
        1 / 0  # noqa: B018
    return others


def test_what_other_threads_take_is_told_once(environment):
    others = taken(environment, PATIENCE + 0.1)
    assert f"have taken {PATIENCE + 0.1:.2g} s" in others.hint()
    assert others.hint() == ""


@pytest.mark.parametrize("why", ["little", "one thread", "PARDISO"])
def test_nothing_is_told_where_it_is_none_or_no_waste(environment, why):
    others = taken(environment, PATIENCE * (0.9 if why == "little" else 2))
    if why == "one thread":
        environment.setenv("OPENBLAS_NUM_THREADS", "1")
    if why == "PARDISO":
        environment.setitem(sys.modules, "pymklpardiso", None)
    assert others.hint() == ""
