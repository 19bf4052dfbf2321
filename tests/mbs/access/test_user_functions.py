"""User functions: runs are the same bit for bit with and without us, whatever functions keep between their calls."""

import itertools
import random
import sys
import tempfile
import threading
import warnings
import weakref
from functools import lru_cache, partial
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from exudyn import itemInterface

from exudyn_romerr.mbs.access.detached import Detached, controller
from models import mechanisms
from tests.helpers.mechanism_runs import (
    FROZEN,
    STEP,
    add_load,
    add_spring,
    ground_marker,
    pendulum,
    reports,
    solve,
    watch,
)


def integral_of_the_mbs(scene):
    """PI controller that keeps its integral in mbs.variables, one step of it for each new time."""
    scene.mbs.variables["controller"] = {"t": 0.0, "integral": 0.0}

    def force(mbs, t, vector):
        kept, deflection = mbs.variables["controller"], mbs.GetSensorValues(scene.sensors["tip 1 local"])[1]
        if t > kept["t"]:
            kept["integral"] += deflection * (t - kept["t"])
            kept["t"] = t
        return [0.0, 10.0 - 1e5 * deflection - 1e7 * kept["integral"], 0.0]

    return force


def integral_of_every_call(scene):
    """Takes every call for a new step, as first attempts do, so weakly that Newton converges; in a closure."""
    integral = 0.0

    def force(mbs, t, vector):
        nonlocal integral
        deflection = mbs.GetSensorValues(scene.sensors["tip 1 local"])[1]
        integral += deflection * STEP
        return [0.0, 10.0 + 1e-3 * integral, 0.0]

    return force


class Controller:
    """The same by an object."""

    def __init__(self, scene):
        self.sensor, self.seen = scene.sensors["tip 1 local"], []

    def force(self, mbs, t, vector):
        self.seen.append(mbs.GetSensorValues(self.sensor)[1])
        return [0.0, 10.0 + 1e-6 * sum(self.seen), 0.0]


def counting(scene, calls=[0]):  # noqa: B006 (that is what is tried)
    """Load that grows by its calls, counted in a default value."""
    calls[0] = 0

    def force(mbs, t, vector, calls=calls):
        calls[0] += 1
        return [0.0, 10.0 + 1e-9 * calls[0], 0.0]

    return force


def of_numpy():
    np.random.seed(1)
    return np.random.rand


def of_random():
    random.seed(1)
    return random.random


def of_an_own_generator():
    generator = random.Random(1)
    return lambda: generator.random()


def of_a_function_that_is_called():
    calls = [0]

    def count():
        calls[0] += 1
        return calls[0]

    return lambda: 1e-2 * count()


def counting_in(calls):
    """What counts its calls in an attribute."""

    def count():
        calls.number += 1
        return 1e-2 * calls.number

    return count


def of_a_class():
    class Calls:
        number = 0

    return counting_in(Calls)


def of_an_object_that_cannot_be_pickled():
    class Calls:
        def __init__(self):
            self.number, self.share = 0, lambda: 1e-2

    calls = Calls()

    def count():
        calls.number += 1
        return calls.number * calls.share()

    return count


def of_a_partial():
    def count(calls, last=None):
        calls["number"] += 1
        return 1e-2 * calls["number"]

    return partial(count, {"number": 0}, last=[])


def of_slots():
    class Kept:
        __slots__ = ("number",)

    class Calls(Kept):
        __slots__ = ("later",)

    calls = Calls()
    calls.number = 0

    def count():
        calls.number += 1
        calls.later = getattr(calls, "later", 0) + 1  # not set before the first call
        return 1e-2 * (calls.number + calls.later)

    return count


def of_a_namespace():
    return counting_in(SimpleNamespace(number=0))


def of_a_module():
    module = ModuleType("settings")
    module.calls, module.seen = 0, {"number": 0}

    def count():
        module.calls += 1
        module.seen["number"] += 1
        return 1e-2 * (module.calls + module.seen["number"])

    return count


def of_an_object_in_a_list_beside_a_function():
    class Calls:
        pass

    kept = [Calls(), lambda x: 1e-2 * x]
    kept[0].number = 0

    def count():
        kept[0].number += 1
        return kept[1](kept[0].number)

    return count


