"""Functions that only compute: told apart, whatever a function can do to keep something."""

import math
import random
from functools import lru_cache, partial
from types import FunctionType, SimpleNamespace

import numpy as np
import pytest

from exudyn_romerr.mbs.memory import user_memory
from exudyn_romerr.mbs.memory.plain_functions import keep_nothing
from exudyn_romerr.mbs.memory.user_memory import memory_kept
from models import mechanisms

GRAVITY, LEVELS, CALLS, ARRAY, NUMBER = [0.0, 0.0, -9.81], (1.0, 2.0), [0], np.zeros(3), 0.0
KEPT, GENERATOR = {}, random.Random(1)


def helper(t):
    return math.exp(-t) * min(t, LEVELS[1])


def after(start):
    """A function with a start of its own."""

    def load(mbs, t, vector):
        return [0.0 if t < start else helper(t - start), *vector[1:]]

    return load


def summed(mbs, t, vector, share=(0.5, 0.5), *, offset=0.0):
    total = offset
    for i, x in enumerate(share):
        total += x * np.sin(i * t)
    return [total, max(0.0, float(np.clip(t, 0, 1))), abs(np.pi - t)]


def by_cases(mbs, t, vector):
    if not 0.0 < t <= 1.0:
        return [0.0] * 3
    scaled = [x**2 / 2 for x in GRAVITY if x != 0]
    return [scaled[0], *np.array(GRAVITY)[:2]]


PLAIN = {
    "gravity of the models": mechanisms._gravity,
    "closure": after(0.1),
    "defaults": summed,
    "branches": by_cases,
    "lambda": lambda t: (math.sin(t), 2.0),
    "constant": lambda mbs, t, vector: GRAVITY,
}


@pytest.mark.parametrize("name", PLAIN)
def test_what_only_computes_is_found(name):
    assert keep_nothing([PLAIN[name]])


def sets_a_global(mbs, t, vector):
    global NUMBER
    NUMBER += 1.0
    return [NUMBER, 0.0, 0.0]


def of_a_nonlocal():
    last = 0.0

    def load(mbs, t, vector):
        nonlocal last
        last = t
        return [last, 0.0, 0.0]

    return load


def of_an_inner_function():
    last = 0.0

    def load(mbs, t, vector):
        def inner():
            nonlocal last
            last += t
            return last

        return [inner(), 0.0, 0.0]

    return load


def with_a_list(mbs, t, vector, calls=[0.0]):  # noqa: B006 (that is what is tried)
    calls += [t]
    return [calls[-1], 0.0, 0.0]


def longer(calls):
    calls += [1.0]
    return calls[-1]


def calls_one_that_adds(mbs, t, vector):
    return [longer(CALLS), 0.0, 0.0]


def counts(mbs, t, vector):
    CALLS[0] += 1
    return [CALLS[0], 0.0, 0.0]


def loops_over_an_entry(mbs, t, vector):
    for CALLS[0] in (t, 2 * t):
        pass
    return vector


def appends(mbs, t, vector):
    CALLS.append(t)
    return vector


def deletes(mbs, t, vector):
    del CALLS[0]
    return vector


def attribute_of_itself(mbs, t, vector):
    attribute_of_itself.last = t
    return vector


def by_name(mbs, t, vector):
    setattr(by_name, "last", t)  # noqa: B010 (that is what is tried)
    return vector


def in_globals(mbs, t, vector):
    globals()["NUMBER"] = t
    return vector


def imports(mbs, t, vector):
    from random import random as draw

    return [draw(), 0.0, 0.0]


def evaluates(mbs, t, vector):
    return eval("CALLS.append(t)")


def writes_to_an_array(mbs, t, vector):
    np.sin(t, ARRAY)
    return ARRAY


def adds_to_a_list_by_numpy(mbs, t, vector):
    np.add.at(ARRAY, 0, t)
    return ARRAY


