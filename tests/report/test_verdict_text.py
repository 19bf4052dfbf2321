"""What is said of verdicts: rules of the one table, on rows made by hand."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from exudyn_romerr.report.answers import STATUS, Answer, Limit, Tolerances, worst
from exudyn_romerr.report.data import extents
from exudyn_romerr.report.verdict_text import (
    by_sensor,
    first_sentences,
    reasons,
    size_in_words,
    summary,
    table,
)
from exudyn_romerr.report.verdicts import (
    ESTIMATED,
    MEASURED,
    Row,
    Verdict,
    beside_estimate,
    judge,
    judged_together,
    not_covered,
    of_a_run_cut_short,
)


def row(name, axis, limit=0.01, extent=1.0, how=ESTIMATED, **sizes):
    """A row of sizes and half widths by cause; None: not covered. "whole": of the sum, the largest if not given."""
    whole = sizes.pop("whole", None)
    of = {
        cause: not_covered("nobody knows") if pair is None else judge(*pair, limit, how, f"cure of {cause}")
        for cause, pair in sizes.items()
    }
    known = [pair for pair in sizes.values() if pair is not None]
    of["sum"] = judge(*(whole or max(known)), limit, how) if len(known) == len(sizes) else not_covered("nobody knows")
    of = judged_together(of, extent, limit)
    label, component = f"{name} {axis}".strip(), "xyz".find(axis) if axis else 0
    return Row(name, component, 0, "", extent, extent, of, Limit(limit, True), label, axis)


SURE_AND_SMALL = row("mid", "x", modes=(1e-4, 1e-6), step=(0.02, 1e-3))
LARGE_AND_UNSURE = row("mid", "y", modes=(2e-4, 1e-6), step=(0.2, 0.15))


def test_a_row_is_the_component_with_the_largest_share_of_its_tolerance():
    """A sure "too large" does not hide what may be ten times larger; cells are those of one component."""
    (told,) = by_sensor([SURE_AND_SMALL, LARGE_AND_UNSURE])
    assert told is LARGE_AND_UNSURE
    head, line = table([told])
    assert (head[0], line[0]) == ("sensor", "mid y")
    assert "0.35 or less (35 %)" in line


def test_a_cause_that_is_worst_elsewhere_has_a_row_of_its_own():
    other = row("mid", "z", modes=(5e-3, 1e-5), step=(1e-3, 1e-5))
    assert [told.label for told in by_sensor([SURE_AND_SMALL, other])] == ["mid x", "mid z"]
    assert len(by_sensor([SURE_AND_SMALL, replace(SURE_AND_SMALL, component=1)])) == 1  # one of two alike


def test_a_row_with_something_unknown_comes_first():
    unknown = row("mid", "z", modes=None, step=(1e-3, 1e-5))
    assert by_sensor([SURE_AND_SMALL, unknown])[0] is unknown


GOOD = row("hub", "", modes=(1e-5, 1e-8), step=(1e-5, 1e-8))
NOT_ASKED = row("tip", "", None, modes=(9.0, 0.1))
STILL = row("tip", "", 0.0, 0.0, modes=(0.0, 0.0), step=(0.0, 0.0))
TOGETHER = row("tip", "", modes=(8e-3, 1e-5), step=(8e-3, 1e-5), whole=(0.016, 1e-5))
WITHIN = "the error of {} is within its tolerance"


@pytest.mark.parametrize(
    ("rows", "status", "said"),
    [
        (
            [
                SURE_AND_SMALL,
                LARGE_AND_UNSURE,
                row("tip", "", modes=(0.5, 0.01), step=None),
                row("end", "", modes=(0.5, 0.01), step=(1e-3, 1e-6)),
                GOOD,
            ],
            3,
            "Too large, by step: mid; by modes: tip, end. Not known, by step: tip.",
        ),
        ([GOOD], 0, f"Enough: {WITHIN.format('every sensor')}."),
        ([GOOD, NOT_ASKED], 0, f"Enough: {WITHIN.format('hub')}. No tolerance: tip."),
        ([NOT_ASKED], 2, "No tolerance: tip."),  # only names that no sensor has
        (
            [replace(GOOD, limit=Limit(0.01, False))],
            0,
            f"Enough: {WITHIN.format('every sensor')} (1 % assumed; --tolerance).",
        ),
        ([TOGETHER], 3, "Too large: tip."),
        (
            [GOOD, row("ground", "", modes=None)],
            4,
            f"Not covered by any estimate: ground. Enough: {WITHIN.format('hub')}.",
        ),
        ([STILL], 4, "Shows 0 throughout: tip."),
    ],
)
def test_the_first_line_names_what_is_too_large_then_what_is_not_known(rows, status, said):
    assert (summary(rows), STATUS[worst(one.answer for one in rows)]) == (said, status)


@pytest.mark.parametrize(
    ("one", "sentences"),
    [
        (NOT_ASKED, ["Modes: no tolerance, about 9 +- 0.1 (900 %) at tip."]),
        (STILL, []),
        (
            row("tip", "", modes=(0.0101, 1e-3)),
            ["Modes: not known (too close to the tolerance), about 0.01 +- 0.001 (1 %) at tip; cure of modes."],
        ),
    ],
)
def test_sentences_of_one_sensor(one, sentences):
    assert first_sentences([one]) == sentences


def test_what_all_causes_make_together_may_be_too_large_alone():
    assert first_sentences([TOGETHER])[0].startswith("Whole error: too large, about 0.016 (1.6 %) at tip")


def test_a_sentence_tells_what_is_too_large_and_what_is_not_known():
    step, after = first_sentences([SURE_AND_SMALL, LARGE_AND_UNSURE, row("tip", "", modes=(1e-3, 1e-5))])
    assert step == (
        "Step: too large, about 0.02 +- 0.001 (2 %) at mid x; cure of step; "
        "not known, about 0.35 or less (35 %) at mid y; cure of step, then ask again."
    )
    assert after == "All else is judged once steps are shorter: mid."


def test_a_cause_is_not_enough_where_a_component_of_it_is_not_judged():
    """Of one whose steps resolve nothing: the modes of the others are no answer."""
    coarse, fine = row("mid", "y", modes=(0.21, 1e-3), step=(0.5, 0.01)), row("mid", "z", modes=(1e-3, 1e-5))
    assert [line.split(":")[0] for line in first_sentences([coarse, fine])[:-1]] == ["Step"]
    large = row("tip", "", modes=(0.05, 1e-5))
    assert "Modes: too large, about 0.05" in first_sentences([coarse, fine, large])[1]


def test_the_whole_is_too_large_where_a_cause_is_unless_both_are_known_to_cancel():
    unsure = row("tip", "", modes=(0.05, 1e-4), step=(0.1, 0.09), whole=(0.1, 0.09))
    assert (unsure.answer, STATUS[unsure.answer]) == (Answer.TOO_LARGE, 3)
    cancel = row("tip", "", modes=(0.05, 1e-4), step=(0.05, 1e-4), whole=(1e-3, 1e-4))
    assert cancel.answer is Answer.ENOUGH
    assert "causes cancel each other: change none of them alone: tip" in summary([cancel])


def test_what_is_not_resolved_contradicts_what_is_above_it_alone():
    """What is 1.3e-06 or less may be 2.9e-07."""
    one = row("tip", "", step=(0.029, 7e-3), how=MEASURED, limit=0.1)
    assert not beside_estimate(one, judge(0.08, 0.05, 0.1, ESTIMATED)).is_contradicted
    other = beside_estimate(one, judge(0.01, 0.005, 0.1, ESTIMATED))
    assert (other.is_contradicted, other.answer) == (True, Answer.ENOUGH)


def test_what_is_largest_is_told_first():
    steps = row("tip", "", modes=(0.05, 1e-4), step=(0.08, 1e-3))
    modes = row("tip", "", modes=(0.09, 1e-4), step=(0.08, 1e-3))
    assert [line.split(":")[0] for line in first_sentences([steps])] == ["Step", "Modes"]
    assert [line.split(":")[0] for line in first_sentences([modes])] == ["Modes", "Step"]


def test_steps_are_told_that_are_enough_for_all_sensors():
    """Of first order a smaller share may ask for more of them."""
    first, second = row("tip", "", step=(0.1, 1e-3)), row("hub", "", step=(0.2, 1e-3))
    first = replace(first, order=1.0, of={"step": replace(first.of["step"], cure="11 times"), "sum": first.of["sum"]})
    (line,) = first_sentences([first, replace(second, order=2.0)])
    assert line == "Step: too large, about 0.2 (20 %) at hub; 11 times."


def test_where_steps_resolve_nothing_that_is_all_that_is_told():
    coarse = row("tip", "", modes=(1e-4, 1e-6), step=(0.5, 0.01))
    line, after = first_sentences([coarse])
    assert after.endswith("once steps are shorter: tip.")
    assert line.startswith("Step: too large")
    assert line.endswith("then ask again.")
    assert summary([coarse]) == "Too large, by step: tip."
    assert coarse.of["modes"].answer is Answer.NOT_KNOWN


def test_a_run_that_ended_early_says_so_first():
    """Nothing is enough then; what is too large until then is."""
    early = "until 0.105 of 0.25 s: the solve failed"
    rows = [row("tip", "", modes=(1e-5, 1e-8)), row("end", "", modes=(0.5, 1e-3))]
    rows = [replace(one, until=early, of=of_a_run_cut_short(one.of, early)) for one in rows]
    assert (
        summary(rows)
        == "Until 0.105 of 0.25 s: the solve failed. Too large, by modes: end. Not known, by modes: tip."
    )
    assert reasons(rows) == [f"not known, tip: known {early}; let it run to its end"]
    two = [rows[0], replace(rows[1], solve=1)]
    assert summary(two).startswith("Solve 0 until 0.105 of 0.25 s: the solve failed. Solve 1 until")


def test_of_several_solves_that_with_the_worst_is_named():
    rows = [row("tip", "", step=(1e-3, 1e-5)), replace(row("tip", "", step=(0.5, 1e-3)), solve=4)]
    assert " at tip in solve 4" in first_sentences(rows)[0]
    assert " in solve" not in first_sentences(rows[1:])[0]


@pytest.mark.parametrize(
    ("measured", "estimated", "answer"),
    [
        ((0.0, 0.0), (0.19, 1e-3), Answer.TOO_LARGE),
        ((1e-3, 1e-5), (2e-3, 1e-5), Answer.ENOUGH),
        ((0.19, 0.0), (1e-3, 0.0), Answer.TOO_LARGE),
    ],
)
def test_of_two_that_contradict_each_other_the_worse_counts(measured, estimated, answer):
    one = row("tip", "x", step=measured, how=MEASURED)
    told = beside_estimate(one, judge(*estimated, 1e9, ESTIMATED))
    assert (told.is_contradicted, told.answer) == (True, answer)
    assert ("one of both is wrong" in summary([told])) == (answer is not Answer.ENOUGH)


def test_two_within_their_half_widths_agree():
    one = beside_estimate(row("tip", "x", step=(0.02, 2e-3), how=MEASURED), judge(0.023, 1e-3, 1.0, ESTIMATED))
    assert not one.is_contradicted
    assert "wrong" not in summary([one])
    assert not beside_estimate(one, None).is_contradicted


def test_of_two_components_the_larger_contradiction_is_told():
    estimates = {"x": 0.04, "y": 0.19}
    rows = [
        beside_estimate(row("tip", axis, step=(0.0, 0.0), how=MEASURED), judge(size, 0.0, 1.0, ESTIMATED))
        for axis, size in estimates.items()
    ]
    assert summary(rows).endswith("Measured 0, estimated about 0.19 at tip y: one of both is wrong.")


@pytest.mark.parametrize("half", [1.1e-3, 1.01e-3, 9.9e-3, 0.0123456])
def test_half_widths_are_rounded_up_to_two_digits(half):
    told = float(size_in_words(Verdict(0.123, half, ESTIMATED, Answer.ENOUGH)).split("+- ")[1])
    assert half <= told <= 1.1 * half


def test_a_size_without_a_half_width_is_that_or_more():
    assert size_in_words(Verdict(0.123, None, MEASURED, Answer.TOO_LARGE), "m") == "0.12 m or more"
    assert size_in_words(Verdict(0.123, None, MEASURED, Answer.TOO_LARGE), "", 1.0).endswith(" (12 %)")


def test_shares_are_of_what_is_said():
    """Rounding, too."""
    rounded = Verdict(1e-6, 1e-9, ESTIMATED, Answer.NOT_KNOWN, floor=0.02)
    assert size_in_words(rounded) == "0.03 or less, at round-off"
    assert size_in_words(rounded, "", 1.0).endswith(" (2 %)")


def test_one_definition_of_what_a_share_is_of():
    value = np.array([[0.0, 100.0], [-3.0, 101.0]])
    assert extents(value).tolist() == [3.0, 101.0]
    assert extents(value, is_position=True).tolist() == [3.0, 1.0]


def test_reasons_say_what_to_type():
    lost = row("tip", "", modes=None, step=(1e-3, 1e-5))
    lost = replace(
        lost, of={cause: replace(one, cure="romerr verify your_script.py") for cause, one in lost.of.items()}
    )
    assert reasons([lost], "arm.py") == ["not known, tip: nobody knows; romerr verify arm.py"]
    assert reasons([row("hub", "", modes=(1e-5, 1e-8))]) == []


@pytest.mark.parametrize(
    ("asked", "nearest"), [("mdi=1e-4", "mid"), ("Slider=1", "slider"), ("tip =1", "tip"), ("slder=1%", "slider")]
)
def test_a_misspelt_name_is_told_with_the_nearest(asked, nearest):
    (line,) = Tolerances([asked]).misspelt(["mid", "slider", "tip"])
    assert f"did you mean {nearest!r}?" in line
    assert Tolerances([asked, "1%"]).misspelt([]) == []  # where nothing has a number nothing is misspelt
    assert Tolerances(["mid=1", "1%"]).misspelt(["mid", "slider"]) == []


def test_json_has_axis_tolerance_time_and_action():
    told = SURE_AND_SMALL.as_json()
    assert (told["component"], told["axis"], told["tolerance"], told["extent"]) == (0, "x", 0.01, 1.0)
    assert told["step"]["action"] == "cure of step"
    assert row("tip", "", modes=(1.0, 0.1)).as_json()["axis"] is None
    assert not any(isinstance(x, float) and math.isinf(x) for x in told.values())


def test_words_are_few():
    """Enough, too large, not known, no tolerance, not covered; nothing else answers."""
    rows = [SURE_AND_SMALL, LARGE_AND_UNSURE, row("tip", "", modes=None), row("hub", "", modes=(1e-5, 1e-8))]
    words = {re.match(r"\w[\w ]+: ([\w ]+)", line).group(1) for line in first_sentences(rows)[:-1]}
    assert words <= {answer.value for answer in Answer} | {"not known "}
