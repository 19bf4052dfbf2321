"""Residuals between samples, looked at where they are rough and now and then elsewhere: against all of them."""

import exudyn as exu
import numpy as np
import pytest

from exudyn_romerr.estimates.local_errors import defects, filled, in_the_middle, seldom, standing_out, told
from exudyn_romerr.mbs.access.state_guard import state_set
from exudyn_romerr.mbs.derivatives import twin
from exudyn_romerr.mbs.derivatives.linearisation import Tangents
from exudyn_romerr.mbs.mechanism import stored_residuals as module
from exudyn_romerr.mbs.mechanism.stored_residuals import StoredResiduals
from models import floating
from tests.mbs.mechanism.test_step_errors import joined, pendulum, sampled

H, STEPS = 1e-3, 120
STEP = 57  # not one of those looked at in any case


def slow(mbs, t, vector):
    return [0.0, 0.0, 100.0 * np.sin(60.0 * t)]


def pulsed(mbs, t, vector):
    """For a tenth of a step, in the middle of one: no sample knows."""
    return [0.0, 0.0, 100.0 * np.sin(60.0 * t) + 50.0 * (abs(t - (STEP + 0.5) * H) < 0.05 * H)]


def begun(mbs, t, vector):
    """Over some steps, from within one to within another."""
    return [0.0, 0.0, 100.0 * np.sin(60.0 * t) + 50.0 * ((STEP - 20.7) * H < t < (STEP + 0.4) * H)]


def rough(mbs, t, vector):
    return [0.0, 0.0, 100.0 * np.sin(2000.0 * t)]


def spring(mbs, t, item, displacement, velocity, stiffness, damping, offset):
    return [0.0, 0.0, -10.0 * displacement[2]]


class Found:
    """R and its uncertainty in the steps of a run, so many of them looked at; local errors and masses beside."""

    def __init__(self, monkeypatch, all_steps=False, **scene):
        mbs, settings = pendulum(H, STEPS * H, **scene)
        rows = []
        mbs.SetPostStepUserFunction(lambda mbs, t: rows.append(sampled(mbs, t)) or True)
        mbs.SolveDynamic(settings)
        rows, tangents = joined(rows), Tangents(mbs)
        tangents.read(mbs, float(rows[0][-1]))
        self.light, self.dv = np.sqrt(tangents.readings[-1].masses), defects(*rows[:4])[1]
        residuals, at, self.looked = StoredResiduals(tangents, mbs), StoredResiduals._at, []

        def counted(of, mbs, rows, share, steps):
            self.looked += steps[np.broadcast_to(share, steps.shape) == module.MIDDLE].tolist()
            return at(of, mbs, rows, share, steps)

        with monkeypatch.context() as patched:
            patched.setattr(StoredResiduals, "_at", counted)
            patched.setattr(module, "FEW", STEPS if all_steps else module.FEW)
            self.r, self.uncertain = residuals.between(mbs, rows, 0, self.dv)
        assert residuals.failure == ""
        self.state = mbs.systemData.GetODE2Coordinates(exu.ConfigurationType.Current)


def both(monkeypatch, **scene):
    return Found(monkeypatch, **scene), Found(monkeypatch, all_steps=True, **scene)


def test_smooth_residuals_are_looked_at_now_and_then(monkeypatch):
    some, whole = both(monkeypatch, force=slow)
    assert len(whole.looked) == STEPS
    assert len(some.looked) < STEPS / 2
    known = np.abs(some.dv * some.light)
    known = np.maximum(known.max(axis=0), module.SEEN * known.max())
    # cubics are told of by their neighbours, which know the fourth derivative there, not here: measured 1.3 OFF
    assert (H * np.abs(some.r - whole.r) / (some.light * known)).max() < 2 * module.OFF
    assert np.array_equal(some.state, whole.state)


def test_pulse_between_samples_is_seen(monkeypatch):
    """Its step, which others say nothing of, is looked at, and closer."""
    assert not seldom(STEPS)[STEP]
    some, whole = both(monkeypatch, force=pulsed)
    assert STEP in some.looked
    assert len(some.looked) < STEPS / 2
    np.testing.assert_array_equal(some.r[STEP], whole.r[STEP])
    np.testing.assert_array_equal(some.uncertain[STEP], whole.uncertain[STEP])
    assert np.abs(some.uncertain[STEP]).max() > 0.1 * np.abs(some.r[STEP]).max()


def test_loads_that_begin_and_end_within_steps_are_uncertain_as_if_all_steps_were_looked_at(monkeypatch):
    """Looked at closer are those steps that cubics through others miss most, not only those that stand out."""
    some, whole = both(monkeypatch, force=begun)
    assert len(some.looked) < 0.8 * STEPS
    largest = np.abs(whole.uncertain).max(axis=0)
    for step in (STEP - 21, STEP):
        np.testing.assert_array_equal(some.uncertain[step], whole.uncertain[step])
        assert np.abs(whole.uncertain[step]).max() > 0.5 * largest.max()
    np.testing.assert_allclose(np.abs(some.uncertain).max(axis=0), largest, rtol=0, atol=0.01 * largest.max())


