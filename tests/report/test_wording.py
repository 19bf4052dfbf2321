"""Words that reports share: numbers, scopes, what a truth says of an estimate."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from exudyn_romerr.report.scope import COMPLETE, COUPLED, FROZEN, FULL_MODEL, PAGE, SCOPES
from exudyn_romerr.report.wording import (
    corrected_within,
    digits,
    off_by,
    parts_of,
    rounded_down,
    rounded_up,
    scope_lines,
    under,
)
from tests.helpers.report_outputs import corrected, estimated


def test_conditions_of_bounds():
    for scope, said in ((COMPLETE, ""), (COUPLED, ", to first order"), (FROZEN, ", inputs frozen")):
        assert under({"auxiliary": scope}) == said
    out, known = corrected(2.0, 1.0, 0.5, 0.1, covers=FROZEN)
    within = corrected_within(out, known)
    assert within.startswith("under the frame motion, loads and joint forces of this run the corrected output")


def test_interfaces_that_an_estimate_does_not_tell_apart_are_those_of_the_bound():
    out, _ = estimated(2.0, 1.0, {"basis": 0.4})
    out.causes["interfaces"], out.causes["basis"] = (share * out.bound["best"] for share in (0.75, 0.25))
    parts = parts_of(out)
    assert (parts["interfaces"][1, 0], parts["basis"][1, 0]) == pytest.approx((0.3, 0.1))


@pytest.mark.parametrize(
    ("x", "digits", "text"),
    [
        (1.2341e-3, 3, "0.00124"),
        (2.4e-13, 1, "3e-13"),
        (9.991, 3, "10"),
        (0.125, 3, "0.125"),
        (0.0, 3, "0"),
        (np.inf, 3, "inf"),
    ],
)
def test_printed_bounds_are_never_smaller(x, digits, text):
    assert rounded_up(x, digits) == text
    assert float(text) >= x


@pytest.mark.parametrize("scope", SCOPES)
@pytest.mark.parametrize("time", ["reconstructed", "sampled", "static"])
def test_scope_is_said_in_one_line_with_a_link(scope, time):
    """At most 100 characters as printed; what it says of time steps is what bounds cover; the truth is named."""
    of = {"energy": scope}
    report = SimpleNamespace(
        scope=of,
        time=time,
        scope_reason=f"because. {FULL_MODEL}: all of the fem, interfaces free",
        remainder={},
        uncertified=(),
    )
    line, model = scope_lines(report)
    assert len(f"  {line}") <= 100
    assert line.startswith(f"scope: {scope}: ")
    assert ("time steps too" in line) == (time == "reconstructed" and scope == COMPLETE)
    assert ("no time steps" in line) == (time == "sampled")
    assert model == "full model: all of the fem, interfaces free"
    page, anchor = PAGE.split("#")
    text = (Path(__file__).resolve().parents[2] / page).read_text(encoding="utf-8")
    assert f"## {anchor.capitalize()}" in text
    assert f"`{scope}" in text


@pytest.mark.parametrize("scope", SCOPES)
def test_corrected_output_without_a_bound_is_said_in_words(scope):
    out, known = corrected(1.0, 1e-3, 1e-3, np.inf, covers=scope)
    text = corrected_within(out, known)
    assert "inf" not in text.split()
    assert "not known" in text


@pytest.mark.parametrize(
    ("x", "count", "text"),
    [
        (314.0, 2, "310"),
        (1234.5, 3, "1230"),
        (-314.0, 1, "-300"),
        (9994.0, 3, "9990"),
        (9996.0, 3, "1e+04"),  # from here on an exponent is shorter
        (12345.0, 2, "1.2e+04"),
        (0.00123, 2, "0.0012"),
        (3.14e-7, 2, "3.1e-07"),
        (0.0, 3, "0"),
        (np.inf, 3, "inf"),
    ],
)
def test_numbers_below_ten_thousand_have_no_exponent(x, count, text):
    assert digits(x, count) == text


@pytest.mark.parametrize("x", [314.0, 999.6, 1234.5, 9996.0, 3.14159e-7, 0.0012349])
def test_rounding_goes_the_safe_way(x):
    """By less than one in the last digit."""
    for count in (1, 2, 3):
        assert x <= float(rounded_up(x, count)) <= x * (1 + 10.0 ** (1 - count))
    assert x * (1 - 1e-2) <= float(rounded_down(x)) <= x


def test_how_far_the_estimate_was_off():
    out, _ = estimated(2.0, 1.0, {"basis": 0.9})
    out.error = np.array([[0.0], [0.8]])
    assert off_by(out) == "the estimate is off by up to 0.1 m (12 % of it)"
    out.error = np.array([[0.0], [0.0]])
    assert off_by(out) == "the estimate is off by up to 0.9 m"


def test_an_estimate_of_steps_that_the_truth_shares_is_said_without_them():
    out, _ = estimated(2.0, 1.0, {"basis": 0.8, "time step": 0.4})
    out.error = np.array([[0.0], [0.75]])
    said = "the estimate is off by up to 0.45 m (60 % of it)"
    assert off_by(out) == f"{said}, without its time steps by 0.05 m (6.7 % of it)"
    out.error = np.array([[0.0], [1.1]])
    assert off_by(out) == "the estimate is off by up to 0.1 m (9.1 % of it)"
