"""Floating bodies that are the same share one full model, and nothing keeps it when they are gone."""

import gc
import weakref
from dataclasses import replace

import numpy as np

import exudyn_romerr as romerr
from exudyn_romerr.mbs.floating.full_body import full_body
from exudyn_romerr.mbs.floating.reference_search import Reference
from models import floating, mechanisms

RAYLEIGH = (0.5, 1e-4)


def made():
    """A body of the bar's fem, and reference conditions on its left face."""
    scene = floating.pendulum(2)
    return romerr.floating_body(scene.fem, scene.items), romerr.mean_motion(*floating.interface(scene.fem, "left"))


def test_two_bars_of_one_fem_share_factors_and_modes():
    scene = mechanisms.double_pendulum(2, t_end=0.004)
    monitors = [romerr.attach(scene.mbs, romerr.floating_body(scene.fem, bar)) for bar in scene.bodies]
    scene.solve()
    first, second = (monitor.subject.body for monitor in monitors)
    assert first is second


def test_what_differs_is_not_shared():
    flex, mean = made()
    body = full_body(flex, RAYLEIGH, Reference(mean, "left"))
    assert full_body(replace(flex, stiffness=flex.stiffness.copy()), RAYLEIGH, Reference(mean, "other name")) is body
    uneven = romerr.mean_motion(mean.nodes, 1.0 + np.arange(len(mean.nodes)))
    others = [
        (replace(flex, stiffness=(1 + 1e-12) * flex.stiffness), RAYLEIGH, mean),
        (replace(flex, mass=(1 + 1e-12) * flex.mass), RAYLEIGH, mean),
        (replace(flex, positions=flex.positions + 1e-12), RAYLEIGH, mean),
        (flex, (0.5, 2e-4), mean),
        (flex, RAYLEIGH, uneven),
        (flex, RAYLEIGH, romerr.mass_orthogonal()),
    ]
    found = [full_body(flex, rayleigh, Reference(conditions, "left")) for flex, rayleigh, conditions in others]
    assert len({id(other) for other in [body, *found]}) == 1 + len(others)


def test_no_full_model_outlives_what_uses_it():
    flex, mean = made()
    alive = weakref.ref(full_body(flex, RAYLEIGH, Reference(mean, "left")))
    gc.collect()
    assert alive() is None
