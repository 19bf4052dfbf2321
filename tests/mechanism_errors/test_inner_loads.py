"""Loads inside steps: what a jump may still be off by."""

import numpy as np
import pytest

from exudyn_romerr.mechanism_errors.inner_loads import _largest_jump


def test_a_jump_keeps_its_signs():
    """Signs of modes are anybody's choice: those of what it may be off by follow them, as those of the load do."""
    masses, jump = np.array([2.0, 1.0, 0.5]), np.array([3.0, -1.0, 2.0])
    changes = np.zeros((6, 3))
    changes[2] = jump
    signs = np.array([-1.0, 1.0, -1.0])
    np.testing.assert_array_equal(_largest_jump(changes, masses), jump)
    np.testing.assert_array_equal(_largest_jump(signs * changes, masses), signs * jump)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_a_pulse_is_off_at_both_ends(share):
    changes = np.zeros((6, 2))
    changes[1], changes[4] = [4.0, -2.0], [-4.0 * share, 2.0 * share]
    np.testing.assert_allclose(_largest_jump(changes, np.ones(2)), (1 + share) * changes[1])


def test_nothing_jumps_where_loads_are_constant():
    assert not _largest_jump(np.zeros((6, 2)), np.ones(2)).any()
