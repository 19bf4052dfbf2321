"""One monitor for a mechanism: its bodies as with a monitor each, and sensors that are on none of them."""

import re
from itertools import chain

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface
from exudyn.utilities import InertiaCuboid

import exudyn_romerr as romerr
from exudyn_romerr.mbs.floating.sensor_outputs import NO_STATE
from exudyn_romerr.mbs.monitoring.monitor import NOT_TOLD
from exudyn_romerr.mbs.studies.two_level import build_trial
from exudyn_romerr.report.mechanism_report import MechanismReport
from models import floating, mechanisms
from tests.helpers import mbs_scenes
from tests.helpers.mechanism_runs import COUPLED, FROZEN, pendulum, solve
from tests.helpers.observed import attached_all, flexes, named, observed_all

T_END = 0.01  # s
BASIS = 2e-3  # of the error of the basis: what 26 vectors leave of it; measured 1.4e-3
# of the same, of accelerations and forces of joints: between readings 8 steps apart tangents are off by as much;
# measured 1.5e-3 and 2.7e-3, with more readings 4e-4 and 8e-4
ROUGH = 5e-3
BEGUN_ANEW = 0.03  # of the error: what two solves are wrong by differs from what one is; measured 0.023
SHOWN = ("Displacement", "Velocity", "Acceleration", "AngularVelocity")
CRANK = (*(f"crank {name}" for name in (*SHOWN, "Rotation")), "force of a joint")


def slider_crank(n=0, kind="RBE3", t_end=T_END):
    """A slider crank with sensors of its piston, of its crank and of a joint, a load and a function."""
    scene = mechanisms.slider_crank(n, kind, t_end=t_end)
    mbs = scene.mbs
    options = {"storeInternal": True}
    for body, name in (("piston", "Displacement"), *(("crank", name) for name in SHOWN), ("crank", "Rotation")):
        kind = getattr(exu.OutputVariableType, name)
        place = [mechanisms.CRANK_RADIUS, 0, 0] if body == "crank" else [0, 0, 0]
        sensor = itemInterface.SensorBody(
            name=f"{body} {name}",
            bodyNumber=scene.objects[body],
            localPosition=place,
            outputVariableType=kind,
            **options,
        )
        scene.sensors[f"{body} {name}"] = mbs.AddSensor(sensor)
    for sensor in (
        itemInterface.SensorObject(
            name="force of a joint",
            objectNumber=first_object(mbs, "JointGeneric"),
            outputVariableType=exu.OutputVariableType.ForceLocal,
            **options,
        ),
        itemInterface.SensorLoad(name="torque", loadNumber=0),
        itemInterface.SensorUserFunction(name="function", sensorUserFunction=lambda *_: [1.0]),
        itemInterface.SensorBody(
            name="ground",
            bodyNumber=first_object(mbs, "Ground"),
            outputVariableType=exu.OutputVariableType.Position,
        ),
    ):
        scene.sensors[sensor.name] = mbs.AddSensor(sensor)
    return scene


def first_object(mbs, kind):
    return next(i for i in range(mbs.systemData.NumberOfObjects()) if mbs.GetObject(i)["objectType"] == kind)


def shown(scene):
    """What sensors stored, by name."""
    return {
        name: scene.mbs.GetSensorStoredData(k)[:, 1:]
        for name, k in scene.sensors.items()
        if scene.mbs.GetSensor(k)["storeInternal"]
    }


@pytest.fixture(scope="module")
def run():
    """Scene and monitor of a short run of the slider crank."""
    scene = named(slider_crank())
    monitor = attached_all(scene)
    solve(scene)
    return scene, monitor


@pytest.fixture(scope="module")
def report(run):
    return run[1].report()


@pytest.mark.parametrize("tolerance", [None, {"tip 1 local": 1.0}])
def test_the_run_is_the_same_and_so_are_values(tolerance):
    """With blocks of steps, and where each step is evaluated before the next."""
    alone, watched = named(slider_crank()), named(slider_crank())
    names = ["tip 1 local", "piston Displacement", *CRANK]
    numbers = [watched.sensors[name] for name in names]
    monitor = attached_all(watched, outputs=numbers, tolerance=tolerance)
    for scene in (alone, watched):
        solve(scene)
    stored, report = shown(watched), monitor.report()
    for name, values in shown(alone).items():
        np.testing.assert_array_equal(values, stored[name])
    for name in ("piston Displacement", *CRANK):
        np.testing.assert_array_equal(report.output(name).value, stored[name])


