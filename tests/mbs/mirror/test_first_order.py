"""Coordinates of first order (ODE1): pressures of cylinders, filters of controllers, beside runs with all modes."""

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

from benchmarks.by_run import told_by_run
from benchmarks.told_and_true import parts
from exudyn_romerr.errors import AssumptionError
from exudyn_romerr.mbs.mirror.covered import require_covered
from exudyn_romerr.mbs.mirror.recorder import as_rows
from models import floating, mechanisms
from models.boom import MOUNTS, boom
from tests.helpers.observed import attached_all, flexes, shown

H = 2e-3
TAU = 4e-3  # s


def valve_arm(n=4, kind="RBE3", h=H, t_end=0.03):
    """A bar that a cylinder lifts, whose valves are opened at once; nothing but its forces acts on the bar."""
    scene = floating.pendulum(n, kind, h=h, t_end=t_end, force=lambda t: (0.0, 0.0, 0.0))
    mbs = scene.mbs
    nodes, weights = floating.interface(scene.fem, "right")
    end = weights @ scene.fem.GetNodePositionsAsArray()[nodes]
    base = end - [0.3, 0.0, 0.3]
    ground = mbs.AddObject(itemInterface.ObjectGround(referencePosition=base))
    node = itemInterface.NodeGenericODE1(
        referenceCoordinates=[0, 0], initialCoordinates=[1.4e6, 2e6], numberOfODE1Coordinates=2
    )
    node, length = mbs.AddNode(node), float(np.linalg.norm(end - base))
    mbs.AddObject(
        itemInterface.HydraulicActuatorSimple(
            markerNumbers=[
                mbs.AddMarker(itemInterface.MarkerBodyPosition(bodyNumber=ground)),
                scene.markers["right"],
            ],
            nodeNumbers=[node],
            offsetLength=0.8 * length,
            strokeLength=0.5 * length,
            chamberCrossSection0=4e-4,
            chamberCrossSection1=2.5e-4,
            hoseVolume0=2e-4,
            hoseVolume1=2e-4,
            valveOpening0=0.2,
            valveOpening1=-0.2,
            oilBulkModulus=1e9,
            actuatorDamping=2e2,
            nominalFlow=5e-8,
            systemPressure=2e7,
            tankPressure=1e5,
        )
    )
    return finished(scene, node, h)


def filtered_bar(n=4, kind="RBE3", h=H, t_end=0.06):
    """A bar on springs, whose sensor goes through two filters to a force that saturates."""
    scene = mechanisms.sprung_body(n, kind, h, t_end)
    mbs, marker = scene.mbs, scene.markers["right 1"]
    shows = exu.OutputVariableType
    place = mbs.AddSensor(itemInterface.SensorMarker(markerNumber=marker, outputVariableType=shows.Displacement))
    node = itemInterface.NodeGenericODE1(
        referenceCoordinates=[0, 0], initialCoordinates=[0, 0], numberOfODE1Coordinates=2
    )
    node = mbs.AddNode(node)

    def rates(mbs, t, itemNumber, q):
        return [(mbs.GetSensorValues(place)[2] - q[0]) / TAU, (q[0] + q[0] ** 2 - q[1]) / TAU]

    def force(mbs, t, load):
        return [0, 0, -1e4 * np.tanh(2 * mbs.GetNodeOutput(node, shows.Coordinates)[1])]

    mbs.AddObject(itemInterface.ObjectGenericODE1(nodeNumbers=[node], rhsUserFunction=rates))
    mbs.AddLoad(itemInterface.LoadForceVector(markerNumber=marker, loadVectorUserFunction=force))
    return finished(scene, node, h)


def finished(scene, node, h):
    """With sensors of what is of first order."""
    for name, variable in (("state", "Coordinates"), ("rate", "Coordinates_t")):
        sensor = itemInterface.SensorNode(
            nodeNumber=node, storeInternal=True, outputVariableType=getattr(exu.OutputVariableType, variable)
        )
        scene.sensors[name] = scene.mbs.AddSensor(sensor)
    for name, number in scene.sensors.items():
        scene.mbs.SetSensorParameter(number, "name", name)
    newton = scene.settings.timeIntegration.newton
    newton.relativeTolerance, newton.absoluteTolerance = 1e-9, 1e-8
    newton.numericalDifferentiation.minimumCoordinateSize = 1
    scene.settings.solution.sensors.writePeriod = h
    scene.mbs.Assemble()
    return scene


def run(scene, every=1):
    """What sensors show, in every so many rows."""
    scene.solve()
    return {name: values[::every] for name, values in shown(scene).items()}


def told(scene):
    return told_by_run(scene.mbs, flexes(scene), scene.solve)[1]


def extrapolated(coarse, fine, order):
    """What steps of length zero would show, by those of one length and half of it."""
    return {name: fine[name] + (fine[name] - coarse[name]) / (2**order - 1) for name in fine}


