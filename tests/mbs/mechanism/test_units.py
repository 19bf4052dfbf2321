"""Mechanisms in other units: the same bounds, and where numbers are lost in rounding a message."""

from dataclasses import replace

import exudyn as exu
import numpy as np
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
