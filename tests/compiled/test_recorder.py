"""The compiled PostStep function beside the one in Python: the same rows, and the same is asked at the same steps."""

import gc
import weakref
from types import SimpleNamespace

import exudyn as exu
import numpy as np
import pytest

from exudyn_romerr.mbs.access.equations import IN_PLACE, current_state, state_set
from exudyn_romerr.mbs.monitoring import step_hook
from tests.helpers.mbs_scenes import scene, settings

SIZE, MULTIPLIERS = 3, 2
SOLVES = 4


class System:
    """States that follow from the number of the step, in memory that is another one from time to time."""

    def __init__(self, moves):
        self.start, self.asked, self.moves = 0.0, [], moves
        self.states = [np.zeros(SIZE), np.zeros(SIZE), np.zeros(SIZE), np.zeros(MULTIPLIERS)]
        self.step = 0

    @property
    def step(self):
        return self._step

    @step.setter
    def step(self, step):
        self._step = step
        if step in self.moves:
            self.states = [x.copy() for x in self.states]
        for x, more, factor in zip(self.states, (0, 0.25, 0.5, 0), (10, 10, 10, -10), strict=True):
            x[:] = np.arange(len(x)) + factor * step + more

    def _state(self, i, configuration, copy):
        assert configuration == exu.ConfigurationType.Current
        return self.states[i].copy() if copy else self.states[i][:]

    def GetTime(self, configuration):
        assert configuration == exu.ConfigurationType.StartOfStep
        return self.start

    def GetODE2Coordinates(self, *how):
        return self._state(0, *how)

    def GetODE2Coordinates_t(self, *how):
        return self._state(1, *how)

    def GetODE2Coordinates_tt(self, *how):
        return self._state(2, *how)

    def GetAECoordinates(self, *how):
        if self.asked[-1:] != [self.step]:  # asked twice where memory moved
            self.asked.append(self.step)
        return self._state(3, *how)

    def GetODE1Coordinates(self, *how):
        return np.zeros(0)

    GetODE1Coordinates_t = GetODE1Coordinates


class Hook:
    """Is told of steps, writes down what it is asked and given, and answers at random."""

    def __init__(self, seed, is_wide, user=None):
        self.random, self.keeps_multipliers, self.user = np.random.default_rng(seed), is_wide, user
        self.told, self.end, self.system = [], np.inf, System(range(0, 1000, 7))
        self.step, self.drain, self.end_block = step_hook.gatherer(SimpleNamespace(systemData=self.system), self)

    def begin(self, mbs):
        self.flush()
        self.told.append("begin")
        rows = int(self.random.integers(1, 12))
        self.end = self.random.uniform(0, 40) if self.keeps_multipliers else np.inf
        widths = (SIZE, SIZE, SIZE, MULTIPLIERS)
        return np.empty(rows), *(np.full((rows, width), np.nan) for width in widths)

    def flush(self):
        self.told.append([x.copy() for x in self.drain()])

    def rows_until_next(self):
        self.flush()
        return self.random.choice([0.0, 1.0, 4.0, np.inf], p=[0.05, 0.15, 0.2, 0.6]) if self.told else 1

    def call_user(self, mbs, t, go_on):
        self.told.append(t)
        return self.user(mbs, t) and go_on

    def run(self):
        """Solve some times; now and then somebody asks for what is stored between two steps."""
        system = self.system
        for _ in range(SOLVES):
            for i in range(int(self.random.integers(1, 60))):
                t = 0.5 * i
                system.start, system.step = (t if i == 0 else t - 0.5), system.step + 1
                go_on = self.step(None, t)
                self.told.append(go_on)
                if not go_on:
                    break
                if self.random.uniform() < 0.05:
                    self.flush()
                if self.random.uniform() < 0.03:
                    self.end_block()
        self.flush()
        return self.told, system.asked


def assert_same(one, other):
    assert len(one) == len(other)
    for x, y in zip(one, other, strict=True):
        if isinstance(x, list):
            for a, b in zip(x, y, strict=True):
                np.testing.assert_array_equal(a, b)
        else:
            assert x == y


