"""One verdict for each component and cause: sizes, half widths, answers, reasons and cures."""

import math
from dataclasses import replace

import numpy as np
import pytest

from exudyn_romerr.report import verdicts
from exudyn_romerr.report.answers import ASSESSED, STATUS, Answer, Tolerances, worst
from exudyn_romerr.report.assessment import OF_BOUNDS_ALONE, of_estimates, rows_of
from exudyn_romerr.report.causes import ESTIMATE_PARTS
from exudyn_romerr.report.scope import COMPLETE, COUPLED, FROZEN, SMOOTHLY, Doubt, Reason
from exudyn_romerr.report.verdicts import SHOWS_NOTHING, TOO_COARSE, judge
from tests.helpers.report_outputs import estimated, output, report_of, with_rows

HALVES = {"vectors": 1e-4, "linearisation": 1e-4, "steps": 3e-4, "linearisation of steps": 1e-5, "loads": 0.0}
ERRORS = {"basis": 2e-3, "time step": -8e-3}


def row_of(tolerance=(), parts=ERRORS, halves=HALVES, covers=COUPLED, time="sampled", bound=0.02, **options):
    """The row of an output up to 2 m."""
    beside, ended = options.pop("beside_steps", ()), options.pop("planned_end", None)
    meant = options.pop("on_purpose", False)
    value = options.pop("value", 2.0)
    out, scope = estimated(value, bound, parts, halves, covers=covers, **options)
    out.beside_steps = beside
    (row,) = rows_of(report_of((out, scope), time, planned_end=ended, on_purpose=meant), Tolerances(tolerance))
    return row


def test_each_cause_has_the_half_width_of_its_checks():
    row = row_of()
    assert (row.of["modes"].size, row.of["modes"].half_width) == (2e-3, pytest.approx(2e-4))
    assert (row.of["step"].size, row.of["step"].half_width) == (8e-3, pytest.approx(3.1e-4))
    assert (row.of["sum"].size, row.of["sum"].half_width) == (pytest.approx(6e-3), pytest.approx(5.1e-4))
    assert {*row.of} == {"modes", "step", "sum"}  # nothing of interfaces and starts
    assert sorted(name for cause in verdicts.CAUSES.values() for name in cause.parts) == sorted(ESTIMATE_PARTS)


def test_rigid_interfaces_and_starts_are_causes_of_their_own():
    row = row_of(parts={"basis": 1e-3, "interfaces": 3e-3, "initial": 1e-3, "jumps": -2e-3})
    assert row.of["interfaces"].size == 3e-3
    assert row.of["interfaces"].half_width == pytest.approx(0.75 * 2e-4)  # as its share of what vectors tell
    assert row.of["start"].size == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("tolerance", "answers"),
    [
        ([], ("enough", "enough", "enough")),  # 1 % of 2 m is assumed
        (["0.1%"], ("not known", "too large", "too large")),
        (["0.1"], ("enough", "enough", "enough")),
        (["1%"], ("enough", "enough", "enough")),
        (["7e-3"], ("enough", "too large", "enough")),  # both cancel in part
        (["tip z=1e-4"], ("too large", "too large", "too large")),
        (["other=1e-4"], ("no tolerance", "no tolerance", "no tolerance")),
    ],
)
def test_answers_by_cause(tolerance, answers):
    of = row_of(tolerance).of
    assert tuple(of[cause].answer.value for cause in ("modes", "step", "sum")) == answers


def test_what_is_not_resolved_is_neither():
    halves = {**HALVES, "vectors": 1e-2}
    assert row_of(["1e-4"], halves=halves).of["modes"].answer is Answer.NOT_KNOWN
    assert row_of(["1"], halves=halves).of["modes"].answer is Answer.ENOUGH
    assert row_of(["1"], halves={**HALVES, "vectors": np.inf}).of["modes"].size is None


