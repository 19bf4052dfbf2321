"""Coupled bounds beside real runs of mechanisms: what is found, and that runs, solves and reports behave."""

import gc
import weakref
from dataclasses import replace

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

from exudyn_romerr import AssumptionError, InputError, attach, floating_body, load_report
from exudyn_romerr.mbs.access.mbs_items import node_coordinates
from exudyn_romerr.mbs.mirror.recorder import Recorder
from models import floating, mechanisms
from tests.helpers.mechanism_runs import (
    BOTH,
    COUPLED,
    FROZEN,
    STEP,
    add_load,
    add_spring,
    ground_marker,
    pendulum,
    raised,
    ran_to_its_end,
    reports,
    solve,
    watch,
)

SCENES = {
    "double pendulum": lambda: pendulum(2),
    "slider crank": lambda: mechanisms.slider_crank(2, t_end=0.01),
    "sprung body": lambda: mechanisms.sprung_body(2, t_end=0.02),
}


# --- scope ------------------------------------------------------------------


@pytest.mark.parametrize("name", SCENES)
def test_mechanism_with_all_bars_attached_is_coupled(name):
    for report in reports(SCENES[name]()):
        assert report.scope == {"auxiliary": COUPLED}
        assert "to first order" in report.reason("auxiliary")
        assert np.all(report.output("probe").bound["best"][1:] > 0)
        assert report.output("probe").corrected is not None


def test_other_estimators_are_known_with_frozen_inputs_only():
    for report in reports(pendulum(), estimators=("fast", *BOTH)):
        assert set(report.scope.values()) == {FROZEN}
        assert "estimators=('fast', 'energy', 'auxiliary') are known with frozen inputs only" in report.scope_reason


def test_correction_under_frozen_inputs_says_so():
    for report in reports(pendulum(), estimators="auxiliary", scope=FROZEN):
        said = "under the frame motion, loads and joint forces of this run the corrected output is within"
        assert said in report.details


@pytest.mark.parametrize("asked", ["auto", FROZEN])
def test_estimators_without_feedback_alone_are_as_with_frozen_inputs(asked):
    for report in reports(pendulum(), estimators="fast", scope=asked):
        assert report.scope == {"fast": FROZEN}
        assert report.time == "reconstructed"


def test_chain_of_three_bars():
    scene = mechanisms._scene((1, "RBE3"), (STEP, 10 * STEP))
    left, right = mechanisms._faces(scene.fem)
    ends = [mechanisms._ground_marker(scene.mbs, left)]
    for bar in (1, 2, 3):
        mechanisms._add_bar(scene, floating.RAYLEIGH, position=(bar - 1) * (right - left))
        mechanisms.join(scene, f"hinge {bar}", ends[-1], scene.markers[f"left {bar}"], mechanisms.HINGE)
        ends.append(scene.markers[f"right {bar}"])
    mechanisms._finished(scene, itemInterface.LoadForceVector, ends[-1], mechanisms.swaying_force, False)
    found = reports(scene)
    assert len(found) == 3
    for report, of_two in zip(found, reports(pendulum()), strict=False):
        assert report.scope == {"auxiliary": COUPLED}
        assert np.max(report.output("probe").bound["best"]) > np.max(of_two.output("probe").bound["best"])


# --- reports ----------------------------------------------------------------


def test_saved_report_keeps_scopes(tmp_path):
    for report in reports(pendulum(), estimators=("fast", *BOTH)):
        report.save(tmp_path / "run.npz")
        loaded = load_report(tmp_path / "run.npz")
        assert loaded.scope == report.scope
        assert [loaded.reason(e) for e in report.scope] == [report.reason(e) for e in report.scope]
        assert str(loaded) == str(report)


def test_fields_at_nodes_are_those_of_outputs():
    """Bounds; displacements of the run, also beside vectors that react; the estimate that corrects the output."""
    scene = pendulum()
    for report in reports(scene, estimators=BOTH):
        fields, out = report.at_nodes(), report.output("probe")
        i, size = np.argmax(report.position_bound["auxiliary"]), np.max(np.abs(out.value))
        moved, known = (x["auxiliary"][mechanisms.MIDDLE] for x in (fields.displacement, fields.estimate))
        np.testing.assert_allclose(moved, out.value[i], rtol=0, atol=1e-9 * size)
        np.testing.assert_allclose(known, out.corrected[i] - out.value[i], rtol=0, atol=1e-9 * size)
        assert np.max(np.abs(known)) > 1e-6 * size
        assert fields.instant["auxiliary"] == report.t[i]
        for e in BOTH:
            assert report.node_bound[e].shape == (scene.fem.NumberOfNodes(),)
            there = report.output("probe").bound[e][np.argmax(report.position_bound[e])]
            # rounding, 1e-9 of the bounds by energy, is bounded by way of the mass norm at nodes
            rounding = 1e-7 * np.max(report.output("probe").bound["energy"])
            assert np.max(there) <= report.node_bound[e][mechanisms.MIDDLE] <= np.linalg.norm(there) + rounding


