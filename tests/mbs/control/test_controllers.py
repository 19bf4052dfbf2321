"""Controllers in PreStep functions: sampled feedback, by the state at the begin of each step.

Truth: the same simulation with all modes, same steps; of time steps, Richardson's of 8 and 16 times as many, of first
order by the delay.
"""

from functools import cache

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface

from exudyn_romerr.report.assessment import steps_of
from models import controlled_arm, mechanisms
from models.controlled_arm import LENGTH, STEP, STEPS, add_load, add_spring, arm, controlled, pd, set_point, truth
from tests.helpers import tolerances as tol
from tests.helpers.mechanism_runs import COUPLED, FROZEN, ground_marker, pendulum, reports
from tests.helpers.observed import attached, attached_all, observed_all, shown

P, D = 2e3, 20.0  # Nm/rad, Nms/rad
TRUE = 24  # steps
SAME = 1e-6  # eigenmodes and vectors differ in their last bits each time, accelerations by 1e-7


def seen(scene):
    """What gives angle and rate of the arm, in an mbs."""
    marker, of = scene.markers["right 1"], exu.OutputVariableType
    sensors = [
        scene.mbs.AddSensor(itemInterface.SensorMarker(markerNumber=marker, outputVariableType=kind))
        for kind in (of.Displacement, of.Velocity)
    ]
    return lambda mbs: [-mbs.GetSensorValues(number)[2] / LENGTH for number in sensors]


def by_load(scene, torque):
    """Let a PreStep function set a load: torque(mbs, t, angle, rate) against the motion."""
    motion, place = seen(scene), {"markerNumber": scene.markers["left 1"]}
    load = scene.mbs.AddLoad(itemInterface.LoadTorqueVector(**place))

    def act(mbs, t):
        mbs.SetLoadParameter(load, "loadVector", [0.0, -torque(mbs, t, *motion(mbs)), 0.0])
        return True

    scene.mbs.SetPreStepUserFunction(act)


def by_variables(scene):
    """Write what the user function of a load reads."""
    motion, place = seen(scene), {"markerNumber": scene.markers["left 1"]}
    scene.mbs.variables["torque"] = 0.0

    def torque(mbs, t, vector):
        return [0.0, mbs.variables["torque"], 0.0]

    def act(mbs, t):
        mbs.variables["torque"] = -pd(P, D)(t, *motion(mbs))
        return True

    scene.mbs.AddLoad(itemInterface.LoadTorqueVector(**place, loadVectorUserFunction=torque))
    scene.mbs.SetPreStepUserFunction(act)


def by_gain(scene):
    """Set stiffness and offset of a spring, the first by the motion."""
    motion, motor = seen(scene), add_spring(scene, pd(P, D))
    for name, value in {"springTorqueUserFunction": 0, "stiffness": P, "damping": D}.items():
        scene.mbs.SetObjectParameter(motor, name, value)

    def act(mbs, t):
        angle, _ = motion(mbs)
        mbs.SetObjectParameter(motor, "stiffness", P * (1.0 + 5.0 * angle**2))
        mbs.SetObjectParameter(objectNumber=motor, parameterName="offset", value=set_point(t)[0])
        return True

    scene.mbs.SetPreStepUserFunction(act)


def by_joint(scene, of_time=True):
    """Move the hinge by a parameter of its offset, by time or by the motion."""
    motion, hinge = seen(scene), scene.objects["hinge"]
    add_spring(scene, pd(P, D))
    scene.mbs.SetObjectParameter(hinge, "offsetUserFunction", lambda mbs, t, number, offset: offset)

    def act(mbs, t):
        moved = set_point(t)[0] if of_time else motion(mbs)[0]
        mbs.SetObjectParameter(hinge, "offsetUserFunctionParameters", [0.0, 0.0, 0.02 * moved, 0.0, 0.0, 0.0])
        return True

    scene.mbs.SetPreStepUserFunction(act)


