"""Coordinates that are moved together, against one by one; where G is not the derivative of what joints keep zero."""

import numpy as np
import pytest

from exudyn_romerr.mbs.access.equations import Equations
from exudyn_romerr.mbs.access.state_guard import current_state, of_coordinates, state_kept
from exudyn_romerr.mbs.derivatives.dependence import Dependence, Dependences, normalised
from exudyn_romerr.mbs.derivatives.linearisation import DIFFERENCE, Tangents
from exudyn_romerr.mbs.derivatives.twin import Place
from models import chain, mechanisms, wishbone

# Of what a coordinate changes: one-sided differences over 1e-7, modes that move interfaces by 230 m; 2.5e-6 at most.
ONE_SIDED = 1e-5
# C is taken at both sides of a state, 1e-4 of coordinates away: half the square of it, by curvatures of size 4.
NEAR = 2e-8
# C_t is rounding over two steps of 1e-4 of the largest rate, of that size; measured 7e-9.
RATE = 1e-6
SCENES = {
    "double pendulum": (lambda: mechanisms.double_pendulum(1, h=2e-3, t_end=0.042), 0.04),
    "slider crank": (lambda: mechanisms.slider_crank(2, h=5e-4, t_end=0.051), 0.05),
    "wishbone": (lambda: wishbone.quarter_car(0, h=1e-3, t_end=0.006, static=wishbone.INTERFACES[:2]), 0.005),
}


def at_a_step(scene, at, look):
    """What `look` finds with tangents of the scene, read at its first step already, in the state at a time."""
    scene.mbs.Assemble()
    if hasattr(scene, "settle"):
        scene.settle()
    tangents, found = Tangents(scene.mbs), []

    def hook(mbs, t):
        if not tangents.readings:
            tangents.read(mbs, t)
        if t >= at and not found:
            with state_kept(mbs.systemData):
                found.append(look(mbs, tangents))
        return True

    scene.mbs.SetPostStepUserFunction(hook)
    scene.mbs.SolveDynamic(scene.settings)
    return found[0]


def derivative(mbs, tangents, t, q):
    """C by every coordinate, differences of sixth order."""
    mbs.systemData.SetTime(t)
    kept, step = of_coordinates(mbs, tangents.equations.drift), 1e-3
    columns = []
    for unit in step * np.eye(len(q)):
        near, far, farthest = (kept(q + k * unit) - kept(q - k * unit) for k in (1, 2, 3))
        columns.append((45 * near - 9 * far + farthest) / (60 * step))
    return np.transpose(columns)[tangents.independent]


def test_what_is_moved_together_touches_different_rows():
    rng = np.random.default_rng(0)
    touched = rng.random((40, 30)) < 0.1
    wanted = touched & (rng.random(touched.shape) < 0.7)
    tied = [[3, 8, 9], [20, 21]]
    depends = Dependence.of(wanted, touched, tied)
    assert len(depends.groups) < np.count_nonzero(wanted.any(axis=1)) / 2
    assert sorted(zip(depends.j, depends.i, strict=True)) == sorted(zip(*np.nonzero(wanted), strict=True))
    for moved, entries in depends.groups:
        columns = np.flatnonzero(moved)
        assert set(depends.j[entries]) <= set(columns)
        for own in tied:
            assert moved[own].all() or not moved[own].any()
        rows = [touched[own].any(axis=0) for own in tied if moved[own].any()]
        rows += [touched[j] for j in columns if not any(j in own for own in tied)]
        assert np.max(np.sum(rows, axis=0)) == 1