def test_bodies_are_drawn_as_the_error_deforms_them(tmp_path):
    """To 2 % those of a run with many modes at the same instant, in picture and file; saved if asked for."""
    scene, everything = pendulum(2), pendulum(50)
    monitor = attach(scene.mbs, [floating_body(scene.fem, items) for items in scene.bodies])
    solve(scene)
    kept = Recorder(everything.mbs, None)
    everything.mbs.SetPostStepUserFunction(kept)
    solve(everything)
    report, (rows,) = monitor.report(), kept.runs()
    with pytest.raises(InputError, match=r"ask report\.bodies\[\.\.\.\]"):
        report.plot_body(scene.fem)
    for body, items in zip(report.bodies, everything.bodies, strict=True):
        nodes = body.at_nodes()
        (known,), (moved,), (at,) = (x.values() for x in (nodes.estimate, nodes.displacement, nodes.instant))
        V = everything.mbs.GetObject(items["oFFRFreducedOrder"])["modeBasis"]
        own = node_coordinates(everything.mbs, items["nGenericODE2"])
        error = (V @ rows.q[np.argmin(np.abs(rows.t - at))][own]).reshape(-1, 3) - moved
        np.testing.assert_allclose(known, error, rtol=0, atol=0.02 * np.abs(error).max())
    figure = body.plot_body(scene.fem, tmp_path / "body.svg")
    assert f"t = {at:.4g} s, as the error deforms it" in figure.axes[0].get_title()
    body.to_vtu(tmp_path / "body.vtu", scene.fem)
    file = pytest.importorskip("meshio").read(tmp_path / "body.vtu")
    assert [*file.point_data] == ["displacement", "error estimate, to first order"]
    np.testing.assert_array_equal(file.point_data["error estimate, to first order"], known)
    report.save(tmp_path / "run.npz")
    (again,) = load_report(tmp_path / "run.npz").bodies[1].at_nodes().estimate.values()
    np.testing.assert_array_equal(again, known)


def test_an_error_as_large_as_the_deformation_is_not_drawn():
    for report in reports(pendulum(1, kind="free")):
        with pytest.raises(InputError, match="as large as its deformation"):
            report.plot_body(None)
        with pytest.raises(InputError, match="as large as its deformation"):
            report.to_vtu("body.vtu")


def test_what_a_solve_has_made_goes_with_the_next():
    """Bodies with vectors, and before garbage is collected; rows stay, for the report of their run."""
    scene = pendulum()
    watch(scene)
    hook = scene.mbs.GetPostStepUserFunction()["function"].hook
    gc.disable()
    try:
        solve(scene)
        body, errors = weakref.ref(hook._ended.bodies[0]), weakref.ref(hook._ended.errors)
        solve(scene)
        assert (body(), errors()) == (None, None)
    finally:
        gc.enable()


# --- what coupled bounds cannot cover ---


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


def test_bar_that_is_not_attached_is_refused_where_the_coupled_scope_was_asked_for(capfd):
    """Announced once: SolveDynamic does not raise; who looks at sensors first must not be left in the dark."""
    scene = with_named_second_bar()
    (monitor,) = watch(scene, 1, scope=COUPLED)
    solve(scene)
    exu.Print("end")
    out = capfd.readouterr().out
    assert out.count("The simulation goes on") == 1
    assert "are not attached" in out
    assert ran_to_its_end(scene)
    assert monitor.runs == ()
    error = raised(monitor)
    with pytest.raises(AssumptionError, match="forearm") as of_plan:
        monitor.plan  # noqa: B018
    for text in (str(error), str(of_plan.value)):
        assert all(word in text for word in (COUPLED, "not attached", "forearm", FROZEN))
    assert type(error) is AssumptionError


def test_a_tolerance_stops_the_solve_by_frozen_inputs_and_the_report_has_the_mechanism():
    scene = pendulum()
    monitors = watch(scene, outputs="tip {}", tolerance={"probe": 1.0})
    solve(scene)
    assert ran_to_its_end(scene)
    for monitor in monitors:
        assert set(monitor.report().scope.values()) == {COUPLED}
        assert monitor.report().output("probe").tolerance == 1.0