def by_global(scene):
    """See and set the mbs that is not given but known, as helpers of Exudyn's robots do."""
    motion, place, own = seen(scene), {"markerNumber": scene.markers["left 1"]}, scene.mbs
    load = own.AddLoad(itemInterface.LoadTorqueVector(**place))

    def act(mbs, t):
        own.SetLoadParameter(load, "loadVector", [0.0, -pd(P, D)(t, *motion(own)), 0.0])
        return True

    own.SetPreStepUserFunction(act)


def logging(scene):
    """Act as a PD controller, and keep what was done, which nobody reads."""
    log = []

    def torque(mbs, t, angle, rate):
        log.append(angle)
        return pd(P, D)(t, angle, rate)

    by_load(scene, torque)


def proportional(scene, limit=np.inf):
    by_load(scene, lambda mbs, *of: pd(P, D, limit)(*of))


WAYS = {
    "load": proportional,
    "variables": by_variables,
    "gain of a spring": by_gain,
    "joint by time": by_joint,
    "logs": logging,
    "global": by_global,
}


def solved(make, n=1, kind="RBE3", parts=1, steps=STEPS, watch=False):
    """What sensors show at the ends of whole steps, and the report, or None."""
    scene = arm(n, kind, steps=steps * parts, h=STEP / parts)
    make(scene)
    monitor = attached_all(scene) if watch else None
    scene.solve()
    shown = {key: scene.mbs.GetSensorStoredData(number)[::parts, 1:] for key, number in scene.sensors.items()}
    return shown, monitor and monitor.report()


@cache
def told(way):
    return solved(WAYS[way], watch=True)


def of_modes(out):
    return out.estimate_parts["basis"] + out.estimate_parts["interfaces"]


@pytest.mark.parametrize("way", ["load", "gain of a spring", "joint by time"])
def test_modes_are_told(way):
    """Off by 3e-5 of the error; truth: the first steps, for all modes take their time."""
    (own, report), (full, _) = told(way), solved(WAYS[way], 0, "complete", steps=TRUE)
    assert set(report.scope.values()) == {COUPLED}
    for key, values in own.items():
        error = full[key] - values[: TRUE + 1]
        assert np.abs(of_modes(report.output(key))[: TRUE + 1] - error).max() <= 1e-3 * np.abs(error).max()


@pytest.mark.parametrize("way", ["variables", "logs", "global"])
def test_other_ways_to_set_the_same_torque_have_the_same_answer(way):
    (_, report), (_, other) = told("load"), told(way)
    assert set(other.scope.values()) == {COUPLED}
    for key, out in report.outputs.items():
        size = np.abs(out.estimate).max()
        np.testing.assert_allclose(other.output(key).estimate, out.estimate, rtol=0, atol=SAME * size)


@pytest.mark.parametrize("way", ["load", "gain of a spring"])
def test_the_step_is_told_with_the_delay(way):
    """0.3 to 1.6 % off, within a third of half widths."""
    own, report = told(way)
    fine, finer = (solved(WAYS[way], parts=parts)[0] for parts in (8, 16))
    for key, values in own.items():
        out, error = report.output(key), 2 * finer[key] - fine[key] - values
        off = np.abs(out.estimate_parts["time step"] - error)
        assert off.max() <= 0.02 * np.abs(error).max()
        assert np.all(off <= out.uncertainty)
    assert steps_of(report).order == 1


def test_one_controller_in_three_ways_has_one_answer():
    """With short steps, where the delay matters little: largest errors by modes differ by less than a twentieth."""
    ways = {
        "PreStep": proportional,
        "load": lambda scene: add_load(scene, pd(P, D), at_node=False),
        "spring": lambda scene: add_spring(scene, pd(P, D)),
    }
    found = {}
    for way, make in ways.items():
        scene = arm(steps=4 * STEPS, h=STEP / 4)
        make(scene)
        report = observed_all(scene)
        found[way] = [np.abs(of_modes(report.output(key))).max() for key in scene.sensors]
    for way in ("load", "spring"):
        np.testing.assert_allclose(found["PreStep"], found[way], rtol=0.05)


