"""What coupled bounds cannot cover: frozen inputs instead, or a clear message, and what was bounded stays."""

from dataclasses import replace

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from exudyn_romerr import AssumptionError, InputError, attach, floating_body
from exudyn_romerr.mbs.mechanism.stored_residuals import StoredResiduals
from models import floating, mechanisms
from tests.helpers.mechanism_runs import (
    BOTH,
    COUPLED,
    FROZEN,
    STEP,
    add_load,
    add_spring,
    assert_same_bounds,
    ground_marker,
    pendulum,
    raised,
    ran_to_its_end,
    reports,
    solve,
    watch,
)


def assert_frozen(found, *words):
    """All reports are of frozen inputs, and say why."""
    for report in found:
        assert set(report.scope.values()) == {FROZEN}
        for e in report.scope:
            assert all(word in report.reason(e) for word in ("no coupled bound", *words))


# --- which bodies and outputs -----------------------------------------------


def with_named_second_bar():
    scene = pendulum()
    scene.mbs.SetObjectParameter(scene.bodies[1]["oFFRFreducedOrder"], "name", "forearm")
    return scene


def test_bar_that_is_not_attached_is_named():
    """And to attach it is the next step: half the step would not tell what its error does."""
    scene = with_named_second_bar()
    made = reports(scene, 1)
    assert_frozen(made, "not attached", "forearm")
    out = made[0].output("probe")
    made[0].outputs["other"] = replace(out, name="other")
    assert str(made[0]).count("; attach all flexible bodies\n") == 1


def test_bar_that_is_not_attached_is_refused_where_the_coupled_scope_was_asked_for():
    scene = with_named_second_bar()
    (monitor,) = watch(scene, 1, scope=COUPLED)
    solve(scene)
    assert ran_to_its_end(scene)
    assert monitor.runs == ()
    error = raised(monitor)
    with pytest.raises(AssumptionError, match="forearm") as of_plan:
        monitor.plan  # noqa: B018
    for text in (str(error), str(of_plan.value)):
        assert all(word in text for word in (COUPLED, "not attached", "forearm", FROZEN))
    assert type(error) is AssumptionError


def test_tolerance_on_an_output_in_global_axes_asks_for_a_bound():
    """There is one with frozen inputs alone; inf would stop the solve. A tolerance on another output does not ask."""
    asked = {"outputs": "tip {}", "tolerance": {"probe": 1.0}}
    assert_frozen(reports(pendulum(), **asked), "'probe'", "frame='body'", "DisplacementLocal")
    scene = pendulum()
    local = romerr.node_displacement("here", node=mechanisms.MIDDLE)
    seen = romerr.node_displacement("there", node=mechanisms.MIDDLE, frame="global")
    flex = [floating_body(scene.fem, items) for items in scene.bodies]
    monitors = [attach(scene.mbs, body, outputs=[local, seen], tolerance={"here": 1.0}) for body in flex]
    solve(scene)
    assert ran_to_its_end(scene)
    assert {scope for monitor in monitors for scope in monitor.report().scope.values()} == {COUPLED}


FROZEN_FIRST = {
    "scope": {"scope": FROZEN},
    "tolerance": {"outputs": "tip {}", "tolerance": 1.0},
    "initial": {"initial": "equilibrium"},
}


@pytest.mark.parametrize("what", FROZEN_FIRST)
@pytest.mark.parametrize("estimators", ["energy", "auto"])
def test_body_beside_one_of_frozen_inputs_has_no_coupled_bound(estimators, what):
    """It would be coupled with an error that is taken as zero."""
    scene = pendulum()
    monitors = [
        *watch(scene, 1, estimators=estimators, **FROZEN_FIRST[what]),
        *watch(scene, 2, estimators=estimators),
    ]
    solve(scene)
    for monitor in monitors:
        assert set(monitor.report().scope.values()) == {FROZEN}


def test_body_without_a_coupled_estimator_leaves_the_others_frozen():
    scene = pendulum()
    monitors = [*watch(scene, 1, estimators="fast"), *watch(scene, 2, estimators="auxiliary")]
    solve(scene)
    for monitor in monitors:
        assert set(monitor.report().scope.values()) == {FROZEN}
        reason = monitor.report().scope_reason
        assert "none of the estimators fast" in reason or "has frozen inputs only" in reason


def test_bodies_with_different_estimators_are_refused():
    scene = pendulum()
    monitors = [*watch(scene, 1, estimators="energy"), *watch(scene, 2, estimators="auxiliary")]
    solve(scene)
    assert ran_to_its_end(scene)
    for monitor in monitors:
        assert type(raised(monitor)) is InputError
        assert "different estimators" in str(raised(monitor))


def test_estimators_that_are_never_coupled_do_not_meet_a_coupled_scope():
    scene = pendulum()
    monitors = watch(scene, estimators="fast", scope=COUPLED)
    solve(scene)
    for monitor in monitors:
        assert type(raised(monitor)) is AssumptionError


@pytest.mark.parametrize("count", [1, 60, 189])
def test_any_number_of_auxiliary_vectors(count):
    for report in reports(pendulum(0, steps=2), estimators="auxiliary", auxiliary_modes=count):
        assert np.isfinite(report.output("probe").bound["auxiliary"]).all()


# --- what acts in the mechanism ---------------------------------------------


