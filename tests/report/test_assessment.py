"""Assessments: every answer, by hand and of runs whose error is known."""

import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.report.assessment import ANSWERS, PRINTED, TOO_LARGE, assess
from exudyn_romerr.report.scope import COMPLETE, COUPLED, FROZEN, Reason
from exudyn_romerr.report.verdicts import CAUSES, OF_CHECKS
from models import estimate_truths
from models.estimate_scenes import SCENES, LinearScene
from tests.helpers.report_outputs import corrected, estimated, output, report_of, with_rows

PROVED = corrected(2.0, 1.2, 1.0, 0.1)
SAID = estimated(2.0, 9.0, {"basis": 0.8, "time step": 0.2}, {"steps": 0.1}, covers=COUPLED)
VAGUE = estimated(2.0, 9.0, {"time step": 1.0}, {"steps": 0.1, "loads": 0.3}, covers=COUPLED)
UNDER_FORCES = estimated(2.0, 1.2, {"basis": 1.0}, {"proved": 0.1}, covers=FROZEN)
ROUNDED = corrected(2.0, 1.2, 1.0, 0.1, round_off=0.05)
BOUNDED = output(2.0, {"auxiliary": 1.2}, {"auxiliary": COMPLETE}), {"auxiliary": COMPLETE}
INFINITE = estimated(2.0, np.inf, {"time step": 1.0}, {"steps": np.inf}, covers=COUPLED)


@pytest.mark.parametrize(
    ("made", "tolerance", "answer", "time"),
    [
        (PROVED, 1.2, "proven", "reconstructed"),
        (PROVED, 1.2, "proven", "static"),
        (PROVED, 1.15, "likely", "reconstructed"),  # the bound is above, estimate and half width are not
        (PROVED, 1.0, "unknown", "reconstructed"),
        (PROVED, 0.89, "disproven", "reconstructed"),
        (PROVED, 0.89, "disproven", "static"),
        (PROVED, 1.2, "unknown", "sampled"),  # nothing is known of the time steps
        (PROVED, 0.89, "unlikely", "sampled"),  # the modes alone make more
        (ROUNDED, 1.2, "likely", "reconstructed"),  # bound and rounding: 1.25
        (ROUNDED, 1.14, "unknown", "reconstructed"),
        (ROUNDED, 0.86, "unknown", "reconstructed"),
        (ROUNDED, 0.84, "disproven", "reconstructed"),
        (SAID, 1.11, "likely", "sampled"),
        (SAID, 1.05, "unknown", "sampled"),
        (SAID, 0.89, "unlikely", "sampled"),
        (VAGUE, 1.41, "likely", "sampled"),  # small enough, though not resolved
        (VAGUE, 0.1, "unknown", "sampled"),
        (UNDER_FORCES, 9.0, "unknown", "reconstructed"),  # the mechanism's answer may be larger
        (UNDER_FORCES, 0.1, "unknown", "reconstructed"),
        (BOUNDED, 1.2, "proven", "reconstructed"),
        (BOUNDED, 1.1, "unknown", "reconstructed"),  # nothing is known from below
        (BOUNDED, 1.3, "unknown", "sampled"),
        (INFINITE, 9.0, "unknown", "sampled"),
    ],
)
def test_answers(made, tolerance, answer, time):
    found = assess(report_of(made, time), "tip z", tolerance)
    assert (found.answer, str(found)) == (answer, found.text)
    assert found.text.startswith(f"tip z: {PRINTED[answer].value}, ")
    assert found.text.endswith(".")


