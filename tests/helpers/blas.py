"""A process that has several threads of BLAS, as most users' have; tests otherwise run with one."""

from collections.abc import Iterator
from types import ModuleType

import pytest

from exudyn_romerr.process import blas_threads

THREADS = 3


@pytest.fixture
def several_threads() -> Iterator[ModuleType]:
    """Let BLAS have THREADS threads within a test; yield threadpoolctl."""
    module = pytest.importorskip("threadpoolctl")
    blas_threads._controller.cache_clear()  # other tests have loaded one more since, that of ngsolve
    with module.threadpool_limits(THREADS, user_api="blas"):
        if not counts(module):
            pytest.skip("NumPy and SciPy have no OpenBLAS here")
        yield module


def counts(module: ModuleType) -> set[int]:
    """Return how many threads every OpenBLAS has that is loaded."""
    return {x["num_threads"] for x in module.threadpool_info() if x["internal_api"] == "openblas"}
