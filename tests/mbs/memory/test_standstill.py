"""While a hook evaluates steps: functions are called once for a time, and searched once for what they keep."""

import ctypes
import itertools
import math
import warnings
from array import array
from collections import OrderedDict, defaultdict, deque, namedtuple
from types import SimpleNamespace

import numpy as np
import pytest

from exudyn_romerr.mbs.floating import actions
from exudyn_romerr.mbs.memory import own_modules, user_memory
from exudyn_romerr.mbs.memory.standstill import no_step_is_made
from exudyn_romerr.mbs.memory.user_memory import memory_kept
from models import mechanisms
from tests.helpers import calls
from tests.helpers.mechanism_runs import add_load, pendulum, reports


def noted(mbs, t, vector):
    """Gravity that begins smoothly, as users write it: it takes no arrays."""
    calls.note(t)
    return [0.0, 0.0, -9.81 * np.sin(min(math.hypot(6.0 * t, 6.0 * t, 6.0 * t), 1.5)) ** 2]


def test_gravity_of_two_bodies_is_called_once_for_a_time(monkeypatch):
    """Bounds, vectors and estimates of both bodies ask for the same times."""
    monkeypatch.setattr(own_modules, "_is_users", lambda name: False)  # or what is noted counts as a memory
    monkeypatch.setattr(mechanisms, "_gravity", noted)
    asked, over_time = [], actions.over_time

    def only_ours(vector, t):
        calls.TIMES.clear()
        found = over_time(vector, t)
        asked.extend(x for x in calls.TIMES if np.ndim(x) == 0 and vector.function is noted)
        return found

    monkeypatch.setattr(actions, "over_time", only_ours)
    scene = pendulum(0, steps=40)
    assert [report.scope for report in reports(scene)] == 2 * [{"auxiliary": "coupled (linearised)"}]
    times = {x for x in asked if x > 0}
    assert len(times) > 39  # 40 steps, and what one of them may lack for rounding
    # the first step is evaluated by itself, and where one block ends the next one begins
    assert len(asked) <= len(times) + 20


def test_functions_may_write_to_what_they_are_given():
    """Exudyn gives them a list of their own: one that fills it in and returns it is as good as another."""

    def made(mbs, t, vector):
        return [0.0, 100.0 * vector[1] * np.sin(60.0 * t), 0.0]

    def filled_in(mbs, t, vector):
        vector[1] *= 100.0 * np.sin(60.0 * t)
        return vector

    def longer(mbs, t, vector):
        return (vector + made(mbs, t, vector))[3:]  # of arrays this would be a sum

    found = []
    for force in (made, filled_in, longer):
        scene = pendulum(0, steps=40)
        add_load(scene, vector=(0.0, 1.0, 0.0), loadVectorUserFunction=force)
        found.append([report.output("probe").bound["auxiliary"] for report in reports(scene)])
    np.testing.assert_array_equal(found[1], found[0])
    np.testing.assert_array_equal(found[2], found[0])


@pytest.fixture
def searched(monkeypatch):
    """What was searched."""
    found, search = [], user_memory.MemorySearch
    monkeypatch.setattr(user_memory, "MemorySearch", lambda *args: found.append(args) or search(*args))
    return found


def counting():
    """A function that counts, and what it holds."""
    kept = {"calls": 0, "rows": np.zeros(3), "names": ["first"]}

    def count():
        kept["calls"] += 1
        kept["rows"][0] += 1.0
        kept["names"].append("more")
        return kept["calls"]

    return count, kept


def test_memory_is_searched_once_while_no_step_is_made(searched):
    (count, kept), mbs = counting(), SimpleNamespace(variables={}, sys={})
    rows, names = kept["rows"], kept["names"]
    with no_step_is_made():
        for _ in range(3):
            with memory_kept(mbs, [count]) as memory:
                assert not memory.changed
                assert count() == 1
                assert memory.changed
            assert memory.was_changed
        assert len(searched) == 1
        assert (kept["calls"], rows.tolist(), names) == (0, [0.0, 0.0, 0.0], ["first"])
        assert kept["rows"] is rows
        assert kept["names"] is names
    with memory_kept(mbs, [count]):
        pass
    assert len(searched) == 2


