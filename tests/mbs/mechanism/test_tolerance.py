"""A tolerance in a mechanism: every step is compared, some at once, and the solve stops where it is exceeded."""

from types import SimpleNamespace

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.mbs.monitoring.body_monitor import FEWEST, MOST, ToleranceCheck
from tests.helpers.mechanism_runs import COUPLED, FROZEN, pendulum, reports, solve, watch


def bound(report):
    return np.max(report.output("probe").bound["best"], axis=1)


@pytest.mark.parametrize("share", [0.01, 0.3, 0.9])
def test_solve_stops_at_the_step_where_it_is_exceeded(share, tmp_path):
    """Bounds rise here smoothly; in the first steps as many are made before they are compared as were before."""
    free, _ = reports(pendulum(steps=40), scope=FROZEN)
    limit = share * np.max(bound(free))
    scene = pendulum(steps=40)
    stopped, other = [*watch(scene, 1, tolerance=limit), *watch(scene, 2)]
    solve(scene)
    t, first = stopped.report().t, int(np.argmax(bound(free) > limit))
    assert t[-1] == other.report().t[-1]
    assert first < len(t) <= 1 + max(2 * first, 1)
    assert set(stopped.report().scope.values()) == {COUPLED}  # while the solve goes on bounds have frozen inputs
    said = next(message for message in stopped.report().messages if "stopped" in message)
    assert said.startswith(f"stopped at t = {t[-1]:g}: tolerance on 'probe' exceeded")
    assert (f"exceeded at t = {t[first]:g}" in said) == (first < len(t) - 1)
    for monitor in (stopped, other):  # in files, too
        monitor.report().save(tmp_path / "report.npz")
        for report in (monitor.report(), romerr.load_report(tmp_path / "report.npz")):
            assert {out.stopped for out in report.outputs.values()} == ({t[-1]} if monitor is stopped else {None})
    assert {out.stopped for out in free.outputs.values()} == {None}


class Rising:
    """A run whose bound follows a function of the number of steps."""

    def __init__(self, of):
        self._of, self.times = of, np.arange(1)

    def best_of_last(self, count):
        return {"x": self._of(self.times[-count:])[:, None]}

    def doubts(self):
        return ()


def made_until(of, steps):
    """What a check says, the step it says it at, and the number of calls until then."""
    check, run, calls = ToleranceCheck({"x": 1.0}), Rising(of), 0
    while len(run.times) <= steps:
        calls += 1
        found = check.exceeded(run)
        if found:
            return SimpleNamespace(found=found, step=run.times[-1], calls=calls)
        run.times = np.arange(len(run.times) + check.room)
    return SimpleNamespace(found=[], step=run.times[-1], calls=calls)


@pytest.mark.parametrize("steps", [3.5, 100.5, 3000.5])
def test_a_bound_that_rises_steadily_is_stopped_at_once(steps):
    stopped = made_until(lambda k: k / steps, 10_000)
    assert stopped.step == np.ceil(steps)
    assert stopped.found == [f"tolerance on 'x' exceeded, {np.ceil(steps) / steps:.3g} > 1"]


def test_a_bound_that_jumps_is_found_in_the_same_block():
    """And the step is told."""
    stopped = made_until(lambda k: np.where(k < 1000, 0.1, 2.0), 10_000)
    assert 1000 <= stopped.step < 1000 + MOST
    assert stopped.found == ["tolerance on 'x' exceeded at t = 1000, 2 > 1"]


def test_a_bound_close_below_is_compared_every_few_steps():
    close = made_until(lambda k: 0.5 + 0.49 * np.sin(0.3 * k), 10_000)
    assert not close.found
    assert close.calls <= FEWEST + 1 + (1 + close.step) / FEWEST


def test_without_bounds_it_stops():
    assert made_until(lambda k: np.where(k < 3, 0.0, np.inf), 10).found == [
        "tolerance on 'x' exceeded at t = 3, inf > 1"
    ]
