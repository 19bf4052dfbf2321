"""Bounds over many periods of what nothing damps."""

import numpy as np
import pytest

import exudyn_romerr as romerr
from models import floating

GROWTH = 1.5  # from one second to ten; measured: 1.005


@pytest.mark.slow
def test_bounds_of_an_undamped_pendulum_do_not_grow():
    """10,000 steps: it falls and swings, and is shaken at 60 rad/s."""
    scene = floating.pendulum(4, h=1e-3, t_end=10.0, damping=(0.0, 0.0))
    scene.mbs.SetSensorParameter(scene.sensors["tip local"], "name", "tip")
    flex = romerr.floating_body(scene.fem, scene.items)
    monitor = romerr.attach(scene.mbs, flex, outputs=[scene.sensors["tip local"]])
    scene.solve()
    bound, t = monitor.report().output("tip").bound["best"], monitor.report().t
    assert np.all(bound.max(axis=0) <= GROWTH * bound[t <= 1.0].max(axis=0))