def test_where_it_saturates_the_half_width_says_so():
    """The error by steps is so large that more of it saturates: 17 to 57 % off, within four fifths of half widths."""

    def make(scene):
        proportional(scene, limit=280.0)

    own, report = solved(make, watch=True)
    fine, finer = (solved(make, parts=parts)[0] for parts in (8, 16))
    for key, values in own.items():
        out, error = report.output(key), 2 * finer[key] - fine[key] - values
        off = np.abs(out.estimate_parts["time step"] - error)
        assert off.max() > 0.1 * np.abs(error).max()
        assert np.all(off <= out.uncertainty)


def test_one_that_only_records_costs_nothing():
    """Neither coverage nor bounds."""
    kept, found = [], []

    def records(scene):
        motion = seen(scene)
        scene.mbs.SetPreStepUserFunction(lambda mbs, t: kept.append(motion(mbs)) is None)

    for more in (seen, records):

        def make(scene, more=more):
            add_spring(scene, pd(P, D))
            more(scene)

        found.append(solved(make, 0, steps=20, watch=True)[1])
    assert len(kept) == 20
    assert np.isfinite(found[0].output("tip 1 local").bound["best"]).all()
    for key in found[0].outputs:
        one, other = (report.output(key) for report in found)
        np.testing.assert_allclose(other.estimate, one.estimate, rtol=0, atol=SAME * np.abs(one.estimate).max())
        np.testing.assert_array_equal(np.isfinite(other.bound["best"]), np.isfinite(one.bound["best"]))


def test_what_it_prints_is_printed_once(capsys):
    def torque(mbs, t, angle, rate):
        print("torque at", t)
        return pd(P, D)(t, angle, rate)

    solved(lambda scene: by_load(scene, torque), 0, steps=5, watch=True)
    assert capsys.readouterr().out.count("torque at") == 5


def test_a_sensor_of_what_it_sets_is_left_out():
    """A spring's torque: off at once where the stiffness is, which no gradient by the state tells."""
    scene = arm(steps=10)
    by_gain(scene)
    motor = scene.mbs.systemData.NumberOfObjects() - 1
    show = exu.OutputVariableType.TorqueLocal
    scene.mbs.AddSensor(itemInterface.SensorObject(name="torque", objectNumber=motor, outputVariableType=show))
    report = observed_all(scene)
    assert set(report.scope.values()) == {COUPLED}
    assert "torque" not in report.outputs
    assert dict(report.plan.left_out)["torque"] == "it shows what the PreStep function sets by what it sees"


# --- what is refused, and why ---------------------------------------------------------


def integrating(scene):
    kept = {"integral": 0.0}

    def torque(mbs, t, angle, rate):
        kept["integral"] += STEP * (angle - set_point(t)[0])
        return pd(P, D)(t, angle, rate) + 1e3 * kept["integral"]

    by_load(scene, torque)


def integrating_in_variables(scene):
    scene.mbs.variables["integral"] = 0.0

    def torque(mbs, t, angle, rate):
        mbs.variables["integral"] += STEP * (angle - set_point(t)[0])
        return pd(P, D)(t, angle, rate) + 1e3 * mbs.variables["integral"]

    by_load(scene, torque)


def noisy(scene):
    by_load(scene, lambda mbs, *of: pd(P, D)(*of) + np.random.normal())


def held(scene):
    """Sampled at every second step."""
    kept = {"t": 0.0, "torque": 0.0}

    def torque(mbs, t, angle, rate):
        if t - kept["t"] > 1.9 * STEP:
            kept.update(t=t, torque=pd(P, D)(t, angle, rate))
        return kept["torque"]

    by_load(scene, torque)


def by_accelerations(scene):
    place = {"bodyNumber": scene.bodies[0]["oFFRFreducedOrder"], "meshNodeNumber": mechanisms.MIDDLE}
    kind = exu.OutputVariableType.Acceleration
    sensor = scene.mbs.AddSensor(itemInterface.SensorSuperElement(outputVariableType=kind, **place))
    by_load(scene, lambda mbs, *of: pd(P, D)(*of) + 1e-3 * mbs.GetSensorValues(sensor)[2])


def by_another_mbs(scene):
    """As if it were coupled to another simulation, whose state goes on."""
    motion, other = seen(scene), arm(0, steps=20)
    other.mbs.Assemble()

    def torque(mbs, t, *of):
        other.mbs.systemData.SetTime(t)
        return pd(P, D)(other.mbs.systemData.GetTime(), *motion(mbs))

    by_load(scene, torque)


