"""Names of the public contract, asked of a mechanism: each answers, or refuses by its name and says what to do."""

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from tests.helpers.mechanism_runs import COUPLED, FROZEN, pendulum, solve

CAUSES = {"basis", "interfaces", "time step", "initial", "jumps"}
GIVEN = {"estimators": "energy", "initial": "equilibrium", "auxiliary_modes": 3}


def attached(scene, outputs=None, **options):
    """A monitor of both bars, on sensors and on outputs that have none."""
    flexes = [romerr.floating_body(scene.fem, bar) for bar in scene.bodies]
    x = scene.fem.GetNodePositionsAsArray()[:, 0]
    last, face = int(np.argmax(x)), np.argsort(x)[-4:].tolist()
    if outputs is None:
        outputs = [
            *scene.sensors.values(),
            (flexes[0], romerr.node_displacement("no sensor", node=last, component="z")),
            (flexes[0], romerr.node_strain("strain", node=last, fem=scene.fem)),
            (flexes[1], romerr.mean_rotation("turn", nodes=face)),
        ]
    return romerr.attach(scene.mbs, flexes, outputs=outputs, **options)


@pytest.fixture(scope="module")
def run():
    scene = pendulum()
    monitor = attached(scene)
    scene.mbs.Assemble()
    plan = str(monitor.plan)
    solve(scene)
    return monitor, plan, monitor.report()


def test_plan_is_there_before_the_solve_and_after(run):
    _, plan, report = run
    assert "linearised mechanism" in plan
    assert "linearised mechanism" in str(report.bodies[0].plan)


def test_plan_of_bodies_that_the_mechanism_does_not_tell_plans_no_other_sensors():
    """It was asked again, without what speaks against it: the second bar is not attached."""
    scene = pendulum()
    on_no_body = scene.mbs.AddSensor(itemInterface.SensorObject(objectNumber=scene.objects["hinge 1"]))
    scene.mbs.SetSensorParameter(on_no_body, "outputVariableType", exu.OutputVariableType.ForceLocal)
    bar = romerr.floating_body(scene.fem, scene.bodies[0])
    monitor = romerr.attach(scene.mbs, [bar], outputs=[scene.sensors["tip 1 local"], on_no_body])
    scene.mbs.Assemble()
    plan = monitor.plan
    (name,) = [name for name, why in plan.left_out if "is not to be had" in why]
    assert name == scene.mbs.GetSensor(on_no_body)["name"]
    assert not any(name in line for line in plan.computed)


def test_every_output_has_an_estimate_with_its_half_width(run):
    *_, report = run
    assert {"no sensor", "strain", "turn"} < report.outputs.keys()
    for name, out in report.outputs.items():
        assert out.value.shape == out.estimate.shape == out.uncertainty.shape == out.bound["best"].shape
        assert out.estimate_parts.keys() == CAUSES
        assert np.all(out.uncertainty < np.inf)
        assert (out.corrected is None) == (out.corrected_bound is None) == np.isinf(out.bound["best"]).all()
        assert report.assess(name, 1e9).answer in ("proven", "likely")
    for name in ("no sensor", "strain", "turn"):
        assert report.output(name).corrected is not None


def test_scope_reason_and_remainder(run):
    *_, report = run
    assert report.scope == {"auxiliary": COUPLED}
    assert "to first order" in report.reason("auxiliary")
    assert report.remainder == {}


@pytest.mark.parametrize("name", ["position_bound", "velocity_bound", "node_bound"])
def test_what_a_mechanism_has_not_refuses_by_its_name(run, name):
    *_, report = run
    for each in (report, report.bodies[0]):
        with pytest.raises(romerr.InputError, match="inputs frozen"):
            getattr(each, name)["auxiliary"]


def test_a_truth_is_compared_and_a_file_loaded(run, tmp_path):
    *_, report = run
    out = report.output("turn")
    report.compare("turn", report.t, out.value + out.estimate)
    assert out.effectivity["best"].shape == (3,)
    report.bodies[0].save(tmp_path / "run.npz")
    again = romerr.load_report(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.output("strain").estimate, report.output("strain").estimate)


@pytest.mark.parametrize("name", GIVEN)
def test_what_the_body_alone_is_asked_freezes_inputs(name):
    scene = pendulum()
    monitor = attached(scene, outputs=[scene.sensors["middle 1 local"]], **{name: GIVEN[name]})
    solve(scene)
    report = monitor.report()
    assert set(report.scope.values()) == {FROZEN}
    assert name in report.scope_reason or "vectors" in report.scope_reason


def test_jumps_are_refused_where_a_frame_turns():
    scene = pendulum()
    monitor = attached(scene, outputs=[scene.sensors["middle 1 local"]], jumps=(0.01,))
    solve(scene)
    with pytest.raises(romerr.AssumptionError, match="jumps= need a frame at rest"):
        monitor.report()


def test_a_tolerance_stops_and_a_live_sensor_shows():
    scene = pendulum()
    number = scene.sensors["middle 1 local"]
    scene.mbs.SetSensorParameter(number, "name", "middle")
    monitor = attached(scene, outputs=[number], tolerance={"middle": 1e-12})
    live = scene.mbs.AddSensor(monitor.bodies[0].bound_sensor("middle"))
    solve(scene)
    assert monitor.report().output("middle").stopped > 0
    assert scene.mbs.GetSensorStoredData(live)[-1, 1:].max() > 1e-12