def of_an_object_that_is_replaced():
    class Calls:
        def __init__(self, number):
            self.number = number

    calls = Calls(0)

    def count():
        nonlocal calls
        calls = Calls(calls.number + 1)
        return 1e-2 * calls.number

    return count


def of_a_global_in_an_inner_function():
    INNER["calls"] = 0

    def count():
        return sum(INNER.update(calls=INNER["calls"] + 1) or 1e-2 * INNER["calls"] for _ in range(2))

    return count


INNER = {"calls": 0}
HIDDEN = (
    of_numpy,
    of_random,
    of_an_own_generator,
    of_a_function_that_is_called,
    of_a_class,
    of_an_object_that_cannot_be_pickled,
    of_a_partial,
    of_slots,
    of_a_namespace,
    of_a_module,
    of_an_object_in_a_list_beside_a_function,
    of_an_object_that_is_replaced,
    of_a_global_in_an_inner_function,
)


def hidden(scene):
    """Load that sums all that is hidden, so weakly that Newton converges."""
    parts = [make() for make in HIDDEN]
    return lambda mbs, t, vector: [0.0, 10.0 + 1e-7 * sum(part() for part in parts), 0.0]


def counting_in_mbs_sys(scene):
    """Counts in mbs.sys, where Exudyn keeps its solvers."""
    scene.mbs.sys["calls"] = 0

    def force(mbs, t, vector):
        mbs.sys["calls"] += 1
        return [0.0, 10.0 + 1e-9 * mbs.sys["calls"], 0.0]

    return force


def of_a_generator(scene):
    """Load of a generator with yield, which nobody can put back."""
    numbers = (1e-9 * i for i in range(10**6))
    return lambda mbs, t, vector: [0.0, 10.0 + next(numbers), 0.0]


def of_a_counter(scene):
    """Load by an iterator in a default value: a copy of it could go on, but not in its place."""
    return lambda mbs, t, vector, numbers=itertools.count(): [0.0, 10.0 + 1e-9 * next(numbers), 0.0]  # noqa: B008


def setting_an_item(scene):
    """Load that makes a spring softer by every call: a parameter of the mbs is no variable that is put back."""
    number = add_spring(scene)

    def soften(mbs):
        mbs.SetObjectParameter(number, "stiffness", (1 - 1e-9) * mbs.GetObjectParameter(number, "stiffness"))

    def force(mbs, t, vector):
        soften(mbs)
        return [0.0, 10.0, 0.0]

    return force


OPEN = []


@pytest.fixture(autouse=True)
def _files_closed():
    yield
    while OPEN:
        OPEN.pop().close()


def of_an_open_file(scene):
    """Load that is read from a file, a line for each call."""
    lines = tempfile.TemporaryFile("w+")
    OPEN.append(lines)
    lines.writelines(f"{i}\n" for i in range(10**5))
    lines.seek(0)
    return lambda mbs, t, vector: [0.0, 10.0 + 1e-9 * float(lines.readline()), 0.0]


def cached_noise(scene):
    """Noise that is the same in all iterations of a step: of a generator, cached."""
    random_numbers = np.random.default_rng(0)

    @lru_cache(None)
    def noise(t):
        return random_numbers.normal()

    return lambda mbs, t, vector: [0.0, 10.0 + noise(t), 0.0]


def integral_over_time(scene):
    """Goes back exactly where it was when it is called at an earlier time; takes what it is given for a time."""
    kept = {"t": 0.0, "integral": 0.0}

    def force(mbs, t, vector):
        kept["integral"] += 1e-3 * (t - kept["t"])
        kept["t"] = t
        return [0.0, 0.0, 10.0 + 1e5 * kept["integral"]]

    return force


def counting_within(scene):
    """Counts in an array that a dict holds, and reads the array by a name of its own."""
    calls = np.zeros(2)
    kept = [{"calls": calls}]

    def force(mbs, t, vector):
        kept[0]["calls"][0] += 1
        return [0.0, 10.0 + 1e-9 * calls[0], 0.0]

    return force


