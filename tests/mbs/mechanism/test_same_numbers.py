"""Mechanisms in other units: the same bounds, and where numbers are lost in rounding a message."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import SensorSuperElement

import exudyn_romerr as romerr
from benchmarks import mechanism_builder
from benchmarks.random_mechanisms import drawn
from models.floating import interface

SEED = 112  # two bars with joints, one of which starts suddenly
TINY = 0.01  # of a bound: Newton's tolerances are numbers, and what is measured depends on them


def in_units(mechanism, length, mass):
    """The same mechanism with so many units of length a metre, of mass a kilogram; seconds stay."""
    force = mass * length
    bars = [
        replace(
            bar,
            size=tuple(x * length for x in bar.size),
            shifts=bar.shifts * length,
            material=(bar.material[0] * force / length**2, bar.material[1] * mass / length**3, bar.material[2]),
        )
        for bar in mechanism.bars
    ]
    links = [
        [replace(x, stiffness=x.stiffness * force / length, length=x.length * length) for x in of]
        for of in (*mechanism.links, [mechanism.last])
    ]
    loads = [replace(x, vector=x.vector * force * (1 if x.kind == "force" else length)) for x in mechanism.loads]
    gravity = mechanism.gravity[0] * length, mechanism.gravity[1]
    return replace(mechanism, bars=bars, links=links[:-1], last=links[-1][0], loads=loads, gravity=gravity)


def reports(monkeypatch, length=1.0, mass=1.0, steps=20):
    """Reports of both bars, outputs in the frame and the tip in global axes."""
    side, share = mechanism_builder.CUBE
    with monkeypatch.context() as patched:
        patched.setattr(mechanism_builder, "CUBE", (side * length, share))
        scene = mechanism_builder.built(in_units(replace(drawn(SEED), steps=steps), length, mass))
    monitors = []
    for fem, items, sensors in zip(scene.fems, scene.bodies, scene.sensors, strict=True):
        place = {"bodyNumber": items["oFFRFreducedOrder"], "meshNodeNumber": interface(fem, "tip")[0][0]}
        of = exu.OutputVariableType.Displacement
        tip = scene.mbs.AddSensor(
            SensorSuperElement(name=f"tip of {len(monitors)}", outputVariableType=of, storeInternal=True, **place)
        )
        flex = romerr.floating_body(fem, items)
        monitors.append(romerr.attach(scene.mbs, flex, outputs=[*sensors.values(), tip]))
    scene.solve()
    return [monitor.report() for monitor in monitors]


def test_what_is_told_does_not_depend_on_units(monkeypatch):
    """Millimetres and tonnes; in micrometres Exudyn's own run is another one."""
    known, length = reports(monkeypatch), 1e3
    for one, other in zip(known, reports(monkeypatch, length, 1e-3), strict=True):
        for name, out in one.outputs.items():
            found = other.output(name)
            pairs = [(found.estimate, out.estimate), (found.bound["best"], out.bound["best"])]
            for x, y in pairs:
                if np.isfinite(y).all():
                    np.testing.assert_allclose(x, length * y, rtol=0, atol=TINY * length * np.abs(y).max())
                assert np.isfinite(x).all() == np.isfinite(y).all()


# --- the same script gives the same numbers ---


ROOT = Path(__file__).resolve().parents[3]
# of bounds, by modes whose last digits differ
NEARLY = 1 + 1e-4
SCRIPT = """
import hashlib, sys
import numpy as np
import exudyn_romerr as romerr
from tests.mbs.mechanism.test_same_numbers import attached, mechanism_of

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
