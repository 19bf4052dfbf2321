"""Products in pieces: the same numbers, and none so large that BLAS starts threads for it."""

import numpy as np
import pytest

from exudyn_romerr.linalg import blocked_products as blocked
from tests.helpers.tolerances import SUMS

THREADS_FROM = 2**18  # multiplications of two matrices: interface/gemm.c of OpenBLAS 0.3, SMP_THRESHOLD_MIN times 4
THREADS_FROM_OF_A_VECTOR = 2304 * 4  # interface/gemv.c


@pytest.fixture
def products(monkeypatch):
    """Sizes (j, k, m) of all products of NumPy."""
    made, matmul = [], np.matmul

    def noted(one, other, out):
        made.append((*one.shape, other.shape[1]))
        return matmul(one, other, out=out)

    monkeypatch.setattr(np, "matmul", noted)
    monkeypatch.setattr(blocked, "loops", None)  # takes what has few rows
    return made


@pytest.mark.parametrize("m", [1, 8, 30])
def test_rows_times_a_matrix(products, m):
    rng = np.random.default_rng(m)
    rows, matrix = rng.standard_normal((3, 900, 40)), rng.standard_normal((40, m))
    expected = rows @ matrix
    np.testing.assert_allclose(blocked.rows_times(rows, matrix), expected, rtol=0, atol=SUMS * np.abs(expected).max())
    assert len(products) > 2
    assert max(map(np.prod, products)) < (THREADS_FROM if m > 1 else THREADS_FROM_OF_A_VECTOR)


def test_few_weights_times_many_columns(products):
    rng = np.random.default_rng(0)
    weights, columns = rng.standard_normal((64, 4)), rng.standard_normal((4, 3854))
    expected = weights @ columns
    found = blocked.combined(weights, list(columns))
    np.testing.assert_allclose(found, expected, rtol=0, atol=SUMS * np.abs(expected).max())
    assert len(products) > 2
    assert max(map(np.prod, products)) < THREADS_FROM