def failing_elsewhere(scene):
    own = scene.mbs
    by_load(scene, lambda mbs, *of: pd(P, D)(*of) if mbs is own else {}["key"])


def moving_a_joint(scene):
    by_joint(scene, of_time=False)


REFUSED = {
    integrating: "keeps something from call to call (an integrator",
    integrating_in_variables: "keeps something from call to call (an integrator",
    noisy: "keeps something from call to call",
    held: "at stored instants the equations are off",
    by_accelerations: "the PreStep function reads accelerations or forces",
    by_another_mbs: "cannot be called away from the run: AssumptionError a user function calls SetTime",
    failing_elsewhere: "the PreStep function cannot be called away from the run: KeyError",
    moving_a_joint: "the PreStep function moves joints by what it sees",
}


@pytest.mark.parametrize("make", REFUSED)
def test_what_is_no_sampled_feedback_is_refused_with_its_reason(make):
    report = solved(make, steps=20, watch=True)[1]
    assert set(report.scope.values()) == {FROZEN}
    assert REFUSED[make] in report.scope_reason
    for out in report.outputs.values():
        assert out.estimate_scope != COUPLED
    assert "romerr verify your_script.py" in str(report)


# --- controllers in user functions of springs and loads ---


MATTERS = 1e-7  # of an output: estimates of errors below are not asked for


def watched(scene, **options):
    """The report of a run, all sensors."""
    monitor = attached(scene, outputs=list(scene.sensors.values()), **options)
    scene.solve()
    return monitor.report()


@cache
def found(name):
    return watched(controlled(name))


def errors(name):
    """(Output, its reduction error (T, 3))."""
    for key, out in found(name).outputs.items():
        yield out, truth(name)[key] - out.value


def test_stored_truths_are_those_of_the_scene():
    """Their first steps, solved again."""
    for key, values in controlled_arm.solved("load", steps=3).items():
        wanted = truth("load")[key][:4]
        np.testing.assert_allclose(values, wanted, rtol=0, atol=1e-9 * np.abs(truth("load")[key]).max())


@pytest.mark.parametrize("name", controlled_arm.MOTORS)
def test_estimates_are_those_of_the_mechanism_and_bounds_are_above_errors(name):
    """Within 0.2 %; a sensor of a node in the body sees vectors, too: without them 115 %, and bounds 6 % below."""
    assert set(found(name).scope.values()) == {COUPLED}
    seen = 0
    for out, error in errors(name):
        assert out.estimate_scope == COUPLED
        basis = out.estimate_parts["basis"] + out.estimate_parts["interfaces"]
        size = np.abs(error).max(axis=0)
        noise = tol.MECHANISM_NEWTON * np.abs(out.value).max()
        assert np.all(np.abs(basis - error) <= out.uncertainty + noise)
        matters = size > MATTERS * np.abs(out.value).max()
        assert np.all(np.abs(basis - error).max(axis=0)[matters] <= 0.002 * size[matters])
        assert np.all(np.abs(error) <= out.bound["best"] + noise)
        assert "local" not in out.name or np.all(out.bound["best"].max(axis=0)[matters] <= 1.05 * size[matters])
        seen += matters.sum()
    assert seen >= 4


@pytest.mark.parametrize("name", ["spring", "load"])
def test_part_by_time_steps_is_within_its_half_width(name):
    """Truth: Richardson's, of 2 and 4 times as many steps; measured 2.3 % off."""
    out, runs = found(name).outputs["tip 1"], []
    for finer in (2, 4):
        scene = controlled(name, steps=finer * controlled_arm.STEPS, h=controlled_arm.STEP / finer)
        scene.solve()
        runs.append(scene.mbs.GetSensorStoredData(scene.sensors["tip 1"])[::finer, 1:])
    error = runs[1] + (runs[1] - runs[0]) / 3 - out.value
    left = error - out.estimate_parts["time step"]
    assert np.abs(left).max() <= 0.03 * np.abs(error).max()
    noise = tol.MECHANISM_NEWTON * np.abs(out.value).max()
    assert np.all(np.abs(left) <= out.uncertainty + noise)


