"""Inertia forces of flexible bodies in closed form: Exudyn's own, and the derivatives of these."""

from unittest import mock

import exudyn as exu
import numpy as np
import pytest

from exudyn_romerr.mbs.access.equations import Equations
from exudyn_romerr.mbs.access.state_guard import current_state, set_state
from exudyn_romerr.mbs.derivatives import frame_inertia
from exudyn_romerr.mbs.derivatives.frame_inertia import FrameInertia
from exudyn_romerr.mbs.derivatives.linearisation import Tangents
from exudyn_romerr.mbs.derivatives.twin import Place
from models import mechanisms

ROUNDING = 1e-13  # of the largest entry of a part: sums in another order; measured 2e-15
STEP = 1e-5  # forces are of fourth degree in the coordinates: what is left out is 1e-10
DIFFERENCES = 1e-8  # of the largest entry of a part: rounding over such steps; measured 2e-10
# Of K and D by Exudyn's differences, whose steps are 1e-7 of a coordinate's size or so: measured 3e-7
EXUDYNS = 1e-5
PARTS = (slice(0, 3), slice(3, 7), slice(7, None))


def body_of(scene, rng, unit):
    """The second bar of a double pendulum in any state: itself, and q, q', q'' of it."""
    mbs, number = scene.mbs, scene.bodies[1]["oFFRFreducedOrder"]
    item = mbs.GetObject(number)
    node = mbs.GetNode(int(item["nodeNumbers"][0]))
    own = FrameInertia(item, node, number, mbs.systemData.GetObjectLTGODE2(number))
    n = len(mbs.systemData.GetODE2Coordinates())
    state = [size * rng.normal(size=n) for size in (0.1, 1.0, 10.0)]
    if unit:
        p = np.array(node["referenceCoordinates"][3:]) + state[0][own.columns[3:7]]
        state[0][own.columns[3:7]] += p / np.linalg.norm(p) - p
    return own, state


def check(found, wanted, limit, of=None):
    """Part by part: place, turn and modes have sizes of their own."""
    for part in PARTS:
        for other in PARTS if found.ndim > 1 else [()]:
            at = (..., part, other) if found.ndim > 1 else (part,)
            size = np.abs((wanted if of is None else of)[at]).max()
            assert np.abs(found[at] - wanted[at]).max() <= limit * size


@pytest.mark.parametrize("unit", [True, False])  # Euler parameters, which a solver lets leave the unit sphere
@pytest.mark.parametrize(("n", "kind"), [(3, "RBE3"), (2, "RBE2"), (6, "free")])
def test_forces_and_masses_are_exudyns(n, kind, unit):
    scene = mechanisms.double_pendulum(n, kind, assemble=True)
    own, (q, q_t, q_tt) = body_of(scene, np.random.default_rng(n), unit)
    mbs, place = scene.mbs, own.columns
    set_state(mbs.systemData, 0.0, (q, q_t, q_tt, mbs.systemData.GetAECoordinates()))
    kind = exu.ComputeItemType
    M, left = (mbs.ComputeItem(exu.ObjectIndex(own.number), what) for what in (kind.MassMatrix, kind.ODE2LHS))
    check(own.mass(q[place]), M, ROUNDING)
    check(own.force(q[place], q_t[place], 0 * q_tt[place]), left, ROUNDING)
    check(own.force(q[place], q_t[place], q_tt[place]), M @ q_tt[place] + left, ROUNDING)


def test_states_may_be_several():
    """Forces as of one after the other, and the diagonal of M."""
    own, _ = body_of(mechanisms.double_pendulum(3, assemble=True), np.random.default_rng(4), False)
    states = np.random.default_rng(8).normal(size=(3, 2, 4, len(own.columns)))
    forces, masses = own.force_and_masses(*states)
    for at in np.ndindex(2, 4):
        q, q_t, q_tt = states[(slice(None), *at)]
        check(forces[at], own.force(q, q_t, q_tt), ROUNDING)
        check(masses[at], np.diag(own.mass(q)), ROUNDING)


@pytest.mark.skipif(frame_inertia.loops is None, reason="nothing is compiled")
@pytest.mark.parametrize("count", [1, 3])
def test_compiled_forces_are_those_of_numpy(monkeypatch, count):
    """Off unit norm, with a damping matrix that is not symmetric."""
    rng = np.random.default_rng(6)
    own, _ = body_of(mechanisms.double_pendulum(5, assemble=True), rng, False)
    own.D = own.D + np.abs(own.D).max() * rng.normal(size=own.D.shape)
    states = rng.normal(size=(3, count, 2 * len(own.columns)))[..., ::2]  # with gaps
    found = own.force_and_masses(*states)
    monkeypatch.setattr(frame_inertia, "loops", None)
    for some, wanted in zip(found, own.force_and_masses(*states), strict=True):
        for s in range(count):
            check(some[s], wanted[s], ROUNDING)


