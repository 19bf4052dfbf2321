"""Assessments: every answer, by hand and of runs whose error is known."""

import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.report.advice import RUN_TO_END, advice, next_step
from exudyn_romerr.report.assessment import ANSWERS, TOO_LARGE, assess
from exudyn_romerr.report.data import Plan, ReportData
from exudyn_romerr.report.formats.printed_text import details
from exudyn_romerr.report.overview import next_steps
from exudyn_romerr.report.scope import COMPLETE, COUPLED, FROZEN, UNATTACHED, Doubt
from exudyn_romerr.report.verdict import row_verdict, sentence
from exudyn_romerr.report.wording import CURES_OF_CHECKS
from models import estimate_truths
from models.estimate_scenes import SCENES, LinearScene
from tests.report.test_estimates import estimated
from tests.report.test_verdict import output


def report(made, time="reconstructed", reason=""):
    """A report of one output, with all that assess reads."""
    out, scope = made
    plan, t = Plan((), ()), np.array([0.0, 1.0])
    return ReportData(t, {}, {}, {out.name: out}, scope, reason, {}, plan, [], time, None)


def corrected(value, bound, known, left, **options):
    """An output whose error is `known` within `left`, by a bound of scope complete."""
    out, scope = estimated(value, bound, {"basis": known}, {"proved": left}, **options)
    out.corrected, out.corrected_bound = out.value + out.estimate, out.uncertainty
    return out, scope


PROVED = corrected(2.0, 1.2, 1.0, 0.1)
SAID = estimated(2.0, 9.0, {"basis": 0.8, "time step": 0.2}, {"steps": 0.1}, covers=COUPLED)
VAGUE = estimated(2.0, 9.0, {"basis": 1.0}, {"steps": 0.1, "loads": 0.3}, covers=COUPLED)
UNDER_FORCES = estimated(2.0, 1.2, {"basis": 1.0}, {"proved": 0.1}, covers=FROZEN)
ROUNDED = corrected(2.0, 1.2, 1.0, 0.1, round_off=0.05)
BOUNDED = output(2.0, {"auxiliary": 1.2}, {"auxiliary": COMPLETE}), {"auxiliary": COMPLETE}
INFINITE = estimated(2.0, np.inf, {"basis": 1.0}, {"steps": np.inf}, covers=COUPLED)