def test_what_others_keep_meanwhile_stays(searched):
    """Another thread, or a call that nobody guards: what is there when a look begins is put back, nothing older."""
    (count, kept), mbs = counting(), SimpleNamespace(variables={}, sys={})
    with no_step_is_made():
        for calls_before in (0, 1):
            with memory_kept(mbs, [count]):
                count()
            assert kept["calls"] == calls_before
            count()
            mbs.variables["new"] = calls_before
        assert kept["calls"] == 2
        assert mbs.variables == {"new": 1}
        assert len(searched) == 2


def test_looks_within_looks(searched):
    """What the outer one has seen change is put back by the outer one."""
    (count, kept), mbs = counting(), SimpleNamespace(variables={}, sys={})
    with no_step_is_made(), memory_kept(mbs, [count]) as outer:
        count()
        with memory_kept(mbs, [count]) as inner:
            count()
        assert inner.was_changed
        assert kept["calls"] == 1
        assert outer.changed
    assert kept["calls"] == 0
    assert outer.was_changed


def test_other_bit_generators_of_numpy_are_put_back():
    """np.random may have another one than it begins with; numpy warns when its state is asked for as a tuple."""
    before = np.random.get_bit_generator()
    np.random.set_bit_generator(np.random.PCG64(1))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with memory_kept(SimpleNamespace(variables={}, sys={}), [np.random.rand]) as memory:
                first = np.random.rand()
            assert memory.was_changed
        assert np.random.rand() == first
    finally:
        np.random.set_bit_generator(before)


def test_constant_loads_are_not_called():
    vector = actions.load_vector(None, "load", {"loadVector": [1.0, 2.0, 3.0], "loadVectorUserFunction": 0}, None)
    assert vector.at is None
    np.testing.assert_array_equal(actions.over_time(vector, np.zeros(4)), np.tile([1.0, 2.0, 3.0], (4, 1)))


class Log:
    """An object of a script, as libraries have them: kept by value, for it is of another module than functions."""

    def __init__(self, rows):
        self.rows, self.last = rows, {"row": rows}


Log.__module__ = "a library"
Pair = namedtuple("Pair", ("first", "second"))
ROWS = {
    "list": list,
    "array": lambda rows: np.array([*rows], dtype=float),
    "deque": deque,
    "bytes": bytearray,
    "set": set,
    "dict": lambda rows: dict.fromkeys(rows, "a"),
    "subclass": type("Rows", (list,), {}),
    "list of tuples": lambda rows: [(x, x) for x in rows],
    "list of lists": lambda rows: [[x] for x in rows],
}
WITHIN = {
    "itself": lambda rows: rows,
    "dict": lambda rows: {"rows": rows, "name": "a"},
    "list": lambda rows: ["a", {1: (rows,)}],
    "attribute": Log,
    "namespace": lambda rows: SimpleNamespace(rows=rows, last={"row": rows}),
    "tuple of a list": lambda rows: ([rows], 1),
    "named tuple": lambda rows: Pair([rows], "a"),
}


def changed(rows):
    """Change it in place."""
    if isinstance(rows, np.ndarray):
        rows += 1.0
    elif isinstance(rows, dict):
        rows[9] = rows.pop(1)
    elif isinstance(rows, set):
        rows.add(9)
    elif rows and isinstance(rows[0], list):
        rows[0].append(9)
        rows.reverse()
    else:
        rows.append(9)