# --- what switches, saturates, drives, remembers ------------------------------------

CONTROLS = {  # torque by time, angle, rate -> how far estimates are off, of the error
    "negative stiffness": (lambda t, x, v: 5e4 * t**2 - 1e3 * x, 2e-3),
    "negative damping": (lambda t, x, v: 5e4 * t**2 + 10.0 * x - 10.0 * v, 2e-3),
    "saturates": (pd(2e3, 20.0, limit=5.0), 1e-2),
    "nearly saturates": (pd(2e3, 20.0, limit=280.0), 2e-3),  # largest 269 Nm
    "switches": (lambda t, x, v: (1e3 if t < 0.0105 else 2e3) * x, 2e-3),
    "gets stiffer": (lambda t, x, v: 1e3 * (1.0 + 10.0 * t) * x, 2e-3),
    "rubs": (lambda t, x, v: 1e2 * x + (0.1 if v > 0.05 else 0.0), 2e-3),
    "rubs smoothly": (lambda t, x, v: 1e2 * x + 3.0 * float(np.tanh(v / 0.02)), 2e-3),
    "drives": (lambda t, x, v: (1e3 if t < 0.0105 else -1e3) * x, 2e-3),
    "cubic": (lambda t, x, v: 10.0 * x + 1e3 * x**3 + v, 2e-3),
}


@pytest.mark.parametrize("name", CONTROLS)
def test_what_a_controller_does_is_told(name):
    """As the bar bends, in its frame; truth: all modes. How a hinge turns is told within its half width alone."""
    control, off = CONTROLS[name]
    full, scene = arm(0, "complete", steps=30), arm(steps=30)
    for one in (full, scene):
        add_spring(one, control)
    full.solve()
    report = watched(scene)
    assert set(report.scope.values()) == {COUPLED}
    for key, number in full.sensors.items():
        out, y = report.output(key), full.mbs.GetSensorStoredData(number)[:, 1:]
        error, noise = y - out.value, tol.MECHANISM_NEWTON * np.abs(y).max()
        assert np.all(np.abs(error) <= out.bound["best"] + noise)
        left = np.abs(out.estimate_parts["basis"] - error)
        assert np.all(left <= out.uncertainty + noise)
        assert "local" not in key or left.max() <= off * np.abs(error).max() + noise


def sampled(every):
    """A PD controller that is sampled: its torque stays what it was until so many seconds are over."""
    kept = {"t": 0.0, "torque": 0.0}

    def control(t, angle, rate):
        if t - kept["t"] >= 0.99 * every:
            kept.update(t=t, torque=pd(2e3, 20.0)(t, angle, rate))
        return kept["torque"]

    return control


def test_a_controller_that_is_sampled_is_found_out_and_left_as_it_is():
    """No function of time and state is what it answers with; the run is that without us, bit for bit."""
    alone, scene = (arm(0, steps=8) for _ in range(2))
    for one in (alone, scene):
        add_spring(one, sampled(controlled_arm.STEP))
    alone.solve()
    report = watched(scene)
    for name, values in shown(alone).items():
        np.testing.assert_array_equal(shown(scene)[name], values)
    assert set(report.scope.values()) == {FROZEN}
    assert "the equations are off by" in report.scope_reason


# --- the same springs, as parameters and as functions -------------------------------

GAINS = {"stiffness": 2e4, "damping": 30.0}


def between(scene):
    """Ground beside the end of the second bar, and that end."""
    return [ground_marker(scene, [0.8, 0.02, 0.33]), scene.markers["right 2"]]