@pytest.mark.parametrize(
    ("made", "tolerance", "answer", "time"),
    [
        (PROVED, 1.2, "proven", "reconstructed"),
        (PROVED, 1.2, "proven", "static"),
        (PROVED, 1.15, "likely", "reconstructed"),  # the bound is above, estimate and half width are not
        (PROVED, 1.0, "unknown", "reconstructed"),
        (PROVED, 0.89, "disproven", "reconstructed"),
        (PROVED, 0.89, "disproven", "static"),
        (PROVED, 1.2, "likely", "sampled"),  # nothing is proved without the time steps
        (PROVED, 0.89, "unlikely", "sampled"),
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
    found = assess(report(made, time), "tip z", tolerance)
    assert (found.answer, str(found)) == (answer, found.text)
    assert found.text.startswith(f"tip z: {answer}, ")
    assert found.text.endswith(".")


@pytest.mark.parametrize(
    ("made", "tolerance", "time", "said"),
    [
        (PROVED, 1.2, "static", "tip z: proven, its error is at most 1.2 m, within the tolerance of 1.2 m: "),
        (PROVED, 0.5, "static", "disproven, its error is at least 0.9 m, above the tolerance of 0.5 m: 100 % of it"),
        (SAID, 2.0, "sampled", "likely, its error is about 1 +- 0.1 m (50 %; basis 0.8, time step 0.2), within the "),
        (SAID, 0.5, "sampled", "above the tolerance of 0.5 m: 80 % of it from the basis: add modes; the rest is"),
        (PROVED, 1.2, "sampled", "likely, its reduction error is about 1 +- 0.1 m (50 %; basis), within"),
        (PROVED, 1.2, "sampled", "; what the time steps do is not in it: nothing to do."),
        (VAGUE, 0.1, "sampled", f"whether it is within the tolerance of 0.1 m: {CURES_OF_CHECKS['loads']}."),
        (
            UNDER_FORCES,
            9.0,
            "static",
            "unknown, under the frame motion, loads and joint forces of this run its error",
        ),
        (
            BOUNDED,
            1.1,
            "static",
            "and no proof that it is within the tolerance of 1.1 m: 75 % of it from the step",
        ),
    ],
)
def test_texts(made, tolerance, time, said):
    assert said in assess(report(made, time), "tip z", tolerance).text


def test_a_run_that_is_not_certified_proves_nothing():
    """The answer names all causes, and what to do; not the balance of the run, unless that is it."""
    (out, scope), causes = PROVED, (Doubt("loads may be missing", "tell them"), Doubt("it starts", "smoothly"))
    found = assess(report((replace(out, uncertified=causes), scope)), "tip z", 5.0)
    assert found.answer == "unknown"
    assert found.text == (
        "tip z: unknown, what is computed of this run is not certified (loads may be missing; it starts): "
        "tell them; smoothly."
    )


def two_rows(smaller):
    """Rows x and y, the second so much smaller, with the same error: 1 % of the first, half width 1e-4."""
    out, scope = estimated(1.0, 9.0, {"basis": 0.01}, {"steps": 1e-4}, covers=COUPLED)
    out.value, out.labels = np.hstack([out.value, out.value * smaller]), ("x", "y")
    out.bound = {e: np.tile(x, 2) for e, x in out.bound.items()}
    out.round_off, out.estimate, out.uncertainty = (
        np.tile(x, 2) for x in (out.round_off, out.estimate, out.uncertainty)
    )
    out.estimate_parts, out.uncertainty_parts = (
        {name: np.tile(x, 2) for name, x in parts.items()} for parts in (out.estimate_parts, out.uncertainty_parts)
    )
    return report((out, scope), "sampled")


def test_the_worst_row_counts_by_its_own_size():
    """A second row a fiftieth of the first, whose error is half of it."""
    made = two_rows(1 / 50)
    assert assess(made, "tip z", 0.02).answer == "likely"
    found = assess(made, "tip z", 0.02, relative=True)
    assert found.answer == "unlikely"
    assert found.text.startswith("tip z y: unlikely")
    assert "the tolerance of 0.0004 m" in found.text
    assert "this row is up to" not in found.text
    assert found.rows == {"tip z x": "likely", "tip z y": "unlikely"}
    assert found.text.endswith("(other rows: tip z x likely).")  # who asked for two rows reads of two


def test_a_row_that_hardly_moves_is_told_of():
    """The answer is the worst row's; the sentence says which row that is, what the others are, and how to ask."""
    made = two_rows(1e-5)
    found = assess(made, "tip z", 0.02, relative=True)
    assert found.answer == "unlikely"
    assert "the tolerance of 2e-07 m" in found.text
    assert found.todo == (
        "this row is up to 1e-05 m, tip z x up to 1; assess('tip z', 0.02) asks for the same of all rows"
    )
    assert found.text.endswith(f"{found.todo} (other rows: tip z x likely).")
    assert assess(made, "tip z", 0.02).answer == "likely"
    assert "this row" not in assess(made, "tip z", 0.005, relative=True).text  # the first is no better
    still = two_rows(0.0)
    still.outputs["tip z"].value[:] = 0.0
    assert "this row" not in assess(still, "tip z", 0.02, relative=True).text


def test_of_rows_with_the_worst_answer_the_one_that_moves_most_is_named():
    made = two_rows(1e-5)
    out = made.outputs["tip z"]
    out.value, out.labels = out.value[:, ::-1], ("y", "x")
    assert assess(made, "tip z", 0.02, relative=True).text.startswith("tip z y: unlikely, ")
    assert assess(made, "tip z", 0.005, relative=True).text.startswith("tip z x: unlikely, ")


def test_other_bodies_are_to_be_attached_first():
    unattached = assess(report(UNDER_FORCES, reason=f"{UNATTACHED}, so their errors are not known"), "tip z", 9.0)
    assert unattached.todo == "attach all flexible bodies"
    assert "romerr verify" in assess(report(UNDER_FORCES), "tip z", 9.0).todo


def test_what_is_disproven_is_lowered_by_what_makes_it():
    """Not by what makes the half width."""
    out, scope = corrected(2.0, 1.2, 1.0, 0.1)
    out.uncertainty_parts = {"steps": 0.8 * out.estimate}
    out.uncertainty = out.uncertainty_parts["steps"]
    found = assess(report((out, scope)), "tip z", 0.5)
    assert (found.answer, found.todo) == (
        "disproven",
        "100 % of it from the basis: add modes; the rest is about 0.8 m or less",
    )


def stopped(made, allowed):
    """A report of a run that a tolerance of `allowed` stopped, or of another output (None)."""
    out, scope = made
    return report((replace(out, stopped=0.5, tolerance=allowed), scope), "sampled")


@pytest.mark.parametrize(("allowed", "tolerance"), [(0.5, 1.2), (None, 1.2), (0.5, 0.95)])
def test_a_run_that_was_stopped_is_likely_nothing(allowed, tolerance):
    found = assess(stopped(SAID, allowed), "tip z", tolerance)
    assert found.text.startswith(
        "tip z: unknown, the run was stopped at t = 0.5 s by tolerance=; until then its error"
    )
    assert found.todo.startswith("run on without tolerance=")


def test_a_run_that_was_stopped_proves_nothing_of_the_rest():
    out, scope = PROVED
    for tolerance, answer in ((1.2, "unknown"), (0.89, "disproven")):
        assert assess(report((replace(out, stopped=0.5), scope)), "tip z", tolerance).answer == answer


@pytest.mark.parametrize(
    ("steps", "basis", "cure"),
    [
        (0.39, 0.0, "halve it; "),
        (0.41, 0.0, "take steps 3 times as short; "),
        (0.41, 0.05, "take steps 3 times as short; "),  # sqrt(0.41 / 0.05) is below 3
        (0.79, 0.05, "take steps 4 times as short; "),
        (0.8, 0.11, "halve it; "),  # no steps are short enough alone
    ],
)
def test_steps_are_as_short_as_the_tolerance_asks_for(steps, basis, cure):
    """Their error falls with the square of their length."""
    out, scope = estimated(2.0, 9.0, {"basis": basis, "time step": steps}, {"steps": 0.01}, covers=COUPLED)
    made = report((out, scope), "sampled")
    found = assess(made, "tip z", 0.1)
    assert found.answer == "unlikely"
    assert f"% of it from the step size, not the basis: {cure}" in found.todo
    told = replace(out, tolerance=0.1)
    assert next_step(told, "sampled", scope) == cure.replace(" it", " the step").removesuffix("; ")
    assert "halve it" in advice(out, "sampled", scope)  # nothing was asked for


def test_what_is_not_known_is_not_printed_as_a_number():
    """The row says "error not known" where the half width is above the output itself; so does the answer."""
    made = estimated(2.0, 9.0, {"time step": 1.0}, {"steps": 3.0}, covers=COUPLED)
    (line,) = (row_verdict(made[0], row, "sampled", made[1]) for row in (0,))
    assert "error not known (not resolved: halve the step)" in line
    found = assess(report(made, "sampled"), "tip z", 0.1)
    said = "its error is not known, and so not whether it is within the tolerance of 0.1 m"
    assert found.text == f"tip z: unknown, {said}: halve the step."


@pytest.mark.parametrize("made", [SAID, PROVED])
def test_a_run_that_ended_early_says_nothing_good_of_the_rest(made):
    """What is too large until then is too large."""
    early = report(made)
    early.planned_end = 2.5
    good, bad = (assess(early, "tip z", tolerance) for tolerance in (1.2, 0.5))
    assert good.text.startswith(
        "tip z: unknown, the run ends at t = 1 s and was to go to 2.5 s; until then its error"
    )
    assert good.todo.startswith("let it run to its end")
    assert bad == assess(report(made), "tip z", 0.5)
    assert bad.answer in TOO_LARGE


def test_a_run_that_ended_early_is_not_called_enough():
    """Neither in the table nor in details: what is small enough until then may not be at the end."""
    early = report(corrected(2.0, 1.2e-3, 1e-3, 1e-4))  # 0.06 % of the largest value
    early.outputs["other"] = replace(early.output("tip z"), name="other")
    assert next_steps(early) == ["next step: enough: within 0.1 % of the largest value"]
    assert "\n  enough: " in details(early, [])
    early.planned_end = 2.5
    begin, end = "until the run ended enough: ", f"; {RUN_TO_END}"
    assert next_steps(early) == [f"next step: {begin}within 0.1 % of the largest value{end}"]
    assert f"\n  {begin}the bound of the error is within 0.1 % of the largest value{end}\n" in details(early, [])
    told = sentence(early.output("tip z"), 0, early.time, early.scope, planned_end=early.planned_end)  # in HTML
    assert f"; {begin}" in told
    assert told.endswith(f"{end}.")
    early.outputs = {"tip z": PROVED[0], "other": replace(PROVED[0], name="other")}
    assert "ended" not in str(next_steps(early))  # what is not enough until then needs its own cure


@pytest.mark.parametrize(("left", "is_told"), [(1.9, True), (2.0, False), (np.inf, True)])
def test_a_corrected_output_that_may_be_off_by_its_size_is_not_offered(left, is_told):
    """The value is 2; where nothing is known of it that is said."""
    made = corrected(2.0, 3.0, 1.0, left)
    assert ("corrected output" in details(report(made), [])) is is_told


def test_a_first_instant_is_no_run():
    made = report(SAID, "sampled")
    made.t = made.t[:1]
    found = assess(made, "tip z", 1.2)
    assert found.text.startswith("tip z: unknown, only the first instant was bounded; there its error")


def test_cure_of_a_stop_lowers_the_bound_that_stopped_it():
    """Which holds nothing of the steps here, though these make most of the error."""
    out, scope = estimated(2.0, 9.0, {"basis": 0.2, "time step": 0.8}, {"steps": 0.1}, covers=COUPLED)
    out.causes = {"basis": out.bound["best"], "time step": 0 * out.bound["best"]}
    (made,) = stopped((out, scope), 0.5).outputs.values()
    assert next_step(made, "sampled", scope) == "more modes"  # more vectors were tried before the run was stopped
    assert "halve" not in advice(made, "sampled", scope)
    assert advice(made, "sampled", scope).endswith(f", or lower the bound: {next_step(made, 'sampled', scope)}")
    assert next_step(replace(made, tolerance=10.0), "sampled", scope) == "run on without tolerance="


@pytest.mark.parametrize("tolerance", [0, -1.0, np.nan, np.inf, True, "1%", None])
def test_tolerances_that_are_none(tolerance):
    with pytest.raises(romerr.InputError, match="pass a positive finite number, in m"):
        assess(report(PROVED), "tip z", tolerance)
    with pytest.raises(romerr.InputError, match=r"as a share of the largest value, such as 0\.01"):
        assess(report(PROVED), "tip z", tolerance, relative=True)


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