def spring(n=0, kind="RBE3"):
    """A bar on springs with a sensor of the force of one."""
    scene = mechanisms.sprung_body(n, kind, t_end=T_END)
    sensor = itemInterface.SensorObject(
        objectNumber=scene.objects["left spring"],
        outputVariableType=exu.OutputVariableType.ForceLocal,
        storeInternal=True,
    )
    scene.sensors["force"] = scene.mbs.AddSensor(sensor)
    return scene


@pytest.mark.parametrize(("make", "names"), [(slider_crank, CRANK), (spring, ("force",))])
def test_the_basis_part_is_what_all_modes_show(make, names):
    """Same steps, so that only modes differ; of displacements and their rates, of angles, and of a spring's force."""
    scene, full = named(make()), named(make(kind="complete"))
    monitor = attached_all(scene, outputs=[scene.sensors[name] for name in names])
    for one in (scene, full):
        one.settings.timeIntegration.newton.relativeTolerance = 1e-12
        solve(one)
    reduced, truth, found = shown(scene), shown(full), monitor.report()
    assert list(found.outputs) == [*names]
    for name in names:
        error = truth[name] - reduced[name]
        off = np.abs(found.output(name).estimate_parts["basis"] - error).max()
        assert off <= (ROUGH if name in ("crank Acceleration", "force of a joint") else BASIS) * np.abs(error).max()


def test_studies_take_it_as_the_monitors_of_its_bodies():
    scene = pendulum()
    monitor = attached_all(scene)
    assert build_trial(lambda: (scene.mbs, monitor, scene.settings)).monitors == monitor.bodies


def test_lie_group_nodes_are_not_covered():
    """A rigid body of a Lie group node has no tangent: inputs are frozen, and the report says why."""
    scene = pendulum(0, steps=4)
    scene.mbs.CreateRigidBody(
        referencePosition=[0, 1, 0],
        inertia=InertiaCuboid(1000.0, [0.1, 0.2, 0.3]),
        initialAngularVelocity=[1.0, 2.0, 3.0],
        nodeType=exu.NodeType.RotationRotationVector,
    )
    report = observed_all(scene, outputs=[scene.sensors["tip 1"]])
    assert set(report.scope.values()) == {FROZEN}
    assert "RigidBodyRotVecLG is not covered" in report.scope_reason


def test_bodies_are_as_with_a_monitor_each():
    scene, both = pendulum(0), pendulum(0)  # eigenmodes differ in their last digits each time
    monitors = [romerr.attach(scene.mbs, flex) for flex in flexes(named(scene))]
    monitor = romerr.attach(both.mbs, flexes(named(both)))
    solve(scene)
    solve(both)
    report, reports = monitor.report(), [one.report() for one in monitors]
    for one, body in zip(reports, report.bodies, strict=True):
        assert (list(one.outputs), one.scope, one.plan) == (list(body.outputs), body.scope, body.plan)
        for name, out in one.outputs.items():
            for other in (body.output(name), report.output(name)):
                np.testing.assert_array_equal(other.estimate, out.estimate)
                np.testing.assert_array_equal(other.bound["best"], out.bound["best"])
    assert list(report.outputs) == list(chain(*(one.outputs for one in reports)))
    assert [len(runs) for runs in monitor.runs] == [2]


def test_sensors_without_estimate_say_why(report):
    left_out = dict(report.plan.left_out)
    for name in ("torque", "function"):
        assert left_out[name] == NO_STATE[{"torque": "Load", "function": "UserFunction"}[name]]
        assert name not in report.outputs
    assert any(line.startswith("estimated only, no bound of it is known: piston") for line in report.messages)


def test_a_sensor_has_an_estimate_and_no_bound(report):
    out = report.output("crank Displacement")
    assert (out.unit, out.estimate_scope, out.labels) == ("", COUPLED, ("x", "y", "z"))
    assert np.isinf(out.bound["best"]).all()
    assert np.abs(out.estimate).max() > 0
    assert {"loads", "linearisation of modes", "linearisation of steps"} <= set(out.uncertainty_parts)
    largest = np.abs(out.estimate).max()
    np.testing.assert_allclose(sum(out.estimate_parts.values()), out.estimate, atol=1e-15 * largest)
    assert report.assess("crank Displacement", 1.0).answer == "likely"


