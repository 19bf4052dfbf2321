"""Bodies that are the same are one, and nothing keeps it when what uses it is gone."""

import gc
import weakref
from dataclasses import replace

import numpy as np

import exudyn_romerr as romerr
from exudyn_romerr.model.shared_body import shared_body
from models import floating, mechanisms

RAYLEIGH = (0.5, 1e-4)


def bar():
    """Arguments of the bar's full model, by name; the mean motion of its left face is zero."""
    scene = floating.pendulum(2)
    flex = romerr.floating_body(scene.fem, scene.items)
    left = romerr.mean_motion(*floating.interface(scene.fem, "left"))
    names = ("mass", "stiffness", "positions", "rayleigh", "fixed", "rigid", "reference")
    values = (flex.mass, flex.stiffness, flex.positions, RAYLEIGH, (), (), left)
    return dict(zip(names, values, strict=True))


def test_two_bars_of_one_fem_share_factors_and_modes():
    scene = mechanisms.double_pendulum(2, t_end=0.004)
    monitors = [romerr.attach(scene.mbs, romerr.floating_body(scene.fem, bar)) for bar in scene.bodies]
    scene.solve()
    first, second = (monitor.subject.body for monitor in monitors)
    assert first is second


def test_what_differs_is_not_shared():
    given = bar()
    body, left, more = shared_body(**given), given["reference"], 1 + 1e-12
    copies = {name: given[name].copy() for name in ("mass", "stiffness", "positions")}
    assert shared_body(**{**given, **copies, "reference": replace(left, nodes=left.nodes.copy())}) is body
    others = {
        "mass": [more * given["mass"]],
        "stiffness": [more * given["stiffness"]],
        "positions": [given["positions"] + 1e-12],
        "rayleigh": [(0.5, 2e-4)],
        "reference": [romerr.mean_motion(left.nodes, 1.0 + np.arange(len(left.nodes))), romerr.mass_orthogonal()],
    }
    found = [shared_body(**{**given, name: value}) for name, values in others.items() for value in values]
    held = {"reference": None, "fixed": tuple(range(12))}
    found += [shared_body(**{**given, **held}), shared_body(**{**given, **held, "rigid": ((20, 21, 22, 23),)})]
    assert len({id(other) for other in [body, *found]}) == 1 + len(found)


def test_no_body_outlives_what_uses_it():
    alive = weakref.ref(shared_body(**bar()))
    gc.collect()
    assert alive() is None