@pytest.mark.parametrize("half", [0.0, 0.029, 0.3])
@pytest.mark.parametrize("seed", range(5))
def test_any_error_within_the_half_widths_is_within_what_is_told(seed, half):
    """At each instant another one: its largest value is within size and half width."""
    rng = np.random.default_rng(seed)
    out, scope = estimated(2.0, 1.0, {"basis": 0.1})
    out.value, out.round_off, t = np.ones((200, 1)), np.zeros((200, 1)), np.arange(200.0)
    out.estimate = rng.normal(size=(200, 1))
    out.uncertainty = half * np.maximum.accumulate(rng.random((200, 1)), axis=0)
    out.bound["best"] = np.ones((200, 1))
    out.estimate_parts, out.uncertainty_parts = {"basis": out.estimate}, {"vectors": out.uncertainty}
    (row,) = rows_of(replace(report_of((out, scope)), t=t))
    for _ in range(50):
        error = np.abs(out.estimate + out.uncertainty * rng.uniform(-1, 1, (200, 1))).max()
        for verdict in (row.of["modes"], row.of["sum"]):
            assert abs(error - verdict.size) <= verdict.half_width * (1 + 1e-12)  # rounding of two sums
            assert error <= verdict.most * (1 + 1e-12)


def test_the_largest_error_may_be_known_where_others_are_not():
    """Its half width is what may change it, not that of instants where it is small."""
    out, scope = estimated(2.0, 1.0, {"basis": 0.0})
    out.estimate, half = np.array([[0.1], [0.0]]), np.array([[1e-4], [0.05]])
    out.estimate_parts, out.uncertainty, out.uncertainty_parts = {"basis": out.estimate}, half, {"proved": half}
    (row,) = rows_of(report_of((out, scope)))
    assert row.of["modes"].half_width == pytest.approx(1e-4)


@pytest.mark.parametrize(
    ("round_off", "limit", "answer"),
    [(0.0, 2.3e-3, "enough"), (2e-4, 2.3e-3, "not known"), (2e-4, 1.7e-3, "not known"), (0.0, 1.7e-3, "too large")],
)
def test_rounding_is_beside_both(round_off, limit, answer):
    row = row_of([str(limit)], parts={"basis": 2e-3}, round_off=round_off)
    assert row.of["modes"].answer.value == answer


def test_what_rounding_moves_as_much_is_at_round_off():
    assert row_of(parts={"basis": 1e-3}, round_off=1e-3).of["modes"].is_at_round_off
    assert not row_of(parts={"basis": 1e-3}, round_off=1e-4).of["modes"].is_at_round_off


@pytest.mark.parametrize(("bound", "answer"), [(0.02, "enough"), (0.021, "not known")])
@pytest.mark.parametrize("time", ["reconstructed", "static"])
def test_where_there_is_no_estimate_a_bound_of_the_whole_error_answers(bound, answer, time):
    """And its largest cause says what to do."""
    made = output(2.0, {"auxiliary": bound}, {"auxiliary": COMPLETE}), {"auxiliary": COMPLETE}
    (row,) = rows_of(report_of(made, time))
    assert (row.answer.value, row.bound) == (answer, bound)
    assert row.of["sum"].cure == ("" if answer == "enough" else verdicts.CAUSES["step"].cure)
    for covers, time_of in ((COUPLED, time), (FROZEN, time), (COMPLETE, "sampled")):
        made = output(2.0, {"auxiliary": bound}, {"auxiliary": covers}), {"auxiliary": covers}
        (row,) = rows_of(report_of(made, time_of))
        assert row.answer is Answer.NOT_COVERED


def test_a_proof_is_enough_whatever_the_estimate():
    parts, halves = {"basis": 1e-4}, {"proved": 0.0199}
    for time, answer in (("reconstructed", Answer.ENOUGH), ("sampled", Answer.NOT_COVERED)):
        row = row_of(["0.02"], covers=COMPLETE, time=time, parts=parts, halves={**halves, "vectors": 0.01})
        assert row.of["sum"].answer is answer  # a sampled one has nothing of the time steps
    row = row_of(["0.019"], covers=COMPLETE, time="reconstructed", parts=parts, halves=halves)
    assert row.answer is not Answer.ENOUGH


