"""Plain scripts of examples/, without a line of ours, and what README and docs show of them."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import exudyn_romerr as romerr
from tests.helpers.pages import assert_printed

ROOT = Path(__file__).resolve().parents[2]
SHOWN = {  # a page -> [script, its arguments, what is printed, in part]
    name: re.findall(
        r"```bash\nromerr run --tolerance 1% (\S+)([^\n]*)\n```\n\n```text\n(.*?)\n```",
        (ROOT / name).read_text(encoding="utf-8"),
        re.DOTALL,
    )
    for name in ("README.md", "docs/fe_input.md", "docs/gallery.md")
}
ARM = "examples/hinged_arm.py"


@pytest.fixture(scope="module")
def arm():
    return romerr.run(ROOT / ARM, tolerance="1%")


def assert_shows(shown, run):
    assert_printed([line for line in shown.split("\n") if line], str(run))


def test_page_on_interfaces_shows_what_is_printed(arm):
    ((script, _, shown),) = SHOWN["docs/fe_input.md"]
    assert script == ARM
    assert_shows(shown, arm)


def test_readme_shows_what_is_printed():
    ((script, arguments, shown),) = SHOWN["README.md"]
    assert_shows(shown, romerr.run(ROOT / script, arguments.split(), tolerance="1%"))


@pytest.mark.parametrize(("script", "arguments", "shown"), SHOWN["docs/gallery.md"])
def test_gallery_shows_what_is_printed(script, arguments, shown):
    assert_shows(shown, romerr.run(ROOT / script, arguments.split(), tolerance="1%"))


RBE2 = re.compile(r"fem\.ComputeHurtyCraigBamptonModes\(.*?\n    \)\n", re.DOTALL)
FREE = """import exudyn_romerr as romerr
    reference = romerr.mean_motion(*faces[0])
    body = romerr.ElasticBody.from_fem(fem, rayleigh=(0, 0), reference=reference)
    fem.modeBasis = {"matrix": romerr.modal_basis(body, 60).V, "type": "NormalModes"}
"""
EVERY_STEP = (
    ("Path(__file__).resolve().parents[1]", repr(str(ROOT))),
    ("SensorSuperElement(name", "SensorSuperElement(storeInternal=True, name"),
    (
        "simulationSettings.solution.file",
        "simulationSettings.solution.sensors.writePeriod = 0\n    simulationSettings.solution.file",
    ),
    ('print("tip:"', 'print("bending", *mbs.GetSensorStoredData(1)[:, 2])\n    print("tip:"'),
)


def bending(code):
    """What the arm's script shows at every step in y of the arm's frame."""
    for old, new in EVERY_STEP:
        assert code.count(old) == 1
        code = code.replace(old, new)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    line = next(line for line in done.stdout.split("\n") if line.startswith("bending"))
    return [float(x) for x in line.split()[1:]]


def test_interfaces_are_what_a_run_with_free_ones_shows(arm):
    """Truth: the same script and steps, 60 modes of the body with free interfaces in place of its own."""
    code = (ROOT / ARM).read_text(encoding="utf-8")
    rigid, free = bending(code), bending(RBE2.sub(FREE, code))
    true = max(abs(a - b) for a, b in zip(rigid, free, strict=True))
    row = next(row for row in arm.rows if row["name"] == "bending" and row["component"] == 1)
    told = row["modes"]["size"] + row["interfaces"]["size"]
    assert told == pytest.approx(true, rel=0.05)  # both are largest values, each at its own instant


ROBOT = ROOT / "examples/robot_prestep.py"


@pytest.fixture(scope="module")
def robot():
    return romerr.verify(ROBOT, tolerance="0.1%")


def payload(*edits):
    """What the robot's script shows of its payload at the end of each millisecond, changed."""
    code, steps = ROBOT.read_text(encoding="utf-8"), 1
    for old, new in (*EVERY_STEP[:1], *EVERY_STEP[2:3], *edits):
        assert code.count(old) == 1
        code = code.replace(old, new)
        steps = int(new.split("/")[-1].split(")")[0]) if new.startswith("END / (1e-3") else steps
    code = code.replace('SensorBody(name="payload"', 'SensorBody(storeInternal=True, name="payload"')
    code = code.replace(
        '    print("payload:"', '    print("payload", *mbs.GetSensorStoredData(2)[:, 1:].ravel())\n    print("end:"'
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    line = next(line for line in done.stdout.split("\n") if line.startswith("payload"))
    return np.array([float(x) for x in line.split()[1:]]).reshape(-1, 3)[::steps]


def test_a_robots_step_is_wrong_and_not_its_modes(robot):
    """Truth: the controller called 4 and 8 times as often, extrapolated; its delay is of first order."""
    base, fine, finer = (payload(*([("END / 1e-3", f"END / (1e-3 / {k})")] if k > 1 else [])) for k in (1, 4, 8))
    error = np.abs(2 * finer - fine - base).max()
    row = max((row for row in robot.judgement.rows if row.name == "payload"), key=lambda row: row.of["step"].size)
    assert error > 1e-3  # m
    assert abs(row.of["step"].size - error) <= row.of["step"].half_width
    assert row.of["step"].size == pytest.approx(error, rel=0.1)
    assert row.of["step"].answer.value == "too large"
    more = np.abs(payload(("nEigenModes=6", "nEigenModes=40")) - base).max()
    assert more < 1e-7
    assert row.of["modes"].most < 1e-6
    assert row.of["modes"].answer.value == "enough"
    assert str(robot).startswith("Too large, by step: angle, rate, payload, bending.")
    page = (ROOT / "docs" / "verify.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"robot_prestep.py\n```\n\n```text\n(.*?)\n```", page, re.DOTALL)
    lines = shown.split("\n")
    assert_printed(lines[:3], str(robot))
    assert re.split(r"  +", lines[4]) == [
        "sensor",
        "up to",
        *(f"{x} measured" for x in ("modes", "step", "whole error")),
        "order",
        "noise",
        "estimated about",
    ]


def test_the_estimate_of_a_robot_is_what_is_measured():
    """By the page on verify; its controller acts at the begin of each step, with the delay in the step's part."""
    page = (ROOT / "docs" / "verify.md").read_text(encoding="utf-8")
    measured = float(re.search(r"payload y .*?%\)  (\S+) \+- ", page)[1])
    run = romerr.run(ROBOT, tolerance="1%")
    assert {row["sum"]["how"] for row in run.rows} == {"estimated"}
    row = max((row for row in run.rows if row["name"] == "payload"), key=lambda row: row["step"]["size"])
    assert row["step"]["size"] == pytest.approx(measured, rel=0.02)  # two digits
    assert str(run).startswith("Too large, by step: rate, bending.")
