"""Modes that move the body as a rigid one, by little: motion of the frame, to first order (theory.md 7)."""

from functools import cache

import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from exudyn_romerr.errors import AssumptionError
from exudyn_romerr.mbs.floating.frame_node import RigidPart
from exudyn_romerr.model.admissible_space import rigid_modes
from models import floating

# Of the estimate, over the share: what is of second order, the rigid part times the deformation over the length, and
# what the run itself differs by from that with the exact modes; measured 0.013 of the estimate without eigenmodes
SECOND_ORDER = 0.05
TIMES = {"h": 1e-3, "t_end": 0.03}


def shifted(share):
    """floating.reduce with so large a rigid motion in every mode, by the mass norm."""
    plain = floating.reduce

    def reduce(fem, n, kind="RBE3"):
        plain(fem, n, kind)
        V, M, Rg = fem.modeBasis["matrix"], fem.massMatrix, rigid_modes(fem.GetNodePositionsAsArray())
        by = np.random.default_rng(1).standard_normal((6, V.shape[1])) / norms(M, Rg)[:, None]
        fem.modeBasis = {**fem.modeBasis, "matrix": V + share * (Rg @ by) * norms(M, V) / norms(M, Rg @ by)}

    return reduce


def norms(M, X):
    return np.sqrt(np.einsum("ij,ij->j", X, M @ X))


def reported(share, change=None, scope="auto"):
    """Report of a pendulum without gravity, whose moment Exudyn takes at the undeformed mass centre, and a sensor."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(floating, "GRAVITY", [0, 0, 0])
        if share:
            patch.setattr(floating, "reduce", shifted(share))
        if change:
            change(patch)
        scene = floating.pendulum(0, **TIMES)
        flex = romerr.floating_body(scene.fem, scene.items)
        tip = romerr.node_displacement("tip in the frame", node=floating.interface(scene.fem, "tip")[0][0])
        monitor = romerr.attach(scene.mbs, flex, outputs=[scene.sensors["tip"], tip], scope=scope)
        scene.solve()
        shown = np.array(scene.mbs.GetSensorStoredData(scene.sensors["tip"]))[:, 1:]
        return monitor.report(), shown, str(monitor.plan)


exact = cache(lambda scope="auto": reported(0.0, scope=scope))


def misses(report, scope="auto"):
    """How far estimates of the error by modes are from those of the exact modes, of their size, by output."""
    found = []
    for name, out in report.outputs.items():
        right = exact(scope)[0].output(name).estimate_parts["basis"]
        found.append(np.abs(out.estimate_parts["basis"] - right).max() / np.abs(right).max())
    return found


@pytest.mark.parametrize("share", [1e-4, 1e-2])
def test_estimates_are_those_of_the_exact_modes(share):
    report, shown, plan = reported(share)
    assert report.scope["auxiliary"] == exact()[0].scope["auxiliary"] == "coupled (linearised)"
    assert max(misses(report)) < SECOND_ORDER * share
    value = next(iter(report.outputs.values())).value
    assert np.abs(value - shown).max() < SECOND_ORDER * share * np.abs(value).max()
    assert f"up to {share:.1e} of one (mass norm) moves the body as a rigid one" in plan


def test_truth_of_the_complete_basis_is_met():
    """The frame's definition differs between both runs: the truth is that of the exact modes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(floating, "GRAVITY", [0, 0, 0])
        scene = floating.pendulum(0, "complete", **TIMES)
        scene.solve()
    truth = np.array(scene.mbs.GetSensorStoredData(scene.sensors["tip"]))[:, 1:]
    for share in (1e-4, 1e-2):
        out = next(iter(reported(share)[0].outputs.values()))
        error = truth - out.value
        assert np.abs(out.estimate_parts["basis"] - error).max() < SECOND_ORDER * share * np.abs(error).max()


@pytest.mark.parametrize(
    "left_out",
    [
        lambda patch: patch.setattr(RigidPart, "add_inertia", lambda *_: None),
        lambda patch: patch.setattr(RigidPart, "frame", lambda self, motion, *_: motion),
    ],
)
def test_mutations_are_seen(left_out):
    """Inertia of the rigid part, and the motion of the frame that it is."""
    report, shown, _ = reported(1e-2, left_out, "inputs frozen")
    value = next(iter(report.outputs.values())).value
    off = np.abs(value - shown).max() / np.abs(value).max()
    assert max(*misses(report, "inputs frozen"), off) > 5 * SECOND_ORDER * 1e-2


def test_what_acts_on_the_node_of_the_frame_is_refused():
    """A force there does no work on the modes, whatever they move."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(floating, "reduce", shifted(1e-4))
        scene = floating.pendulum(0, **TIMES)
    node = scene.mbs.AddMarker(itemInterface.MarkerNodeRigid(nodeNumber=scene.items["nRigidBody"]))
    scene.mbs.AddLoad(itemInterface.Force(markerNumber=node, loadVector=[0, 1, 0]))
    monitor = romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.items))
    scene.solve()
    with pytest.raises(AssumptionError, match=r"act on the frame's node .*hold_modes"):
        monitor.report()
