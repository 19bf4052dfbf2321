"""Judgement of a script: rows of all solves, what has none and why, and the text of them."""

from dataclasses import replace

import pytest

from exudyn_romerr.errors import InputError
from exudyn_romerr.report.answers import Answer, Tolerances, worst
from exudyn_romerr.report.data import Plan
from exudyn_romerr.report.judgement import Judgement, Solve, rows_of_solve, text
from exudyn_romerr.report.scope import COUPLED, FROZEN
from exudyn_romerr.report.verdict_text import by_sensor
from tests.helpers.report_outputs import estimated, report_of

HALVES = {"vectors": 1e-4, "linearisation": 1e-4, "steps": 3e-4, "linearisation of steps": 1e-5, "loads": 0.0}
PARTS = {"basis": 2e-3, "time step": -8e-3}


def made(output, time="sampled", reason="", left_out=()):
    """A solve whose report has this output."""
    report = report_of(output, time, reason)
    report.plan = Plan((), tuple(left_out))
    return Solve(0, "dynamic", 1, report, sensors=[output[0].name])


def verdicts(tolerance=(), **options):
    parts, halves = options.pop("parts", PARTS), options.pop("halves", HALVES)
    covers, time = options.pop("covers", COUPLED), options.pop("time", "sampled")
    out = estimated(2.0, 0.02, parts, halves, covers=covers, **options)
    (row,) = rows_of_solve(made(out, time), Tolerances(tolerance))
    return row


def test_frozen_inputs_cover_nothing():
    solve = made(estimated(2.0, 0.02, PARTS, HALVES, covers=FROZEN), reason="PreStep")
    (row,) = rows_of_solve(solve, Tolerances(["1"]))
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
    of = {row.name: row for row in rows_of_solve(solve, Tolerances())}
    assert of["force"].of["sum"].reason == "it is shared"
    assert of["stress"].of["sum"].reason == "body 3 (arm): it has a user function"
    assert worst(row.answer for row in of.values()) is Answer.NOT_COVERED
    told = text(Judgement([*of.values()], [solve]), "arm.py")
    assert told.startswith("Not covered by any estimate: force, stress. Enough: the error of tip z is within")
    assert "not known, force: it is shared" in told
    solve.report, solve.failure = None, ValueError("no frame")
    assert {row.of["sum"].reason for row in rows_of_solve(solve, Tolerances())} == {"no frame"}


def test_of_components_the_worst_is_told():
    one, other = (verdicts(["5e-3"], parts={"basis": x, "time step": 1e-3}) for x in (1e-3, 9e-3))
    (row,) = by_sensor([replace(one, component=0), replace(other, component=1)])
    assert row.of["modes"].size == 9e-3
    assert row.answer is Answer.TOO_LARGE
    told = text(Judgement([one, other], [Solve(0, "dynamic", 1)]), "a.py").split("\n")
    assert told[0] == "Too large, by modes: tip z."
    assert told[1] == "Modes: too large, about 0.009 +- 0.0002 m (0.45 %) at tip z; more modes."
    assert (
        told[2] == "Step: enough, about 0.0014 m or less (0.066 %) at tip z."
    )  # half widths above 30 % are no digits


@pytest.mark.parametrize("text", ["", "x", "-1", "0", "nan", "inf%", "tip=", "tip=-1", "=", "1 2"])
def test_what_is_no_tolerance(text):
    with pytest.raises(InputError, match="--tolerance"):
        Tolerances([text])


def test_names_in_tolerances_may_have_any_letter():
    found = Tolerances(["a=b=2%", "0.5"])
    assert found.limit("a=b", 3.0) == (0.06, True)
    assert found.limit("c", 3.0) == (0.5, True)
