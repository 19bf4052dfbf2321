"""Plain scripts of examples/, without a line of ours, and what the README shows of them."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import exudyn_romerr as romerr
from tests.helpers.pages import assert_printed

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
ARM = "examples/hinged_arm.py"


@pytest.fixture(scope="module")
def arm():
    return romerr.run(ROOT / ARM, tolerance="1%")


def test_readme_shows_what_is_printed(arm):
    (shown,) = re.findall(r"<!-- hinged arm -->\n```text\n(.*?)\n```", README, re.DOTALL)
    assert_printed([line for line in shown.split("\n") if line], str(arm))


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
