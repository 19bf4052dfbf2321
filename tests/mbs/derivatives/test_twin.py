"""The copy of an mbs in which tangents are read: the same equations on three nodes a marker, while they stay so."""

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface
from exudyn.FEM import ObjectFFRFreducedOrderInterface

from exudyn_romerr.mbs.access.equations import Equations
from exudyn_romerr.mbs.access.light_mesh import lightened
from exudyn_romerr.mbs.access.state_guard import state_set
from exudyn_romerr.mbs.derivatives.linearisation import Tangents
from exudyn_romerr.mbs.derivatives.twin import Place
from models import mechanisms, wishbone
from models.floating import add_interface_marker, craig_bampton, interface
from models.hex_bar import hex_bar

# Of the largest entry: sums of 54 nodes against three; measured 6e-16 at most
ROUNDING = 1e-13
# Of K: Exudyn's one-sided differences, whose steps are of a coordinate's size; measured 2e-6 in D, 1e-9 in K
DIFFERENCES = 1e-5
SPRINGS = {itemInterface.MarkerSuperElementPosition: 2e5, itemInterface.MarkerSuperElementRigid: 3e4}  # N/m


def crank():
    """With springs at markers of all nodes of a face: of their mean displacement, weights of any size."""
    scene = mechanisms.slider_crank(3, kind="RBE2")
    mbs, (nodes, _) = scene.mbs, interface(scene.fem, "right")
    ground = mbs.AddMarker(
        itemInterface.MarkerBodyRigid(bodyNumber=mbs.CreateGround(), localPosition=[0.4, 0.1, 0.3])
    )
    weights = np.random.default_rng(1).uniform(0.1, 1.0, len(nodes))
    items = {"bodyNumber": scene.bodies[0]["oFFRFreducedOrder"], "meshNodeNumbers": nodes}
    for kind, stiffness in SPRINGS.items():
        marker = mbs.AddMarker(kind(**items, weightingFactors=weights / weights.sum()))
        mbs.AddObject(
            itemInterface.CartesianSpringDamper(
                markerNumbers=[ground, marker], stiffness=[stiffness] * 3, damping=[1e-3 * stiffness] * 3
            )
        )
    return scene


def quarter_car():
    return wishbone.quarter_car(2, static=wishbone.INTERFACES[:2])


@pytest.mark.parametrize("make", [crank, quarter_car])
def test_three_nodes_a_marker_are_the_same_equations(make):
    scene = make()
    scene.mbs.Assemble()
    own = Place(Equations(scene.mbs, 1), scene.mbs)
    twin = Place.copied(scene.mbs, 1)
    rng, n = np.random.default_rng(2), own.equations.size
    multipliers = scene.mbs.systemData.GetAECoordinates()
    for _ in range(3):
        state = [*(size * rng.normal(size=n) for size in (0.05, 1.0, 10.0)), rng.normal(size=len(multipliers))]
        seen = own.look(0.03, state)
        for one, other in zip(seen, twin.look(0.03, state), strict=True):
            assert np.abs(one - other).max() <= ROUNDING * np.abs(one).max()
            assert np.abs(one).max() > 0
        assert twin.shows(0.03, state, seen)
        with state_set(scene.mbs.systemData, 0.03, state), state_set(twin.mbs.systemData, 0.03, state):
            wanted, found = own.residual(), twin.residual()
        assert np.abs(found - wanted).max() <= ROUNDING * np.abs(wanted).max()
    for factors in ((0.0, -1.0, 0), (-1.0, 0.0, 1)):
        wanted, found = (place.equations.jacobian(place.mbs, *factors) for place in (own, twin))
        assert np.abs(found - wanted).max() <= DIFFERENCES * np.abs(wanted).max()
    markers = [twin.mbs.GetMarker(i) for i in range(twin.mbs.systemData.NumberOfMarkers())]
    assert {len(m["meshNodeNumbers"]) for m in markers if m["markerType"] == "SuperElementRigid"} == {3}
    assert {len(m["meshNodeNumbers"]) for m in markers if m["markerType"] == "SuperElementPosition"} <= {1}


