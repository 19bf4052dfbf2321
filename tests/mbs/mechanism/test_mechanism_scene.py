"""Coupled bounds beside real runs of mechanisms: what is found, and that runs, solves and reports behave."""

import gc
import weakref

import numpy as np
import pytest
from exudyn import itemInterface

from exudyn_romerr import load_report
from models import floating, mechanisms
from tests.helpers.mechanism_runs import (
    BOTH,
    COUPLED,
    FROZEN,
    STEP,
    pendulum,
    reports,
    solve,
    watch,
)

NEGLECTED = "Neglected"
REACT = "these react to the body's deformation"
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


# --- the simulation is not touched ------------------------------------------


@pytest.mark.parametrize("estimators", ["auto", ("fast", *BOTH)])
@pytest.mark.parametrize("name", SCENES)
def test_attaching_changes_no_bit_of_the_simulation(name, estimators):
    scene = SCENES[name]()
    solve(scene)
    before = everything(scene)
    monitors = watch(scene, estimators=estimators)
    solve(scene)
    scope = COUPLED if estimators == "auto" else FROZEN
    assert all(set(monitor.report().scope.values()) == {scope} for monitor in monitors)
    for one, other in zip(before, everything(scene), strict=True):
        np.testing.assert_array_equal(other, one)


def everything(scene):
    """Final coordinates, their rates and accelerations, multipliers; all that sensors stored."""
    system = scene.mbs.systemData
    states = system.GetODE2Coordinates, system.GetODE2Coordinates_t, system.GetODE2Coordinates_tt
    sensors = [scene.mbs.GetSensorStoredData(sensor) for sensor in scene.sensors.values()]
    return [*(read() for read in states), system.GetAECoordinates(), *sensors]


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


def test_tolerance_on_one_bar_stops_the_solve():
    free, _ = reports(pendulum(20), estimators="energy")
    bound = np.max(free.output("probe").bound["best"], axis=1)
    scene, limit = pendulum(20), np.max(bound) / 2
    monitors = [*watch(scene, 1, estimators="energy", tolerance=limit), *watch(scene, 2, estimators="energy")]
    solve(scene)
    stopped, other = (monitor.report() for monitor in monitors)
    assert stopped.t[-1] == other.t[-1] == free.t[np.argmax(bound > limit)] < free.t[-1]
    assert "tolerance on 'probe' exceeded" in stopped.messages[0]


def test_mbs_is_freed_when_dropped():
    def solved():
        scene = pendulum()
        monitors = watch(scene)
        solve(scene)
        return weakref.ref(scene.mbs), monitors[0]

    mbs, runs = (lambda mbs, monitor: (mbs, monitor.runs))(*solved())
    gc.collect()
    assert mbs() is None
    assert len(runs[0].report().t) == 11


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
