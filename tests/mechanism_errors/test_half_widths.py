"""What further vectors would add, where thirds of those that there are make less and less."""

import numpy as np
import pytest

from exudyn_romerr.mechanism_errors.half_widths import tail


@pytest.mark.parametrize("r", [0.1, 0.3, 0.45])
@pytest.mark.parametrize("thirds", [1, 2])
def test_a_geometric_series_is_summed_whatever_stands_before_its_last_third(r, thirds):
    """Of rigid interfaces two thirds stand before it: taken for one, their half width was a fifth at r = 0.5."""
    before = np.array([1.0 if thirds == 1 else 1 / r + 1.0])
    np.testing.assert_allclose(tail(np.array([r]), before, thirds), r * r / (1 - r), rtol=1e-12)


def test_what_hardly_falls_is_not_extrapolated():
    assert tail(np.array([0.9]), np.array([1.0]))[0] == 0.9
    assert tail(np.array([0.9]), np.array([1.0]), 2)[0] == 0.9
    assert tail(np.array([0.0]), np.array([1.0]), 2)[0] == 0.0
