"""The tangent of a mechanism against differences of its equations of motion, by every coordinate."""

from itertools import pairwise

import numpy as np
import pytest

from exudyn_romerr import AssumptionError
from exudyn_romerr.mbs.derivatives import linearisation as tangent
from exudyn_romerr.mbs.derivatives.linearisation import Tangents
from exudyn_romerr.mbs.derivatives.tangent_reading import Reading, compared
from models import mechanisms, wishbone

STEP = 1e-6  # central: rounding 1e-16 of forces of 1e4 N, over 2e-6; the second derivatives' share is 1e-12
# One-sided differences over 1e-7, in Exudyn's part of each coordinate's size; measured 4e-3 at the wishbone's bushes.
NEAR = 1e-2
# The same of what Exudyn leaves out, without stiff springs in it: measured 3e-6.
CARRIED = 1e-4


def running(scene, at):
    """At one step of a solve: a reading, K of Exudyn alone, differences of all forces and of M q'' + G^T l alone."""
    mbs, found = scene.mbs, []
    mbs.Assemble()
    if hasattr(scene, "settle"):
        scene.settle()
    tangents = Tangents(mbs)

    def hook(mbs, t):
        if t >= at and not found:
            tangents.read(mbs, t)
            equations, beside, *_ = tangents.light(mbs)
            exudyns = equations.jacobian(beside, -1.0, 0.0, 1)  # of the state that was read
            found.extend([tangents, exudyns, *differences(mbs, tangents)])
        return True

    mbs.SetPostStepUserFunction(hook)
    mbs.SolveDynamic(scene.settings)
    return found


def differences(mbs, tangents):
    system, equations = mbs.systemData, tangents.equations
    q, q_tt, multipliers = system.GetODE2Coordinates(), system.GetODE2Coordinates_tt(), system.GetAECoordinates()

    def left(moved):
        system.SetODE2Coordinates(moved)
        carried = equations.mass(mbs) @ q_tt + equations.constraints(mbs).T @ multipliers
        return np.array([equations.residual(mbs), carried])

    columns = [(left(q + step) - left(q - step)) / (2 * STEP) for step in STEP * np.eye(len(q))]
    system.SetODE2Coordinates(q)
    return np.moveaxis(columns, 0, 2)


@pytest.mark.parametrize(
    ("make", "at"),
    [
        (lambda: mechanisms.slider_crank(2, h=5e-4, t_end=0.051), 0.05),
        (lambda: mechanisms.double_pendulum(1, h=2e-3, t_end=0.042), 0.04),
        (lambda: wishbone.quarter_car(2, h=1e-3, t_end=0.011, static=wishbone.INTERFACES[:2]), 0.01),
    ],
)
def test_stiffness_is_the_derivative_of_all_forces_by_all_coordinates(make, at):
    """Joints' forces on arms that follow the deformation included, which Exudyn's Jacobians leave out."""
    tangents, exudyns, wanted, carried = running(make(), at)
    reading = tangents.readings[0]
    size = np.abs(np.diag(wanted)) + np.diag(reading.M) / at**2
    for parameters in tangents._reader._rotations:  # one of four may have neither mass nor stiffness
        size[parameters] = size[parameters].mean()
    off = np.abs(reading.K - wanted) / np.sqrt(np.outer(size, size))
    assert off.max() < NEAR
    lengths = np.linalg.norm(carried, axis=0)
    found = np.linalg.norm(reading.K - exudyns - carried, axis=0)
    assert np.all(found < CARRIED * np.maximum(lengths, 1e-3 * lengths.max()))
    assert np.count_nonzero(lengths) > sum(map(len, tangents._reader._rotations))


def test_tangents_are_read_where_forces_change_though_nothing_turns():
    """The quarter car's springs: with G alone, steps between readings would have doubled each time."""
    scene = wishbone.quarter_car(0, h=1e-3, t_end=0.1)
    scene.mbs.Assemble()
    scene.settle()
    tangents, strides = Tangents(scene.mbs), []

    def hook(mbs, t):
        if not strides or t > hook.due - 1e-9:
            strides.append(tangents.read(mbs, t))
            hook.due = t + 1e-3 * strides[-1]
        return True

    scene.mbs.SetPostStepUserFunction(hook)
    scene.mbs.SolveDynamic(scene.settings)
    by_constraints = [np.linalg.norm(b.G - a.G) / np.linalg.norm(b.G) for a, b in pairwise(tangents.readings)]
    assert max(by_constraints) < tangent.CHANGE
    assert max(strides) < 64  # after three readings where all is calm
    assert strides[-1] <= 32


def reading(K, G=(), t=0.0):
    """Of a point of mass 1 in a plane; what of it does not matter here is zero."""
    K, G, none = np.array(K), np.reshape(G, (-1, 2)), np.zeros((2, 2))
    springs = np.abs(np.diag(K))
    return Reading(t, (np.zeros(2),) * 4, np.eye(2), none, K, G, G, 0 * G, np.ones(2), springs, 0)


STIFF, ALONG, ACROSS = 1e8, np.array([0.6, 0.8]), np.array([-0.8, 0.6])


def test_soft_springs_across_stiff_ones_are_seen():
    """Beside both coordinates the change is 1e-6 of a stiffness; across the stiff spring it is 100 times m/dt^2."""
    before, now = (STIFF * np.outer(ALONG, ALONG) + soft * np.outer(ACROSS, ACROSS) for soft in (0.0, 100.0))
    change = compared(reading(before), reading(now, t=1.0), 1.0).change
    assert change == pytest.approx(100 / 101, rel=1e-6)


@pytest.mark.parametrize(("G", "wanted"), [((), 0.5 * STIFF / (1 + 1.5 * STIFF)), (ALONG, 0.0)])
def test_springs_along_constraints_do_not_matter(G, wanted):
    before, now = (share * STIFF * np.outer(ALONG, ALONG) for share in (1.0, 1.5))
    found = compared(reading(before, G), reading(now, G, t=1.0), 1.0)
    assert found.change == pytest.approx(wanted, rel=1e-6, abs=1e-6)
    X = found.motions
    np.testing.assert_allclose(X.T @ (now + np.eye(2)) @ X, np.eye(X.shape[1]), atol=1e-6)
    assert X.shape == (2, 2 - len(found.G))
    assert np.abs(found.G @ X).max(initial=0.0) < 1e-12


def test_tangents_that_are_not_finite_are_refused():
    with pytest.raises(AssumptionError, match="not finite at t = 1 s"):
        compared(reading(np.eye(2)), reading([[1.0, 0.0], [0.0, np.nan]], t=1.0), 1.0)