def test_bodies_without_damping_have_closed_forms():
    """ObjectFFRFreducedOrder has no damping matrix then."""
    scene = mechanisms.double_pendulum(2, damping=(0.0, 0.0), assemble=True)
    mbs, number = scene.mbs, scene.bodies[0]["oFFRFreducedOrder"]
    item = mbs.GetObject(number) | {"dampingMatrixReduced": exu.MatrixContainer()}
    own = FrameInertia(
        item, mbs.GetNode(int(item["nodeNumbers"][0])), number, mbs.systemData.GetObjectLTGODE2(number)
    )
    q, q_t = np.random.default_rng(1).normal(size=(2, len(own.columns)))
    damped = body_of(scene, np.random.default_rng(2), False)[0]
    assert not damped.D.any()
    np.testing.assert_array_equal(own.force(q, q_t, q_t), damped.force(q, q_t, q_t))


@pytest.mark.parametrize("unit", [True, False])
def test_derivatives_are_those_of_the_forces(unit):
    """Without stiffness and damping, beside which nothing else would show."""
    scene = mechanisms.double_pendulum(3, assemble=True)
    own, state = body_of(scene, np.random.default_rng(7), unit)
    own.K, own.D = 0 * own.K, 0 * own.D
    q, q_t, q_tt = (x[own.columns] for x in state)
    steps = STEP * np.eye(len(q))

    def by(value):
        return np.array([value(dq) - value(-dq) for dq in steps]) / (2 * STEP)

    M, D, K = own.tangent(q, q_t, q_tt)
    np.testing.assert_array_equal(M, own.mass(q))
    wanted = by(lambda dq: own.force(q + dq, q_t, q_tt)).T, by(lambda dq: own.force(q, q_t + dq, q_tt)).T
    for found, truth in zip((K, D), wanted, strict=True):
        check(found, truth, DIFFERENCES, of=np.maximum(np.abs(truth), np.abs(truth).max() * 1e-3))
        assert not found[:, :3].any()
    wanted = by(lambda dq: own.mass(q + dq))
    check(own.mass_changes(q), wanted, DIFFERENCES, of=np.abs(wanted) + 1e-3)


def test_tangents_by_closed_forms_are_those_by_differences():
    """Two bars, gravity, a load, joints at interfaces; all that a reading holds, and how M changes."""
    scene, readings = mechanisms.double_pendulum(3, h=2e-3, t_end=0.05), []
    scene.mbs.Assemble()
    scene.mbs.SolveDynamic(scene.settings)
    for many in (0, 10_000):
        with mock.patch.object(frame_inertia, "MANY", many):
            tangents = Tangents(scene.mbs)
            tangents.read(scene.mbs, 0.05)
        assert len(tangents._twin.hollow.inertias) == (2 if many == 0 else 0)
        readings.append((tangents.readings[0], tangents.carried[0]))
    (found, changes), (wanted, wanted_changes) = readings
    motions = np.linalg.svd(wanted.G)[2][len(wanted.G) :].T * wanted.scale(1e-3)[:, None]
    for name in ("M", "D", "K"):
        one, other = (getattr(of, name) for of in (found, wanted))
        assert np.abs(one - other).max() <= EXUDYNS * np.abs(other).max()
        off, size = (np.abs(motions.T @ x @ motions).max() for x in (one - other, other))
        assert off <= EXUDYNS * size
    for name in ("G", "C", "C_t"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), atol=1e-9)
    rng = np.random.default_rng(4)
    for _ in range(3):
        x = rng.normal(size=wanted_changes.by.shape[1])
        one, other = np.zeros((2, *wanted.K.shape))
        for K, of in ((one, changes), (other, wanted_changes)):
            K[of.i, of.j] = of.by @ x
        assert np.abs(one - other).max() <= EXUDYNS * np.abs(other).max()


@pytest.mark.parametrize("rigid", [False, True], ids=["nothing else has a mass", "something else has a mass"])
def test_a_hollow_twin_is_the_same_mechanism(rigid):
    scene = mechanisms.double_pendulum(3, assemble=True)
    if rigid:
        scene.mbs.CreateMassPoint(mass=2.0)
        scene.mbs.Assemble()
    with mock.patch.object(frame_inertia, "MANY", 0):
        twin = Place.copied(scene.mbs, 1, tuple(FrameInertia.all_of(scene.mbs)))
    own = Place(Equations(scene.mbs, 1), scene.mbs)
    assert len(twin.inertias) == 2
    state = current_state(scene.mbs.systemData)
    rng = np.random.default_rng(5)
    state = [x + rng.normal(size=len(x)) for x in state]
    assert twin.shows(0.01, state, own.look(0.01, state))
    residuals = []
    for place in (own, twin):
        set_state(place.mbs.systemData, 0.01, state)
        residuals.append(place.residual())
    assert np.abs(residuals[0] - residuals[1]).max() <= ROUNDING * np.abs(residuals[0]).max()
    others = [x + rng.normal(size=len(x)) for x in state]
    both = [np.array(pair) for pair in zip(state, others, strict=True)]
    wanted, found = (place.residuals(np.array([0.01, 0.02]), both) for place in (own, twin))
    assert np.abs(wanted - found).max() <= ROUNDING * np.abs(wanted).max()
    np.testing.assert_array_equal(wanted[0], residuals[0])
    twin.inertias[1].D *= 1.001
    vars(twin.inertias[1]).pop("_constants", None)  # what is compiled has its own
    assert not twin.shows(0.01, state, own.look(0.01, state))
