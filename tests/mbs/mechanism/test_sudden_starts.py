"""Sudden starts with numerical damping: dampers of joints, Rayleigh's alpha, first steps that are not linear."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from exudyn.itemInterface import ObjectConnectorCoordinateSpringDamper as CoordinateSpringDamper
from exudyn.itemInterface import ObjectConnectorDistance as Distance

import exudyn_romerr as romerr
from benchmarks import sweep_mechanisms, sweep_mechanisms_table
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
from exudyn_romerr.mbs.access.mbs_items import has_dampers
from exudyn_romerr.mbs.control import connectors
from exudyn_romerr.mbs.shadow.measured import OF_THIRD_ORDER
from exudyn_romerr.online.run_messages import STARTS_DAMPED
from exudyn_romerr.report.scope import NOT_CERTIFIED


def mechanism(seed, rho, kind="at once", steps=16):
    """Two bars and one torque, in steps of 4 ms. 110: with damped hinges; 104: without any damping."""
    one = drawn(seed)
    modes, damping, omega = {110: ((1, 4), (2.0, 1e-5), 12.5), 104: ((4, 4), (0.0, 0.0), 150.0)}[seed]
    bars = tuple(replace(bar, n=n, damping=damping) for bar, n in zip(one.bars[:2], modes, strict=True))
    load = one.loads[0]
    load = replace(load, shape=replace(load.shape, kind=kind, omega=omega, begin=0.0))
    return replace(one, bars=bars, links=one.links[:2], loads=(load,), h=4e-3, steps=steps, rho=rho, vectors="auto")


def reports(one):
    scene = built(one)
    parts = zip(scene.flexible(), scene.sensors, strict=True)
    names = {"estimators": ("energy", "auxiliary"), "auxiliary_modes": one.vectors}
    monitors = [romerr.attach(scene.mbs, flex, outputs=list(sensors.values()), **names) for flex, sensors in parts]
    scene.solve()
    return [monitor.report() for monitor in monitors]


@pytest.mark.parametrize("rho", [0.9, 0.3, 0.0])
def test_dampers_of_joints_are_in_the_bound(rho):
    """Errors were up to 1.05, 16 and 121 times the bound, in steps 1 to 15."""
    result = sweep_mechanisms.measured(mechanism(110, rho))
    assert result["scopes"] == [sweep_mechanisms.COUPLED]
    assert not sweep_mechanisms_table.violated(result)


def test_a_first_step_that_is_not_linear_is_in_the_bound():
    """Velocities of modes were off by 4.7 m/s beside 5e-7 m: of second order, 2.9 times the bound."""
    result = sweep_mechanisms.measured(mechanism(104, 0.0, steps=5))
    assert result["scopes"] == [sweep_mechanisms.COUPLED]
    assert not sweep_mechanisms_table.violated(result)


def held_back(seed, alpha, rho):
    """Sudden loads, and Rayleigh's alpha in 1/s alone. 137: a bar on a spherical joint; 17: two bars, one driven."""
    one = drawn(seed)
    modes, h, vectors, links = {137: ((0,), 2.5e-4, "auto", one.links), 17: ((1, 1), 1e-3, 6, one.links)}[seed]
    links = tuple(
        tuple(replace(x, kind=x.kind.replace("bushing", "spherical"), damped=False) for x in y) for y in links
    )
    bars = tuple(replace(bar, n=n, damping=(alpha, 0.0)) for bar, n in zip(one.bars, modes, strict=True))
    loads = tuple(replace(load, shape=replace(load.shape, kind="at once")) for load in one.loads)
    changed = {"bars": bars, "links": links, "loads": loads, "vectors": vectors, "end": "none"}
    return replace(one, h=h, steps=4, rho=rho, **changed)


@pytest.mark.parametrize(("seed", "rho"), [(137, 0.3), (17, 0.5)])
def test_what_alpha_carries_on_into_slow_motion_is_in_the_bound(seed, rho):
    """It damps motion relative to the frame, and so joins modes: errors were 3.1 and 3.4 times the bound."""
    result = sweep_mechanisms.measured(held_back(seed, 50.0, rho))
    assert result["scopes"] == [sweep_mechanisms.COUPLED]
    assert not sweep_mechanisms_table.violated(result)


CASES = [mechanism(110, 0.9, steps=4), held_back(137, 50.0, 0.3)]


@pytest.mark.parametrize("rho", [0.9, 0.3, 0.0])
@pytest.mark.parametrize("one", CASES, ids=["dampers", "alpha"])
def test_dampers_and_alpha_are_certified(one, rho):
    for report in reports(replace(one, rho=rho)):
        assert not report.uncertified
        assert not any("starts suddenly" in message for message in report.messages)


@pytest.mark.parametrize(("rho", "kind"), [(0.0, "at once"), (0.0, "smooth"), (0.9, "at once")])
def test_small_radii_are_certified_where_first_steps_are_linear(rho, kind):
    for report in reports(mechanism(104, rho, kind, steps=4)):
        assert report.uncertified == ((OF_THIRD_ORDER,) if (rho, kind) == (0.0, "at once") else ())


def test_springs_of_unknown_stiffness_are_not(monkeypatch):
    """Nor integrators that are not generalised-alpha, with dampers."""
    monkeypatch.setattr(connectors, "PLACES", {})
    for report in reports(replace(mechanism(110, 0.9, steps=4), base="bushing", links=bushings(110))):
        (doubt,) = report.uncertified
        assert doubt is STARTS_DAMPED
        assert doubt.cure in str(report)
        assert NOT_CERTIFIED in str(report)


def bushings(seed):
    """Joints of the first two bars, the first one a spring with a damper."""
    first, *others = mechanism(seed, 0.9).links
    return (tuple(replace(link, kind="bushing") for link in first), *others)


def holding(*items):
    """An mbs with these objects."""
    counts = {"NumberOfObjects": lambda: len(items), "NumberOfMarkers": lambda: 0}
    return SimpleNamespace(GetObject=lambda i: items[i], systemData=SimpleNamespace(**counts))


@pytest.mark.parametrize(
    ("given", "is_damped"),
    [
        (CoordinateSpringDamper(markerNumbers=[0, 0], stiffness=1.0, damping=2.0), True),
        (CoordinateSpringDamper(markerNumbers=[0, 0], stiffness=1.0), False),
        (Distance(markerNumbers=[0, 0], distance=1.0), False),
    ],
)
def test_dampers_are_found(given, is_damped):
    assert has_dampers(holding({**dict(given), "objectType": "Connector"})) == is_damped


def test_damping_of_floating_bodies_is_their_own():
    """And of linear ones that nothing else touches."""
    floating, linear = (
        {"objectType": kind, "dampingMatrix": np.eye(2)} for kind in ("FFRFreducedOrder", "GenericODE2")
    )
    linear["nodeNumbers"] = [3]
    assert not has_dampers(holding(floating))
    assert not has_dampers(holding(linear, floating))
    assert has_dampers(holding(linear, {"objectType": "Connector", "nodeNumbers": [3]}))
