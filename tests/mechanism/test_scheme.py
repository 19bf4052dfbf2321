"""Coordinates of first order that do not go on as the trapezoidal rule says."""

import numpy as np
import pytest

from exudyn_romerr.mechanism.scheme import strays_of_first_order


@pytest.mark.parametrize("unit", [1.0, 1e7])
def test_a_step_that_began_from_another_rate_is_found(unit):
    """As after a step that Newton rejects: of a motor's current the modes' part was 500 half widths off."""
    t = np.linspace(0.0, 1.0, 41) ** 1.2
    rates = unit * np.column_stack([np.cos(3 * t), np.sin(t)])
    x = np.zeros((41, 2))
    x[1:] = np.cumsum(np.diff(t)[:, None] / 2 * (rates[1:] + rates[:-1]), axis=0)
    assert not len(strays_of_first_order(t, x, rates))
    x[17:, 1] += 0.01 * unit * np.diff(t)[16]
    assert strays_of_first_order(t, x, rates).tolist() == [17]
    assert not len(strays_of_first_order(t, x[:, :0], rates[:, :0]))