def test_bounds_of_bodies_are_asked_of_these(report):
    assert isinstance(report, MechanismReport)
    for ask in (
        lambda: report.position_bound["auxiliary"],
        lambda: report.velocity_bound["auxiliary"],
        lambda: report.node_bound,
    ):
        with pytest.raises(romerr.InputError, match=r"ask report\.bodies\[\.\.\.\]"):
            ask()
    with pytest.raises(romerr.InputError, match="attach with scope='inputs frozen'"):
        report.bodies[0].position_bound["auxiliary"].max()
    assert report.scope == {"auxiliary": COUPLED}


def test_a_saved_report_says_the_same(report, tmp_path):
    report.save(tmp_path / "run.npz")
    again = romerr.load_report(tmp_path / "run.npz")
    assert str(again) == str(report)
    assert [str(body) for body in again.bodies] == [str(body) for body in report.bodies]
    for name, x in report.to_dict().items():
        np.testing.assert_array_equal(again.to_dict()[name], x)
    assert "piston Displacement x estimate" in again.to_dict()
    with pytest.raises(romerr.InputError, match="bodies"):
        again.position_bound["auxiliary"]


def test_a_report_is_drawn_and_written(tmp_path):
    """One body, one output; the page draws both."""
    scene = slider_crank(t_end=0.002)
    report = observed_all(scene, outputs=[scene.sensors["piston Displacement"]])
    assert report.plot(tmp_path / "run.png").axes
    report.to_html(tmp_path / "run.html")
    assert "piston Displacement" in (tmp_path / "run.html").read_text(encoding="utf-8")


def test_the_plan_names_bodies_and_sensors(run):
    _, monitor = run
    assert not {name for name in dict(monitor.plan.left_out) if name.startswith(("piston", "crank"))}
    assert "output 'tip 1 local'" in str(monitor.plan)


def test_equal_names_are_refused_with_both_places_and_sensors_get_their_numbers():
    scene = pendulum()
    output = romerr.node_displacement("tip", node=mechanisms.MIDDLE, component="z")
    bodies = flexes(scene)
    with pytest.raises(romerr.InputError, match=r"'tip' is an output of flex\[0\] and of flex\[1\]"):
        romerr.attach(scene.mbs, bodies, outputs=[(flex, output) for flex in bodies])
    for name in ("tip 1", "tip 2"):
        scene.mbs.SetSensorParameter(scene.sensors[name], "name", "tip")
    monitor = romerr.attach(scene.mbs, bodies)
    solve(scene)
    names = [f"tip (sensor {scene.sensors[name]})" for name in ("tip 1", "tip 2")]
    assert all(monitor.report().output(name).estimate is not None for name in names)


@pytest.mark.parametrize(
    ("outputs", "said"),
    [
        ([99], "outputs contains sensor 99; the mbs has"),
        (99, "outputs is a int; needed: a list of sensors"),
        ([romerr.node_displacement("tip", node=0)], "of several bodies: a sensor's number or name, or"),
        (["tip"], "outputs names 'tip', and no sensor is called so; the mbs has sensors 0 '"),
    ],
)
def test_wrong_outputs_leave_nothing_attached(outputs, said):
    scene = pendulum()
    with pytest.raises(romerr.InputError, match=said):
        attached_all(scene, outputs=outputs)
    assert not scene.mbs.GetPostStepUserFunction()
    bodies = flexes(scene)
    again = romerr.floating_body(scene.fem, scene.bodies[0])
    for wrong, said in (
        ([], "flex is an empty list; needed: at least one body"),
        ([bodies[0], bodies[0]], r"flex\[0\] and flex\[1\] are the same body, object 0; list it once"),
        ([*bodies, again], r"flex\[0\] and flex\[2\] are the same body, object 0; list it once"),
    ):
        with pytest.raises(romerr.InputError, match=said):
            romerr.attach(scene.mbs, wrong)
    assert not scene.mbs.GetPostStepUserFunction()


