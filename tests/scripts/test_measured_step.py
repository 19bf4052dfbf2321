"""What shorter steps measured, beside what a run says of itself."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from exudyn_romerr.report.answers import Answer, Limit
from exudyn_romerr.report.verdicts import ESTIMATED, MEASURED, Row, judge, judged_together, not_covered
from exudyn_romerr.scripts.child_run import Result
from exudyn_romerr.scripts.measured_step import OTHERWISE, with_measured_steps

LIMIT = 0.01


def row(component, step, modes=(1e-4, 1e-6), how=ESTIMATED, largest=1.0, solve=0):
    """Of a sensor that shows up to 1."""
    of = {"modes": judge(*modes, LIMIT, ESTIMATED), "step": judge(*step, LIMIT, how)}
    whole = judge(step[0] + modes[0], step[1] + modes[1], LIMIT, how)
    of = judged_together(of | {"sum": whole}, 1.0, LIMIT)
    return Row("tip", component, solve, "m", largest, 1.0, of, Limit(LIMIT, True), f"tip {'xyz'[component]}")


def steps_of(*rows, solves=((True),)):
    """What measure_steps returns, of solves with bodies or without."""
    unchanged = Result("unchanged", solves=[{"has_bodies": x} for x in solves])
    return SimpleNamespace(results={"unchanged": unchanged}, judgement=SimpleNamespace(rows=[*rows]))


OPEN = (0.01, 0.005)  # about the tolerance


def test_an_open_step_is_measured_and_the_whole_is_what_causes_add_up_to():
    estimated, measured = row(2, OPEN), row(2, (2e-3, 1e-4), how=MEASURED)
    ((found,), said) = with_measured_steps([estimated], steps_of(measured))
    assert said == []
    assert (estimated.answer, found.answer) == (Answer.NOT_KNOWN, Answer.ENOUGH)
    assert (found.of["step"].how, found.of["sum"].how) == (MEASURED, ESTIMATED)
    assert found.of["sum"].most == pytest.approx(2e-3 + 1e-4 + 1e-4 + 1e-6)
    assert found.of["sum"].least == pytest.approx(2e-3 - 1e-4 - 1e-4 - 1e-6)


def test_a_sensor_of_which_nothing_is_known_has_all_its_components():
    """Its one row had the number of x, and with it what the step makes of x alone: enough where z is 8 % off."""
    none = not_covered("its FEMinterface is gone")
    alone = replace(row(0, OPEN), of=dict.fromkeys(("modes", "step", "sum"), none), largest=None, extent=None)
    measured = [row(0, (1e-6, 1e-8), how=MEASURED), row(2, (0.08, 1e-3), how=MEASURED)]
    found, _ = with_measured_steps([alone], steps_of(*measured))
    assert [one.component for one in found] == [0, 2]
    assert [one.of["step"].answer for one in found] == [Answer.ENOUGH, Answer.TOO_LARGE]
    assert [one.answer for one in found] == [Answer.NOT_KNOWN, Answer.TOO_LARGE]


def test_a_script_that_does_something_else_when_it_is_run_again_is_not_measured():
    measured = row(2, (1e-6, 1e-8), how=MEASURED, largest=0.5)
    assert with_measured_steps([row(2, OPEN)], steps_of(measured)) == ([row(2, OPEN)], [OTHERWISE.format("tip")])


@pytest.mark.parametrize(
    ("solves", "is_measured"), [((False, True), True), ((True, False), False), ((False,), False)]
)
def test_solves_are_matched_by_those_that_move_bodies(solves, is_measured):
    """A second solve that only the first run has made was an IndexError."""
    measured = row(2, (2e-3, 1e-4), how=MEASURED, solve=1)
    ((found,), _) = with_measured_steps([row(2, OPEN)], steps_of(measured, solves=solves))
    assert (found.of["step"].how == MEASURED) == is_measured


def test_differences_that_lead_nowhere_leave_the_estimate():
    open_ended = replace(row(2, OPEN, how=MEASURED).of["step"], half_width=None)
    measured = replace(row(2, OPEN), of={"step": open_ended})
    assert with_measured_steps([row(2, OPEN)], steps_of(measured))[0] == [row(2, OPEN)]


@pytest.mark.parametrize("cause", ["modes", "step"])
def test_what_speaks_against_a_cause_speaks_against_the_whole(cause):
    """A run that ended early, or what no estimate covers: with both causes within the tolerance all was enough."""
    estimated, measured = row(2, OPEN), row(2, (2e-3, 1e-4), how=MEASURED)
    doubted = replace((estimated if cause == "modes" else measured).of[cause], answer=Answer.NOT_KNOWN, reason="why")
    if cause == "modes":
        estimated = replace(estimated, of=estimated.of | {cause: doubted})
    else:
        measured = replace(measured, of=measured.of | {cause: doubted})
    ((found,), _) = with_measured_steps([estimated], steps_of(measured))
    assert found.of["step"].how == MEASURED
    assert (found.answer, found.of["sum"].reason) == (Answer.NOT_KNOWN, "why")