LOADS = {
    "hidden": hidden,
    "within": counting_within,
    "integral over time": integral_over_time,
    "mbs.variables": integral_of_the_mbs,
    "closure": integral_of_every_call,
    "object": lambda scene: Controller(scene).force,
    "counting": counting,
    "mbs.sys": counting_in_mbs_sys,
    "generator": of_a_generator,
    "counter": of_a_counter,
    "open file": of_an_open_file,
    "item": setting_an_item,
    "cached noise": cached_noise,
}


def recorded(make, attached):
    """All sensors of a double pendulum, one of them by a user function that counts."""
    scene = pendulum(0, steps=40)  # eigenmodes differ in the last bits each time they are computed
    add_load(scene, loadVectorUserFunction=make(scene), name="motor")
    counts = []

    def counted(mbs, t, sensorNumbers, factors, configuration):
        counts.append(t)
        return [float(len(counts))]

    sensor = itemInterface.SensorUserFunction(storeInternal=True, sensorUserFunction=counted)
    numbers = [*scene.sensors.values(), scene.mbs.AddSensor(sensor)]
    if attached:
        watch(scene)
    solve(scene)
    return [scene.mbs.GetSensorStoredData(number) for number in numbers]


@pytest.mark.parametrize("name", LOADS)
def test_runs_are_the_same_with_and_without_us(name):
    """A memory that a call of ours moved on would show in the motion at once."""
    alone, watched = (recorded(LOADS[name], attached) for attached in (False, True))
    for one, other in zip(alone, watched, strict=True):
        np.testing.assert_array_equal(one, other)
    assert np.ptp(alone[0][:, 1:]) > 0


SAID = {
    "mbs.variables": "of the largest force",
    "generator": "cannot pickle 'generator' object",
    "open file": "cannot pickle",
}


@pytest.mark.parametrize("name", SAID)
def test_memory_that_matters_is_said(name):
    """Such a load cannot be called away from the run, or does something else there: frozen, and why is said."""
    scene = pendulum(0, steps=5)
    add_load(scene, loadVectorUserFunction=LOADS[name](scene), name="motor")
    for report in reports(scene):
        assert set(report.scope.values()) == {FROZEN}
        assert SAID[name] in report.scope_reason


@pytest.mark.parametrize("make", HIDDEN)
def test_copies_keep_what_is_the_functions_own(make):
    part = make()

    def load(mbs, t, vector):
        return [part(), 0.0, 0.0]

    first, state = None, random.getstate()
    for _ in range(2):
        detached = Detached(Space(), [load])
        with detached.in_use():
            found = [detached.of(load)(None, 0.0, None)[0] for _ in range(3)]
        first = first or found
    assert found == first
    assert len(set(found)) == 3
    assert random.getstate() == state


