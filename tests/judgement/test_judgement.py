"""One verdict for each sensor and cause: from parts of the estimate to answers, words and exit statuses."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from exudyn_romerr.errors import InputError
from exudyn_romerr.judgement.answers import OF_ASSESS, STATUS, Answer, Tolerances, worst
from exudyn_romerr.judgement.solve import Solve
from exudyn_romerr.judgement.table import by_sensor, text
from exudyn_romerr.judgement.verdicts import Judgement, judge, rows_of
from exudyn_romerr.report.assessment import ANSWERS
from exudyn_romerr.report.data import Plan
from exudyn_romerr.report.scope import COMPLETE, COUPLED, FROZEN
from tests.report.test_estimates import estimated

HALVES = {"vectors": 1e-4, "linearisation": 1e-4, "steps": 3e-4, "linearisation of steps": 1e-5, "loads": 0.0}
PARTS = {"basis": 2e-3, "time step": -8e-3}


def made(*outputs, time="sampled", scope=COUPLED, reason="", left_out=()):
    """A solve whose report has these outputs."""
    report = SimpleNamespace(
        outputs={out.name: out for out, _ in outputs},
        scope={"auxiliary": scope},
        scope_reason=reason,
        time=time,
        plan=Plan((), tuple(left_out)),
    )
    return Solve(0, "dynamic", 1, report, sensors=[out.name for out, _ in outputs])


def verdicts(tolerance=(), **options):
    parts, halves = options.pop("parts", PARTS), options.pop("halves", HALVES)
    covers, time = options.pop("covers", COUPLED), options.pop("time", "sampled")
    out = estimated(2.0, 0.02, parts, halves, covers=covers, **options)
    (row,) = rows_of(made(out, time=time, scope=covers), Tolerances(tolerance))
    return row


def test_each_cause_has_the_half_width_of_its_checks():
    row = verdicts()
    assert (row.of["modes"].size, row.of["modes"].half_width) == (2e-3, pytest.approx(2e-4))
    assert (row.of["step"].size, row.of["step"].half_width) == (8e-3, pytest.approx(3.1e-4))
    assert (row.of["sum"].size, row.of["sum"].half_width) == (pytest.approx(6e-3), pytest.approx(5.1e-4))
    assert {*row.of} == {"modes", "step", "sum"}  # nothing of interfaces and starts


def test_rigid_interfaces_and_starts_are_causes_of_their_own():
    row = verdicts(parts={"basis": 1e-3, "interfaces": 3e-3, "initial": 1e-3, "jumps": -2e-3})
    assert row.of["interfaces"].size == 3e-3
    assert row.of["interfaces"].half_width == pytest.approx(0.75 * 2e-4)  # as its share of what vectors tell
    assert row.of["start"].size == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("tolerance", "answers"),
    [
        ([], ("not known", "too large", "too large")),  # 0.1 % of 2 m
        (["0.1"], ("enough", "enough", "enough")),
        (["1%"], ("enough", "enough", "enough")),
        (["7e-3"], ("enough", "too large", "enough")),  # both cancel in part
        (["tip z=1e-4"], ("too large", "too large", "too large")),
        (["other=1e-4"], ("enough", "enough", "enough")),
    ],
)
def test_answers_by_cause(tolerance, answers):
    of = verdicts(tolerance).of
    assert tuple(of[cause].answer.value for cause in ("modes", "step", "sum")) == answers


def test_what_is_not_resolved_is_neither():
    halves = {**HALVES, "vectors": 1e-2}
    assert verdicts(["1e-4"], halves=halves).of["modes"].answer is Answer.NOT_KNOWN
    assert verdicts(["1"], halves=halves).of["modes"].answer is Answer.ENOUGH
    assert verdicts(["1"], halves={**HALVES, "vectors": np.inf}).of["modes"].size is None


def test_a_proof_is_enough_whatever_the_estimate():
    halves = {"proved": 0.0199}
    parts = {"basis": 1e-4}
    for time, answer in (("reconstructed", Answer.ENOUGH), ("sampled", Answer.NOT_COVERED)):
        row = verdicts(["0.02"], covers=COMPLETE, time=time, parts=parts, halves={**halves, "vectors": 0.01})
        assert row.of["sum"].answer is answer  # a sampled one has nothing of the time steps
    assert verdicts(["0.019"], covers=COMPLETE, time="reconstructed", parts=parts, halves=halves).answer is not (
        Answer.ENOUGH
    )


def test_frozen_inputs_cover_nothing():
    solve = made(estimated(2.0, 0.02, PARTS, HALVES, covers=FROZEN), scope=FROZEN, reason="PreStep")
    (row,) = rows_of(solve, Tolerances(["1"]))
    assert {verdict.how for verdict in row.of.values()} == {"not covered"}
    assert row.bound is None  # it holds under this run's forces alone
    told = text(Judgement([row], [solve]), "robot.py")
    assert told.startswith("Not covered")
    assert "PreStep" in told
    assert "romerr verify robot.py" in told


def test_sensors_without_a_row_say_why():
    solve = made(estimated(2.0, 0.02, PARTS, HALVES), left_out=[("force", "it is shared")])
    solve.sensors += ["force", "stress"]
    solve.refused = [("body 3 (arm)", "it has a user function")]
    of = {row.name: row for row in rows_of(solve, Tolerances())}
    assert of["force"].of["sum"].reason == "it is shared"
    assert of["stress"].of["sum"].reason == "body 3 (arm): it has a user function"
    assert worst(row.answer for row in of.values()) is Answer.TOO_LARGE
    told = text(Judgement([*of.values()], [solve]), "arm.py")
    assert "not known, force: it is shared" in told
    solve.report, solve.failure = None, ValueError("no frame")
    assert {row.of["sum"].reason for row in rows_of(solve, Tolerances())} == {"no frame"}


def test_of_components_the_worst_is_told():
    one, other = (verdicts(["5e-3"], parts={"basis": x, "time step": 1e-3}) for x in (1e-3, 9e-3))
    (row,) = by_sensor([one, other])
    assert row.of["modes"].size == 9e-3
    assert row.answer is Answer.TOO_LARGE
    told = text(Judgement([one, other], [Solve(0, "dynamic", 1)]), "a.py").split("\n")
    assert told[0] == "Too large, by modes: tip z."
    assert told[1] == "Modes: too large, 0.009 +- 0.0002 m (0.45 %) at tip z; more modes."
    assert told[2] == "Step: enough, 0.0014 m or less (0.066 %) at tip z."  # half widths above 30 % are no digits


def test_answers_statuses_and_words_are_one_table():
    assert {*OF_ASSESS} == {*ANSWERS}
    assert {*STATUS} == {*Answer}
    assert (STATUS[Answer.ENOUGH], STATUS[Answer.TOO_LARGE], STATUS[Answer.NOT_KNOWN]) == (0, 3, 4)
    assert judge(1.0, math.inf, 1.0, "estimated").answer is Answer.NOT_KNOWN


@pytest.mark.parametrize("text", ["", "x", "-1", "0", "nan", "inf%", "tip=", "tip=-1", "=", "1 2"])
def test_what_is_no_tolerance(text):
    with pytest.raises(InputError, match="--tolerance"):
        Tolerances([text])


def test_names_in_tolerances_may_have_any_letter():
    found = Tolerances(["a=b=2%", "0.5"])
    assert found.of("a=b") == (0.02, True)
    assert found.of("c") == (0.5, False)
