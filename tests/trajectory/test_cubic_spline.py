"""The spline is SciPy's."""

import numpy as np
import pytest
import scipy.interpolate

from exudyn_romerr.trajectory.cubic_spline import CubicSpline
from tests.helpers import tolerances


@pytest.mark.parametrize("n", [2, 3, 4, 5, 60])
def test_values_and_slopes_are_scipys(n):
    """At uneven times, also outside of these; of many values at each time, or of one."""
    rng = np.random.default_rng(n)
    t, x = np.cumsum(rng.uniform(0.1, 1.0, n)), np.linspace(-0.2, 0.6 * n, 50)
    for shape in ((3, 2), ()):
        y = rng.standard_normal((n, *shape))
        ours, known = CubicSpline(t, y), scipy.interpolate.CubicSpline(t, y)
        for found, expected in ((ours(x), known(x)), (ours(x[7]), known(x[7])), (ours.slopes, known(t, 1))):
            assert found.shape == expected.shape
            np.testing.assert_allclose(found, expected, rtol=0, atol=tolerances.SUMS * abs(expected).max())