def driven_by_a_counter(attached):
    """Sensors of a bar on a spring whose other end a joint moves by an offset that counts its calls; scopes."""
    scene, calls = mechanisms.sprung_body(n=0, t_end=0.02), [0]
    mbs, scopes = scene.mbs, set()

    def offset(mbs, t, number, parameters):
        calls[0] += 1
        return [1e-3 * np.sin(100 * t) + 1e-9 * calls[0], 0.0, 0.0, 0.0, 0.0, 0.0]

    node = mbs.AddNode(itemInterface.NodeRigidBodyEP(referenceCoordinates=[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
    body = mbs.AddObject(itemInterface.RigidBody(mass=1.0, inertia=[1.0, 1.0, 1.0, 0.0, 0.0, 0.0], nodeNumber=node))
    marker = mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=body))
    ends = [ground_marker(scene, [0.0, 0.0, 0.0]), marker]
    mbs.AddObject(itemInterface.GenericJoint(markerNumbers=ends, offsetUserFunction=offset, name="drive"))
    ends = [marker, scene.markers["right 1"]]
    mbs.AddObject(itemInterface.CartesianSpringDamper(markerNumbers=ends, stiffness=[1e4] * 3))
    if attached:
        monitor = watch(scene)[0]
    solve(scene)
    if attached:
        scopes = {*monitor.report().scope.values(), "drive" in monitor.report().scope_reason}
    return np.hstack([mbs.GetSensorStoredData(number) for number in scene.sensors.values()]), scopes


def test_joints_that_remember_go_on_as_if_they_were_not_called():
    (alone, _), (watched, scopes) = driven_by_a_counter(False), driven_by_a_counter(True)
    np.testing.assert_array_equal(alone, watched)
    assert scopes == {"coupled (linearised)", False}  # 1e-9 of a call does no harm


def controllers(mbs):
    """Number -> name of loads that are no functions of time alone."""
    found = {i: controller(mbs, i, mbs.GetLoad(i)) for i in range(mbs.systemData.NumberOfLoads())}
    return {i: said for i, said in found.items() if said}


@pytest.mark.parametrize(("name", "kind"), [("generator", "generator"), ("open file", "TextIOWrapper")])
def test_what_cannot_be_put_back_is_not_called(name, kind):
    """Not once: the report says what it is."""
    scene = pendulum(0, steps=1)
    function, calls = LOADS[name](scene), []

    def load(mbs, t, vector):
        calls.append(t)
        return function(mbs, t, vector)

    add_load(scene, loadVectorUserFunction=load, name="motor")
    scene.mbs.Assemble()
    calls.clear()
    ((number, said),) = controllers(scene.mbs).items()
    assert said.startswith(f"load {number} (motor, whose function keeps what cannot be copied: ")
    assert kind in said
    assert not calls


def test_objects_of_a_script_are_no_memory():
    """A scene with its SystemContainer (which warns when it is pickled), what is printed to, locks, functions."""
    scene = pendulum(0, steps=1)
    others = {"lock": threading.Lock(), "mbs": weakref.ref(scene.mbs), "file": sys.stderr, "law": lambda t: t}

    def load(mbs, t, vector):
        assert scene.SC is not None
        return [0.0, others["law"](t) * np.pi, 0.0]

    add_load(scene, loadVectorUserFunction=load, name="ramp")
    scene.mbs.sys["scene"] = scene
    scene.mbs.Assemble()
    with warnings.catch_warnings(record=True) as said:  # as errors they would not get out of there
        warnings.simplefilter("always")
        assert controllers(scene.mbs) == {}
    assert not said  # Exudyn says it once in a process, so:
    assert scene.mbs.sys["scene"] is scene


class Space:
    """Stands for an mbs."""

    def __init__(self):
        self.variables, self.sys = {"list": [1], "number": 2}, {}


def test_copies_share_what_the_functions_share_and_the_run_keeps_its_own():
    mbs, array = Space(), np.zeros(2)
    one, owner = mbs.variables["list"], Controller.__new__(Controller)
    owner.seen = []

    def write(mbs):
        array[0] += 1.0
        mbs.variables["list"].append(5)
        mbs.variables["new"] = 4
        owner.seen.append(6)
        write.calls = 1

    def read(mbs):
        return array[0], len(owner.seen), len(mbs.variables["list"])

    detached = Detached(mbs, [write, read])
    with detached.in_use(mbs):
        assert not detached.has_changed()
        detached.of(write)(mbs)
        assert detached.has_changed()
        assert detached.of(read)(mbs) == (1.0, 1, 2)
        assert mbs.variables["new"] == 4
    assert mbs.variables == {"list": [1], "number": 2}
    assert mbs.variables["list"] is one
    assert array.tolist() == [0.0, 0.0]
    assert owner.seen == []
    assert not vars(write)
    assert read(mbs) == (0.0, 0, 1)


def test_functions_that_only_compute_have_not_changed():
    detached = Detached(None, [lambda t: np.sin(t), partial(np.interp, xp=[0.0, 1.0], fp=[0.0, 2.0])])
    for f in detached._functions:
        assert detached.of(f)(0.5) == f(0.5)
    assert not detached.has_changed()


def test_loads_are_told_apart():
    scene = pendulum(0, steps=1)
    add_load(scene, loadVectorUserFunction=lambda mbs, t, vector: [0.0, t, 0.0], name="ramp")
    add_load(scene, loadVectorUserFunction=counting(scene), name="motor")
    scene.mbs.Assemble()
    last = scene.mbs.systemData.NumberOfLoads() - 1
    assert controllers(scene.mbs) == {last: f"load {last} (motor)"}
