"""User functions that read a global mbs in place of their argument: the message names function and cure; it works."""

from functools import partial

import pytest
from exudyn import itemInterface

from exudyn_romerr.mbs.control.control_functions import OUTPUT
from exudyn_romerr.mbs.control.mbs_by_name import hint_of, read_outside
from models import mechanisms
from models.controlled_arm import LENGTH, arm
from tests.helpers.mbs_scenes import new_mbs
from tests.helpers.mechanism_runs import COUPLED, FROZEN
from tests.mbs.control.test_controllers import watched

mbs = None  # as scripts have it
SENSORS = []


def torque(_, t, loadVector):
    """A controller that looks at a node within the arm, as scripts often have it."""
    angle, rate = (-mbs.GetSensorValues(sensor)[2] / (LENGTH / 2) for sensor in SENSORS)
    return [0.0, -2e3 * angle - 20.0 * rate, 0.0]


def angle_of(sensor):
    """A function that the user function calls."""
    return -mbs.GetSensorValues(sensor)[2] / (LENGTH / 2)


def by_another(mbs, t, loadVector):
    return [0.0, -2e3 * angle_of(SENSORS[0]), 0.0]


def mended(mbs, t, loadVector):
    """The same, with its argument."""
    angle, rate = (-mbs.GetSensorValues(sensor)[2] / (LENGTH / 2) for sensor in SENSORS)
    return [0.0, -2e3 * angle - 20.0 * rate, 0.0]


def report_of(function):
    """Of an arm whose motor is a load by a user function."""
    global mbs
    scene = arm(steps=8)
    mbs = scene.mbs
    place = {"bodyNumber": scene.bodies[0]["oFFRFreducedOrder"], "meshNodeNumber": mechanisms.MIDDLE}
    kinds = (OUTPUT.Displacement, OUTPUT.Velocity)
    SENSORS[:] = [mbs.AddSensor(itemInterface.SensorSuperElement(outputVariableType=kind, **place)) for kind in kinds]
    motor = {"name": "motor", "markerNumber": scene.markers["left 1"], "loadVectorUserFunction": function}
    mbs.AddLoad(itemInterface.LoadTorqueVector(**motor))
    return watched(scene)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (torque, "the user function torque reads 'mbs' from outside"),
        (by_another, "the user function by_another calls angle_of, which reads 'mbs' from outside"),
    ],
    ids=["itself", "by another"],
)
def test_function_and_cure_are_named(function, words):
    report = report_of(function)
    assert {out.estimate_scope for out in report.outputs.values()} == {FROZEN}
    head = f"def {function.__name__}(mbs, t, loadVector)"
    lines = [line for line in str(report).splitlines() if "is a controller" in line or "its copy has" in line]
    assert any("its copy has" in line for line in lines)
    assert any("is a controller" in line for line in lines)
    for line in lines:
        assert words in line
        assert f"the mbs that it is given as its first argument, {head}" in line
    assert "load 1 (motor)" in str(report)
    assert "see the scope" not in str(report)


def test_the_cure_covers_the_scene():
    report = report_of(mended)
    assert {out.estimate_scope for out in report.outputs.values()} == {COUPLED}
    assert "Not covered by any estimate" not in str(report)
    assert "from outside" not in str(report)


class Motor:
    """A controller that keeps the mbs."""

    def __init__(self, owner):
        self.owner = owner

    def __call__(self, mbs, t, loadVector):
        return self.owner.GetSensorValues(0)

    def method(self, mbs, t, loadVector):
        return self.owner.GetSensorValues(0)


def test_wherever_python_lets_a_function_have_one():
    """Closures, defaults, partial arguments, attributes, lambdas; one that has none, and one that is given it."""
    owner = new_mbs()

    def closure(_, t):
        return owner.GetSensorValues(0)

    def default(_, t, own=owner):
        return own.GetSensorValues(0)

    def given(own, _, t):
        return own.GetSensorValues(0)

    def is_an_attribute(settings, t):
        return settings.mbs

    motor = Motor(owner)
    cases = {
        "owner": closure,
        "own": default,
        "an argument of partial": partial(given, owner),
        "self.owner": motor,
    }
    for variable, function in cases.items():
        assert [one.variable for one in read_outside([function])] == [variable]
    assert [one.variable for one in read_outside([motor.method])] == ["self.owner"]
    assert "def method(self, mbs, t, loadVector)" in hint_of([motor.method])
    assert "lambda mbs, t: ..." in hint_of([lambda _, t: owner.GetSensorValues(t)])
    assert read_outside([is_an_attribute, mended, max]) == []