@pytest.mark.parametrize("user", [None, lambda mbs, t: True], ids=["alone", "a user's function"])
@pytest.mark.parametrize("is_wide", [False, True])
def test_rows_and_questions_are_the_same(compiled, monkeypatch, is_wide, user):
    rows = 0
    for seed in range(40):
        found = []
        for loops in (None, compiled):
            monkeypatch.setattr(step_hook, "loops", loops)
            found.append(Hook(seed, is_wide, user).run())
        (told, asked), (told_compiled, asked_compiled) = found
        assert_same(told, told_compiled)
        assert asked == asked_compiled
        rows += sum(len(x[0]) for x in told if isinstance(x, list) and len(x) == 5)
    assert rows > 1000


def test_bounds_of_a_solve_are_the_same(compiled, monkeypatch):
    found = []
    for loops in (None, compiled):
        monkeypatch.setattr(step_hook, "loops", loops)
        mbs, _, monitor = scene()
        for _ in range(2):
            mbs.SolveDynamic(settings(40))
        kind = type(mbs.GetPostStepUserFunction()["function"]).__name__
        assert (kind == "Recorder") == (loops is not None)
        found.append([monitor.report(i).output("tip").bound["best"] for i in (0, 1)])
    np.testing.assert_array_equal(*found)


def test_what_goes_wrong_is_told(compiled):
    rows = np.zeros(4), np.zeros((4, SIZE)), np.zeros((4, SIZE)), np.zeros((4, SIZE))
    of = (lambda *_: np.zeros(SIZE),) * 2

    def made(q_tt):
        return compiled.Recorder(lambda mbs, t: "slow", lambda _: 0.0, None, None, *of, q_tt, None)

    recorder = made(lambda *_: np.zeros(SIZE + 1))
    assert recorder(None, 1.0) == "slow"
    recorder.go_on(0, 3, np.inf, *rows)
    assert recorder(None, 0.0) == "slow"  # a solve begins
    for _ in range(2):
        with pytest.raises(ValueError, match="32 bytes in place of 24"):
            recorder(None, 1.0)
    assert recorder.stop() == 0
    assert recorder(None, 1.0) == "slow"
    with pytest.raises(ValueError, match="does not hold 5 rows"):
        recorder.go_on(0, 5, np.inf, *rows)
    assert recorder(None, 1.0) == "slow"
    failing = made(lambda *_: 1 / 0)
    failing.go_on(0, 3, np.inf, *rows)
    with pytest.raises(ZeroDivisionError):
        failing(None, 1.0)


def test_memory_of_states_stays_in_a_solve():
    """What the compiled function holds from step to step: also where states are set, or a solve is repeated."""
    mbs, _, _ = scene()
    system, places = mbs.systemData, set()
    readers = system.GetODE2Coordinates, system.GetODE2Coordinates_t, system.GetODE2Coordinates_tt

    def look(mbs, t):
        states = [read(*IN_PLACE) for read in readers]
        assert not any(x.flags.owndata for x in states)
        places.add(tuple(x.ctypes.data for x in states))
        system.SetODE2Coordinates(system.GetODE2Coordinates())
        system.SetSystemState(system.GetSystemState())
        kept = current_state(system)
        moved = [x + 1.0 for x in kept]
        with state_set(system, t, moved):
            np.testing.assert_array_equal(np.hstack(current_state(system)), np.hstack(moved))
        np.testing.assert_array_equal(np.hstack(current_state(system)), np.hstack(kept))
        return True

    mbs.SetPostStepUserFunction(look)
    for _ in range(2):
        mbs.SolveDynamic(settings(10))
    mbs.SolveStatic(settings(10))
    assert len(places) == 1


def test_it_goes_with_who_is_told(compiled, monkeypatch):
    """It holds the hook, which holds it."""
    monkeypatch.setattr(step_hook, "loops", compiled)
    hook = Hook(1, True)
    hook.run()
    gone = weakref.ref(hook)
    del hook
    gc.collect()
    assert gone() is None
