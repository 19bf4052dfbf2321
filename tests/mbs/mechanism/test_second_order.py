"""What linearised equations leave out is of second order in the error, and in the bounds of mechanisms.

Truth: the same simulation with all modes, on a plastic bar so soft that its error is percents off the linear
prediction. Newton's method goes further than by default: with 1e-8 the truth's first steps are 1 % of the error off.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import exudyn_romerr as romerr
from benchmarks import mechanism_builder, sweep_mechanisms, sweep_mechanisms_table
from benchmarks.random_mechanisms import drawn
from models import driven_bar, mechanisms
from tests.helpers import tolerances as tol

SENSORS = ("displacement local", "velocity local")
STEPS = 20


def recorded(scene):
    return {name: scene.mbs.GetSensorStoredData(scene.sensors[name])[:, 1:] for name in SENSORS}


def spinning(h, **options):
    scene = driven_bar.spinning(0.8, h=h, t_end=STEPS * h, **options)
    scene.settings = mechanisms.settings_to_compare(h, STEPS * h)
    return scene


@cache
def truth(h):
    scene = spinning(h, kind="complete")
    scene.solve()
    return recorded(scene)


@pytest.mark.parametrize(("kind", "n"), [("RBE3", 0), ("RBE3", 4), ("RBE2", 4)])
@pytest.mark.parametrize("h", [1e-3, 2.5e-4])
def test_corrected_outputs_of_a_bar_that_spins_near_its_first_frequency_are_covered(h, kind, n):
    scene = spinning(h, n=n, kind=kind)
    flex = romerr.floating_body(scene.fem, scene.items)
    monitor = romerr.attach(scene.mbs, flex, outputs=[scene.sensors[name] for name in SENSORS])
    scene.solve()
    report = monitor.report()
    assert report.scope == {"auxiliary": "coupled (linearised)"}
    for name, y in truth(h).items():
        out = report.output(name)
        noise = tol.MECHANISM_NEWTON * np.abs(y).max()
        assert np.all(np.abs(y - out.corrected) <= out.corrected_bound + noise)
        assert np.all(np.abs(y - out.value) <= out.bound["best"] + noise)


@pytest.mark.parametrize(
    ("driven", "h", "steps", "n", "rho"),
    [
        (0.1, 4e-3, 26, 0, 1.0),
        (0.003, 8e-3, 14, 0, 1.0),
        (0.1, 8e-3, 14, 0, 1.0),
        (0.1, 8e-3, 14, 0, 0.9),
        (0.1, 12e-3, 14, 1, 1.0),
    ],
)
def test_bounds_hold_where_much_turns_in_a_step(driven, h, steps, n, rho, monkeypatch):
    """Two undamped bars on a driven joint, up to 0.04 rad a step: errors were 1.05 times the bound, corrected 2.3.

    Up to 0.015 rad a step, ringing from step to step since a sudden start: 1.01 and 1.3 times. Both by averages.
    Up to 0.08 rad a step, accelerations of the start that go on in coordinates that turn: 1.03 and 1.7 times, with
    spectral radius 0.9 1.02 and 1.5; certified, with a mode of each bar, 1.003 and 1.4.
    """
    monkeypatch.setattr(mechanism_builder, "DRIVEN", driven)
    one = drawn(37)
    bars = tuple(replace(bar, n=n, damping=(0.0, 0.0)) for bar in one.bars[:2])
    loads = tuple(replace(load, shape=replace(load.shape, kind="at once")) for load in one.loads if load.bar < 2)
    changed = {"bars": bars, "links": one.links[:2], "loads": loads, "h": h, "steps": steps, "rho": rho}
    result = sweep_mechanisms.measured(replace(one, **changed))
    assert result["scopes"] == [sweep_mechanisms.COUPLED]
    assert not sweep_mechanisms_table.violated(result)


def swings_back_and_forth(mechanism):
    """As benchmarks.mechanism_builder._driving: the driven joint, by 0.8 rad in 31 steps."""
    return lambda mbs, t, i, parameters: [0.0, 0.0, 0.0, 0.4 * np.sin(0.1 * t / mechanism.h) ** 2, 0.0, 0.0]


def test_what_is_of_third_order_is_not_certified(monkeypatch):
    """A bar that is swung at once and shaken: errors were 1.02 times their bound, corrected ones 1.14, certified.

    Linear equations left out 22 % of what they predict; bounds have what that is, and what is of second order.
    """
    monkeypatch.setattr(mechanism_builder, "_driving", swings_back_and_forth)
    one = drawn(3)
    load = replace(one.loads[0], bar=0, shape=replace(one.loads[0].shape, kind="at once", omega=0.0))
    bar = replace(one.bars[0], n=1, damping=(0.0, 1e-6))
    gravity = (one.gravity[0], replace(one.gravity[1], kind="at once"))
    changed = {"loads": (load,), "gravity": gravity, "h": 5e-4, "steps": 140, "rho": 0.5, "vectors": 12}
    result = sweep_mechanisms.measured(replace(one, bars=(bar,), links=one.links[:1], end="cube", **changed))
    assert sweep_mechanisms_table.violated(result)
    assert any(message.startswith("linear equations leave out more than") for message in result["messages"])