@pytest.mark.parametrize(
    ("made", "tolerance", "time", "said"),
    [
        (PROVED, 1.2, "static", "tip z: enough, its error is at most 1.2 m, within the tolerance of 1.2 m: nothing"),
        (PROVED, 0.5, "static", "too large, its error is at least 0.9 m, above the tolerance of 0.5 m: more modes."),
        (SAID, 2.0, "sampled", "enough, its error is about 1 +- 0.1 m (50 %), within the tolerance of 2 m: nothing"),
        (
            SAID,
            0.5,
            "sampled",
            "too large, its error is about 1 +- 0.1 m (50 %), above the tolerance of 0.5 m: more ",
        ),
        (
            VAGUE,
            0.1,
            "sampled",
            f"tell whether that is within the tolerance of 0.1 m: {OF_CHECKS['loads']}, then ask again.",
        ),
        (UNDER_FORCES, 9.0, "static", "(only the error under this run's forces is known: "),
        (UNDER_FORCES, 9.0, "static", "): romerr verify your_script.py measures the whole error."),
        (
            BOUNDED,
            1.1,
            "static",
            "not known, its error is not known, and so not whether it is within the tolerance of ",
        ),
        (BOUNDED, 1.1, "static", f": {CAUSES['step'].cure}."),
        (PROVED, 1.2, "sampled", "(the error of the time steps is in none of its numbers): romerr verify"),
    ],
)
def test_texts(made, tolerance, time, said):
    assert said in assess(report_of(made, time), "tip z", tolerance).text


@pytest.mark.parametrize(
    ("cause", "tolerance", "answer", "todo"),
    [
        ("modes", 0.9, "likely", "nothing to do"),
        ("modes", 0.7, "unlikely", "more modes"),
        ("step", 0.31, "likely", "nothing to do"),
        ("step", 0.05, "unknown", "take 3 steps, 3 times as short, then ask again"),  # its half width is half of it
        ("interfaces", 1e-9, "likely", "nothing to do"),  # there are none
        ("start", 1e-9, "likely", "nothing to do"),
    ],
)
def test_causes_are_asked_by_themselves(cause, tolerance, answer, todo):
    found = assess(report_of(SAID, "sampled"), "tip z", tolerance, cause=cause)
    assert (found.answer, found.todo) == (answer, todo)
    assert " by " in found.said
    assert assess(report_of(UNDER_FORCES), "tip z", 9.0, cause=cause).answer == "unknown"
    assert assess(report_of(BOUNDED), "tip z", 9.0, cause=cause).answer == "unknown"


def test_unknown_causes_are_refused():
    with pytest.raises(romerr.InputError, match="'mode' is unknown; allowed: 'modes'"):
        assess(report_of(SAID), "tip z", 1.0, cause="mode")


def test_a_run_that_is_not_certified_proves_nothing():
    """Its estimate is what it was, where only bounds are doubted; else the answer names cause and cure."""
    out, scope = PROVED
    of_bounds, of_all = Reason.UNCHECKED.doubt(), Reason.GOES_ON.doubt()
    assert assess(report_of((replace(out, uncertified=(of_bounds,)), scope)), "tip z", 5.0).answer == "likely"
    found = assess(report_of((replace(out, uncertified=(of_bounds, of_all)), scope)), "tip z", 5.0)
    assert found.answer == "unknown"
    assert found.text.endswith(f"({of_all.cause}): {of_all.cure}.")


def two_rows(smaller):
    """Rows x and y, the second so much smaller, with the same error: 1 % of the first, half width 1e-4."""
    out, scope = estimated(1.0, 9.0, {"basis": 0.01}, {"steps": 1e-4}, covers=COUPLED)
    with_rows(out, (1.0, 1.0), ("x", "y")).value[:, 1] *= smaller
    return report_of((out, scope), "static")


def test_a_share_is_one_of_what_all_rows_show_together():
    """A second row a hundred thousandth of the first, with the same error: no more is asked of it."""
    made = two_rows(1e-5)
    found = assess(made, "tip z", 0.02, relative=True)
    assert found.answer == "likely"
    assert found.text.startswith(
        "tip z x: enough, its error is about 0.01 +- 0.0001 m (1 %), within the tolerance of 0.02"
    )
    assert found.rows == {"tip z x": "likely", "tip z y": "likely"}
    assert found.text.endswith("(other rows: tip z y enough).")  # who asked for two rows reads of two
    assert assess(made, "tip z", 0.005, relative=True).rows == {"tip z x": "unlikely", "tip z y": "unlikely"}