@pytest.mark.parametrize("asked", [{"scope": FROZEN}, {"initial": "equilibrium"}, {"estimators": "fast"}], ids=str)
def test_a_body_beside_one_of_frozen_inputs_is_told_all_the_same(asked):
    """The mechanism knows the error of both."""
    scene = pendulum()
    frozen, told = *watch(scene, 1, **asked), *watch(scene, 2)
    solve(scene)
    assert set(frozen.report().scope.values()) == {FROZEN}
    assert set(told.report().scope.values()) == {COUPLED}


def test_estimators_that_are_never_coupled_do_not_meet_a_coupled_scope():
    scene = pendulum()
    monitors = watch(scene, estimators="fast", scope=COUPLED)
    solve(scene)
    for monitor in monitors:
        assert type(raised(monitor)) is AssumptionError


@pytest.mark.parametrize("count", [6, 60, 189])
def test_numbers_of_auxiliary_vectors(count):
    for report in reports(pendulum(0, steps=2), auxiliary_modes=count):
        assert set(report.scope.values()) == {COUPLED}
        assert np.abs(report.output("probe").estimate_parts["basis"]).max() > 0


def test_too_few_vectors_have_no_check():
    """One vector told a tenth of the error within half a percent."""
    assert_frozen(reports(pendulum(0, steps=2), auxiliary_modes=1), "auxiliary_modes=1 is too few")


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
    "contact": (add_connector(itemInterface.ObjectContactCoordinate, 1, contactStiffness=1e3), "data coordinates"),
    "limit stops": (add_connector(EXTENDED, 3, useLimitStops=True, limitStopsStiffness=1e3), "data coordinates"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_data_coordinates_is_frozen_and_named(name):
    add, culprit = REFUSED[name]
    scene = pendulum()
    add(scene)
    assert_frozen(reports(scene), culprit)


ALLOWED = {
    "spring": add_spring,
    "connector of a mass": add_connector(itemInterface.CoordinateSpringDamper, stiffness=10.0, damping=1.0),
    "load": add_load,
    "load that turns with a bar": lambda scene: add_load(scene, bodyFixed=True),
    "friction": add_connector(EXTENDED, dynamicFrictionForce=1.0, frictionProportionalZone=1e-3),
    "own force": lambda scene: add_spring(scene, springForceUserFunction=own_force),
}


@pytest.mark.parametrize("name", ALLOWED)
def test_springs_and_loads_are_coupled(name):
    scene = pendulum()
    ALLOWED[name](scene)
    for report in reports(scene):
        assert set(report.scope.values()) == {COUPLED}


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
        found.append(reports(scene))
    for one, other in zip(*found, strict=True):
        assert set(other.scope.values()) == {COUPLED}
        pairs = (report.output("probe").estimate_parts["basis"] for report in (one, other))
        np.testing.assert_allclose(*pairs, rtol=0, atol=1e-6 * np.abs(one.output("probe").estimate).max())


def on_interior_nodes(kind, n, joints, steps=5):
    """One bar with joints at its right face or in its middle, which its modes cannot move apart from all else."""
    scene = mechanisms._scene((n, kind), (STEP, steps * STEP))
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


INTERIOR = [("free", 3, ["middle"]), ("RBE3", 2, ["right", "middle"])]


@pytest.mark.parametrize(("kind", "n", "joints"), INTERIOR)
def test_bounds_of_a_body_alone_need_modes_that_move_its_joints(kind, n, joints):
    scene, middle = on_interior_nodes(kind, n, joints)
    (monitor,) = watch(scene, estimators="energy")
    solve(scene)
    error = raised(monitor)
    assert type(error) is AssumptionError
    assert "static modes" in str(error)
    assert f"marker {int(middle)}" in str(error)


@pytest.mark.parametrize(("kind", "n", "joints"), INTERIOR)
def test_vectors_move_interfaces_that_modes_cannot(kind, n, joints):
    """Beside a run with all modes: estimates are within 2 %. Bounds were up to 14 % below errors of one free mode."""
    scene, _ = on_interior_nodes(kind, n, joints, steps=20)
    (report,) = reports(scene)
    everything, _ = on_interior_nodes(kind, 170, joints, steps=20)
    solve(everything)
    out, sensor = report.output("probe"), scene.sensors["middle 1 local"]
    full, reduced = (x.mbs.GetSensorStoredData(sensor)[:, 1:] for x in (everything, scene))
    error, size = full - reduced, np.abs(full - reduced).max()
    np.testing.assert_allclose(out.estimate_parts["basis"], error, rtol=0, atol=0.02 * size)
    assert size > 1e-3 * np.abs(full).max()
    assert np.isinf(out.bound["best"]).all()
    assert any("modes that cannot move each interface" in why for _, why in report.plan.left_out)
