"""Equations: accelerations and multipliers that balance in a state."""

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import GenericJoint, MarkerBodyRigid
from exudyn.utilities import InertiaCuboid

from exudyn_romerr.mbs.access.equations import Equations

FAST = 1e6  # m/s^2 and 1/s^2: what accelerations of a rigid crank reach as it begins to turn
OFF = 2e-8  # of accelerations: what two differences leave, and rounding over it


def pendulum():
    """A bar on a hinge."""
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    body = mbs.CreateRigidBody(
        referencePosition=[0.25, 0, 0], inertia=InertiaCuboid(7850.0, (0.5, 0.04, 0.06)), gravity=[0, 0, -9.81]
    )
    places = ((mbs.CreateGround(), [0, 0, 0]), (body, [-0.25, 0, 0]))
    markers = [mbs.AddMarker(MarkerBodyRigid(bodyNumber=number, localPosition=x)) for number, x in places]
    mbs.AddObject(GenericJoint(markerNumbers=markers, constrainedAxes=[1, 1, 1, 1, 0, 1]))
    mbs.Assemble()
    return SC, mbs


@pytest.mark.parametrize("rate", [0.0, 30.0])
def test_what_balances_does_not_depend_on_accelerations_to_begin_with(rate):
    """They were squared in the difference that takes constraints twice: 20 where 15 was right."""
    _SC, mbs = pendulum()
    equations = Equations(mbs)
    q = mbs.systemData.GetODE2Coordinates()
    q_t, one = np.zeros_like(q), np.ones(1)
    q_t[2], q_t[5] = -0.25 * rate, 0.5 * rate  # about y
    G = equations.constraints(mbs)
    independent = np.flatnonzero(G.any(axis=1))
    none = np.zeros((1, len(G)))
    known, found = (
        equations.balanced(mbs, (0 * one, q[None], q_t[None], q_tt, none), independent)
        for q_tt in (np.zeros((1, len(q))), FAST * np.random.default_rng(0).standard_normal((1, len(q))))
    )
    assert np.abs(found[3] - known[3]).max() < OFF * FAST
    assert np.abs(known[3]).max() > 1.0
