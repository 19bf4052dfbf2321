"""Exudyn's own ways: bounds as sensors, bands on its plots, lines beside the solver's, sensors as outputs."""

import dataclasses
import re
import sys
import types
from pathlib import Path

import exudyn as exu
import matplotlib.pyplot as plt
import numpy as np
import pytest
from exudyn import itemInterface
from exudyn.processing import ParameterVariation

import exudyn_romerr as romerr
from examples import bound_sensor
from exudyn_romerr import progress as bars
from exudyn_romerr.errors import InputError
from exudyn_romerr.linear.run import balance
from exudyn_romerr.linear.run.run import Run
from exudyn_romerr.mbs.monitoring import step_hook as hooks
from exudyn_romerr.report.scope import FROZEN
from exudyn_romerr.report.wording import NOT_THE_MECHANISM, rounded_up
from models import floating
from tests.helpers import mechanism_runs
from tests.helpers.mbs_scenes import SOLVERS, TIP, N, added, random_basis
from tests.helpers.mbs_scenes import settings as chain_settings
from tests.helpers.observed import attached, flexes, observed

Quantity = exu.OutputVariableType
TWO = romerr.Output("two", np.eye(N)[:2], unit="m")
STATES = ("ODE2Coordinates", "ODE2Coordinates_t", "ODE2Coordinates_tt", "AECoordinates")


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path, monkeypatch):
    """Exudyn writes files beside; figures are closed."""
    monkeypatch.chdir(tmp_path)
    yield
    plt.close("all")


def chain(outputs=(TIP, TWO), **options):
    """A chain of masses with a bound sensor for each output: mbs, monitor, sensors; assembled."""
    mbs, flex = added()
    monitor = romerr.attach(mbs, flex, outputs=list(outputs), **options)
    sensors = {out.name: mbs.AddSensor(monitor.bound_sensor(out.name)) for out in outputs}
    mbs.Assemble()
    return mbs, monitor, sensors


def written(steps=60, period=0.0, **options):
    ss = chain_settings(steps, **options)
    ss.solution.sensors.writePeriod = period
    return ss


def assert_same(mbs, sensor, report, name, late=0):
    """Sensor data are the report's bounds, bit for bit, at all times they were written; inf before it begins."""
    data, bound = mbs.GetSensorStoredData(sensor), report.output(name).bound["best"]
    assert len(data) > 2
    assert np.all(data[:late, 1:] == np.inf)
    at = np.searchsorted(report.t, data[late:, 0])
    np.testing.assert_array_equal(report.t[at], data[late:, 0])
    np.testing.assert_array_equal(bound[at], data[late:, 1:])
    assert np.max(bound) > 0


# --- sensors ------------------------------------------------------------------


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("period", [0.0, 0.01])
def test_sensors_show_the_bounds_of_the_very_step(solver, period):
    """Written after PostStep: zero steps late."""
    mbs, monitor, sensors = chain()
    SOLVERS[solver](mbs, written(period=period))
    for name, sensor in sensors.items():
        assert_same(mbs, sensor, monitor.report(), name)


def test_sensors_beside_full_blocks(monkeypatch):
    """Blocks end in between, and one run goes on from another."""
    monkeypatch.setattr(hooks, "BLOCK", 16)
    mbs, monitor, sensors = chain()
    mbs.SolveDynamic(written(90, 0.004), updateInitialValues=True)
    mbs.SolveDynamic(written(90, 0.004, start=mbs.systemData.GetTime(), end=0.2))
    assert any("continues the run before" in message for message in monitor.report().messages)
    assert_same(mbs, sensors["two"], monitor.report(), "two")


def test_sensors_beside_a_tolerance():
    mbs, monitor, sensors = chain([TIP], tolerance=1.0)
    mbs.SolveDynamic(written())
    assert_same(mbs, sensors["tip"], monitor.report(), "tip")


