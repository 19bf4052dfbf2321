"""Functions of time are called once for many times where that gives what single calls give, else one by one."""

import math
import warnings

import numpy as np
import pytest

from exudyn_romerr.mbs.floating.actions import over_time
from exudyn_romerr.trajectory.input_signal import COMPARED, InputSignal

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
    "branch": (1, lambda t: 1.0 if t < 1.0 else 2.0),
    "math": (3, lambda t: (0.0, math.sin(t), 0.0)),
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
    few = 2 + len(T) // COMPARED + 1
    assert counted.calls <= few if name in AT_ONCE else counted.calls >= len(T)


def test_loads_of_floating_bodies_are_called_at_once():
    counted = Counted(lambda t: [0.0, 5.0 * np.sin(7.0 * t), 0.0])
    repeated = np.repeat(T, 4)
    expected = np.array([counted.function(t) for t in repeated.tolist()])
    assert np.array_equal(over_time(counted, repeated), expected)
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