@pytest.mark.parametrize("scene", [{"force": rough}, {"spring": spring}], ids=["rough", "function of an object"])
def test_all_steps_are_looked_at(monkeypatch, scene):
    """Where residuals are rough; and where functions that may do anything between samples are not those of loads."""
    some, whole = both(monkeypatch, **scene)
    assert sorted(some.looked) == list(range(STEPS))
    np.testing.assert_array_equal(some.r, whole.r)
    np.testing.assert_array_equal(some.uncertain, whole.uncertain)


def gone_on(t, x, least):
    """Numbers of steps that are looked at, what is known then, and what is said to be missed."""
    looked, known = np.pad(seldom(len(t) - 2), 1, constant_values=True), np.zeros_like(x)
    known[looked] = x[looked]
    off = told(t, known, looked, lambda steps: x[steps], np.ones_like(x), least)
    known[1:-1] = filled(t[1:-1], known[1:-1], looked[1:-1])
    return np.flatnonzero(looked), known, off


TOLERANCE = 1e-11  # of the largest force: sums over the nodes of meshes in another order; measured 2e-14


@pytest.mark.parametrize("least", [0, 1000], ids=["many steps", "few steps"])
@pytest.mark.parametrize("of_run", [False, True], ids=["time as it is given", "time of the run"])
def test_bodies_with_meshes_are_looked_at_in_a_lighter_copy_that_shows_the_same(monkeypatch, of_run, least):
    """And in the mbs of the run, where a function sees that mbs: the copy would be wrong by what it reads there.

    Of many steps in a copy without inertia.
    """
    monkeypatch.setattr(twin, "MANY", least)
    h, steps = 1e-3, module.FEW

    def force(t):
        now = scene.mbs.systemData.GetTime() if of_run else t
        return 0.0, 0.0, 100.0 * np.sin(500.0 * now)

    scene = floating.pendulum(4, h=h, t_end=steps * h, force=force, assemble=True)
    mbs, rows = scene.mbs, []
    mbs.SetPostStepUserFunction(lambda mbs, t: rows.append(sampled(mbs, t)) or True)
    mbs.SolveDynamic(scene.settings)
    rows, tangents = joined(rows), Tangents(mbs)
    tangents.read(mbs, float(rows[0][-1]))
    residuals, dv = StoredResiduals(tangents, mbs), defects(*rows[:4])[1]
    r, _ = residuals.between(mbs, rows, 0, dv)
    assert residuals.failure == ""
    assert residuals.in_a_copy == (not of_run)
    assert len(tangents._bare.inertias) == (1 if least == 0 else 0)
    assert tangents.light(mbs).mbs is not mbs
    t, *states = rows
    inside = [in_the_middle(t, x) for x in states]
    for i in range(steps):
        with state_set(mbs.systemData, (t[i] + t[i + 1]) / 2, [x[i] for x in inside]):
            wanted, forces = tangents.equations.residual(mbs), tangents.equations.forces(mbs)
        np.testing.assert_allclose(r[i], wanted, rtol=0, atol=TOLERANCE * np.abs(forces).max())


@pytest.mark.parametrize("count", [module.FEW + 1, 40, 129, 131, 132, 400])
@pytest.mark.parametrize("period", [2, 3, 4, 8, 16, 32])
def test_what_alternates_is_not_taken_for_smooth(count, period):
    t = np.arange(float(count))
    x = np.cos(2 * np.pi * t / period + 0.3)[:, None]
    looked, known, _ = gone_on(t, x, 0.01)
    assert np.abs(known - x).max() < 0.05  # between the last steps that are looked at; measured 0.011
    assert period > 4 or len(looked) == count


def test_steps_around_a_jump_are_looked_at_and_few_others():
    t = np.arange(400.0)
    x = np.where(t < 201, np.exp(t / 100), 0.0)[:, None]
    looked, known, off = gone_on(t, x, 0.01)
    assert {200, 201} <= set(looked)
    assert len(looked) < 400 / 5
    assert np.abs(known - x).max() < 0.01
    assert off.max() > 0.1


def test_cubics_between_steps_that_are_looked_at():
    """Exact for cubics; what others are off by is less than what was allowed."""
    t, looked = np.cumsum(np.random.default_rng(2).uniform(0.9, 1.1, 40)), seldom(40)
    cubic, wave = np.column_stack([(t - 9.0) ** 3, t - 4.0]), np.sin(0.3 * t)[:, None]
    hidden = np.where(looked[:, None], [cubic], np.nan)[0]
    np.testing.assert_allclose(filled(t, hidden, looked), cubic, rtol=0, atol=1e-12 * np.abs(cubic).max())
    some, known, _ = gone_on(t, wave, 1e-3)
    assert len(some) < 40
    assert 1e-6 < np.abs(known - wave).max() < 1e-3


def test_what_stands_out_beside_steps_that_are_looked_at():
    looked = np.array([True, False, False, True, False, True])
    sizes = np.array([[1.0], [1.4], [1.6], [1.0], [0.0], [0.2]])
    assert standing_out(sizes, looked).tolist() == [False, False, True, False, False, False]
    assert not standing_out(sizes, looked, least=0.11).any()
