"""The stored truths of estimates are what full models with short steps do, and near the limit of no steps."""

import numpy as np
import pytest

from models import driven_truth, estimate_truths
from models.estimate_scenes import SCENES
from tests.helpers import tolerances as tol

# steps of the reduced run that are solved again: in less than a second, and bodies move; of other scenes, slow, a
# tenth of all: `python -m models.estimate_truths` solves all, in an hour
CHEAP = {"linear_bar": 40, "driven_bar": 20, "hinged_bar": 4, "hinged_bar_fine": 8}


def assert_stored(name, steps):
    """What is found is what is stored."""
    found, wanted = estimate_truths.extrapolated(name, steps), estimate_truths.stored(name)
    assert found.keys() == wanted.keys() == {*SCENES[name].sensors}
    for key, truth in found.items():
        largest = np.abs(wanted[key].value[: len(truth.t)]).max()
        for values, kept in ((truth.value, wanted[key].value), (truth.same_steps, wanted[key].same_steps)):
            np.testing.assert_allclose(values, kept[: len(values)], rtol=0, atol=tol.OTHER_PROCESSOR * largest)


@pytest.mark.parametrize("name", CHEAP)
def test_first_steps_are_those_stored(name):
    assert_stored(name, CHEAP[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SCENES if name not in CHEAP])
def test_a_tenth_of_the_steps_is_that_stored(name):
    assert_stored(name, round(SCENES[name].t_end / SCENES[name].h / 10))


@pytest.mark.parametrize("name", SCENES)
def test_truths_are_better_than_what_is_compared_with_them(name):
    """A tenth of what is promised, 3 % of the error or more.

    Errors of joint forces are 1e-5 of these and more: of fine steps they are the basis', not the steps'.
    """
    truths = estimate_truths.stored(name)
    assert truths.keys() == {*SCENES[name].sensors}
    for truth in truths.values():
        assert truth.value.shape == truth.same_steps.shape == (round(SCENES[name].t_end / SCENES[name].h) + 1, 3)
        share = 3e-3
        fine = 1e-6 * np.abs(truth.value).max() if name == "slider_crank_fine" else 0.0
        assert truth.off.max() <= max(share * np.abs(truth.value - truth.same_steps).max(), fine)


def test_driven_bar_is_that_of_a_truth_without_steps():
    """An independent one: models/driven_truth.py integrates its own equations to 1e-11."""
    for name, exact in zip(driven_truth.SENSORS, driven_truth.stored("turns"), strict=True):
        truth = estimate_truths.stored("driven_bar").get(name)
        if truth is not None:
            steps = np.abs(truth.value - truth.same_steps).max()
            assert np.abs(truth.value - exact[::4]).max() < tol.RICHARDSON * steps