def test_of_rows_with_the_worst_answer_the_one_that_moves_most_is_named():
    made = two_rows(1e-5)
    out = made.outputs["tip z"]
    out.value, out.labels = out.value[:, ::-1], ("y", "x")
    assert assess(made, "tip z", 0.005, relative=True).text.startswith("tip z x: too large, ")


def test_a_part_of_a_run_says_nothing_good_of_the_rest():
    """What is too large until then is too large."""
    out, scope = PROVED
    for options in ({"planned_end": 2.5}, {}):
        made = (out if options else replace(out, stopped=0.5)), scope
        good, bad = (assess(report_of(made, **options), "tip z", x) for x in (1.2, 0.5))
        assert good.answer == "unknown"
        assert ("run on without it" if not options else "let it run to its end") == good.todo
        assert bad.answer in TOO_LARGE


def test_what_is_disproven_is_lowered_by_what_makes_it():
    """Not by what makes the half width."""
    out, scope = corrected(2.0, 1.2, 1.0, 0.1)
    found = assess(report_of((out, scope)), "tip z", 0.5)
    assert (found.answer, found.todo) == ("disproven", "more modes")


@pytest.mark.parametrize("tolerance", [0, -1.0, np.nan, np.inf, True, "1%", None])
def test_tolerances_that_are_none(tolerance):
    with pytest.raises(romerr.InputError, match="pass a positive finite number, in m"):
        assess(report_of(PROVED), "tip z", tolerance)
    with pytest.raises(romerr.InputError, match=r"as a share of the largest value, such as 0\.01"):
        assess(report_of(PROVED), "tip z", tolerance, relative=True)


@cache
def questions(name, n):
    """(output, whether its error is below a tolerance of half and of twice its size, what assess says) of a scene."""
    scene = SCENES[name]
    made = scene.make(n, "RBE3", scene.h)
    for key, number in made.sensors.items():
        made.mbs.SetSensorParameter(number, "name", key)
    if isinstance(made, LinearScene):
        monitors = [romerr.attach(made.mbs, made.flex, outputs=list(made.outputs))]
    else:
        monitors = [romerr.attach(made.mbs, [romerr.floating_body(made.fem, items) for items in made.bodies])]
    made.mbs.Assemble()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        estimate_truths.motion(made, scene.h)
    found = []
    for run in (monitor.report() for monitor in monitors):
        for key, truth in estimate_truths.stored(name).items():
            if key in run.outputs:
                error = np.max(np.abs(truth.value - run.output(key).value))
                found += [(key, times > 1, run.assess(key, times * error)) for times in (0.5, 2.0)]
    return found


SCENES_ASKED = (("slider_crank", 4), ("sprung_body", 4), ("hinged_bar", 8), ("clamped_bar", 4), ("linear_bar", 4))


def test_runs_whose_error_is_known():
    """48 questions: nothing wrong is called proven, at most one likely, and at most 3 of 20 are not answered.

    Twelve are of forces in joints, two of a rigid body; the most of what is not answered rings in joints.
    """
    asked = [question for scene in SCENES_ASKED for question in questions(*scene)]
    assert len(asked) == 48
    of_forces = [found.answer for key, _, found in asked if key.split()[-1] in ("ForceLocal", "TorqueLocal")]
    assert len(of_forces) == 12
    assert of_forces.count("unknown") <= 5  # their half widths are as large as they are
    assert [found.answer for key, _, found in asked if key == "piston"] == ["unlikely", "likely"]
    answers = [(ANSWERS.index(found.answer) - 2, is_within) for _, is_within, found in asked]  # -2 .. 2
    wrong = [abs(answer) for answer, is_within in answers if (answer < 0 if is_within else answer > 0)]
    assert 2 not in wrong
    assert len(wrong) <= 1
    assert sum(answer == 0 for answer, _ in answers) <= 3 / 20 * len(asked)
