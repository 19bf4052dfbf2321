"""Threads of BLAS: one inside, what was there before afterwards."""

import sys
from threading import Event, Thread

import pytest

from exudyn_romerr.process import blas_threads
from exudyn_romerr.process.blas_threads import one_thread
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