def add_mass(scene):
    """A mass point beside the pendulum; markers of its height above the ground."""
    items, mbs = itemInterface, scene.mbs
    node = mbs.AddNode(items.NodePoint(referenceCoordinates=[0, 0, 3]))
    mbs.AddObject(items.MassPoint(nodeNumber=node, mass=1.0))
    ground = mbs.AddNode(items.NodePointGround())
    return [
        mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=number, coordinate=c))
        for number, c in ((ground, 0), (node, 2))
    ]


def add_connector(kind, data=0, **options):
    """Return a function that joins a mass point to the ground by a connector, which is named `culprit`."""

    def add(scene):
        more = dict(options)
        if data:
            node = itemInterface.NodeGenericData(initialCoordinates=[0.0] * data, numberOfDataCoordinates=data)
            more["nodeNumber"] = scene.mbs.AddNode(node)
        scene.mbs.AddObject(kind(name="culprit", markerNumbers=add_mass(scene), **more))

    return add


def own_force(mbs, t, number, u, v, stiffness, damping, offset):
    return [0.0, 0.0, -10.0 * u[2]]


EXTENDED = itemInterface.CoordinateSpringDamperExt
REFUSED = {
    "contact": (add_connector(itemInterface.ObjectContactCoordinate, 1, contactStiffness=1e3), "culprit"),
    "limit stops": (add_connector(EXTENDED, 3, useLimitStops=True, limitStopsStiffness=1e3), "culprit"),
    "friction": (add_connector(EXTENDED, dynamicFrictionForce=1.0, frictionProportionalZone=1e-3), "culprit"),
    "velocity level": (add_connector(itemInterface.CoordinateConstraint, velocityLevel=True), "culprit"),
    "own force": (lambda s: add_spring(s, name="culprit", springForceUserFunction=own_force), "culprit"),
    "load that turns with a bar": (lambda s: add_load(s, bodyFixed=True), "bodyFixed"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_switches_or_controls_is_frozen_and_named(name):
    add, culprit = REFUSED[name]
    scene = pendulum()
    add(scene)
    assert_frozen(reports(scene), culprit)


ALLOWED = {
    "spring": add_spring,
    "connector of a mass": add_connector(itemInterface.CoordinateSpringDamper, stiffness=10.0, damping=1.0),
    "load": add_load,
}


@pytest.mark.parametrize("name", ALLOWED)
def test_linear_springs_and_loads_are_coupled(name):
    scene = pendulum()
    ALLOWED[name](scene)
    for report in reports(scene, estimators=BOTH):
        assert report.scope == dict.fromkeys(BOTH, COUPLED)


def test_redundant_constraints_change_nothing():
    found = []
    for doubled in (False, True):
        scene = pendulum(steps=20)
        solver = scene.settings.linearSolver
        solver.solverType, solver.ignoreSingularJacobian = exu.LinearSolverType.EigenDense, doubled
        if doubled:
            hinge = scene.mbs.GetObject(scene.objects["hinge 2"])
            markers = hinge["markerNumbers"]
            scene.mbs.AddObject(itemInterface.GenericJoint(markerNumbers=markers, constrainedAxes=mechanisms.HINGE))
        found.append(reports(scene, estimators=BOTH))
    for one, other in zip(*found, strict=True):
        assert other.scope == dict.fromkeys(BOTH, COUPLED)
        assert_same_bounds(one, other, rtol=1e-6, share=1e-6)


def on_interior_nodes(kind, n, *joints):
    """One bar with joints at its right face or in its middle."""
    scene = mechanisms._scene((n, kind), (STEP, 5 * STEP))
    mechanisms._add_bar(scene, floating.RAYLEIGH)
    positions = scene.fem.GetNodePositionsAsArray()
    nodes = np.flatnonzero(np.abs(positions[:, 0] - 0.2) < 0.03)
    weights = np.ones(len(nodes)) / len(nodes)
    middle = floating.add_interface_marker(scene.mbs, scene.bodies[0]["oFFRFreducedOrder"], nodes, weights)
    places = {
        "right": (scene.markers["right 1"], [0.4, 0.02, 0.03]),
        "middle": (middle, positions[nodes].mean(axis=0)),
    }
    for joint in joints:
        marker, place = places[joint]
        mechanisms.join(scene, joint, ground_marker(scene, place), marker, mechanisms.HINGE)
    return scene, middle


@pytest.mark.parametrize(("kind", "n", "joints"), [("free", 3, ["middle"]), ("RBE3", 2, ["right", "middle"])])
@pytest.mark.parametrize("estimators", ["energy", "auxiliary"])
def test_joint_on_nodes_without_static_modes_is_refused(estimators, kind, n, joints):
    scene, middle = on_interior_nodes(kind, n, *joints)
    (monitor,) = watch(scene, estimators=estimators)
    solve(scene)
    error = raised(monitor)
    assert type(error) is AssumptionError
    assert "static modes" in str(error)
    assert f"marker {int(middle)}" in str(error)


def test_midpoint_residual_is_yes_or_no():
    with pytest.raises(InputError, match="midpoint_residual='on'; needed: True or False"):
        watch(pendulum(), midpoint_residual="on")


@pytest.mark.parametrize("midpoint_residual", [False, True])
def test_loads_between_samples_are_evaluated_where_asked_for(midpoint_residual, monkeypatch):
    seen = []
    monkeypatch.setattr(StoredResiduals, "between", lambda self, *rest: seen.append(rest) or (None, None))
    for report in reports(pendulum(steps=5), estimators="auxiliary", midpoint_residual=midpoint_residual):
        assert np.isfinite(report.output("probe").bound["auxiliary"]).all()
    assert bool(seen) == midpoint_residual
