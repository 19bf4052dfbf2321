"""One thread of BLAS while our small matrices are computed with, and the user's number of threads afterwards."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import cache
from typing import Any

_INSIDE = threading.Lock()


@contextmanager
def one_thread() -> Iterator[None]:
    """Let OpenBLAS, NumPy's and SciPy's, compute with one thread until the end; also usable as a decorator.

    It starts threads at 1e4 multiplications of a matrix with a vector and 3e5 of two matrices, which wait for one
    another at ten times as many, too. Nothing happens without threadpoolctl. MKL keeps its own: PARDISO has its
    threads from there.
    """
    # the setting is the process's: were it changed by two threads of Python, the last to leave would put back a 1
    if not _INSIDE.acquire(blocking=False):
        yield
        return
    try:
        controller = _controller()
        with nullcontext() if controller is None else controller.limit(limits=1):
            yield
    finally:
        _INSIDE.release()


@cache
def _controller() -> Any:
    """The controller of every OpenBLAS that is loaded, which takes some ms to find, or None."""
    try:
        import scipy.linalg  # noqa: F401  # brings one of its own
        from threadpoolctl import ThreadpoolController
    except ImportError:
        return None
    return ThreadpoolController().select(internal_api="openblas")
