"""Settings of all tests."""

import os

import pytest

from tests.slower import are_slow

# Small matrices: a second BLAS thread only waits for the first, and on a busy machine it waits eight times as long.
# Read when numpy is imported, which pytest does after this file.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is slow before -m chooses."""
    cases: dict[str, list[str]] = {}
    for item in items:
        cases.setdefault(_test_of(item), []).append(item.nodeid)
    slow = are_slow(cases)
    for item in items:
        if item.nodeid in slow:
            item.add_marker(pytest.mark.slow)


def _test_of(item: pytest.Item) -> str:
    """Its file in tests/, and its name without the case."""
    return item.nodeid.partition("[")[0].removeprefix("tests/")