# steps are of first order where pressures change from the start: Exudyn takes their rates to be zero there. All modes
# where valves open at once; of the other scene they are 0.5 % farther than 40, and take half a minute
@pytest.mark.parametrize(
    ("build", "order", "full", "steps"),
    [(valve_arm, 1, (0, "complete"), (8, 16)), (filtered_bar, 2, (40, "RBE3"), (4, 8))],
)
def test_modes_and_steps_are_told(build, order, full, steps):
    scene = build()
    report, reduced = told(scene), shown(scene)
    full = run(build(*full))
    finer = extrapolated(*(run(build(h=H / k), k) for k in steps), order)
    for name in ("state", "rate"):
        out = report.output(name)
        by_modes = full[name] - reduced[name]
        assert np.abs(out.estimate_parts["basis"] - by_modes).max() < 0.02 * np.abs(by_modes).max()
    by_steps = finer["state"] - reduced["state"]
    off = np.abs(report.output("state").estimate_parts["time step"] - by_steps).max()
    assert 0 < off < 0.03 * np.abs(by_steps).max()
    assert all(np.all(np.isinf(out.bound["best"])) for out in report.outputs.values())  # nothing is proved
    left_out = dict(report.plan.left_out)
    assert "coordinates of first order (ODE1)" in left_out["bounds of what sensors show in frames of bodies"]


def test_a_crane_from_its_static_solve_on():
    """Two cylinders, a controller that samples, a payload on a rope, and the equilibrium that they begin in.

    What the script makes of the static solve is in pressures at the start: with all modes it sets others.
    """
    build = {"h": 1e-2, "t_end": 0.5}
    scene = boom(**build)
    monitor = attached_all(scene)
    reduced = run(scene)
    report = monitor.report()
    full = run(boom(30, interfaces=tuple(MOUNTS), **build))
    finer = extrapolated(*(run(boom(h=1e-2 / k, t_end=0.5), k) for k in (4, 8)), 1)
    errors = {"basis": full, "time step": finer}
    for name, component in (("tip", 2), ("payload", 2), ("pressures first", 0)):
        out = report.output(name)
        for part, truth in errors.items():
            wanted = np.abs(truth[name] - reduced[name])[:, component].max()
            assert np.abs(out.estimate_parts[part][:, component]).max() == pytest.approx(wanted, rel=0.1)
    for name in ("pressures first", "pressures second"):
        out = report.output(name)
        by_modes, by_steps = (truth[name] - reduced[name] for truth in errors.values())
        np.testing.assert_allclose(out.estimate_parts["basis"][0], by_modes[0], rtol=1e-3, atol=0.1)
        assert np.abs(by_modes[0]).max() > 10
        assert np.abs(out.estimate_parts["time step"] - by_steps).max() < 0.05 * np.abs(by_steps).max()
        assert np.all(np.abs(out.estimate - by_modes - by_steps) <= 2 * out.uncertainty)
        part, half = parts(out, "modes")  # of which valves know half: their flow has a kink where they are closed
        assert np.all(np.abs(part - by_modes) <= half)
    of_static = monitor.report(0).output("tip").estimate_parts["basis"][-1]
    np.testing.assert_allclose(of_static, (full["tip"] - reduced["tip"])[0], rtol=0, atol=1e-7)


def test_what_pressures_are_off_by_without_a_mode():
    scene = valve_arm(2)
    monitor = attached_all(scene)
    reduced = run(scene)
    (in_run,) = monitor.report().modes.in_run.values()
    change = np.abs(run(valve_arm(1))["state"] - reduced["state"]).max()
    assert in_run.sensors["state"][1][7] == pytest.approx(change, rel=1e-2)  # behind six static modes and another


def test_a_run_that_goes_on_says_that_what_was_before_is_not_known():
    scene = valve_arm(t_end=0.02)
    monitor = attached_all(scene)
    scene.solve()
    system, time = scene.mbs.systemData, scene.settings.timeIntegration
    system.SetSystemState(system.GetSystemState(), exu.ConfigurationType.Initial)
    time.startTime, time.endTime = 0.02, 0.04
    scene.solve()
    (doubt,) = monitor.report().uncertified
    assert doubt.cause == "it goes on from a solve before whose error is not known"


def test_a_static_solve_has_to_hold_them():
    scene = valve_arm()
    scene.mbs.sys["simulationSettings"] = scene.settings
    require_covered(scene.mbs, is_static=True)
    scene.settings.staticSolver.constrainODE1Coordinates = False
    require_covered(scene.mbs)
    with pytest.raises(AssumptionError, match="does not hold coordinates of first order"):
        require_covered(scene.mbs, is_static=True)


def test_nothing_of_the_run_changes():
    scene = valve_arm(t_end=0.02)
    bare = run(scene)
    monitor = attached_all(scene)
    for name, values in run(scene).items():  # it begins anew
        np.testing.assert_array_equal(values, bare[name])
    system = scene.mbs.systemData
    before = [system.GetODE1Coordinates(), system.GetODE1Coordinates_t()]
    assert np.abs(monitor.report().output("state").estimate).max() > 0
    np.testing.assert_array_equal([system.GetODE1Coordinates(), system.GetODE1Coordinates_t()], before)
    assert np.all(before)


def test_rows_have_them_as_rates_of_their_integrals():
    t = np.linspace(0.0, 1.0, 21)[:, None]
    q, multipliers = np.hstack([t, 2 * t]), np.hstack([-t])
    stored = np.hstack([t, q, 3 * q, 4 * q, multipliers, np.cos(t), -np.sin(t)])
    rows = as_rows(stored, 2, 1)
    assert [x.shape[1] for x in (rows.q, rows.v, rows.a, rows.multipliers)] == [3, 3, 3, 1]
    np.testing.assert_array_equal(rows.v, np.hstack([3 * q, np.cos(t)]))
    np.testing.assert_array_equal(rows.a, np.hstack([4 * q, -np.sin(t)]))
    np.testing.assert_allclose(rows.q, np.hstack([q, np.sin(t)]), rtol=0, atol=1e-8)
    np.testing.assert_array_equal(rows.multipliers, multipliers)
