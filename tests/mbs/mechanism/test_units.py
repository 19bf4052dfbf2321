"""Mechanisms in other units: the same bounds, and where numbers are lost in rounding a message."""

from dataclasses import replace
from itertools import cycle

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import GenericJoint, SensorSuperElement

import exudyn_romerr as romerr
from benchmarks import mechanism_builder
from benchmarks.random_mechanisms import drawn
from exudyn_romerr.estimators.rigid_motion import RigidMotion
from exudyn_romerr.mbs.derivatives.linearisation import Tangents
from exudyn_romerr.residual.free_mass import AtStart
from models.floating import interface

CHAIN = 1  # three bars, welded to the ground, joined by a cardan joint and a cube
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


def test_bounds_in_millimetres_and_tonnes_are_those_in_metres(monkeypatch):
    known = reports(monkeypatch)
    for one, other in zip(known, reports(monkeypatch, 1e3, 1e-3), strict=True):
        for name, out in one.outputs.items():
            bound = other.output(name).bound["best"]
            assert np.isfinite(bound).all()
            assert bound.max() == pytest.approx(1e3 * out.bound["best"].max(), rel=TINY)


def test_last_digits_of_dampings_do_not_matter(monkeypatch):
    """Those of bodies of one material are read from reduced matrices, and differ by rounding, or do not.

    Where they did, stiff modes kept what the start gave them, and bounds were 1.4 to 3.7 times as wide.
    """
    known, digits = reports(monkeypatch), cycle((1 - 4e-16, 1 + 4e-16))
    read = AtStart.damping.fget
    damping = property(lambda self: tuple(x * digit for x, digit in zip(read(self), [next(digits)] * 2, strict=True)))
    monkeypatch.setattr(AtStart, "damping", damping)
    for one, other in zip(known, reports(monkeypatch), strict=True):
        for name, out in one.outputs.items():
            assert other.output(name).bound["best"].max() == pytest.approx(out.bound["best"].max(), rel=1e-6)


def test_positions_are_bounded_in_any_unit(monkeypatch):
    """Where rotations and lengths counted as they are: 0.968 times the bound in m at the end, in mm."""
    pair = reports(monkeypatch, steps=60), reports(monkeypatch, 1e3, 1e-3, steps=60)
    known, found = (of[1].output("tip of 1").bound["best"].max(axis=0) for of in pair)
    assert 1e-3 * found == pytest.approx(known, rel=1e-3)


def test_in_micrometres_no_freedom_is_lost_in_rounding(monkeypatch):
    """Rotations and lengths are 1e6 apart there; all bounds ended with a LinAlgError, then those of positions did."""
    for report in reports(monkeypatch, 1e6, 1e6, steps=2):
        assert all(np.isfinite(out.bound["best"]).all() for out in report.outputs.values())


def test_freedoms_that_are_lost_cost_positions_only(monkeypatch):
    monkeypatch.setattr(RigidMotion, "advance", lambda *of: False)
    for report in reports(monkeypatch, steps=2):
        assert any("is lost in rounding" in message for message in report.messages)
        for name, out in report.outputs.items():
            assert np.isfinite(out.bound["best"]).all() != name.startswith("tip of")


@pytest.mark.parametrize("length", [1e-3, 1.0, 1e3, 1e6, 1e9], ids=["km", "m", "mm", "um", "nm"])
def test_redundant_are_the_same_constraints(monkeypatch, length):
    """In micrometres two of the chain's own were taken for redundant: joints' arms are 1e6 times rotations there.

    In nanometres their forces counted as shared by others.
    """
    side, share = mechanism_builder.CUBE
    monkeypatch.setattr(mechanism_builder, "CUBE", (side * length, share))
    scene = mechanism_builder.built(in_units(drawn(CHAIN), length, 1.0))
    items = map(scene.mbs.GetObject, range(scene.mbs.systemData.NumberOfObjects()))
    weld = next(item for item in items if "Joint" in item["objectType"])
    for twice in (False, True):
        if twice:
            scene.mbs.AddObject(GenericJoint(markerNumbers=weld["markerNumbers"], constrainedAxes=[1] * 6))
        scene.mbs.Assemble()
        tangents = Tangents(scene.mbs)
        tangents.read(scene.mbs, 0.0)
        assert tangents.redundant == 6 * twice
        assert len(tangents.shared(scene.mbs)) == 12 * twice  # those of both welds
