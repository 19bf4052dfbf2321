"""Bodies that are the same are one, and nothing keeps it when what uses it is gone."""

import gc
import weakref
from contextlib import contextmanager
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.basis.enrichment import Enrichment
from exudyn_romerr.mechanism_bounds.free_mass import FreeMass
from exudyn_romerr.model import shared_body as sharing
from exudyn_romerr.model.shared_body import fingerprint, shared_body
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


@contextmanager
def work_counted():
    """Count vectors and mass norms that are made."""
    made = []

    def counted(kind):
        init = kind.__init__

        def counting(self, *arguments, **options):
            made.append(kind.__name__)
            init(self, *arguments, **options)

        return mock.patch.object(kind, "__init__", counting)

    with counted(Enrichment), counted(FreeMass):
        yield made


def falling(fem, output="tip"):
    """A pendulum of a fem with modes, and its monitor."""
    with mock.patch.object(floating, "load_fem", return_value=fem), mock.patch.object(floating, "reduce"):
        scene = floating.pendulum(2, h=1e-3, t_end=0.02, assemble=True)
    tip = romerr.node_displacement(output, node=int(floating.interface(fem, "tip")[0][0]), component="z")
    return scene, romerr.attach(scene.mbs, romerr.floating_body(fem, scene.items), outputs=[tip])


def bounds(fem, output="tip"):
    scene, monitor = falling(fem, output)
    scene.solve()
    return monitor.report().output(output).corrected_bound


@pytest.fixture
def fem():
    made = floating.load_fem("bar")
    floating.reduce(made, 2)
    return made


def test_a_second_attach_finds_what_the_first_one_made(fem):
    fem.stiffnessMatrix = 1.03125 * fem.stiffnessMatrix  # no other test has this one
    floating.reduce(fem, 2)
    with work_counted() as made:
        first = bounds(fem)
        assert sorted(made) == ["Enrichment", "FreeMass"]
        offline = len(made)
        second = bounds(fem, "its name")
        assert len(made) == offline
    np.testing.assert_array_equal(second, first)


def test_an_object_that_changed_after_its_plan_is_checked_anew(fem):
    scene, monitor = falling(fem)
    _ = monitor.plan
    number = scene.items["oFFRFreducedOrder"]
    moved = 1.01 * scene.mbs.GetObjectParameter(number, "referencePositions")
    scene.mbs.SetObjectParameter(number, "referencePositions", moved)
    with pytest.raises(romerr.InputError, match="other node positions"):
        _ = monitor.plan


def test_what_changed_is_made_anew(fem):
    _ = bounds(fem)
    fem.stiffnessMatrix = 1.5 * fem.stiffnessMatrix
    floating.reduce(fem, 2)
    with work_counted() as made:
        found = bounds(fem)
        floating.reduce(fem, 3)
        more = bounds(fem)
    assert made.count("Enrichment") == 2
    for n, values in ((2, found), (3, more)):
        other = floating.load_fem("bar")
        other.stiffnessMatrix = 1.5 * other.stiffnessMatrix
        floating.reduce(other, n)
        # ARPACK starts anywhere, and vectors chosen by a modes' pair turn with it: first steps differ by 0.6 %
        expected = bounds(other)
        np.testing.assert_allclose(values, expected, rtol=1e-3, atol=1e-3 * expected.max())


def test_work_goes_with_the_fem():
    fem = floating.load_fem("bar")
    fem.stiffnessMatrix = 1.0625 * fem.stiffnessMatrix  # no other test has this one, which would keep its body
    floating.reduce(fem, 2)
    scene, monitor = falling(fem)
    _ = monitor.plan
    body = weakref.ref(monitor.subject.body)
    del scene, monitor
    gc.collect()
    assert body() is not None
    gone = weakref.ref(fem)
    del fem
    gc.collect()
    assert gone() is None
    assert body() is None


def test_of_many_bodies_and_results_the_last_are_kept():
    given, fem, made = bar(), floating.load_fem("bar"), []
    bodies = [shared_body(**{**given, "rayleigh": (0.5, beta)}) for beta in (1e-4, 2e-4, 3e-4)]
    for body in bodies:
        sharing.keep_with(fem, body)
    for number in [*range(6), 5, 2, 0]:
        sharing.made_once(bodies[-1], "number", [number], lambda number=number: made.append(number))
    assert made == [*range(6), 0]
    first = weakref.ref(bodies[0])
    del bodies, body
    gc.collect()
    assert first() is None


def test_fingerprints_tell_numbers_apart():
    A = bar()["mass"]
    more = A.copy()
    more.data[3] *= 1 + 1e-15
    x = np.arange(6.0)
    parts = ([A], [more], [A[:, :-1]], [x], [x.reshape(2, 3)], [x.reshape(2, 3).T], [x[:3], x[3:]], ["x"], [1], [1.0])
    assert len({fingerprint(of) for of in parts}) == len(parts)
    assert fingerprint([A.copy(), x.copy()]) == fingerprint([A, x])