def test_thin_bars_have_a_twin():
    """Faces of 5 mm: rotations of their markers are 4e-12 of the largest entry of G off by rounding, others not."""
    fem = hex_bar(8, size=(0.4, 0.005, 0.005))
    craig_bampton(fem, ("left", "right"), 6, "RBE3")
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    body = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(mbs)["oFFRFreducedOrder"]
    ground = mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=mbs.CreateGround()))
    for side, axes in (("left", [1, 1, 1, 1, 1, 0]), ("right", [0, 0, 0, 0, 1, 1])):
        marker = add_interface_marker(mbs, body, *interface(fem, side))
        mbs.AddObject(itemInterface.GenericJoint(markerNumbers=[ground, marker], constrainedAxes=axes))
    mbs.Assemble()
    tangents = Tangents(mbs)
    tangents.read(mbs, 0.0)
    assert tangents.light(mbs).mbs is not mbs


def test_markers_that_move_in_another_way_keep_their_nodes():
    nodes = np.random.default_rng(3).normal(size=(5, 3))
    body = {"objectType": "FFRFreducedOrder", "referencePositions": nodes.ravel(), "modeBasis": np.ones((15, 2))}
    rigid = {"markerType": "SuperElementRigid", "useAlternativeApproach": True}
    rigid |= {"meshNodeNumbers": [0, 1, 2, 4], "weightingFactors": [0.25] * 4}
    assert len(lightened(body, [dict(rigid)])["modeBasis"]) == 9
    for other in ({"useAlternativeApproach": False}, {"weightingFactors": [0.3] * 4}, {"markerType": "BodyRigid"}):
        marker = rigid | other
        assert lightened(body, [marker]) == {}
        assert marker["meshNodeNumbers"] == rigid["meshNodeNumbers"]
    assert lightened(body | {"objectType": "FFRF"}, [dict(rigid)]) == {}


@pytest.mark.parametrize("changed", ["stiffness", "damping"])
@pytest.mark.parametrize("to", [2e-3, 5e5])
def test_what_is_changed_in_the_mbs_is_in_its_next_tangent(changed, to):
    """Of a spring of 1e-3 N/m, beside a body of 1e9: the twin is another mbs then."""
    scene = crank()
    spring = scene.mbs.systemData.NumberOfObjects() - 1
    for name in ("stiffness", "damping"):
        scene.mbs.SetObjectParameter(spring, name, [1e-3] * 3)
    scene.mbs.Assemble()
    tangents = Tangents(scene.mbs)
    tangents.read(scene.mbs, 0.0)
    before = tangents.readings[0]
    assert tangents.reads_the_same(scene.mbs, before)
    assert tangents._twin is not None
    scene.mbs.SetObjectParameter(spring, changed, [to] * 3)
    assert not tangents.reads_the_same(scene.mbs, before)
    tangents.read(scene.mbs, 1e-3)
    assert tangents._twin is None
    now, then = (getattr(of, {"stiffness": "K", "damping": "D"}[changed]) for of in (tangents.readings[1], before))
    place = scene.mbs.systemData.GetObjectLTGODE2(scene.bodies[0]["oFFRFreducedOrder"])[:3]
    more = np.diag(now - then)[place]  # of the bar's place, which other springs hold with 2e5
    assert more == pytest.approx(to - 1e-3, rel=1e-6, abs=0.1)


def test_functions_that_look_at_the_mbs_of_the_run_are_asked_there():
    """A spring whose force follows the motion that it finds in a mbs of its own choice: the twin is another one."""
    scene = crank()
    mbs = scene.mbs

    def pull(_, t, itemNumber, u, v, k, d, force):
        return 1e3 * mbs.systemData.GetODE2Coordinates().sum()

    ends = [0, mbs.systemData.NumberOfMarkers() - 1]
    mbs.AddObject(
        itemInterface.SpringDamper(markerNumbers=ends[::-1], referenceLength=0.1, springForceUserFunction=pull)
    )
    mbs.Assemble()
    tangents = Tangents(mbs)
    tangents.read(mbs, 0.0)
    assert tangents._twin is None