@pytest.mark.parametrize("within", WITHIN)
@pytest.mark.parametrize("kind", ROWS)
def test_objects_within_others_are_put_back_themselves(kind, within):
    """Other functions may hold the same rows, and what is in them: a copy in their place would leave them behind."""
    rows = ROWS[kind]((1, 2))
    kept, before = WITHIN[within](rows), repr(rows)
    inner = [*rows] if kind == "list of lists" else []

    def load():
        nonlocal kept
        changed(rows)
        kept = "another"

    held = kept
    with memory_kept(SimpleNamespace(variables={}, sys={}), [load]):
        load()
        assert repr(rows) != before
    assert kept is held
    assert repr(rows) == before
    where = {"itself": kept} | dict.fromkeys(("attribute", "namespace"), getattr(kept, "rows", None))
    if within not in where:
        where[within] = kept["rows"] if within == "dict" else kept[1][1][0] if within == "list" else kept[0][0]
    assert where[within] is rows
    assert all(x is y for x, y in zip(inner, rows, strict=False))
    if within in ("attribute", "namespace"):
        assert kept.last["row"] is rows


def test_what_is_in_itself_is_put_back():
    kept = [1, {}]
    kept[1]["all"] = kept

    def load():
        kept.append(2)
        kept[1]["new"] = 3

    with memory_kept(SimpleNamespace(variables={}, sys={}), [load]):
        load()
    assert len(kept) == 2
    assert kept[1].keys() == {"all"}
    assert kept[1]["all"] is kept


def test_to_look_changes_nothing():
    """An exception whose attributes were asked for is pickled in another way than before."""
    error = ValueError("mine")

    def load():
        return error

    for _ in range(2):
        with memory_kept(SimpleNamespace(variables={}, sys={}), [load]) as memory:
            assert not memory.changed


class Rows(list):
    """A list with attributes of its own."""


CONTAINERS = {
    "deque": lambda rows: deque([rows, 1], maxlen=5),
    "defaultdict": lambda rows: defaultdict(list, rows=rows),
    "ordered dict": lambda rows: OrderedDict(first=1, rows=rows),
}


@pytest.mark.parametrize("name", CONTAINERS)
def test_rows_in_other_containers_are_put_back_themselves(name):
    """A function after each step may add to the same list by another name."""
    rows = [1, 2]
    kept = CONTAINERS[name](rows)

    def load():
        rows.append(9)
        if isinstance(kept, deque):
            kept.rotate()
        else:
            kept["new"] = [9]

    with memory_kept(SimpleNamespace(variables={}, sys={}), [load]):
        load()
    assert rows == [1, 2]
    assert kept == CONTAINERS[name](rows)
    assert (kept[0] if isinstance(kept, deque) else kept["rows"]) is rows


def test_what_is_no_container_of_python_is_put_back_itself():
    """In a default value nothing could take its place."""
    logs, numbers, of_c, single = Rows([1]), array("d", [1.0, 2.0]), (ctypes.c_double * 2)(1.0, 2.0), ctypes.c_int(3)

    def load(mbs, t, vector, logs=logs, numbers=numbers, of_c=of_c, single=single):
        logs.append(2)
        logs.last = 2
        numbers.append(3.0)
        of_c[0] = single.value = 7

    with memory_kept(SimpleNamespace(variables={}, sys={}), [load]) as memory:
        load(None, 0.0, None)
        assert memory.changed
    assert (logs, vars(logs), numbers.tolist(), [*of_c], single.value) == ([1], {}, [1.0, 2.0], [1.0, 2.0], 3)


@pytest.mark.parametrize("numbers", [itertools.count(), iter([0.0] * 99), memoryview(bytearray(9))], ids=type)
def test_what_cannot_be_set_back_is_lost(numbers):
    """Copies of iterators go on by themselves: one in a default value, or with two names, is the run's no more."""

    def load(mbs, t, vector, numbers=numbers):
        return [float(len([*zip(numbers, (1,), strict=False)])), 0.0, 0.0]

    with memory_kept(SimpleNamespace(variables={}, sys={}), [load]) as memory:
        assert memory.lost == type(numbers).__name__
