"""One thread of BLAS while our small matrices are computed with, and the user's number of threads afterwards."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
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