def test_tolerances_and_bound_sensors_find_their_body():
    scene = pendulum()
    bodies = flexes(scene)
    outputs = [
        (flex, romerr.node_displacement(f"middle {i}", node=mechanisms.MIDDLE, component="z"))
        for i, flex in enumerate(bodies)
    ]
    with pytest.raises(romerr.InputError, match="tolerance names 'tip'; allowed: 'middle 0', 'middle 1'"):
        romerr.attach(scene.mbs, bodies, outputs=outputs, tolerance={"tip": 1.0})
    monitor = romerr.attach(scene.mbs, bodies, outputs=outputs, tolerance={"middle 1": 1e-3})
    shows = scene.mbs.AddSensor(monitor.bound_sensor("middle 1"))
    solve(scene)
    report = monitor.report()
    assert [report.output(name).tolerance for name in report.outputs] == [None, 1e-3]
    assert scene.mbs.GetSensorStoredData(shows)[-1, 1] > 0  # with inputs frozen
    assert set(report.scope.values()) == {COUPLED}
    with pytest.raises(romerr.InputError, match="output='tip' is unknown"):
        monitor.bound_sensor("tip")


def test_without_a_linearised_mechanism_sensors_are_left_out():
    scene = slider_crank(t_end=0.002)
    report = observed_all(scene, outputs=[scene.sensors["piston Displacement"]], scope=FROZEN)
    assert (report.outputs, report.scope["auxiliary"]) == ({}, FROZEN)
    assert dict(report.plan.left_out)["piston Displacement"] == NOT_TOLD
    assert f"scope={FROZEN!r} was asked for" in report.scope_reason


def test_a_second_solve_goes_on():
    whole, parts, found = slider_crank(t_end=0.008), slider_crank(t_end=0.008), []
    for scene in (whole, parts):
        monitor = attached_all(scene, outputs=[scene.sensors["piston Displacement"]])
        if scene is parts:
            scene.mbs.Assemble()
            time = scene.settings.timeIntegration
            time.endTime, time.numberOfSteps = 0.004, 8
            scene.mbs.SolveDynamic(scene.settings, updateInitialValues=True)
            time.startTime, time.endTime = 0.004, 0.008
        solve(scene)
        found.append(monitor.report().output("piston Displacement"))
    assert len(monitor.runs) == 2
    first, second = (out.estimate_parts["basis"][-9:] for out in found)
    assert np.all(second[0, 0] != 0)
    assert np.abs(first - second).max() <= BEGUN_ANEW * np.abs(first).max()


def test_a_changed_mbs_is_not_read():
    """A mass that a PostStep function changes: equations do not hold at stored steps, so inputs are frozen."""
    scene = slider_crank(t_end=0.004)

    def change(mbs, t):
        if t > 0.003:
            mbs.SetObjectParameter(scene.objects["piston"], "mass", 1.1 * mechanisms.PISTON_MASS)
        return True

    scene.mbs.SetPostStepUserFunction(change)
    report = observed_all(scene, outputs=[scene.sensors["piston Displacement"]])
    assert dict(report.plan.left_out)["piston Displacement"] == NOT_TOLD
    assert "parameters that the script changes" in report.scope_reason


# --- linear and floating bodies in one attach list: each is bounded as alone ---


SAME = 1e-3  # of the largest: bounds and estimates of 1e-10 m, beside what Newton leaves of 4e-4 m in two solves
COMPLETE = "complete"


def linear_bar(mbs):
    """A bar whose left face is fixed, under a force at its right face."""
    fem = floating.load_fem("bar")
    fixed = [3 * node + axis for node in floating.interface(fem, "left")[0] for axis in range(3)]
    body = romerr.ElasticBody.from_fem(fem, rayleigh=floating.RAYLEIGH, fixed=fixed)
    nodes, weights = floating.interface(fem, "right")
    inputs = np.zeros((body.N, 3))
    for axis in range(3):
        inputs[3 * nodes + axis, axis] = weights
    force = floating.ramped_force
    return romerr.add_reduced_body(mbs, body, romerr.modal_basis(body, 4), inputs=inputs, input_function=force)


