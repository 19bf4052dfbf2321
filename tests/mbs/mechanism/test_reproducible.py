"""The same script gives the same numbers: to the last bit in another process, and whatever rounding does to modes."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import exudyn_romerr as romerr
from benchmarks import mechanism_builder
from benchmarks.random_mechanisms import drawn

ROOT = Path(__file__).resolve().parents[3]
# of bounds, by modes whose last digits differ
NEARLY = 1 + 1e-4
SCRIPT = """
import hashlib, sys
import numpy as np
import exudyn_romerr as romerr
from tests.mbs.mechanism.test_reproducible import attached, mechanism_of

np.random.seed(int(sys.argv[1]))
before = np.random.get_state()[1].copy()
scene, monitors = attached(mechanism_of(9))
scene.solve()
for name, out in (pair for monitor in monitors for pair in monitor.report().outputs.items()):
    numbers = out.value, out.bound["best"], out.estimate, out.uncertainty
    print(name, *(hashlib.sha256(x.tobytes()).hexdigest() for x in numbers))
print("the user's random numbers", np.array_equal(before, np.random.get_state()[1]))
"""


def mechanism_of(seed):
    return replace(drawn(seed), steps=20)


def attached(mechanism):
    """A scene and the monitors of its bodies."""
    scene, monitors = mechanism_builder.built(mechanism), []
    for fem, items, sensors in zip(scene.fems, scene.bodies, scene.sensors, strict=True):
        monitors.append(romerr.attach(scene.mbs, romerr.floating_body(fem, items), outputs=list(sensors.values())))
    return scene, monitors


def told_by_a_process(seed):
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONHASHSEED": str(seed)}
    command = [sys.executable, "-c", SCRIPT, str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=ROOT, check=True)
    return [line for line in done.stdout.splitlines() if line.startswith(("tip", "middle", "the user's"))]


def test_two_processes_agree_to_the_last_bit():
    """Whatever the user's random numbers are, which stay what they are."""
    one, other = told_by_a_process(1), told_by_a_process(2)
    assert len(one) == 6  # five outputs
    assert one == other
    assert one[-1] == "the user's random numbers True"


@pytest.mark.parametrize("seed", [9, 49])
def test_rounding_of_modes_decides_nothing(seed, monkeypatch):
    """Exudyn's solver of eigenvalues begins with random numbers; here with three sets of them."""
    found = []
    for start in range(3):
        monkeypatch.setattr(mechanism_builder, "START", start)
        scene, monitors = attached(mechanism_of(seed))
        scene.solve()
        outputs = [out for monitor in monitors for out in monitor.report().outputs.values()]
        found.append([np.max(out.bound["best"]) for out in outputs])
    assert np.all(np.max(found, axis=0) <= NEARLY * np.min(found, axis=0))
