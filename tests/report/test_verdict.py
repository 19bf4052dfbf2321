"""Verdicts in words: the sentence of every kind of bound, and whose bound it is."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from exudyn_romerr.report.advice import next_step
from exudyn_romerr.report.plots.style import CAUSE_STYLES
from exudyn_romerr.report.report import OutputReport
from exudyn_romerr.report.scope import COMPLETE, COUPLED, FROZEN, FULL_MODEL, PAGE, SCOPES
from exudyn_romerr.report.verdict import sentence
from exudyn_romerr.report.wording import (
    CURES_OF_CAUSES,
    STEPS,
    corrected_within,
    digits,
    rounded_down,
    rounded_up,
    scope_lines,
    under,
)


def output(value, bounds, scope, round_off=0.0, shares=(0.25, 0.75, 0.0, 0.0), of="displacement", **known):
    """One row, two instants, and the scope of its estimators."""
    bound = {e: np.array([[0.0], [x]]) for e, x in bounds.items()}
    widest = [bound[e] for e in bounds if scope[e] == (COUPLED if COUPLED in scope.values() else scope[e])]
    best = np.min(widest, axis=0)
    parts = zip(("basis", "time step", "initial", "jumps"), shares, strict=True)
    causes = {name: np.where(np.isfinite(best), best, 0.0) * share for name, share in parts}
    if not np.isfinite(best).all():
        causes["basis"] = best
    value, off = np.array([[0.0], [-value]]), np.full((2, 1), round_off)
    return OutputReport("tip z", "m", of, value, off, {**bound, "best": best}, {}, None, None, causes, **known)


ONE = {"auxiliary": COMPLETE}


@pytest.mark.parametrize(
    ("out", "scope", "time", "said"),
    [
        (
            output(4.27e-2, {"auxiliary": 4e-4}, ONE),
            ONE,
            "reconstructed",
            "tip z is up to 0.0427 m, error at most 0.0004 m (0.94 %); 75 % of it from the step size, not the "
            "basis: halve it; the rest alone bounds it by 0.0001 m.",
        ),
        (
            output(4.27e-2, {"auxiliary": 4e-6}, ONE),
            ONE,
            "reconstructed",
            "tip z is up to 0.0427 m, error at most 4e-06 m (0.0094 %); enough: the bound of the error is within "
            "0.1 % of the largest value.",
        ),
        (
            output(4.27e-2, {"auxiliary": 4e-4}, ONE, tolerance=1e-3),
            ONE,
            "static",
            "tip z is up to 0.0427 m, error at most 0.0004 m (0.94 %); enough: the bound of the error is within "
            "the tolerance of 0.001 m.",
        ),
        (
            output(4.27e-2, {"auxiliary": 4e-6}, ONE, round_off=3e-6),
            ONE,
            "reconstructed",
            "tip z is up to 0.0427 m, error at round-off: at most 7e-06 m, rounding of the input included; nothing "
            "to improve: more modes or shorter steps do not show above rounding of the input.",
        ),
        (
            output(4.27e-2, {"auxiliary": np.inf}, ONE),
            ONE,
            "reconstructed",
            "tip z is up to 0.0427 m, error not bounded; no finite bound: the messages or reasons say why.",
        ),
        (
            output(0.0, {"auxiliary": 0.0}, ONE),
            ONE,
            "reconstructed",
            "tip z is up to 0 m, error at most 0 m; nothing to improve.",
        ),
        (
            output(2.0, {"auxiliary": 1.0}, {"auxiliary": FROZEN}, shares=(1.0, 0.0, 0.0, 0.0)),
            {"auxiliary": FROZEN},
            "reconstructed",
            "tip z is up to 2 m; under the frame motion, loads and joint forces of this run the error is at most "
            "1 m (50 %) (what joints and controllers do with other steps or modes is not covered and may be many "
            "times larger); under this run's forces 100 % of it from the basis: add modes; romerr verify "
            "your_script.py measures the whole error.",
        ),
        (
            output(2.0, {"auxiliary": 1.0}, {"auxiliary": COUPLED}, shares=(0.0, 0.0, 0.0, 1.0)),
            {"auxiliary": COUPLED},
            "sampled",
            "tip z is up to 2 m, reduction error, to first order, at most 1 m (50 %); 100 % of it from the load "
            "jumps: add modes, or let the load grow over a short time.",
        ),
    ],
    ids=["bound", "enough", "tolerance", "round-off", "infinite", "zero", "frozen", "coupled"],
)
def test_sentences(out, scope, time, said):
    assert sentence(out, 0, time, scope) == said


@pytest.mark.parametrize(
    ("value", "bound", "known", "enough"),
    [
        (2.0, 2e-3, {}, True),
        (2.0, 2.01e-3, {}, False),
        (2.0, 2e-3, {"of": "velocity"}, True),
        (2.0, 2e-3, {"tolerance": 1e-3}, False),  # less was asked for
        (2.0, 1.0, {"tolerance": 1.0}, True),
        (2.0, 1.9e-3, {"round_off": 2e-4}, False),  # both together are above it
        (0.0, 1e-9, {}, False),  # of an output that stays zero nobody knows what is enough
        (0.0, 1e-9, {"tolerance": 1e-9}, True),
        (2.0, np.inf, {"tolerance": 1.0}, False),
    ],
)
def test_no_advice_where_it_is_enough(value, bound, known, enough):
    said = output(value, {"auxiliary": bound}, ONE, **known).advice("reconstructed", ONE)
    assert said.startswith("enough: the bound of the error is within ") == enough
    assert ("halve it" in said) == (not enough and np.isfinite(bound))


def test_every_cause_has_a_cure_and_a_step():
    """Otherwise reports of several outputs fail."""
    assert set(CURES_OF_CAUSES) == set(CAUSE_STYLES)
    assert set(STEPS) - set(CURES_OF_CAUSES) == {"round-off", "zero", "infinite"}
    assert set(CURES_OF_CAUSES) <= set(STEPS)


def test_positions_are_measured_by_how_far_they_move():
    """A body 1 km from the origin that deforms by 1 mm is not known to 0.1 % because its place is."""
    out = output(2.0, {"auxiliary": 1e-3}, ONE, of="position")
    assert out.advice("reconstructed", ONE).endswith("within 0.1 % of the largest change")
    out.value[:] = 1e3 + 1e-3 * out.value
    assert "halve it" in out.advice("reconstructed", ONE)


def test_rows_are_measured_by_the_largest_of_their_output():
    """What a plane motion leaves of z needs no more modes."""
    out = output(2.0, {"auxiliary": 1e-3}, ONE)
    out.value = np.column_stack([out.value, 1e-9 * out.value])
    out.round_off = np.column_stack([out.round_off, out.round_off])
    for fields in (out.bound, out.causes):
        fields.update({key: np.column_stack([x, x]) for key, x in fields.items()})
    assert sentence(out, 1, "static", ONE).endswith("is within 0.1 % of the largest value of tip z.")


def test_enough_is_said_with_what_it_holds_under():
    scope = {"auxiliary": COUPLED}
    advice = output(2.0, {"auxiliary": 1e-3}, scope).advice("sampled", scope)
    assert advice.startswith("enough, to first order: the bound of the reduction error is within ")


@pytest.mark.parametrize(
    ("bound", "round_off", "size"),
    [(1e-3, 0.0, "within 0.1 % of the largest value"), (1e-3, 1e-3, "at round-off"), (0.0, 0.0, "zero")],
)
def test_nothing_is_enough_without_the_mechanisms_answer(bound, round_off, size):
    """A PreStep controller answered with 3.5 times the bound beside which "enough" stood."""
    scope = {"auxiliary": FROZEN}
    out = output(2.0, {"auxiliary": bound}, scope, round_off)
    assert out.advice("reconstructed", scope) == (
        f"under this run's forces the bound of the error is {size}: romerr verify your_script.py measures the whole "
        "error"
    )
    assert next_step(out, "reconstructed", scope) == "romerr verify your_script.py measures the whole error"


@pytest.mark.parametrize(("bound", "share"), [(0.5, " (25 %)"), (2.8, " (140 %)"), (20.0, " (1000 %)"), (20.5, "")])
def test_percentages_are_plain_numbers(bound, share):
    """Above 1000 % there is none."""
    (line,) = output(2.0, {"auxiliary": bound}, ONE).verdict("reconstructed", ONE)
    vain = ", not informative: more than the output itself" if bound > 2 else ""
    assert line == f"tip z: up to 2 m, error at most {bound:.3g} m{share}{vain}, by 'auxiliary'"


@pytest.mark.parametrize("bound", [0.0, 1.0, np.inf])
def test_sentences_without_advice(bound):
    said = sentence(output(2.0, {"auxiliary": bound}, ONE), 0, "reconstructed", ONE, advised=False)
    ends = {0.0: "0 m (0 %).", 1.0: "1 m (50 %).", np.inf: "error not bounded."}
    assert said.endswith(ends[bound])


def test_a_narrower_scope_never_gives_the_verdict():
    """Its bound may be smaller, and says less: the best bound is that of the widest scope, and so is its name."""
    scope = {"energy": COUPLED, "auxiliary": FROZEN}
    out = output(2.0, {"energy": 1.0, "auxiliary": 0.1}, scope)
    (line,) = out.verdict("sampled", scope)
    assert line == "tip z: up to 2 m, reduction error, to first order, at most 1 m (50 %), by 'energy'"


def test_at_most_is_said_only_with_what_it_holds_under():
    """No summary line of a bound with frozen inputs reads as one of the mechanism's error."""
    out = output(2.0, {"auxiliary": 1.0}, {"auxiliary": FROZEN})
    (line,) = out.verdict("reconstructed", {"auxiliary": FROZEN})
    assert line == (
        "tip z: up to 2 m; under the frame motion, loads and joint forces of this run the error is at most 1 m "
        "(50 %), by 'auxiliary' (what joints and controllers do with other steps or modes is not covered and may be "
        "many times larger)"
    )
    for scope, said in ((COMPLETE, ""), (COUPLED, ", to first order"), (FROZEN, ", inputs frozen")):
        assert under({"auxiliary": scope}) == said
    within = corrected_within(out, np.ones(1), {"auxiliary": FROZEN})
    assert within.startswith("under the frame motion, loads and joint forces of this run the corrected output")


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
    out = output(1.0, {"auxiliary": 1e-3}, {"auxiliary": scope})
    text = corrected_within(out, np.array([[1e-3], [np.inf]]), {"auxiliary": scope})
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
