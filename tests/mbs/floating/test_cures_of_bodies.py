"""What messages about a floating body tell to do is done as they say, on one small bar: the answer is there then."""

import numpy as np
import pytest
from exudyn import itemInterface
from exudyn.FEM import HCBstaticModeSelection, ObjectFFRFreducedOrderInterface

import exudyn_romerr as romerr
from models import driven_bar, floating
from models.hex_bar import hex_bar

COMPLETE = {"complete"}
LATE = 0.03  # rad, or m, of the motions that are tried


def hurty(fem, **options):
    """Craig-Bampton modes of both faces, as a user of Exudyn computes them."""
    nodes, weights = zip(*(floating.interface(fem, side) for side in ("left", "right")), strict=True)
    options = {"computationMode": HCBstaticModeSelection.RBE3, "boundaryNodesWeights": weights, **options}
    fem.ComputeHurtyCraigBamptonModes(nodes, 4, **options)


def loaded(modes, reference=None, solve=True, welded=True):
    """Report, or plan, of the bar, loaded at its right face, welded at its left one or free; modes : of the fem."""
    fem = hex_bar()
    modes(fem)
    scene = driven_bar.bar(t_end=2e-3)
    mbs = type(scene.SC)().AddSystem()
    items = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(mbs, stiffnessProportionalDamping=1e-5)
    body = items["oFFRFreducedOrder"]
    left, right = (floating.add_interface_marker(mbs, body, *floating.interface(fem, x)) for x in ("left", "right"))
    nodes, weights = floating.interface(fem, "left")
    place = weights @ fem.GetNodePositionsAsArray()[nodes]
    ground = mbs.AddObject(itemInterface.ObjectGround(referencePosition=place))
    ground = mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=ground))
    if welded:
        mbs.AddObject(itemInterface.GenericJoint(markerNumbers=[ground, left]))
    force = {"loadVectorUserFunction": lambda mbs, t, load: [0.0, 0.0, np.sin(500 * t) ** 2]}
    mbs.AddLoad(itemInterface.LoadForceVector(markerNumber=right, **force))
    out = romerr.node_displacement("tip", node=len(fem.nodes["Position"]) - 1)
    monitor = romerr.attach(mbs, romerr.floating_body(fem, items, reference=reference), outputs=[out])
    mbs.Assemble()
    if not solve:
        return monitor.plan
    mbs.SolveDynamic(scene.settings)
    return monitor.report()


@pytest.mark.parametrize(
    ("before", "after", "word"),
    [
        (lambda fem: hurty(fem, excludeRigidBodyMotion=False), hurty, "excludeRigidBodyMotion=True"),
        (
            lambda fem: fem.ComputeEigenmodes(10, excludeRigidBodyModes=0, useSparseSolver=False),
            lambda fem: floating.reduce(fem, 4, "free"),
            "excludeRigidBodyModes=6",
        ),
    ],
    ids=["static", "free"],
)
@pytest.mark.parametrize("is_named", [False, True])
def test_modes_that_move_the_body_as_a_rigid_one(before, after, word, is_named):
    """Conditions that are named do not hold them, either; modes without rigid motion need none."""
    reference = romerr.mean_motion(*floating.interface(hex_bar(), "left")) if is_named else None
    with pytest.raises(romerr.RomErrError, match="in 6 of 6 ways") as error:
        loaded(before, reference, solve=False)  # Exudyn cannot: what moves the frame moves the modes
    assert word in str(error.value)
    assert "mean_motion" not in str(error.value)
    report = loaded(after, welded=after is hurty)
    assert np.max(np.abs(report.output("tip").value)) > 0
    assert np.isfinite(report.output("tip").bound["best"]).all()


def test_modes_of_an_interface_that_nobody_knows():
    """No marker and no node set tells its weights: named, they hold the body."""
    held = np.arange(8), np.linspace(1.0, 2.0, 8) / 12

    def modes(fem):
        fem.ComputeEigenmodes(6, excludeRigidBodyModes=6, useSparseSolver=False)
        fem.eigenValues = fem.eigenValues[6:12]
        romerr.hold_modes(fem, *held)

    with pytest.raises(romerr.AssumptionError, match=r"reference=romerr\.mean_motion"):
        loaded(modes, welded=False)
    assert np.isfinite(loaded(modes, romerr.mean_motion(*held), welded=False).output("tip").bound["best"]).all()
