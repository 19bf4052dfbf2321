"""What belongs to the whole process of the user: threads of BLAS, Ctrl-C, tracebacks; changed while we compute."""

from __future__ import annotations

import os
import re
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import TracebackType
from typing import Any

_INSIDE = threading.Lock()
LIMITS = "OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "OMP_NUM_THREADS"  # as OpenBLAS: the first that is set counts
# s of CPU time that other threads take beside ours: less is hardly noticed. With bounds, 100 steps of a pendulum,
# 0.4 s of CPU time with one thread, took 1.5 to 2.4 with two, 0.7 to 1.0 of that there, and 4 to 6 s on busy cores
PATIENCE = 0.5
HINT = (
    "other threads have taken {:.2g} s of CPU time while bounds were prepared and evaluated, most likely NumPy's, "
    "which wait for one another at small matrices: pip install threadpoolctl leaves one to bounds, and all to the "
    "rest; or set OPENBLAS_NUM_THREADS=1 before Python starts"
)
OURS = os.path.dirname(os.path.abspath(__file__))  # the package: its frames are no news to users
# In what Exudyn adds to exceptions: a frame of ours, or of what starts us; the frame that called Exudyn last
PLACE = re.compile(rf"^  (?:{re.escape(OURS)}.*|<frozen runpy>)\(\d+\): .*\n", re.MULTILINE)
LAST_PLACE = re.compile(rf"\[Python file '{re.escape(OURS)}[^']*', line \d+\]")


# --- one thread of BLAS while small matrices are computed with, the user's number of threads afterwards ---


@contextmanager
def one_thread() -> Iterator[None]:
    """Let OpenBLAS, NumPy's and SciPy's, compute with one thread until the end; also usable as a decorator.

    It starts threads at 1e4 multiplications of a matrix with a vector and 3e5 of two matrices, which wait for one
    another at ten times as many, too. Without threadpoolctl it is only seen what they take. MKL keeps its own:
    PARDISO has its threads from there.
    """
    # the setting is the process's: were it changed by two threads of Python, the last to leave would put back a 1
    if not _INSIDE.acquire(blocking=False):
        yield
        return
    try:
        controller = _controller()
        with OTHERS.watched() if controller is None else controller.limit(limits=1):
            yield
    finally:
        _INSIDE.release()


class OtherThreads:
    """CPU time that other threads take while ours compute: those of BLAS, which nothing limits then."""

    def __init__(self):
        self._taken, self._is_told = 0.0, False

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Add up what they take until the end."""
        begin = time.process_time() - time.thread_time()
        try:
            yield
        finally:
            self._taken += time.process_time() - time.thread_time() - begin

    def hint(self) -> str:
        """Return once how that is spared, where it is PATIENCE and more; else nothing."""
        # MKL's threads, which PARDISO has, are no waste
        if self._is_told or self._taken < PATIENCE or threads() < 2 or "pymklpardiso" in sys.modules:
            return ""
        self._is_told = True
        return HINT.format(self._taken)


OTHERS = OtherThreads()


def threads() -> int:
    """Return how many threads OpenBLAS starts with, as the environment and the processors of this process say."""
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    given = (os.environ.get(name, "").strip() for name in LIMITS)
    return min(next((int(n) for n in given if n.isdigit() and int(n) > 0), processors), processors)


@cache
def _controller() -> Any:
    """The controller of every OpenBLAS that is loaded, which takes some ms to find, or None."""
    try:
        import scipy.linalg  # noqa: F401  # brings one of its own
        from threadpoolctl import ThreadpoolController
    except ImportError:
        return None
    return ThreadpoolController().select(internal_api="openblas")


# --- Ctrl-C, which is not to leave half of an evaluation behind ---


@contextmanager
def interrupt_deferred() -> Iterator[None]:
    """Let Ctrl-C wait until the block is evaluated, so that it never leaves half a block behind."""
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    caught: list[tuple] = []
    signal.signal(signal.SIGINT, lambda *arguments: caught.append(arguments))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if caught:
            handler(*caught[0])


# --- exceptions of the user's without frames of this package: in tracebacks, and in what Exudyn writes of them ---


def without_our_frames(error: BaseException) -> BaseException:
    """Return the exception, its causes too, without frames of this package in its traceback."""
    seen: list[BaseException] = []
    waiting: list[BaseException | None] = [error]
    while waiting:
        one = waiting.pop()
        if one is not None and not any(one is other for other in seen):
            seen.append(one)
            one.__traceback__ = _kept(one.__traceback__)
            waiting += [one.__cause__, one.__context__]
    return error


def _kept(trace: TracebackType | None) -> TracebackType | None:
    """The traceback without our frames; from its end on, for one of a deep recursion has a thousand."""
    traces: list[TracebackType] = []
    while trace is not None:
        if not os.path.abspath(trace.tb_frame.f_code.co_filename).startswith(OURS + os.sep):
            traces.append(trace)
        trace = trace.tb_next
    kept = None
    for one in reversed(traces):
        kept = TracebackType(kept, one.tb_frame, one.tb_lasti, one.tb_lineno)
    return kept


def without_our_places(error: BaseException) -> BaseException:
    """Return the exception, in whose text Exudyn lists frames, without those of this package.

    Exudyn names the frame that called it last, too: the user's, not ours.
    """
    if len(error.args) == 1 and isinstance(text := error.args[0], str) and OURS in text:
        frame = sys._getframe(1)
        while frame is not None and _is_between(frame.f_code.co_filename):
            frame = frame.f_back
        place = "" if frame is None else f"[Python file '{frame.f_code.co_filename}', line {frame.f_lineno}]"
        error.args = (PLACE.sub("", LAST_PLACE.sub(lambda _: place, text)),)
    return error


def _is_between(file: str) -> bool:
    return file.startswith(OURS) or "site-packages/exudyn/" in file.replace("\\", "/")
