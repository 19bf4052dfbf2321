"""Springs and dampers beside masses: what is read of them, against Exudyn's own linearised equations."""

from dataclasses import replace

import exudyn as exu
import numpy as np
import pytest
import scipy.linalg as la
from exudyn import itemInterface
from exudyn.utilities import InertiaCuboid

from exudyn_romerr.mbs.control.connectors import connectors

K6 = np.diag([1e3, 2e3, 3e3, 10.0, 20.0, 30.0])
SPRINGS = {
    "both": lambda m: itemInterface.RigidBodySpringDamper(markerNumbers=m, stiffness=K6, damping=1e-3 * K6),
    "Cartesian": lambda m: itemInterface.CartesianSpringDamper(
        markerNumbers=m, stiffness=[1e3, 0.0, 5e2], damping=[2.0, 1.0, 0.5]
    ),
    "torsional": lambda m: itemInterface.TorsionalSpringDamper(markerNumbers=m, stiffness=50.0, damping=0.1),
    "by function": lambda m: itemInterface.TorsionalSpringDamper(
        markerNumbers=m,
        stiffness=50.0,
        damping=0.1,
        springTorqueUserFunction=lambda mbs, t, i, x, v, k, d, offset: 2 * k * x + 3 * d * v,
    ),
}


def two_boxes(name):
    """Two rigid bodies that a spring joins off their centres, one of them with a moved centre of mass."""
    mbs = exu.SystemContainer().AddSystem()
    inertias = InertiaCuboid(1000, [0.1, 0.2, 0.3]), InertiaCuboid(500, [0.2, 0.1, 0.1]).Translated([0.03, 0.01, 0.0])
    bodies = [mbs.CreateRigidBody(referencePosition=[0.0, 0, 0], inertia=one) for one in inertias]
    place = [0.05, -0.02, 0.01]
    markers = [mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=body, localPosition=place)) for body in bodies]
    mbs.AddObject(SPRINGS[name](markers))
    mbs.Assemble()
    return mbs


@pytest.mark.parametrize("name", SPRINGS)
def test_stiffness_and_damping_are_bounded_by_mass(name):
    mbs = two_boxes(name)
    M, K, D = mbs.ComputeLinearizedSystem()[:3]
    # Euler parameters: their length has no mass
    keep = la.null_space(np.vstack([np.eye(14)[3], np.eye(14)[10]]))
    M, K, D = (keep.T @ x @ keep for x in (M, K, D))
    found = connectors(mbs, lambda marker: None)
    for exact, bound in ((K, found.stiffness), (D, found.damping)):
        largest = la.eigvalsh((exact + exact.T) / 2, M)[-1]
        assert largest <= bound * (1 + 1e-6) <= 8 * largest  # differences; a trace of up to six for one eigenvalue
    least = la.eigvalsh((D + D.T) / 2 - found.covered * (1 - 1e-6) * (K + K.T) / 2)[0]
    assert least >= -1e-6 * np.abs(D).max()
    assert found.covered == pytest.approx({"both": 1e-3, "Cartesian": 1e-3, "torsional": 2e-3}.get(name, 3e-3))


@pytest.mark.parametrize("touched", [True, False])
def test_what_is_not_known_is_inf(touched):
    """Damping of a linear body, where something else touches that."""
    mbs, without = two_boxes("both"), two_boxes("both")
    without.Assemble()
    alone = connectors(without, lambda marker: None)
    node = mbs.AddNode(
        itemInterface.NodeGenericODE2(
            numberOfODE2Coordinates=1,
            referenceCoordinates=[0.0],
            initialCoordinates=[0.0],
            initialCoordinates_t=[0.0],
        )
    )
    mbs.AddObject(itemInterface.ObjectGenericODE2(nodeNumbers=[node], massMatrix=np.eye(1), dampingMatrix=np.eye(1)))
    if touched:
        ends = [mbs.AddMarker(itemInterface.MarkerNodeCoordinate(nodeNumber=node, coordinate=0)) for _ in range(2)]
        mbs.AddObject(itemInterface.ObjectConnectorCoordinate(markerNumbers=ends))
    mbs.Assemble()
    found = connectors(mbs, lambda marker: None)
    assert np.isfinite(alone.damping)
    assert found == (replace(alone, damping=np.inf, covered=0.0) if touched else alone)


def test_without_dampers_nothing_is_asked():
    mbs = exu.SystemContainer().AddSystem()
    assert connectors(mbs, None).are_damped is False