def test_bounds_are_told_with_what_they_are_of():
    assert (row_of().bound, row_of().scope) == (0.02, "modes, to first order")
    assert row_of(covers=COMPLETE, time="reconstructed").scope == ""
    assert row_of(covers=FROZEN).bound is None  # it holds under this run's forces alone
    assert row_of(uncertified=(Reason.UNCHECKED.doubt(),)).bound is None
    assert row_of(bound=np.inf).bound is None


def test_frozen_inputs_cover_nothing():
    """What a controller does with other steps may be many times what is known."""
    out, scope = estimated(2.0, 1e-9, {"basis": 1e-9}, {"vectors": 1e-10}, covers=FROZEN)
    (row,) = rows_of(report_of((out, scope), reason="no coupled bound: a PreStep function; more"))
    assert {verdict.answer for verdict in row.of.values()} == {Answer.NOT_COVERED}
    assert row.of["sum"].reason == "only the error under this run's forces is known: a PreStep function"
    assert "romerr verify" in row.of["sum"].cure
    out.estimate_scope = COUPLED
    assert rows_of(report_of((out, scope)))[0].answer is Answer.ENOUGH


@pytest.mark.parametrize("reason", Reason)
def test_doubts_of_bounds_leave_estimates_what_they_are(reason):
    """But for those that concern the equations, or what is known of the loads."""
    doubt = reason.doubt(*[0.0] * reason.value[2].count("{"), said="")
    row = row_of(["1"], uncertified=(doubt,))
    assert row.bound is None
    assert (row.answer is Answer.ENOUGH) == (reason.name in OF_BOUNDS_ALONE)
    if of_estimates([doubt]):
        assert (row.of["modes"].reason, row.of["modes"].cure) == (doubt.cause, doubt.cure)


def test_doubts_of_older_files_concern_estimates():
    """What they were is not known."""
    assert row_of(["1"], uncertified=(Doubt("it starts", "smoothly"),)).answer is Answer.NOT_KNOWN


def test_what_is_doubted_is_neither_enough_nor_too_large():
    doubted = row_of(["1e-4"], uncertified=(Reason.GOES_ON.doubt(),))
    assert {verdict.answer for verdict in doubted.of.values()} == {Answer.NOT_KNOWN}


def test_bounds_alone_do_not_tell_of_what_the_run_did_not_reach():
    out = output(2.0, {"auxiliary": 1e-3}, {"auxiliary": COMPLETE})
    (row,) = rows_of(report_of((out, {"auxiliary": COMPLETE}), planned_end=2.5))
    assert (row.answer, row.of["sum"].cure) == (Answer.NOT_KNOWN, "let it run to its end")


def test_of_a_part_of_a_run_nothing_is_enough():
    early = row_of(["1"], planned_end=2.5)
    assert early.answer is Answer.NOT_KNOWN
    assert early.of["modes"].reason == "known until 1 of 2.5 s: it went no farther"
    assert early.until in early.of["modes"].reason
    meant = row_of(["1"], planned_end=2.5, on_purpose=True)
    assert (meant.answer, meant.until) == (Answer.ENOUGH, early.until)  # a complete run, as long as it was
    assert row_of(["1e-4"], planned_end=2.5).answer is Answer.TOO_LARGE  # what is too large until then is
    stopped = row_of(["1"], stopped=0.5)
    assert (stopped.answer, stopped.of["modes"].cure) == (Answer.NOT_KNOWN, "run on without it")


