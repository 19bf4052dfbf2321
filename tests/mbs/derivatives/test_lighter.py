"""Whether masses half way between two readings are lighter than there: against eigenvalues."""

import numpy as np
import pytest
from scipy.linalg import null_space

from exudyn_romerr.mbs.derivatives.tangent_reading import is_lighter


def masses_of(lightest, rng, k=12):
    """M with this smallest eigenvalue, others up to 1."""
    Q = np.linalg.qr(rng.normal(size=(k, k)))[0]
    return Q @ np.diag([lightest, *rng.uniform(max(lightest, 0.05), 1.0, k - 1)]) @ Q.T


@pytest.mark.parametrize("ends", [(0.1, 0.1), (0.1, 1e-3), (1e-3, 0.1), (1e-13, 0.1), (0.1, -1e-3), (-1e-3, 0.1)])
@pytest.mark.parametrize("last", [-0.1, -1e-15, 0.0, 4e-4, 6e-4, 0.04, 0.06, 0.2])
def test_it_is_what_eigenvalues_tell(ends, last):
    rng = np.random.default_rng([abs(int(1e6 * x)) for x in (*ends, last)])
    for constraints in (0, 3):
        M = np.array([masses_of(x, rng) for x in (*ends, last)])
        C, scale = rng.normal(size=(3, constraints, 12)), rng.uniform(0.5, 1.0, 12)
        free = [scale[:, None] * (null_space(one * scale) if constraints else np.eye(12)) for one in C]
        *known, middle = (np.linalg.eigvalsh(f.T @ m @ f)[0] for f, m in zip(free, M, strict=True))
        assert is_lighter(M, C, scale, 0.5) == (middle / min(known) < 0.5)
