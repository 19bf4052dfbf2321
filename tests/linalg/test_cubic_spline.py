"""Cubic splines are those of SciPy, which take long to import."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from exudyn_romerr.linalg.cubic_spline import knot_slopes, spline_weights

from ..helpers.tolerances import SPLINES


@pytest.mark.parametrize("knots", [2, 3, 4, 5, 40])
def test_slopes_and_values_are_those_of_scipy(knots):
    """Values at knots, between them, and a little outside; of arrays in both shapes."""
    rng = np.random.default_rng(knots)
    t = np.cumsum(rng.uniform(0.2, 1.0, knots))
    y = rng.standard_normal((knots, 3, 2))
    at = np.concatenate([t, rng.uniform(t[0] - 0.1, t[-1] + 0.1, 30)])
    known = CubicSpline(t, y)
    np.testing.assert_allclose(knot_slopes(t, y), known(t, 1), rtol=0, atol=SPLINES * np.abs(known(t, 1)).max())
    np.testing.assert_allclose(knot_slopes(t, y[:, 0, 0]), known(t, 1)[:, 0, 0], rtol=0, atol=SPLINES * 10)
    values = np.tensordot(spline_weights(t, at), y, axes=1)
    np.testing.assert_allclose(values, known(at), rtol=0, atol=SPLINES * np.abs(known(at)).max())
