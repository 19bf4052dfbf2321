"""A robot whose PreStep function integrates: no number under this run's forces is called its error."""

import re

import numpy as np
import pytest

from exudyn_romerr.report.formats import html_page
from exudyn_romerr.report.wording import AS_IN_THIS_RUN, FROZEN_FIRST
from models.robot_arm import robot_arm, set_point
from tests.helpers.observed import observed_all

STEP, END = 1e-3, 0.25  # s: the arm is at its fastest at 0.2 s
TOLD = re.compile(r"error (is |about |at most )")


def robot(n=8, h=STEP):
    """The arm, whose controller integrates, too."""
    scene, kept = robot_arm(n, h=h, t_end=END), {"integral": 0.0}
    controller, mbs = scene.mbs.GetPreStepUserFunction()["function"], scene.mbs
    motor = next(i for i in range(mbs.systemData.NumberOfLoads()) if mbs.GetLoad(i)["name"] == "motor")

    def integrating(mbs, t):
        controller(mbs, t)
        kept["integral"] += h * (set_point(t)[0] - mbs.GetSensorValues(scene.sensors["angle"])[2])
        torque = mbs.GetLoadParameter(motor, "loadVector")[2] + 1e3 * kept["integral"]
        mbs.SetLoadParameter(motor, "loadVector", [0.0, 0.0, torque])
        return True

    mbs.SetPreStepUserFunction(integrating)
    return scene


def tip(n=8, parts=1):
    """Position of the tip (T, 3) at every millisecond; its controller acts `parts` times in each."""
    scene = robot(n, STEP / parts)
    scene.solve()
    return scene.mbs.GetSensorStoredData(scene.sensors["tip"])[::parts, 1:]


def largest(x):
    return np.abs(x).max()


@pytest.fixture(scope="module")
def step_error():
    """What the step makes of the tip's position in m: extrapolated, which has to agree with a coarser one."""
    base, half, quarter = (tip(parts=parts) for parts in (1, 2, 4))
    assert largest(base - half) == pytest.approx(2 * largest(half - quarter), rel=0.05)  # of first order
    coarse, truth = 2 * half - base, 2 * quarter - half
    assert largest(truth - coarse) < 0.05 * largest(truth - base)
    return largest(truth - base)


@pytest.fixture(scope="module")
def report():
    scene = robot()
    return observed_all(scene)


def test_its_step_is_wrong_and_its_modes_are_not(step_error):
    assert step_error > 1e-3
    assert largest(tip(40) - tip(8)) < 1e-5 * step_error


def test_what_is_told_is_below_the_error_and_said_with_its_condition(report, step_error):
    out = report.output("tip")
    assert np.max(out.bound["best"]) < 0.1 * step_error  # no bound of the error, so never called one
    for said in (str(report), report.details):
        assert said.splitlines()[0] == f"! {FROZEN_FIRST}"
        assert not re.search(r"\benough\b|time steps too|compare with", said)
    assert (
        str(report).splitlines()[2]
        == "Not covered by any estimate: tip, tip in the link (1 % assumed; report.assess)."
    )
    assert "the PreStep function keeps something from call to call" in report.scope_reason
    told = [line for line in f"{report}\n{report.details}".splitlines() if TOLD.search(line)]
    assert len(told) >= 2  # both outputs, in details
    for line in told:
        assert AS_IN_THIS_RUN in line or "inputs frozen" in line


def test_its_first_line_says_what_is_covered_what_is_not_and_what_to_type():
    covered, left_out, cure = FROZEN_FIRST.split(". ")
    assert covered == "only the error under the forces, controller actions and frame motion of this run"
    assert "PreStep" in left_out
    assert "other steps" in left_out
    assert "not in it" in left_out
    assert cure.endswith("romerr verify your_script.py")


def test_its_page_says_the_same_before_any_number(report):
    text = html_page.page(report)
    assert 0 < text.index(FROZEN_FIRST[1:]) < text.index("<caption>Answer by cause")
    assert "The error of the time integration is included." not in text
    assert not re.search(r"\benough\b", text)


@pytest.mark.parametrize("tolerance", [1e-9, 1e-3, 1.0])
def test_whether_it_is_within_a_tolerance_is_unknown(report, tolerance):
    for name in report.outputs:
        found = report.assess(name, tolerance)
        assert found.answer == "unknown"
        assert found.todo == "romerr verify your_script.py measures the whole error"
        assert "only the error under this run's forces is known" in found.said