def solved(linear, first=False):
    """Report of a double pendulum, of a linear bar, or of both; first: where this is in the list."""
    scene = pendulum(steps=20)
    bodies, outputs = flexes(scene), []
    for name in ("tip 1", "tip 2 local"):
        scene.mbs.SetSensorParameter(scene.sensors[name], "name", name)
        outputs.append(scene.sensors[name])
    if linear:
        flex = linear_bar(scene.mbs)
        node = itemInterface.SensorNode(
            name="modes",
            nodeNumber=flex.items["nGenericODE2"],
            outputVariableType=exu.OutputVariableType.Coordinates,
        )
        outputs += [(flex, romerr.node_displacement("linear tip", node=5)), scene.mbs.AddSensor(node)]
        bodies.insert(0 if first else 2, flex)
    monitor = romerr.attach(scene.mbs, bodies, outputs=outputs)
    solve(scene)
    return monitor.report()


@pytest.fixture(scope="module")
def alone():
    """Reports of the pendulum, and of the linear bar in an mbs of its own."""
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    monitor = romerr.attach(mbs, linear_bar(mbs), outputs=[romerr.node_displacement("linear tip", node=5)])
    mbs.Assemble()
    mbs.SolveDynamic(pendulum(steps=20).settings)
    return solved(linear=False), monitor.report()


@pytest.mark.parametrize("first", [True, False])
def test_bodies_of_both_kinds_are_bounded_as_alone(alone, first):
    """The linear body has no joint, and its load sees the time alone: it leaves the mechanism what it is."""
    both, (pendulums, bar) = solved(linear=True, first=first), alone
    scopes = [body.scope["auxiliary"] for body in both.bodies]
    assert scopes == ([COMPLETE, COUPLED, COUPLED] if first else [COUPLED, COUPLED, COMPLETE])
    for report, name in ((pendulums, "tip 1"), (pendulums, "tip 2 local"), (bar, "linear tip")):
        one, other = report.output(name), both.output(name)
        for wanted, found in ((one.estimate, other.estimate), (one.bound["best"], other.bound["best"])):
            finite = np.isfinite(wanted)
            assert np.array_equal(finite, np.isfinite(found))
            allowed = SAME * np.max(np.abs(wanted[finite]), initial=0.0)
            np.testing.assert_allclose(found[finite], wanted[finite], rtol=0, atol=allowed)
    most = 1.01 * np.max(bar.output("linear tip").bound["best"] + bar.output("linear tip").round_off)
    assert both.assess("linear tip", most).answer == bar.assess("linear tip", most).answer == "proven"
    assert "modes" not in both.outputs  # of the linear body's own coordinates


# --- outputs by the name of their sensor; the plan names all that is known, watched and left out ---


STEPS = {"h": 1e-3, "t_end": 0.004}


def one_bar(**options):
    """A pendulum with sensors "the tip", "the right" and, of its joint, "force"; its body."""
    scene = floating.pendulum(0, **STEPS, **options)  # eigenmodes differ in their last digits each time
    for name in ("tip", "right"):
        scene.mbs.SetSensorParameter(scene.sensors[name], "name", f"the {name}")
    joint = first_object(scene.mbs, "JointGeneric")
    shows = exu.OutputVariableType.ForceLocal
    scene.mbs.AddSensor(itemInterface.SensorObject(name="force", objectNumber=joint, outputVariableType=shows))
    return scene, romerr.floating_body(scene.fem, scene.items)


def reported(outputs, in_a_list=False):
    scene, flex = one_bar()
    monitor = romerr.attach(scene.mbs, [flex] if in_a_list else flex, outputs=outputs)
    solve(scene)
    return monitor.report()


@pytest.fixture(scope="module")
def by_number():
    scene, flex = one_bar()
    monitor = romerr.attach(scene.mbs, flex, outputs=[scene.sensors["tip"]])
    solve(scene)
    return monitor.report().output("the tip")


@pytest.mark.parametrize("outputs", ["the tip", ["the tip"], ("the tip",)])
def test_a_name_means_its_sensor(outputs, by_number):
    """Alone, or in a list: bounds are those of the number, to the last bit."""
    report = reported(outputs)
    assert list(report.outputs) == ["the tip"]
    np.testing.assert_array_equal(report.output("the tip").bound["best"], by_number.bound["best"])


@pytest.mark.parametrize("in_a_list", [False, True])
def test_what_a_report_calls_in_the_frame_can_be_asked_for(in_a_list):
    """Under the name that it has where sensors were not asked for."""
    scene, flex = one_bar()
    monitor = romerr.attach(scene.mbs, [flex] if in_a_list else flex)
    solve(scene)
    name = "the right in the frame"
    asked, found = reported([name], in_a_list).output(name), monitor.report().output(name)
    np.testing.assert_allclose(asked.value, found.value, rtol=1e-12)  # a product with fewer rows rounds otherwise
    assert np.isfinite(asked.bound["best"]).all()