@pytest.mark.parametrize(
    ("parts", "halves", "cause", "cure"),
    [
        ({"basis": 0.1}, {"vectors": 0.01}, "modes", "more modes"),
        ({"basis": 0.1}, {"vectors": 0.04}, "modes", verdicts.MORE_VECTORS),
        ({"basis": 0.1}, {"proved": 0.04}, "modes", "more modes"),
        ({"basis": 0.1}, {"linearisation": 0.04}, "modes", f"more modes, {verdicts.NOT_LINEAR}"),
        ({"interfaces": 0.1}, {"vectors": 0.01}, "interfaces", verdicts.CAUSES["interfaces"].cure),
        ({"time step": 0.1}, {"steps": 0.04}, "step", f"take 12 steps, 12 times as short, {verdicts.AGAIN}"),
        ({"time step": 0.1}, {"steps": 0.04, "loads": 0.05}, "step", "smoother loads"),
        ({"time step": 0.1}, {"steps": 241.0}, "step", f"take 20 steps, 20 times as short, {verdicts.AGAIN}"),
        (
            {"time step": 0.1},
            {"linearisation of steps": 0.04},
            "step",
            f"take 12 steps, 12 times as short, {verdicts.NOT_LINEAR}",
        ),
        ({"jumps": 0.1}, {"vectors": 0.01}, "start", verdicts.CAUSES["start"].cure),
    ],
)
def test_cures_are_of_the_cause_or_of_what_makes_the_half_width(parts, halves, cause, cure):
    found = row_of(["1e-3"], parts=parts, halves=halves).of[cause]
    assert found.cure == cure or found.cure == f"{cure}, {verdicts.AGAIN}"  # where the step's error leaves nothing


@pytest.mark.parametrize("check", ["steps", "linearisation of steps", "loads"])
def test_what_starts_at_once_has_one_cure(check):
    """8 times shorter steps did not help, a smooth start brought 260."""
    row = row_of(parts={"time step": 0.1}, halves={check: 241.0}, beside_steps=(SMOOTHLY,))
    assert row.of["step"].cure == f"{SMOOTHLY}, {verdicts.AGAIN}"


@pytest.mark.parametrize(
    ("limit", "cure"),
    [
        (0.2, "take 2 steps, 2 times as short"),
        (0.05, "take 3 steps, 3 times as short"),
        (0.008, "take 8 steps, 8 times as short"),
        (1e-4, "take 20 steps, 20 times as short, then ask again"),
    ],
)
def test_steps_are_as_many_as_the_tolerance_asks_for(limit, cure):
    """Their error of 0.4, half width 1e-3, falls with the square of their length; the run has one step."""
    assert row_of([str(limit)], parts={"time step": 0.4}, halves={"steps": 1e-3}).of["step"].cure == cure


def test_steps_fall_with_their_order():
    assert verdicts.shorter_steps(0.8, 0.1, verdicts.Steps(1000, 1.0)) == "take 8,000 steps, 8 times as short"
    assert verdicts.shorter_steps(0.8, 0.1, verdicts.Steps(1000, 3.0)) == "take 2,000 steps, 2 times as short"
    assert (
        verdicts.shorter_steps(0.8, 0.1, verdicts.Steps(None, 0.2)) == "take steps 8 times as short"
    )  # no lower order
    assert verdicts.shorter_steps(0.8, None, verdicts.Steps(1000)) == verdicts.CAUSES["step"].cure
    assert verdicts.shorter_steps(math.inf, 0.1, verdicts.Steps(10)).endswith(verdicts.AGAIN)


def test_a_share_is_one_of_the_largest_component():
    out, scope = estimated(2.0, 1.0, {"basis": 1e-3})
    rows = rows_of(report_of((with_rows(out, (1.0, 1e-3), ("x", "z")), scope)), Tolerances(["1%"]))
    assert [row.tolerance for row in rows] == [0.02, 0.02]
    assert [row.label for row in rows] == ["tip z x", "tip z z"]


def test_tolerances_of_attach_count_where_no_others_are_given():
    out, scope = estimated(2.0, 1.0, {"basis": 1e-3}, tolerance=0.5)
    (row,) = rows_of(report_of((out, scope)))
    assert row.limit == (0.5, True)
    (row,) = rows_of(report_of((out, scope)), Tolerances(["1%"]))
    assert row.tolerance == 0.02


