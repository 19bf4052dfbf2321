"""Functions of time are called once for many times where that gives what single calls give, else one by one."""

import math
import warnings
from math import sin
from types import SimpleNamespace

import numpy as np
import pytest

from exudyn_romerr.errors import AssumptionError, InputError
from exudyn_romerr.linear.residual.input_signal import COMPARED, InputSignal
from exudyn_romerr.mbs.floating.loads_and_joints import OfTime, over_time

T = np.linspace(0.0, 3.0, 1000)
LAST_DIGITS = 1e-15  # of the largest value: NumPy's functions and those of math differ in their last digit
FINE = np.linspace(0.0, 3.0, 4000)


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
BRANCHES = {
    "branch": (1, lambda t: 1.0 if t < 1.0 else 2.0),
    "ramp": (3, lambda t: [0, 0, 0] if t < 0.5 else [0.0, 5 * np.sin(t), 1.0] if t <= 2 else [0.0, 0.0, np.exp(-t)]),
    "limits": (1, lambda t: max(0.0, min(t - 1.0, 0.5))),
    "periods": (2, lambda t: (t % 1.0, 0.0) if t % 1.0 > 0.4 and not t > 2.5 else (0.0, 1.0)),
    "pulse": (1, lambda t: 1e3 * (t - 1.0) if 1.0 < t < 1.004 else 0.0),
}
ONE_BY_ONE = {
    "many branches": (1, lambda t: 1.0 if t % 0.1 < 0.05 else 0.0),
    "largest of all": (2, lambda t: [np.max(np.stack([0 * t, np.sin(4 * t)])), 0.0]),
    "changes what it is given": (1, lambda t: np.multiply(t, 2.0, out=t) if np.ndim(t) else 3.0 * t),
}


@pytest.mark.parametrize("name", [*AT_ONCE, *BRANCHES, *ONE_BY_ONE])
def test_signal_is_what_single_calls_give(name):
    p, f = {**AT_ONCE, **BRANCHES, **ONE_BY_ONE}[name]
    given = T if name in AT_ONCE else FINE
    counted, times = Counted(f), given.copy()
    found = InputSignal(counted, p)(times)
    assert np.array_equal(found, np.reshape([f(t) for t in given.tolist()], (len(given), p)))
    assert np.array_equal(times, given)
    if name in ONE_BY_ONE:
        assert counted.calls >= len(given)
    else:  # for each of up to five places where it branches parts are halved ten times, each with two calls more
        assert counted.calls <= 3 + len(given) // COMPARED + (0 if name in AT_ONCE else 5 * 10 * 4)


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


def helper(t):
    return math.exp(-t) * sin(9.0 * t)


def load(mbs, t, vector):
    """As users write it."""
    if t < 0.5:
        return [0.0, vector[1] * helper(t), 0.0]
    return [math.pi * vector[0], 0.0, -math.sqrt(t) * vector[2]]


def test_functions_with_math_are_called_at_once():
    vector, times = np.array([2.0, 3.0, 5.0]), FINE[1:]
    counted = []

    def f(t):
        counted.append(t)
        return load(None, t, vector)

    expected = np.array([load(None, t, vector) for t in times.tolist()])
    assert np.all(
        np.abs(over_time(OfTime(lambda _: f), times) - expected) <= LAST_DIGITS * np.abs(expected).max(axis=0)
    )
    assert len(counted) < 150
    found = InputSignal(lambda t: math.sin(t), 1)(FINE)
    np.testing.assert_allclose(found[:, 0], np.sin(FINE), rtol=0, atol=LAST_DIGITS)


def smooth_start(t):
    return [float(np.sin(np.pi / 2 * min(t / 1.5, 1.0)) ** 4) * g for g in (0.0, 0.5, -9.81)]


def limited(t):
    rate = max(0.1, min(1.0, float(t), 3.0 - t), float("-inf"))
    return (rate if rate > 0.5 else 0.5, max([0.0, 1.0]), min(t, t * t))


@pytest.mark.parametrize("f", [smooth_start, limited])
def test_functions_with_min_max_and_float_are_called_at_once(f):
    """Values are those of single calls but for the last digit, which sin of many times may differ in."""
    calls = []

    def counted(t):
        calls.append(t)
        return f(t)

    found, expected = InputSignal(counted, 3)(FINE), np.array([f(t) for t in FINE.tolist()])
    assert np.all(np.abs(found - expected) <= LAST_DIGITS * np.abs(expected).max(axis=0))
    assert len(calls) < len(FINE) // 4


MATH_ONE_BY_ONE = {
    "three arguments": lambda t: math.hypot(1.0, 2.0, t),
    "whole numbers": lambda t: float(math.factorial(3)) + [1.0, 2.0, 3.0, 4.0][math.floor(t)],
    "a base": lambda t: math.log(t + 2.0, 10),
}


@pytest.mark.parametrize("name", MATH_ONE_BY_ONE)
def test_what_numpy_lacks_is_called_one_by_one(name):
    f = MATH_ONE_BY_ONE[name]
    assert np.array_equal(InputSignal(f, 1)(FINE)[:, 0], [f(t) for t in FINE.tolist()])


def test_errors_of_math_are_the_users():
    """NumPy gives nan there."""
    with pytest.raises(InputError, match="raised ValueError"):
        InputSignal(lambda t: math.sqrt(2.9995 - t), 1)(FINE)


COUNTER = 0


def counting(t):
    global COUNTER
    COUNTER += 1
    return math.cos(t)


def test_what_functions_write_is_not_written_by_their_copies():
    """Single calls are the user's own."""
    InputSignal(counting, 1)(FINE)
    assert 0 < COUNTER < 100


def test_whole_numbers_to_powers_do_not_overflow():
    """10^20 does as a whole number of NumPy's; in a pulse between the times that are compared nothing else tells."""
    t = np.linspace(0.0, 1.0, 8 * COMPARED + 1)
    middle = t[4 * COMPARED + COMPARED // 2]

    def pulse(x):
        return 1e-20 * math.pow(10, 20) * math.exp(-(((x - middle) / 5e-4) ** 2))

    np.testing.assert_allclose(
        InputSignal(pulse, 1)(t)[:, 0], [pulse(x) for x in t.tolist()], rtol=LAST_DIGITS, atol=LAST_DIGITS
    )


def test_bases_of_logarithms_stay_what_they_are():
    base = np.array(10.0)
    InputSignal(lambda t: math.sin(t) * math.log(5.0, base), 1)(FINE)
    assert base == 10.0


def test_a_value_at_the_first_of_many_times_is_no_constant():
    """Of two loads, as tests/helpers/total_truth.Signal gives them: a pulse between the times that are compared."""

    def pulse(t):
        times = np.atleast_1d(np.asarray(t))
        values = np.where((times > 1.001) & (times < 1.004), 1e3, 0.0)
        return [values[0], 0.0]

    assert InputSignal(pulse, 2)(FINE)[:, 0].max() == 1e3


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