def test_sensor_writes_a_file():
    mbs, flex = added()
    monitor = romerr.attach(mbs, flex, outputs=[TWO])
    sensor = monitor.bound_sensor("two", name="mine", fileName="bound.txt", storeInternal=False)
    assert mbs.GetSensor(mbs.AddSensor(sensor))["name"] == "mine"
    mbs.Assemble()
    mbs.SolveDynamic(written())
    found = np.loadtxt("bound.txt", comments="#", delimiter=",")
    # solution.precision is 10 digits
    np.testing.assert_allclose(found[:, 1:], monitor.report().output("two").bound["best"], rtol=1e-9)
    assert "number of sensor values = 2" in Path("bound.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("estimators", ["energy", "auto"])
def test_sensors_of_a_mechanism_change_nothing(estimators):
    """They show bounds with frozen inputs, and the report has what it has without them; states stay bit for bit."""
    scene = mechanism_runs.pendulum(steps=30)
    monitors = mechanism_runs.watch(scene, estimators=estimators)
    states = []

    def solved():
        mechanism_runs.solve(scene)
        states.append([getattr(scene.mbs.systemData, f"Get{name}")() for name in STATES])
        return [monitor.report() for monitor in monitors]

    without = solved()
    items = [monitor.bound_sensor("probe", name=f"bound {i}") for i, monitor in enumerate(monitors)]
    sensors = [scene.mbs.AddSensor(item) for item in items]
    scene.settings.solution.sensors.writePeriod = 3 * mechanism_runs.STEP
    scene.mbs.Assemble()
    for sensor, report, other in zip(sensors, solved(), without, strict=True):
        if estimators == "energy":
            assert_same(scene.mbs, sensor, report, "probe")
        assert np.isfinite(scene.mbs.GetSensorStoredData(sensor)).all()
        bounds = (x.output("probe").bound["best"] for x in (report, other))
        np.testing.assert_allclose(*bounds, rtol=1e-9)  # blocks of other lengths
    for x, y in zip(*states, strict=True):
        np.testing.assert_array_equal(x, y)


def test_sensor_is_inf_where_the_report_has_no_bound():
    """A solve without initial accelerations is bounded from its first step on."""
    scene = mechanism_runs.pendulum(force=lambda t: (0.0, 100.0, 0.0))
    monitors = mechanism_runs.watch(scene, estimators="energy")
    sensor = scene.mbs.AddSensor(monitors[1].bound_sensor("probe"))
    scene.settings.timeIntegration.generalizedAlpha.computeInitialAccelerations = False
    scene.settings.solution.sensors.writePeriod = 0.0
    mechanism_runs.solve(scene)
    assert_same(scene.mbs, sensor, monitors[1].report(), "probe", late=1)


def test_sensor_is_inf_from_where_evaluation_fails(capfd, monkeypatch):
    """The run goes on, and says so."""
    original = Run._checked

    def checked(self, t, *rest):
        if t[-1] > 0.0505:
            raise ArithmeticError("mine")
        return original(self, t, *rest)

    monkeypatch.setattr(Run, "_checked", checked)
    mbs, monitor, sensors = chain()
    mbs.SolveDynamic(written(100, 0.005))
    data, kept = mbs.GetSensorStoredData(sensors["tip"]), monitor.runs[-1].report()
    assert kept.t[-1] == pytest.approx(0.05)
    at = data[:, 0] <= kept.t[-1]
    np.testing.assert_array_equal(data[~at, 1], np.inf)
    np.testing.assert_array_equal(data[at, 1:], kept.output("tip").bound["best"][::5])
    assert mbs.systemData.GetTime() == pytest.approx(0.1)
    exu.Print("end")
    told = "exudyn_romerr at t = 0.055: bounds end at t = 0.05, report() raises"  # a sensor was written then
    assert capfd.readouterr().out.count(told) == 1


def test_sensor_is_inf_if_a_run_cannot_be_opened(monkeypatch):
    """The error is that of the run, not one of the sensor; once the sensor asked for bounds of a run without any."""

    def failing(*_, **options):
        raise ArithmeticError("mine")

    monkeypatch.setattr(Run, "start", failing)
    mbs, monitor, sensors = chain()
    mbs.SolveDynamic(written())
    np.testing.assert_array_equal(mbs.GetSensorStoredData(sensors["tip"])[:, 1:], np.inf)
    with pytest.raises(ArithmeticError, match="mine"):
        monitor.report()


def test_sensor_of_an_unknown_output():
    _, monitor, _ = chain()
    with pytest.raises(InputError, match="output='tap' is unknown; allowed: 'tip', 'two'"):
        monitor.bound_sensor("tap")


def test_sensor_says_once_a_run_that_its_numbers_are_not_certified(capfd, monkeypatch):
    """They cannot say so themselves; the share in the message changes with every step."""
    mbs, monitor, _ = chain([TIP])
    mbs.SolveDynamic(written())
    monkeypatch.setattr(balance, "limit_of", lambda tolerance: 0.0)  # as if a load were not known
    for _ in range(2):
        mbs.SolveDynamic(written())
    assert "Galerkin" in str(monitor.report().uncertified)
    exu.Print("end")
    told = [line for line in capfd.readouterr().out.splitlines() if "'bound of tip'" in line]
    assert len(told) == 2
    assert all("not certified: the run is not balanced" in line for line in told)


def test_sensor_says_what_frozen_inputs_leave_out(capfd):
    scene = floating.pendulum(1, t_end=0.003)
    scene.mbs.SetSensorParameter(scene.sensors["tip local"], "name", "tip")
    monitor = attached(scene, outputs=["tip"], scope=FROZEN)
    scene.mbs.AddSensor(monitor.bound_sensor("tip"))
    scene.solve()
    exu.Print("end")
    (told,) = (line for line in capfd.readouterr().out.splitlines() if "'bound of tip'" in line)
    assert told.endswith(NOT_THE_MECHANISM)


def largest_bound(parameters):
    """What ParameterVariation varies: the largest bound of a tip, from its sensor."""
    mbs, flex = added(basis=random_basis(int(parameters["modes"])))
    monitor = romerr.attach(mbs, flex, outputs=[TIP], time="sampled")
    sensor = mbs.AddSensor(monitor.bound_sensor("tip"))
    mbs.Assemble()
    mbs.SolveDynamic(written())
    return float(mbs.GetSensorStoredData(sensor)[:, 1].max())


def test_sensor_in_a_parameter_variation():
    varied, bounds = ParameterVariation(
        largest_bound, {"modes": [2, 4, 6, 8]}, useMultiProcessing=False, showProgress=False
    )
    assert list(varied["modes"]) == [2, 4, 6, 8]
    assert bounds[-1] < 1e-3 * bounds[0]  # all 8 coordinates: nothing is reduced
    assert bounds[1] == largest_bound({"modes": 4})


# --- plots --------------------------------------------------------------------


@pytest.fixture(scope="module")
def bar():
    """A clamped bar that was solved with its sensors as outputs: scene, report, bound sensor."""
    scene = floating.clamped_bar(4, h=2e-4, t_end=0.01)
    scene.settings.solution.sensors.writePeriod = 4e-4  # every second step
    monitor = attached(scene, outputs=list(scene.sensors.values()))
    sensor = scene.mbs.AddSensor(monitor.bound_sensor("sensor1"))
    scene.solve()
    return scene, monitor.report(), sensor


def test_bands_around_the_lines_of_plotsensor(bar):
    scene, report, _ = bar
    plotted = scene.mbs.PlotSensor([scene.sensors["tip local"]] * 2, components=[1, 2])
    bands = romerr.add_bands(plotted, report, "sensor1", [1, 2])
    out, lines = report.output("sensor1"), plotted[2].get_lines()
    for band, line, row in zip(bands, lines, (1, 2), strict=True):
        (path,) = band.get_paths()
        edges = out.value[:, row] + np.outer([-1, 1], out.bound["best"][:, row])
        assert path.vertices[:, 1].min() == edges.min()
        assert path.vertices[:, 1].max() == edges.max()
        assert plt.matplotlib.colors.same_color(band.get_facecolor()[0][:3], line.get_color())
    texts = [text.get_text() for text in plotted[1].legends[0].get_texts()]
    largest = np.max(out.bound["best"], axis=0)
    assert texts[-2:] == [
        f"sensor1 {axis} ± at most {rounded_up(largest[row], 2)}" for row, axis in ((1, "y"), (2, "z"))
    ]


def test_band_on_other_axes_with_a_legend(bar):
    _, report, _ = bar
    _, ax = plt.subplots()
    ax.plot(report.t, report.output("sensor1").value[:, 0], label="mine")
    ax.legend()
    for scope, said in ((report.scope, ""), (dict.fromkeys(report.scope, FROZEN), ", inputs frozen")):
        romerr.add_bands(ax, dataclasses.replace(report, scope=scope), "sensor1")
        assert len(ax.collections) == 1  # the second replaces the first
        largest = np.max(report.output("sensor1").bound["best"][:, 0])
        legend = [text.get_text() for text in ax.get_legend().get_texts()]
        assert legend == ["mine", f"sensor1 x ± at most {rounded_up(largest, 2)}{said}"]


def test_bound_sensor_is_plotted(bar):
    scene, report, sensor = bar
    (line,) = scene.mbs.PlotSensor(sensor, components=[2], logScaleY=True)[2].get_lines()
    np.testing.assert_array_equal(line.get_ydata(), report.output("sensor1").bound["best"][::2, 2])


def test_example_writes_its_picture(tmp_path, capsys):
    data = bound_sensor.main(tmp_path, t_end=0.004)
    assert data.shape == (11, 4)
    said = re.match(
        r"tip z is wrong by about (\S+) m, says the report, and by at most (\S+) m", capsys.readouterr().out
    )
    assert float(said[2]) == pytest.approx(data[:, 3].max(), rel=5e-3)  # three digits are printed
    assert 0 < float(said[1]) <= float(said[2])
    assert (tmp_path / "bound_sensor.png").read_bytes().startswith(b"\x89PNG")


WRONG_BANDS = {
    "factors": (lambda mbs, s: mbs.PlotSensor(s, components=[2], factors=[1e3]), [2], "no line of these axes shows"),
    "component": (lambda mbs, s: mbs.PlotSensor(s, components=[1]), [2], "no line of these axes shows sensor1 z"),
    "number": (lambda mbs, s: mbs.PlotSensor(s), [3], r"components=\[3\]; allowed: numbers in 0..2"),
    "no axes": (lambda mbs, s: 5, [0], "plotted is a int; needed: axes"),
}


@pytest.mark.parametrize("name", WRONG_BANDS)
def test_bands_that_would_be_wrong_are_refused(name, bar):
    """A plot in mm must not get a band in m."""
    (scene, report, _), (plot, components, message) = bar, WRONG_BANDS[name]
    with pytest.raises(InputError, match=message):
        romerr.add_bands(plot(scene.mbs, scene.sensors["tip local"]), report, "sensor1", components)


# --- output of the solver -------------------------------------------------------


@pytest.mark.parametrize(("mode", "lines"), [(0, 0), (1, 0), (2, 11)])
@pytest.mark.parametrize("kind", ["timeIntegration", "staticSolver"])
def test_lines_only_where_all_steps_are_told(mode, lines, kind, capfd):
    """With verboseMode = 2: at every evaluation, here when sensors are written.

    Loads that are functions of time leave a static solve out of balance, which lines say.
    """
    mbs, monitor, _ = chain()
    ss = written(60, 0.01)
    getattr(ss, kind).verboseMode = mode
    ss.staticSolver.numberOfLoadSteps = 10
    (mbs.SolveDynamic if kind == "timeIntegration" else mbs.SolveStatic)(ss)
    exu.Print("end")
    told = [line for line in capfd.readouterr().out.splitlines() if line.startswith("error bounds at t = ")]
    assert len(told) == lines
    condition = ", not certified" if kind == "staticSolver" else ""
    for line in told[-1:]:
        last = {out.name: out.bound["best"][-1].max() for out in monitor.report().outputs.values()}
        assert line == f"error bounds at t = {monitor.report().t[-1]:g}: " + ", ".join(
            f"{name} {rounded_up(bound)} m{condition}" for name, bound in last.items()
        )


# --- sensors as outputs -----------------------------------------------------------


def test_sensors_on_the_body_are_outputs(bar):
    scene, asked, _ = bar
    scene = floating.clamped_bar(4, h=2e-4, t_end=0.01)
    report = observed(scene)
    assert list(report.outputs) == list(asked.outputs) == ["sensor0", "sensor1", "sensor2"]
    for name, out in report.outputs.items():
        assert out.estimate_scope == "complete"
        # modes by eigsh have other last digits each time, and the fixture's sensor makes other blocks
        np.testing.assert_allclose(out.value, asked.output(name).value, rtol=0, atol=1e-9 * np.max(np.abs(out.value)))
        np.testing.assert_allclose(out.bound["best"].max(), asked.output(name).bound["best"].max(), rtol=1e-4)


def test_sensors_in_a_mechanism_keep_their_names():
    """The error of how the frame moves has an estimate, no bound. What the frame sees is bounded too, once a node."""
    scene = mechanism_runs.pendulum()
    scene.mbs.DeleteSensor(scene.sensors["tip 1 local"])
    bodies = flexes(scene)
    monitors = [romerr.attach(scene.mbs, flex) for flex in bodies]
    mechanism_runs.solve(scene)
    reports = [monitor.report() for monitor in monitors]
    assert [list(report.outputs) for report in reports] == [
        ["sensor0", "sensor1", "sensor2", "sensor0 in the frame"],
        ["sensor3", "sensor4", "sensor5", "sensor6"],
    ]
    assert {scope for report in reports for scope in report.scope.values()} == {"coupled (linearised)"}
    tip = floating.interface(scene.fem, "tip")[0][0]
    shown = scene.mbs.GetObjectOutputSuperElement(bodies[0].number, Quantity.DisplacementLocal, int(tip))
    np.testing.assert_allclose(reports[0].output("sensor0 in the frame").value[-1], shown, rtol=1e-9)
    shown = scene.mbs.GetSensorValues(scene.sensors["tip 1"])
    np.testing.assert_allclose(reports[0].output("sensor0").value[-1], shown, rtol=1e-9)
    for report in reports:
        for name, out in report.outputs.items():
            in_frame = name.endswith(" in the frame") or name in ("sensor2", "sensor4", "sensor6")
            assert np.isfinite(out.bound["best"]).all() == in_frame, name
            assert out.estimate_scope == "coupled (linearised)"
            assert 0 < np.max(np.abs(out.estimate)) < np.inf
    assert monitors[0].plan == monitors[0].plan


def sensor_on(scene, quantity, node=20, **options):
    item = itemInterface.SensorSuperElement
    kept = {"bodyNumber": scene.items["oFFRFreducedOrder"], "meshNodeNumber": node, "storeInternal": True}
    return scene.mbs.AddSensor(item(**kept, outputVariableType=quantity, **options))


def bare_bar():
    """A clamped bar without sensors, with a monitor that was not told what to bound: scene, monitor."""
    scene = floating.clamped_bar(2, h=2e-4, t_end=2e-3)
    for number in reversed(range(scene.mbs.systemData.NumberOfSensors())):
        scene.mbs.DeleteSensor(number)
    return scene, attached(scene)


def test_sensors_are_found_when_the_solve_begins():
    """Added after attach; what no bound is known for is left out, and the plan says why."""
    scene, monitor = bare_bar()
    for name in ("tip", "other"):
        sensor_on(scene, Quantity.DisplacementLocal, name=name)
    sensor_on(scene, Quantity.Acceleration, name="shock")
    ground = scene.mbs.AddObject(itemInterface.ObjectGround())
    scene.mbs.AddSensor(itemInterface.SensorBody(bodyNumber=ground, outputVariableType=Quantity.Position))
    scene.solve()
    assert list(monitor.report().outputs) == ["tip", "other"]
    plan = str(monitor.plan)
    assert "sensor 2 (shock) measures Acceleration; bounds are known for" in plan
    assert "output 'other': displacement" in plan
    assert "sensor 3" not in plan
    sensor_on(scene, Quantity.VelocityLocal, name="late")
    scene.solve()
    assert list(monitor.report().outputs)[-1] == "late"


def test_body_without_sensors_is_bounded_as_a_whole():
    scene, monitor = bare_bar()
    scene.solve()
    report = monitor.report()
    assert not report.outputs
    assert np.max(report.position_bound["auxiliary"]) > 0
    assert "! no outputs: only the body's position as a whole is bounded" in str(report)
    assert "no sensor of Displacement, Position" in str(monitor.plan)


def test_outputs_added_beside_sensors_stay():
    """choose_modes adds some."""
    scene, monitor = bare_bar()
    monitor.subject.add([romerr.node_displacement("mine", node=3)])
    sensor_on(scene, Quantity.DisplacementLocal, name="tip")
    scene.solve()
    assert list(monitor.report().outputs) == ["tip", "mine"]


def test_sensors_are_outputs_of_a_file_too():
    scene, _ = bare_bar()
    sensor_on(scene, Quantity.Displacement, name="tip")
    file = scene.settings.solution.file
    file.write, file.writePeriod, file.binary, file.name = True, 0, True, "run.sol"
    scene.solve()
    flex = romerr.floating_body(scene.fem, scene.items)
    report = romerr.evaluate_file(scene.mbs, flex, "run.sol")
    # Exudyn's displacement is a difference of positions of up to 0.4 m
    np.testing.assert_allclose(report.output("tip").value[-1], scene.mbs.GetSensorValues(0), rtol=0, atol=1e-15)


def test_what_needs_names_needs_outputs():
    scene, monitor = bare_bar()
    with pytest.raises(
        InputError, match=r"bound_sensor\('tip'\): there are no outputs, or they are not known before"
    ):
        monitor.bound_sensor("tip")
    flex = romerr.floating_body(scene.fem, scene.cms.AddObjectFFRFreducedOrder(scene.mbs))
    with pytest.raises(InputError, match=r"tolerance=1e-06: there are no outputs, .*; pass outputs= to attach"):
        romerr.attach(scene.mbs, flex, tolerance=1e-6)


def test_linear_body_needs_outputs():
    mbs, flex = added()
    with pytest.raises(InputError, match="outputs is missing"):
        romerr.attach(mbs, flex)
    monitor = romerr.attach(mbs, flex, outputs=[])
    mbs.Assemble()
    mbs.SolveDynamic(written())
    assert np.max(monitor.report().position_bound["auxiliary"]) > 0


# --- progress ---------------------------------------------------------------------


class Terminal:
    """A stderr that somebody looks at."""

    def __init__(self, looks):
        self.isatty = lambda: looks


@pytest.fixture
def shown(monkeypatch):
    """What a stand-in for tqdm was called with."""
    calls = []

    def tqdm(items, **options):
        calls.append(options)
        return iter(items)

    monkeypatch.setitem(sys.modules, "tqdm", types.SimpleNamespace(tqdm=tqdm))
    return calls


@pytest.mark.parametrize("looks", [True, False])
def test_progress_only_where_somebody_looks(looks, shown, monkeypatch, bar):
    expected = bar[1].node_bound["auxiliary"]
    monkeypatch.setattr(bars.sys, "stderr", Terminal(looks))
    scene, monitor = bare_bar()
    scene.solve()
    found = monitor.report().node_bound["auxiliary"]
    assert found.shape == expected.shape
    assert [call["desc"] for call in shown] == ["bounds at nodes"] * len(shown)
    assert bool(shown) == looks


def test_no_progress_without_tqdm(monkeypatch):
    monkeypatch.setattr(bars.sys, "stderr", Terminal(True))
    monkeypatch.setitem(sys.modules, "tqdm", None)  # importing it raises
    items = [1, 2]
    assert bars.progress(items, "text") is items