def test_a_position_is_as_large_as_it_moves():
    out, scope = estimated(2.0, 1.0, {"basis": 1e-3}, of="position")
    out.value += 100.0
    (row,) = rows_of(report_of((out, scope)))
    assert row.largest == pytest.approx(2.0)


def test_an_estimate_that_is_not_known_throughout_is_none():
    out, scope = estimated(2.0, 1.0, {"basis": 0.9})
    out.estimate[0] = out.estimate_parts["basis"][0] = np.inf
    (row,) = rows_of(report_of((out, scope), time="static"), Tolerances(["1e-3"]))
    assert row.answer is Answer.NOT_KNOWN
    assert row.of["modes"].size is None


def coarse(tolerance, modes=2e-3):
    """An output up to 2 m whose steps are off by 0.7 m."""
    return row_of([tolerance], parts={"basis": modes, "time step": 0.7}, halves={"steps": 0.01, "vectors": 1e-5})


def test_where_steps_resolve_nothing_they_come_first():
    row = coarse("0.01")
    assert row.is_coarse
    assert (row.of["modes"].answer, row.of["modes"].reason) == (Answer.NOT_KNOWN, TOO_COARSE)
    assert row.of["step"].answer is Answer.TOO_LARGE
    assert row.of["step"].cure == row.of["sum"].cure == "take 9 steps, 9 times as short, then ask again"
    assert coarse("0.01", 0.5).of["modes"].answer is Answer.NOT_KNOWN  # which shorter steps may turn to anything
    assert coarse("1").of["modes"].answer is Answer.ENOUGH  # nothing has to be told more exactly


def test_what_shows_nothing_is_not_enough():
    """It stands still in the full model, or it does not and nobody sees it."""
    for time in ("static", "reconstructed"):
        row = row_of(["1%"], parts={}, halves={"steps": 0.0}, time=time, value=0.0)
        assert {verdict.answer for verdict in row.of.values()} == {Answer.NOT_KNOWN}
        assert row.of["sum"].reason == SHOWS_NOTHING
    row = row_of(["0.1"], parts={"basis": 0.5}, value=0.0, time="static")
    assert row.answer is Answer.TOO_LARGE  # as it is where it is asked for in its unit


def test_nothing_moves_in_a_static_solve():
    """A velocity is 0 there whatever the model, but for rounding."""
    row = row_of(["1%"], parts={}, halves={"steps": 1e-9}, time="static", value=0.0, of="velocity", round_off=1e-9)
    assert {verdict.answer for verdict in row.of.values()} == {Answer.ENOUGH}
    force = row_of(["1%"], parts={"basis": 0.5}, time="static", of="force")  # joints hold what does not move
    assert force.answer is Answer.TOO_LARGE


def test_answers_statuses_and_words_are_one_table():
    assert {*ASSESSED} == {*STATUS} == {*Answer}
    assert (STATUS[Answer.ENOUGH], STATUS[Answer.TOO_LARGE], STATUS[Answer.NOT_KNOWN]) == (0, 3, 4)
    assert worst([Answer.ENOUGH, Answer.NO_TOLERANCE]) is Answer.ENOUGH  # what has no tolerance is not counted
    assert judge(1.0, 0.0, None, "estimated").answer is Answer.NO_TOLERANCE
    assert judge(1.0, math.inf, 1.0, "estimated").answer is Answer.NOT_KNOWN


def test_outputs_of_reports_have_their_verdicts():
    """Of several rows each cause has its worst."""
    out, scope = estimated(2.0, 1.0, {"basis": 1e-3}, covers=COUPLED)
    report = report_of((with_rows(out, (1e-3, 1.0), ("x", "z")), scope), "static")
    found = report.output("tip z").verdict
    assert {*found} == {"modes", "sum"}  # a static solve has no steps
    assert found["modes"].size == 1e-3
