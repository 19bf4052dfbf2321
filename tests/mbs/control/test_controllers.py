"""Controllers in user functions of springs and loads: what they answer the error with is in estimates and bounds.

Truth: the same simulation with all modes, same steps, stored (models/controlled_arm.py); of time steps, Richardson's.
"""

from functools import cache

import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from models import controlled_arm
from models.controlled_arm import add_spring, arm, controlled, pd, truth
from tests.helpers import tolerances as tol
from tests.helpers.mechanism_runs import COUPLED, FROZEN, ground_marker, pendulum, reports

MATTERS = 1e-7  # of an output: estimates of errors below are not asked for


def watched(scene, **options):
    """The report of a run, all sensors."""
    flex = romerr.floating_body(scene.fem, scene.bodies[0])
    monitor = romerr.attach(scene.mbs, flex, outputs=list(scene.sensors.values()), **options)
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


def with_and_without_bounds(make):
    """What all sensors of a scene show, twice."""
    runs = []
    for solve in (watched, lambda scene: scene.solve()):
        scene = make()
        solve(scene)
        runs.append([scene.mbs.GetSensorStoredData(number) for number in scene.sensors.values()])
    return runs


def test_nothing_of_the_run_changes():
    """Bit for bit, with a controller that is called beside the run; eigenmodes differ in the last bits each time."""
    np.testing.assert_array_equal(*with_and_without_bounds(lambda: controlled("load by a node", 0, steps=20)))


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
    full, scene = arm(0, "complete", steps=40), arm(steps=40)
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


def held(every):
    """A PD controller that is sampled: its torque stays what it was until so many seconds are over."""
    kept = {"t": 0.0, "torque": 0.0}

    def control(t, angle, rate):
        if t - kept["t"] >= 0.99 * every:
            kept.update(t=t, torque=pd(2e3, 20.0)(t, angle, rate))
        return kept["torque"]

    return control


def test_a_controller_that_is_sampled_is_found_out_and_left_as_it_is():
    """No function of time and state is what it answers with; the run is that without us, bit for bit."""

    def made():
        scene = arm(0, steps=8)
        add_spring(scene, held(controlled_arm.STEP))
        return scene

    np.testing.assert_array_equal(*with_and_without_bounds(made))
    report = watched(made())
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
        for x, y in ((one.estimate, other.estimate), (one.bound["best"], other.bound["best"])):
            np.testing.assert_allclose(y, x, rtol=0, atol=1e-6 * np.abs(x).max())


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
