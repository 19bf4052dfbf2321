"""What rigid (RBE2) interfaces make of the estimate in a mechanism, and what fewer vectors say of its half width.

Truths are runs of the same scene with the same steps: all modes with free faces ("complete"), and 60 eigenmodes with
rigid faces, which miss 1e-3 of what rigid faces alone change in the middle of the bar, nothing of it at its end.
"""

from functools import cache

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.mbs.floating import reference_search
from exudyn_romerr.mbs.floating.floating_body import read_object
from models import floating, mechanisms

# of the part: second order of what was linearised, and what the truths miss of it; measured 1.65e-2
SHARE = 0.02


@cache
def ran(n, kind, m=None, **options):
    """Sensor -> values of a run, and its report if m vectors were asked for."""
    scene, report = mechanisms.sprung_body(n, kind, h=1e-3, t_end=0.03), None
    names = ["tip 1 local", "middle 1 local"]
    if m is not None:
        for name in names:
            scene.mbs.SetSensorParameter(scene.sensors[name], "name", name)
        flex = romerr.floating_body(scene.fem, scene.bodies[0], **options)
        sensors = [scene.sensors[name] for name in names]
        monitor = romerr.attach(scene.mbs, flex, outputs=sensors, auxiliary_modes=m)
    scene.solve()
    if m is not None:
        report = monitor.report()
    return {name: scene.mbs.GetSensorStoredData(scene.sensors[name])[:, 1:] for name in names}, report


def test_part_of_rigid_interfaces_is_what_they_stiffen():
    """With its sign; and what is left of the estimate is what modes with rigid interfaces lack."""
    (free, _), (rigid, _), (few, report) = ran(0, "complete"), ran(60, "RBE2"), ran(0, "RBE2", "auto")
    for name, out in report.outputs.items():
        stiffened, missing = free[name] - rigid[name], rigid[name] - few[name]
        size = np.abs(stiffened).max(axis=0)
        assert np.all(size > 0.05 * np.abs(stiffened + missing).max(axis=0))
        for part, true in (("interfaces", stiffened), ("basis", missing)):
            assert np.all(np.abs(out.estimate_parts[part] - true).max(axis=0) <= SHARE * size)


def test_bound_is_shared_as_the_errors_are():
    """By largest values of the parts: what modes lack moves with inertia, which static errors know nothing of."""
    (free, _), (rigid, _), (few, report) = ran(0, "complete"), ran(60, "RBE2"), ran(0, "RBE2", "auto")
    for name, out in report.outputs.items():
        stiff, modes = (np.abs(x).max(axis=0) for x in (free[name] - rigid[name], rigid[name] - few[name]))
        found, rest = (out.causes[cause].max(axis=0) for cause in ("interfaces", "basis"))
        np.testing.assert_allclose(rest / (found + rest), modes / (stiff + modes), atol=SHARE)  # at the tip 0.3 %


@pytest.mark.parametrize("m", [6, 8])
def test_few_vectors_that_deform_interfaces_are_checked(m):
    """By a third of them, and by what linear equations miss."""
    (free, _), (few, report) = ran(0, "complete"), ran(0, "RBE2", m)
    for name, out in report.outputs.items():
        off = np.abs(free[name] - few[name] - (out.estimate - out.estimate_parts["time step"])).max(axis=0)
        assert np.all(off <= out.uncertainty.max(axis=0)), name


@pytest.mark.parametrize(("kind", "options"), [("RBE3", {}), ("RBE2", {"interfaces": "rigid"})])
def test_there_is_no_such_part_where_no_interface_is_stiffened(kind, options):
    for out in ran(0, kind, 6, **options)[1].outputs.values():
        assert not out.estimate_parts["interfaces"].any()
        assert out.estimate_parts["basis"].any()


def test_rigid_interfaces_without_a_marker_are_found():
    """By eigenmodes that vanish there; nodes that all modes leave still, or that none does, are no such interface."""
    scene = mechanisms.sprung_body(4, "RBE2")
    flex = romerr.floating_body(scene.fem, scene.bodies[0])
    V = read_object(scene.mbs, flex).V
    left, right = (floating.interface(scene.fem, side)[0] for side in ("left", "right"))
    marked = {"left": romerr.mean_motion(left)}
    found = reference_search.stiff_space(flex, V, marked)
    both = reference_search.stiff_space(flex, V, marked | {"right": romerr.mean_motion(right)})
    assert found.is_rigid
    assert np.array_equal(found.free, both.free)
    assert reference_search.stiff_space(flex, V[:, :6], marked).is_rigid is False  # static modes alone do not tell
