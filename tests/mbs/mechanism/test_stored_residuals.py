"""Residuals between samples, looked at where they are rough and now and then elsewhere: against all of them."""

import exudyn as exu
import numpy as np
import pytest

from exudyn_romerr.estimates.local_errors import defects, filled, missed, seldom, standing_out
from exudyn_romerr.mbs.derivatives.linearisation import Tangents
from exudyn_romerr.mbs.mechanism import stored_residuals as module
from exudyn_romerr.mbs.mechanism.stored_residuals import StoredResiduals
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
            self.looked += steps.tolist() * (share == module.MIDDLE)
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


def test_what_alternates_is_not_taken_for_smooth():
    t, looked = np.arange(40.0), seldom(40)
    assert looked[[0, -1]].all()
    assert looked.sum() < 15
    assert missed(t, (-1.0) ** t[:, None], looked)[~looked].min() > 0.3  # measured 0.33: a third of it


def test_cubics_between_steps_that_are_looked_at():
    """Exact for cubics; what others are off by is less than what is said to be missed."""
    t, looked = np.cumsum(np.random.default_rng(2).uniform(0.9, 1.1, 40)), seldom(40)
    cubic, wave = np.column_stack([(t - 9.0) ** 3, t - 4.0]), np.sin(0.1 * t)[:, None]
    hidden = np.where(looked[:, None], [cubic], np.nan)[0]
    np.testing.assert_allclose(filled(t, hidden, looked), cubic, rtol=0, atol=1e-12 * np.abs(cubic).max())
    off = np.abs(filled(t, wave, looked) - wave)[:, 0]
    assert off.max() > 1e-5
    assert off.max() <= missed(t, wave, looked).max()


def test_what_stands_out_beside_steps_that_are_looked_at():
    looked = np.array([True, False, False, True, False, True])
    sizes = np.array([[1.0], [1.4], [1.6], [1.0], [0.0], [0.2]])
    assert standing_out(sizes, looked).tolist() == [False, False, True, False, False, False]
    assert not standing_out(sizes, looked, least=0.11).any()
