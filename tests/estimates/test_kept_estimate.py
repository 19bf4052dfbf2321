"""What is kept of an estimate along a run: blocks whose last instants are handed over again, running maxima.

Runs here are longer than FEW but where a test is about that: instants of zeros come first.
"""

import numpy as np

from exudyn_romerr.online.kept_estimate import (
    AHEAD,
    ALTERNATES,
    FEW,
    FIRST,
    LOST,
    PHASE_LOST,
    REMAINDER,
    KeptEstimate,
)
from exudyn_romerr.trajectory.estimate import CAUSES, LINEAR, LINEAR_STEPS, LINEARISED, TimeStep


def column(*values):
    return np.array(values, dtype=float)[:, None]


def rough():
    """Outputs that ring so much that no check is limited by it."""
    return 1e6 * (-1.0) ** np.arange(8 * FEW)[:, None]


def started(before=None):
    """A run with FEW instants of zeros behind it."""
    found, none = KeptEstimate(), np.zeros((FEW, 1))
    if before is not None:
        found.go_on(before, rough)
    found.put({"basis": none, "time step": none}, {"vectors": none, "steps": none})
    return found


def kept(before=None):
    """Two blocks; of the time step the last two instants of the first come again."""
    found = started(before)
    found.put({"basis": column(1, 2, 3)}, {"vectors": column(5, 1, 2)})
    found.put({"time step": column(-1, -9, -9)}, {"steps": column(1, 7, 8)})
    found.put({"basis": column(4)}, {"vectors": column(6)})
    found.put({"time step": column(-2, -3, -4)}, {"steps": column(3, 2, 1)}, replaced=2)
    return found


def test_last_instants_may_be_replaced():
    found = kept().read(slice(FEW, None), rough)
    assert tuple(found.parts) == CAUSES
    np.testing.assert_array_equal(found.parts["basis"], column(1, 2, 3, 4))
    np.testing.assert_array_equal(found.parts["time step"], column(-1, -2, -3, -4))
    np.testing.assert_array_equal(found.parts["jumps"], 0 * column(1, 2, 3, 4))
    np.testing.assert_array_equal(found.total, column(0, 0, 0, 0))


def test_half_widths_never_shrink_and_forget_what_was_replaced():
    found = kept().read(slice(FEW, None), rough)
    np.testing.assert_array_equal(found.half_widths["steps"], column(3, 3, 3, 3))
    np.testing.assert_array_equal(found.half_widths["vectors"], column(5, 5, 5, 6))
    np.testing.assert_array_equal(found.half_widths[LINEAR], LINEARISED * column(1, 2, 3, 4))
    np.testing.assert_array_equal(found.half_widths[LINEAR_STEPS], LINEARISED * column(4, 4, 4, 4))
    np.testing.assert_allclose(found.uncertainty, column(8, 8, 8, 9) + LINEARISED * column(5, 6, 7, 8), rtol=1e-15)


def test_half_widths_of_time_steps_count_some_instants_before():
    """A burst is smeared over the steps before it; what is not of time steps is not."""
    run, burst = KeptEstimate(), np.zeros((4 * FEW, 1))
    burst[2 * FEW] = 1.0
    run.put({"basis": 0 * burst, "time step": burst}, {"vectors": burst, "steps": burst})
    widths = run.read(slice(None), rough).half_widths
    assert np.flatnonzero(widths["steps"])[0] == np.flatnonzero(widths[LINEAR_STEPS])[0] == 2 * FEW - AHEAD
    assert np.flatnonzero(widths["vectors"])[0] == 2 * FEW
    np.testing.assert_array_equal(widths["steps"][2 * FEW - AHEAD :], 1.0)


def test_what_linear_equations_miss_more_of_than_they_tell_is_not_known():
    """The remainder of an output may be small beside what is predicted of it, as that of a static rest."""
    none, one = np.zeros((2 * FEW, 1)), np.ones((2 * FEW, 1))
    for share, wide in ((0.5 * LOST, LINEARISED * 7), (2 * LOST, 7.0)):
        run = KeptEstimate()
        run.remainder = share
        run.put({"basis": -3 * one, "interfaces": 4 * one}, {"vectors": none, REMAINDER: 0.02 * one})
        run.put({"time step": none}, {"steps": none})
        found = run.read(slice(None), rough).half_widths[LINEAR]
        np.testing.assert_allclose(found, wide, rtol=1e-12)


