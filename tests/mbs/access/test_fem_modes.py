"""Modes of a FEMinterface: some of them, and without the rigid motion that Exudyn's solver leaves in RBE3 modes."""

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.model.admissible_space import rigid_modes
from models import floating
from tests.helpers import tolerances as tol

OFF = 1e-5  # of the modes; Exudyn leaves 1.3e-6 in a block of steel, 1e-4 in the arm of models/wishbone.py
SAME = 1e-11  # of the modes: rounding of two small solves


def bar_modes(n=5):
    fem = floating.load_fem("bar")
    floating.reduce(fem, n)
    return fem


def test_kept_modes_are_those_asked_for():
    fem = bar_modes()
    V, values = fem.modeBasis["matrix"], fem.eigenValues
    romerr.keep_modes(fem, (3, 1))
    np.testing.assert_array_equal(fem.modeBasis["matrix"], V[:, [0, 1, 2, 3, 4, 5, 7, 9]])
    np.testing.assert_array_equal(fem.eigenValues, values[[1, 3]])
    romerr.keep_modes(fem, ())
    assert fem.modeBasis["matrix"].shape[1] == 6


def moved_modes():
    """Modes with a rigid motion in each, as Exudyn's solver leaves it; of the bar it leaves 1.6e-11 of them."""
    fem = bar_modes()
    made = fem.modeBasis["matrix"]
    romerr.hold_modes(fem, *floating.interface(fem, "left"))
    held = fem.modeBasis["matrix"]
    assert np.abs(held - made).max() < tol.STATIC_MODES * np.abs(made).max()
    Rg = rigid_modes(fem.GetNodePositionsAsArray())
    shares = np.random.default_rng(1).standard_normal((6, held.shape[1]))
    fem.modeBasis = {**fem.modeBasis, "matrix": held + OFF * np.abs(held).max() * Rg @ shares}
    return fem, held


def test_held_modes_are_those_without_the_rigid_motion():
    fem, held = moved_modes()
    romerr.hold_modes(fem, *floating.interface(fem, "left"))
    np.testing.assert_allclose(fem.modeBasis["matrix"], held, rtol=0, atol=SAME * np.abs(held).max())


def test_modes_that_miss_the_conditions_by_little_have_a_rigid_part(monkeypatch):
    """The plan tells how much; tests/mbs/floating/test_rigid_part.py: with which estimates."""
    moved = moved_modes()[0]
    monkeypatch.setattr(floating, "reduce", lambda fem, n, kind: setattr(fem, "modeBasis", moved.modeBasis))
    scene = floating.clamped_bar(5, h=1e-3, t_end=2e-3)
    flex = romerr.floating_body(scene.fem, scene.items)
    monitor = romerr.attach(scene.mbs, flex, outputs=[scene.sensors["tip"]])
    scene.solve()
    assert monitor.report().scope["auxiliary"] == "complete"
    assert "moves the body as a rigid one, which is taken for motion of its frame" in str(monitor.plan)


def test_weights_of_zero_have_no_say():
    """Exudyn gives the middle nodes of quadratic tetrahedra none."""
    x = floating.load_fem("bar").GetNodePositionsAsArray()
    with_zero, without = romerr.mean_motion([3, 5, 8, 9], [1, 2, 1, 0]), romerr.mean_motion([3, 5, 8], [1, 2, 1])
    np.testing.assert_array_equal(with_zero.rows(x), without.rows(x))
    with pytest.raises(romerr.InputError, match="2 nodes with a weight"):
        romerr.mean_motion([3, 5, 8, 9], [1, 2, 0, 0])


@pytest.mark.parametrize("change", [lambda fem: romerr.keep_modes(fem, [0]), lambda fem: romerr.hold_modes(fem, [0])])
def test_what_cannot_be_changed_is_refused(change):
    with pytest.raises(romerr.InputError, match="no modes"):
        change(floating.load_fem("bar"))
    fem = bar_modes()
    fem.postProcessingModes = {"matrix": np.ones((65, 66))}
    with pytest.raises(romerr.InputError, match="compute them after"):
        change(fem)


def test_modes_that_are_not_there_are_refused():
    with pytest.raises(romerr.InputError, match=r"modes lists 5; allowed: 0\.\.4"):
        romerr.keep_modes(bar_modes(), [1, 5])
