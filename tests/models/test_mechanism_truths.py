"""The stored motion of full models is what the full models do: their first steps, and, slow, all of them."""

import numpy as np
import pytest

from models import mechanism_truths
from tests.helpers import tolerances as tol

FIRST = 20  # steps: the bars have moved by 2e-4 of their largest displacement, or more
MOVED = 1e4  # times what Newton's tolerance may leave


@pytest.mark.parametrize("name", mechanism_truths.SCENES)
def test_first_steps_are_those_stored(name):
    for key, found in mechanism_truths.solved(name, FIRST).items():
        wanted = mechanism_truths.stored(name)[key]
        allowed = tol.MECHANISM_NEWTON * np.abs(wanted).max()
        assert np.abs(wanted[: FIRST + 1]).max() > MOVED * allowed
        np.testing.assert_allclose(found, wanted[: FIRST + 1], rtol=0, atol=allowed)


@pytest.mark.slow
@pytest.mark.parametrize("name", mechanism_truths.SCENES)
def test_all_steps_are_those_stored(name):
    found, wanted = mechanism_truths.solved(name), mechanism_truths.stored(name)
    assert found.keys() == wanted.keys()
    for key, values in wanted.items():
        np.testing.assert_allclose(found[key], values, rtol=0, atol=tol.MECHANISM_NEWTON * np.abs(values).max())