def test_names_of_sensors_on_no_flexible_body():
    report = reported(["force", "the tip"], in_a_list=True)
    assert set(report.outputs) == {"force", "the tip"}
    scene, flex = one_bar()
    with pytest.raises(romerr.InputError, match=r"\(force\), of type 'Object', .*; attach\(mbs, \[flex\]\)"):
        romerr.attach(scene.mbs, flex, outputs=["force"])


def test_what_the_message_says_of_a_node_set_works():
    """Its code is run as it stands."""
    scene, flex = one_bar()
    with pytest.raises(romerr.InputError, match="'right' is a node set") as caught:
        romerr.attach(scene.mbs, flex, outputs="right")
    code = re.search(r"pass (romerr\..*)$", str(caught.value))[1]
    output = eval(code, {"romerr": romerr, "fem": scene.fem})
    monitor = romerr.attach(scene.mbs, flex, outputs=[output])
    solve(scene)
    assert np.isfinite(monitor.report().output("right").bound["best"]).all()


def test_a_name_that_several_sensors_have():
    scene, flex = one_bar()
    scene.mbs.SetSensorParameter(scene.sensors["right"], "name", "the tip")
    tip, right = scene.sensors["tip"], scene.sensors["right"]
    with pytest.raises(romerr.InputError, match=f"'the tip', which sensors {tip}, {right} are called: pass"):
        romerr.attach(scene.mbs, flex, outputs=["the tip"])


def test_a_linear_body_has_no_sensors():
    """The message has the code with the name that was asked for."""
    mbs = mbs_scenes.new_mbs()
    body = romerr.ElasticBody(np.eye(6), np.eye(6), positions=np.zeros((2, 3)))
    flex = romerr.add_reduced_body(mbs, body, romerr.Basis(np.eye(6)[:, :2]))
    for outputs in ("last", ["last"]):
        with pytest.raises(romerr.InputError, match=r"pass romerr.Output\('last', rows\) or"):
            romerr.attach(mbs, flex, outputs=outputs)


def test_a_plan_has_gravity_and_what_is_not_on_the_body():
    scene, flex = one_bar()
    monitor = romerr.attach(scene.mbs, flex)
    scene.mbs.Assemble()
    loads = [scene.mbs.GetLoad(i) for i in range(scene.mbs.systemData.NumberOfLoads())]
    gravity = next(i for i, load in enumerate(loads) if load["loadType"] == "MassProportional")
    assert f"known: gravity, load {gravity} ({loads[gravity]['name']})" in monitor.plan.computed
    assert "attach(mbs, [flex])" in dict(monitor.plan.left_out)["sensor 'force'"]


def test_a_plan_of_a_mechanism_lists_all_that_is_watched():
    """Before the run and after it; what the plans of all bodies leave out is there once."""
    scene = mechanisms.double_pendulum(1, **STEPS)
    joint = first_object(scene.mbs, "JointGeneric")
    for name in ("ForceLocal", "TorqueLocal"):
        shows = getattr(exu.OutputVariableType, name)
        scene.mbs.AddSensor(itemInterface.SensorObject(name=name, objectNumber=joint, outputVariableType=shows))
    monitor = attached_all(scene)
    scene.mbs.Assemble()
    before = monitor.plan
    solve(scene)
    report = monitor.report()
    for plan in (before, report.plan):
        assert "output 'ForceLocal': force, estimated, no bound" in plan.computed
        assert "output 'TorqueLocal': torque, estimated, no bound" in plan.computed
        assert all(any(f"output {name!r}: " in line for line in plan.computed) for name in report.outputs)


def test_a_plan_has_the_number_of_vectors():
    scene = floating.pendulum(2, **STEPS)
    for asked, count in (("auto", 26), (30, 30)):
        flex = romerr.floating_body(scene.fem, scene.items)
        scene.mbs.SetPostStepUserFunction(0)
        monitor = romerr.attach(scene.mbs, flex, auxiliary_modes=asked)
        scene.mbs.Assemble()
        assert f"modes by {count} vectors" in monitor.plan.computed[0]