def of_a_generator_expression(mbs, t, vector, numbers=iter(range(10**6))):  # noqa: B008
    return [next(numbers), 0.0, 0.0]


def counting_namespace():
    class Names(dict):
        """Globals that keep what is asked."""

    def load(mbs, t, vector):
        return [NUMBER, 0.0, 0.0]

    return FunctionType(load.__code__, Names(NUMBER=1.0))


@lru_cache(None)
def cached(mbs, t, vector):
    return vector


class Number(float):
    """A number that counts what is done with it."""

    def __mul__(self, other):
        CALLS[0] += 1
        return other


SPECIAL = Number(2.0)

REMEMBERING = {
    "global": sets_a_global,
    "nonlocal": of_a_nonlocal(),
    "nonlocal of an inner function": of_an_inner_function(),
    "default": with_a_list,
    "list handed over": calls_one_that_adds,
    "entry": counts,
    "entry of a loop": loops_over_an_entry,
    "append": appends,
    "delete": deletes,
    "attribute": attribute_of_itself,
    "setattr": by_name,
    "globals()": in_globals,
    "import": imports,
    "eval": evaluates,
    "array": writes_to_an_array,
    "array by at": adds_to_a_list_by_numpy,
    "iterator": of_a_generator_expression,
    "namespace": counting_namespace(),
    "cache": cached,
    "partial": partial(counts, None),
    "number of a class": lambda mbs, t, vector: [SPECIAL * t, 0.0, 0.0],
    "random": lambda mbs, t, vector: [random.random(), 0.0, 0.0],
    "random of numpy": lambda mbs, t, vector: [np.random.rand(), 0.0, 0.0],
    "own generator": lambda mbs, t, vector: [GENERATOR.random(), 0.0, 0.0],
    "variables of the mbs": lambda mbs, t, vector: mbs.variables.setdefault("t", t),
    "sensor": lambda mbs, t, vector: mbs.GetSensorValues(0),
    "dict": lambda mbs, t, vector: KEPT.update(t=t),
    "object": SimpleNamespace(calls=0).__init__,
    "one of them": lambda mbs, t, vector: [helper(t), counts(mbs, t, vector)[0], 0.0],
    "not there yet": lambda mbs, t, vector: [later(t), 0.0, 0.0],  # noqa: F821 (that is what is tried)
}


@pytest.mark.parametrize("name", REMEMBERING)
def test_what_may_keep_something_is_none(name):
    assert not keep_nothing([REMEMBERING[name]])
    assert not keep_nothing([PLAIN["branches"], REMEMBERING[name]])


def test_what_names_stand_for_is_looked_up_each_time(monkeypatch):
    """A function that was plain is none when a name of it is another one, of its own module or of NumPy."""
    counted = []
    assert keep_nothing([summed])
    monkeypatch.setattr(np, "sin", lambda x: counted.append(x) or 0.0)
    assert not keep_nothing([summed])
    monkeypatch.undo()
    assert keep_nothing([after(0.1)])
    monkeypatch.setitem(globals(), "LEVELS", ARRAY)
    assert not keep_nothing([after(0.1)])
    monkeypatch.setitem(globals(), "max", lambda *x: counted.append(x) or 0.0)  # in place of the builtin
    assert not keep_nothing([summed])


def test_memory_of_plain_functions_is_not_searched(monkeypatch):
    mbs, searched = SimpleNamespace(variables={"list": [1]}, sys={}), []
    search = user_memory.MemorySearch
    monkeypatch.setattr(user_memory, "MemorySearch", lambda *args: searched.append(args) or search(*args))
    with memory_kept(mbs, [summed, by_cases]) as memory:
        assert not memory.changed
    assert not memory.was_changed
    assert not searched
    for functions in ([summed, counts], []):  # without functions it is not known what is called within
        with memory_kept(mbs, functions):
            CALLS[0] += 1 if functions else 0
        assert searched.pop()[0] == functions
    assert CALLS == [0]