def test_what_steps_do_not_resolve_is_off_by_its_amplitude_at_most():
    """The check grows like the square of the phase, the estimate like the phase, and the error not at all."""
    phase, A = np.arange(100.0)[:, None], 1e-3
    run, ringing = KeptEstimate(), A * (-1.0) ** np.arange(100)[:, None]
    run.put({"time step": A * phase}, {"steps": A * phase**2 / 2})
    found = run.read(slice(None), lambda: ringing).half_widths["steps"]
    sizes = A * np.minimum(phase + AHEAD, phase[-1])
    np.testing.assert_allclose(found, np.minimum(sizes**2 / (2 * A), PHASE_LOST * sizes + ALTERNATES * A), rtol=1e-12)
    assert found[-1] < 0.05 * A * phase[-1] ** 2


def test_the_limit_of_a_check_that_has_ended_is_none():
    run, one = started(), np.ones((2, 1))
    run.put({"basis": 0 * one}, {"vectors": 0 * one})
    run.put({"time step": one[:1]}, {"steps": one[:1]})
    quiet = np.zeros((FEW + 2, 1))
    np.testing.assert_array_equal(run.read(slice(FEW, None), lambda: quiet).half_widths["steps"], column(1, np.inf))


def test_run_that_goes_on_keeps_the_half_widths():
    found = kept(before=kept()).read(slice(FEW, None), rough)
    np.testing.assert_array_equal(found.half_widths["steps"], column(3, 3, 3, 3))
    np.testing.assert_array_equal(found.parts["basis"], column(1, 2, 3, 4))
    np.testing.assert_array_equal(found.half_widths[LINEAR], LINEARISED * column(4, 4, 4, 4))


def test_what_was_read_stays_as_it_was():
    run = kept()
    found = run.read(slice(FEW, None), rough)
    run.put({"time step": column(7, 7)}, {"steps": column(9, 9)}, replaced=2)
    np.testing.assert_array_equal(found.parts["time step"], column(-1, -2, -3, -4))
    np.testing.assert_array_equal(found.half_widths["steps"], column(3, 3, 3, 3))


def test_there_is_no_estimate_of_nothing():
    assert KeptEstimate().read(slice(None), rough) is None


def test_where_a_check_has_ended_the_half_width_is_infinite():
    run = kept()
    run.put({"basis": column(8, 8)}, {"vectors": column(0, 0)})
    found = run.read(slice(FEW, None), rough)
    np.testing.assert_array_equal(found.total, column(0, 0, 0, 0, 8, 8))
    np.testing.assert_array_equal(found.half_widths["steps"], column(3, 3, 3, 3, np.inf, np.inf))
    assert (np.isinf(found.uncertainty) == column(0, 0, 0, 0, 1, 1)).all()


def test_first_samples_have_the_largest_of_them():
    """Differences of the first steps are one-sided; a run that goes on knows better."""
    sizes = np.linspace(1, 2, FEW + 1)[:, None]
    for before, first in ((None, sizes[FIRST - 1]), (kept(), 6.0)):
        run = KeptEstimate()
        if before is not None:
            run.go_on(before, rough)
        run.put({"basis": 0 * sizes}, {"vectors": sizes})
        found = run.read(slice(None), rough).half_widths["vectors"]
        np.testing.assert_array_equal(found[:FIRST], np.full((FIRST, 1), first))
        assert found[-1] == (2.0 if before is None else 6.0)


def test_runs_of_few_samples_are_not_resolved():
    """The check of steps is as large as what it checks."""
    for count, half in ((FEW, 10.0), (FEW + 1, 1.0)):
        run, one = KeptEstimate(), np.ones((count, 1))
        run.put({"time step": -10 * one}, {"steps": one})
        np.testing.assert_array_equal(run.read(slice(None), rough).half_widths["steps"], half * one)


def test_what_outputs_move_by_in_second_order_checks_the_time_step():
    run, x = KeptEstimate(), np.full((3, 2 * FEW, 1), 0.5)
    run.put_time_step(TimeStep(x, 0 * x, None, 0), lambda x: 3 * x[0] + 7 * x[0] ** 2)
    found, one = run.read(slice(None), rough), np.ones((2 * FEW, 1))
    np.testing.assert_array_equal(found.parts["time step"], -1.5 * one)
    np.testing.assert_array_equal(found.half_widths[LINEAR_STEPS], (1.75 + LINEARISED * 1.5) * one)
    assert "loads" not in found.half_widths
