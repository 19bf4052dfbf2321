"""Functions of time are called once for many times where that gives what single calls give, else one by one."""

import math
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from exudyn_romerr.errors import AssumptionError, InputError
from exudyn_romerr.linear.residual.input_signal import COMPARED, InputSignal
from exudyn_romerr.mbs.floating.loads_and_joints import OfTime, over_time

T = np.linspace(0.0, 3.0, 1000)


class Counted:
    """A function, and how often it was called."""

    def __init__(self, function):
        self.function, self.calls = function, 0

    def __call__(self, t):
        self.calls += 1
        return self.function(t)


AT_ONCE = {
    "float": (1, lambda t: 3.0 * np.sin(t)),
    "array": (2, lambda t: np.array([np.sin(t), t**2])),
    "list, some constant": (3, lambda t: [0.0, np.cos(t), -9.81]),
    "table": (1, lambda t: np.interp(t, [0.0, 1.0, 3.0], [0.0, 2.0, 1.0])),
}
ONE_BY_ONE = {
    "constant": (1, lambda t: 2.0),
    "branch": (3, lambda t: [0, 0, 0] if t < 0.5 else [0.0, 5 * np.sin(t), 1.0]),
    "limits": (1, lambda t: max(0.0, min(t - 1.0, 0.5))),
    "math": (2, lambda t: (math.sin(t), float(t))),
    "largest of all": (2, lambda t: [np.max(np.stack([0 * t, np.sin(4 * t)])), 0.0]),
    "changes what it is given": (1, lambda t: np.multiply(t, 2.0, out=t) if np.ndim(t) else 3.0 * t),
}


@pytest.mark.parametrize("name", [*AT_ONCE, *ONE_BY_ONE])
def test_signal_is_what_single_calls_give(name):
    p, f = {**AT_ONCE, **ONE_BY_ONE}[name]
    counted, times = Counted(f), T.copy()
    found = InputSignal(counted, p)(times)
    assert np.array_equal(found, np.reshape([f(t) for t in T.tolist()], (len(T), p)))
    assert np.array_equal(times, T)
    assert counted.calls >= len(T) if name in ONE_BY_ONE else counted.calls <= 3 + len(T) // COMPARED


def test_loads_of_floating_bodies_are_called_at_once():
    counted = Counted(lambda t: [0.0, 5.0 * np.sin(7.0 * t), 0.0])
    repeated = np.repeat(T, 4)
    expected = np.array([counted.function(t) for t in repeated.tolist()])
    assert np.array_equal(over_time(OfTime(lambda _: counted), repeated), expected)
    assert counted.calls <= 2 + len(T) // COMPARED + 1


def quotient(t):
    """Return sin(t)/t; of an array NumPy divides by zero, too."""
    if np.ndim(t):
        return np.where(t > 0, np.sin(t) / t, 1.0)
    return np.sin(t) / t if t else 1.0


def test_warnings_that_only_an_array_gives_are_not_shown():
    counted = Counted(quotient)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = InputSignal(counted, 1)(T)
    assert np.array_equal(found[:, 0], [quotient(t) for t in T.tolist()])
    assert counted.calls < len(T)


def test_errors_of_math_are_the_users():
    with pytest.raises(InputError, match="raised ValueError"):
        InputSignal(lambda t: math.sqrt(2.9995 - t), 1)(T)


def test_a_value_at_the_first_of_many_times_is_no_constant():
    """Of two loads, as tests/helpers/total_truth.Signal gives them: a pulse between the times that are compared."""

    def pulse(t):
        times = np.atleast_1d(np.asarray(t))
        values = np.where((times > 1.001) & (times < 1.004), 1e3, 0.0)
        return [values[0], 0.0]

    assert InputSignal(pulse, 2)(np.linspace(0.0, 3.0, 4000))[:, 0].max() == 1e3


class Remembering:
    """A load that takes what it is given for a time, and keeps something of it from a time on."""

    def __init__(self, since):
        self.since, self.last, self.integral = since, 0.0, 0.0

    def __call__(self, mbs, t, vector):
        if np.max(t) > self.since:
            self.integral += 1e-3 * (t - self.last)
            self.last = t
        return [0.0, 0.0, 10.0 + self.integral]


def test_what_loads_keep_is_put_back_after_arrays_and_is_refused():
    """An integral over time takes arrays as if they were a time: none of them stays in it."""
    f, mbs = Remembering(since=0.5), SimpleNamespace(variables={}, sys={})
    vector = OfTime(lambda f: lambda t: f(mbs, t, None), f, lambda: mbs)
    early = np.linspace(0.0, 0.4, 9)
    assert np.array_equal(over_time(vector, early), np.tile([0.0, 0.0, 10.0], (9, 1)))
    with pytest.raises(AssumptionError, match="keeps something from call to call"):
        over_time(vector, T)
    assert (type(f.last), type(f.integral), f.last, f.integral) == (float, float, 0.0, 0.0)
