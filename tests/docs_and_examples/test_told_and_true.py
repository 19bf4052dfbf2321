"""half_widths.py, bounds.py: what counts as good, as left out, as above its bound; runs beside stored truths."""

import numpy as np
import pytest

from benchmarks import bounds, constants, half_widths, told_and_true
from exudyn_romerr.mechanism_errors import half_widths as of_package

GOOD = {"name": "tip", "component": 0, "cause": "modes", "true": 1.0, "unsure": 0.01}
GOOD |= {"is known": True, "told": 1.5, "half": 0.3, "off": 0.1, "inside": 1.0}


@pytest.mark.parametrize(
    ("changed", "is_good", "is_left_out"),
    [
        ({}, True, False),
        ({"told": 2.1}, False, False),  # more than twice what is true
        ({"inside": 0.99}, False, False),  # an instant lies outside
        ({"is known": False}, False, False),
        ({"unsure": 0.11}, True, True),
        ({"true": 0.0, "unsure": 0.0}, False, True),
    ],
)
def test_what_is_good(changed, is_good, is_left_out):
    record = GOOD | changed
    assert half_widths.is_good(record) == is_good
    assert half_widths.is_left_out(record) == is_left_out


def test_shares_are_of_what_is_compared():
    records = [GOOD, GOOD | {"told": 3.0}, GOOD | {"is known": False}, GOOD | {"unsure": 1.0}]
    assert half_widths.line_of("all", records).split() == "all 3 25% 33% 100 % (100.0 %) 33% 2.25".split()
    text = half_widths.table([{"scene": "seed 0", "kind": "smooth", "records": records}])
    assert "random mechanisms" in text
    assert len(list(half_widths.not_good([{"scene": "seed 0", "kind": "smooth", "records": records}]))) == 2


def test_the_limit_of_steps_is_that_of_second_order():
    """An error h^2 sin t is found, and known well; one that does not shrink with the step is not known."""
    t = np.linspace(0, 1, 9)[:, None]
    solved = {k: {"a": np.hstack([4.0**-k * np.sin(t), (-1.0) ** k + 0 * t])} for k in range(told_and_true.LAST + 1)}
    found = told_and_true.limits(lambda k: solved[k])
    error, unsure = found["a"]
    np.testing.assert_allclose(error[:, 0], -np.sin(t[:, 0]), rtol=0, atol=1e-14)
    assert unsure[0] < 1e-12
    assert unsure[1] >= np.abs(error[:, 1]).max() / 2


def test_a_run_is_compared_with_its_stored_truth():
    """A mechanism, and a scene of models/ whose bound is of the whole error: estimates of modes are close there."""
    seed = told_and_true.of_seed(0)
    assert seed["kind"] == "smooth"
    assert {one["cause"] for one in seed["records"]} == {"modes", "step", "whole"}
    modes = [one for one in seed["records"] if one["cause"] == "modes" and not half_widths.is_left_out(one)]
    assert modes
    assert all(one["off"] <= 0.1 * one["true"] for one in modes)
    scene = told_and_true.of_scene("clamped_bar", 4, "RBE3")
    assert not list(bounds.below([seed, scene]))
    text = bounds.table([seed, scene])
    assert f"errors above their bounds: 0 of {len(seed['bounds']) + len(scene['bounds'])} components" in text


def test_an_error_above_its_bound_is_told():
    value = {"name": "tip", "component": 0, "of": "displacement", "bound": 1.0, "true": 2.0, "floor": 0.0}
    run = {
        "scene": "seed 5",
        "kind": "smooth",
        "uncertified": ["far"],
        "bounds": [value | {"below": 1.0, "certified": 1}],
    }
    text = bounds.table([run])
    assert "errors above their bounds: 1 of 1 components" in text
    assert "seed 5: tip 0: error 2.000e+00" in text
    assert "certified: 0 of 1 runs" in text


def test_stored_truths_are_what_is_made_anew():
    """To single precision of the modes, and half of the steps; both solves are the same to Newton's tolerance."""
    kept, made = told_and_true.read_truth(0), told_and_true.truth_of(0)
    assert set(kept) == set(made)
    for key in (name.removesuffix("/modes") for name in made if name.endswith("/modes")):
        for part, digits in (("modes", 1e-6), ("step", 1e-3)):
            x, y, unsure = (of[f"{key}/{name}"] for of, name in ((kept, part), (made, part), (made, "unsure")))
            np.testing.assert_allclose(x, y, rtol=0, atol=digits * np.abs(y).max() + unsure.max())


def test_kinds_are_a_quarter_smooth_half_sudden_and_a_quarter_with_dampers():
    made = [told_and_true.mechanism_of(seed) for seed in range(8)]
    sudden = [any(load.shape.kind == "at once" for load in one.loads) for one in made]
    assert sudden == 2 * [False, True, True, True]
    damped = [any(link.damped for of in one.links for link in of) for one in made]
    assert not any(damped[1::4] + damped[2::4])
    assert all(damped[3::4])


def verdict(size, half_width, how):
    return {"size": size, "half_width": half_width, "how": how}


def test_examples_are_compared_with_what_was_measured():
    row = {"solve": 0, "name": "tip", "component": 1, "interfaces": None}
    told = row | {"modes": verdict(1.1, 0.1, "estimated"), "step": verdict(None, None, "not covered")}
    true = row | {"modes": verdict(1.0, 0.0, "measured"), "step": verdict(2.0, 0.1, "measured")}
    rest = {"sum": verdict(None, None, "not covered")}
    modes, step = half_widths.of_example([told | rest], [true | rest])
    assert half_widths.is_good(modes)
    assert (step["true"], step["is known"]) == (2.0, False)


def test_numbers_that_decide_are_moved(capsys):
    """SHARE is a share of estimates in their half widths: four times as much makes a number less sharp."""
    kept = of_package.SHARE
    text = constants.main(["--seeds", "1", "--only", "SHARE"])
    assert of_package.SHARE == kept
    assert "as they are" in text
    assert "mechanism_errors.half_widths.SHARE" in text
    (module, name, value) = next(x for x in constants.numbers_of("mechanism_errors") if x[1] == "SHARE")
    here = constants.figures([0])
    with constants.moved(module, name, 100.0):
        assert of_package.SHARE == 100 * value
        assert constants.figures([0]).good < here.good