@pytest.mark.parametrize("name", SCENES)
def test_forces_are_those_of_coordinates_moved_one_by_one(name):
    """To both sides, a thousand times as far: what is left out of one-sided differences is their rounding."""

    def look(mbs, tangents):
        system, step = mbs.systemData, 1e3 * DIFFERENCE
        q, moving = system.GetODE2Coordinates(), np.concatenate(current_state(system)[2:])

        def by_moving(at):
            system.SetODE2Coordinates(at)
            return np.hstack([tangents.equations.mass(mbs), tangents.equations.constraints(mbs).T])

        alone = [(by_moving(q + dq) - by_moving(q - dq)) / (2 * step) for dq in step * np.eye(len(q))]
        carried, _ = tangents._reader._carried_forces(Place(tangents.equations, mbs), q, current_state(system)[2:])
        return carried, *np.transpose([[x @ moving, np.abs(x) @ np.abs(moving)] for x in alone], (1, 2, 0))

    make, at = SCENES[name]
    carried, wanted, terms = at_a_step(make(), at, look)
    off, size = np.linalg.norm(carried - wanted, axis=0), np.linalg.norm(terms, axis=0)
    assert np.all(off <= ONE_SIDED * np.maximum(size, 1e-6 * size.max()))
    assert np.count_nonzero(size > 1e-6 * size.max()) > 7


@pytest.mark.parametrize("name", SCENES)
def test_constraints_are_differenced_where_they_are_not_their_derivative(name):
    """And at the state itself: C was that of one coordinate moved by 1e-7."""

    def look(mbs, tangents):
        system, quaternions = mbs.systemData, tangents._reader.quaternions
        t, q, q_t = system.GetTime(), system.GetODE2Coordinates(), system.GetODE2Coordinates_t()
        found, wanted = tangents._read(mbs, t), derivative(mbs, tangents, t, q)
        s = 1e-4 / max(1.0, np.abs(q_t).max())
        sides = [derivative(mbs, tangents, t + k * s, normalised(q + k * s * q_t, quaternions)) for k in (1, -1)]
        return found, wanted, (sides[0] - sides[1]) / (2 * s), max(1.0, np.abs(q_t).max())

    make, at = SCENES[name]
    found, wanted, rate, fastest = at_a_step(make(), at, look)
    assert np.abs(found.C - wanted).max() < NEAR
    assert np.abs(found.G - wanted).max() > 1e-6  # which G alone would miss
    assert np.abs(found.C_t - rate).max() < RATE * fastest


def test_less_is_moved_than_there_are_coordinates(monkeypatch):
    """One by one, a reading would take 28 times M and G, and 112 times the positions of the joints."""
    counts = {}

    def look(mbs, tangents):
        def counted(name):
            original = getattr(Equations, name)

            def count(self, mbs):
                counts[name] = counts.get(name, 0) + 1
                return original(self, mbs)

            return count

        for name in ("mass", "constraints", "drift"):
            monkeypatch.setattr(Equations, name, counted(name))
        tangents._read(mbs, mbs.systemData.GetTime())
        return True

    make, at = SCENES["double pendulum"]
    at_a_step(make(), at, look)
    looks = 2  # of mbs and twin, whether they are the same
    assert counts["mass"] <= 14 + looks  # 4 Euler parameters and 7 modes of both bars at a time
    assert counts["constraints"] <= 19 + looks
    assert counts["drift"] <= 20 + looks


@pytest.mark.parametrize("is_looked_for", [True, False])
def test_what_depends_on_what_is_found_anew_where_the_mbs_was_changed(monkeypatch, is_looked_for):
    """The cube's centre of mass moves to a side: M has entries where it had none."""
    if not is_looked_for:
        monkeypatch.setattr(Dependences, "hold_for", lambda *_: True)
    scene = chain.chain(0, t_end=0.03)

    def look(mbs, tangents):
        mbs.SetObjectParameter(scene.objects["cube"], "centerOfMass", [0.0, 0.02, 0.01])
        fresh, t = Tangents(mbs), mbs.systemData.GetTime()
        return tangents._read(mbs, t).K, fresh._read(mbs, t).K

    found, wanted = at_a_step(scene, 0.025, look)
    assert np.allclose(found, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max()) == is_looked_for