def on_a_mass(scene):
    """Ground and a coordinate of a mass point, which a spring joins to the end of the second bar."""
    _, end = between(scene)
    body = scene.mbs.AddObject(
        itemInterface.MassPoint(
            mass=1.0,
            nodeNumber=(node := scene.mbs.AddNode(itemInterface.NodePoint(referenceCoordinates=[0.8, 0.02, 0.03]))),
        )
    )
    at = scene.mbs.AddMarker(itemInterface.MarkerBodyPosition(bodyNumber=body))
    scene.mbs.AddObject(itemInterface.CartesianSpringDamper(markerNumbers=[at, end], stiffness=[1e5] * 3))
    fixed = scene.mbs.AddNode(itemInterface.NodePointGround())
    coordinate = itemInterface.MarkerNodeCoordinate
    return [scene.mbs.AddMarker(coordinate(nodeNumber=of, coordinate=2)) for of in (fixed, node)]


def vector(mbs, t, number, x, v, k, d, offset):
    return [GAINS["stiffness"] * a + GAINS["damping"] * b for a, b in zip(x, v, strict=True)]


def number(mbs, t, number, x, v, k, d, last):
    return GAINS["stiffness"] * x + GAINS["damping"] * v


KINDS = {
    "Cartesian": (itemInterface.CartesianSpringDamper, between, {k: [x] * 3 for k, x in GAINS.items()}, vector),
    "along a line": (itemInterface.SpringDamper, between, GAINS | {"referenceLength": 0.25}, number),
    "linear": (itemInterface.LinearSpringDamper, between, GAINS | {"axisMarker0": [0, 0, 1]}, number),
    "coordinate": (itemInterface.CoordinateSpringDamper, on_a_mass, GAINS, number),
    "torsional": (itemInterface.TorsionalSpringDamper, between, GAINS, number),
}


@pytest.mark.parametrize("kind", KINDS)
def test_springs_by_functions_are_told_as_springs(kind):
    item, markers, parameters, function = KINDS[kind]
    runs = []
    for by_function in (False, True):
        scene = pendulum(0, steps=10)
        key = "springTorqueUserFunction" if kind == "torsional" else "springForceUserFunction"
        gains = {k: 0.0 * np.array(x) if by_function and k in GAINS else x for k, x in parameters.items()}
        gains = {k: x.tolist() if isinstance(x, np.ndarray) else x for k, x in gains.items()}
        scene.mbs.AddObject(item(markerNumbers=markers(scene), **gains, **({key: function} if by_function else {})))
        runs.append(reports(scene))
    for pair in zip(*runs, strict=True):
        assert [set(report.scope.values()) for report in pair] == [{COUPLED}] * 2
        one, other = (report.output("probe") for report in pair)
        np.testing.assert_allclose(other.estimate, one.estimate, rtol=0, atol=1e-6 * np.abs(one.estimate).max())
        x, y = one.bound["best"], other.bound["best"]  # with margins of all rows under functions, else of few
        np.testing.assert_allclose(y, x, rtol=0, atol=0.01 * np.abs(x).max())


# --- torsional springs that count whole turns ---------------------------------------


def turned(by, counts):
    """Report of an arm that a spring turns by an angle in rad; counts : whether a node counts its whole turns."""
    scene = arm(0, steps=40)
    motor, mbs = add_spring(scene, pd(0.0, 0.0)), scene.mbs
    for name, value in {"springTorqueUserFunction": 0, "stiffness": 1e3, "damping": 5.0, "offset": by}.items():
        mbs.SetObjectParameter(motor, name, value)
    if counts:
        node = itemInterface.NodeGenericData(numberOfDataCoordinates=1, initialCoordinates=[0.0])
        mbs.SetObjectParameter(motor, "nodeNumber", mbs.AddNode(node))
    return watched(scene)


def test_a_node_that_counts_turns_changes_nothing_within_half_a_turn():
    """As Exudyn's own CreateTorsionalSpringDamper adds it."""
    one, other = (turned(1.0, counts) for counts in (False, True))
    assert set(other.scope.values()) == {COUPLED}
    for key, out in one.outputs.items():
        size = np.abs(out.estimate).max()
        np.testing.assert_allclose(other.output(key).estimate, out.estimate, rtol=0, atol=1e-6 * size)


def test_beyond_half_a_turn_such_a_spring_is_not_covered():
    """The arm comes to 5 rad; a copy that does not count would pull it back."""
    report = turned(5.0, True)
    assert set(report.scope.values()) == {FROZEN}
    assert "the equations are off by" in report.scope_reason
