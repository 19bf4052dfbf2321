"""ResidualPasses: what linear equations leave is marched once more, where that pays and as long as it converges.

Truth: the residual of nonlinear equations, M q'' + K q + N(q) = f, N cubic, evaluated. The computed motion is rest.
"""

from unittest.mock import Mock

import numpy as np
import pytest

from exudyn_romerr.estimates.march import Tangent
from exudyn_romerr.estimates.mechanism_feedback import Feedback
from exudyn_romerr.estimates.residual_passes import SELDOM, TOGETHER, JointDrift, ResidualPasses
from exudyn_romerr.trajectory.scheme import Scheme

K, STEPS, H, BLOCK = 3, 120, 0.02, 50
M, STIFFNESS = np.diag([1.0, 2.0, 0.5]), np.diag([9.0, 4.0, 30.0])
TIMES = H * np.arange(1, STEPS + 1)
FORCE = np.outer(np.sin(TIMES), [1.0, -0.5, 0.3])


class Cubic:
    """Residuals of the equations; the last coordinate is one of a frame, whose residual is not seen."""

    def __init__(self, size, from_step=0):
        self.size, self.from_step, self.rows, self.done = size, from_step, (), 0
        self.is_far = False

    def missed(self, e):
        return self.size * e[0] ** 3

    def residual(self, part, e):
        return e[2] @ M + e[0] @ STIFFNESS + self.missed(e) - FORCE[self.done :][part]

    def left(self, part, e):
        return -self.residual(part, e) * [1, 1, 0]

    def second_order(self, part, e):
        return self.missed(e) * [0, 0, 1]

    def largest(self, e):
        return float(np.abs(e[0]).max(initial=0.0))

    def pay(self, part, e):
        return self.done + part.start >= self.from_step if part.start is not None else False


def run(residuals):
    """E, e', e'' (3, STEPS, K) in two blocks, and passes."""
    tangent = Tangent(0.0, M, 0 * M, STIFFNESS, np.zeros((0, K)), np.zeros((0, K)))
    feedback, passes = Feedback(Scheme.of_radius(1.0)), ResidualPasses(residuals, K)
    feedback.start(tangent, np.zeros(K))
    passes.start(tangent, (np.zeros(1),), feedback.state, False)
    found, beside = [], []
    for block in (slice(BLOCK), slice(BLOCK, STEPS)):
        residuals.done = block.start or 0
        passes.begin((TIMES[block],))
        e, _ = feedback.advance(TIMES[block], FORCE[block], np.zeros(1), lambda _: tangent, late=[passes])
        found.append(e)
        beside.append(passes.beside)
    residuals.done = 0
    return np.concatenate(found, axis=1), np.concatenate(beside), passes


def test_passes_take_what_is_missed_out_of_the_residual():
    """By a first-order share of itself each, of all coordinates: two leave the square of it."""
    before, _, _ = run(residuals := Cubic(10.0, from_step=STEPS))
    after, beside, passes = run(Cubic(10.0))
    sizes = [np.abs(residuals.residual(slice(None), e)).max(axis=0) for e in (before, after)]
    share = np.abs(after - before)[0].max() / np.abs(before[0]).max()
    assert passes.are_made
    assert 0.01 < share < 0.3
    assert np.all(sizes[1] < 9 * share**2 * sizes[0])  # of a cube: three times the share, each
    np.testing.assert_allclose(beside[:, 2], residuals.residual(slice(None), after)[:, 2], atol=1e-12)


def test_passes_may_begin_late_and_not_at_all():
    """Before they pay nothing is added, nor is anything known of what they leave."""
    before, beside, passes = run(Cubic(10.0, from_step=STEPS))
    assert not passes.are_made
    assert np.isnan(beside).all()
    late, beside, passes = run(Cubic(10.0, from_step=BLOCK))
    assert passes.are_made
    assert np.array_equal(late[:, :BLOCK], before[:, :BLOCK])
    assert np.isnan(beside[:BLOCK]).all()
    assert np.isfinite(beside[BLOCK:]).all()
    assert np.abs(late - before)[0, BLOCK:].max() > 0.01 * np.abs(before[0]).max()


@pytest.mark.parametrize("size", [200.0, -1e4])
def test_passes_that_do_not_converge_are_given_up(size):
    """What is missed is larger than what is known: the linear prediction is what stays, or near it."""
    before, _, _ = run(Cubic(size, from_step=STEPS))
    after, beside, _passes = run(Cubic(size))
    assert np.isfinite(after).all()
    assert np.isnan(beside[-1]).all()
    assert np.abs(after - before)[0].max() < np.abs(before[0]).max()


@pytest.mark.parametrize(("is_far", "most"), [(False, TOGETHER), (True, SELDOM)])
def test_whether_passes_pay_is_asked_of_many_rows_at_once(is_far, most):
    """Of as many as before, at most so many; at the end of a block of all, since rows of another one follow."""
    asked = []
    ask = lambda part, e: asked.append((part.start, part.stop, e[0, :, 0].tolist()))  # noqa: E731
    residuals = Mock(pay=ask, is_far=is_far)
    passes = ResidualPasses(residuals, 1)
    for count in (5 * TOGETHER, 40):
        passes.begin([np.zeros(count)])
        for i in range(0, count, 20):
            assert passes.follow(None, slice(i, i + 20), np.full((3, 20, 1), i) + np.arange(20)[:, None]) is None
    starts, stops, rows = zip(*asked, strict=True)
    last = stops.index(5 * TOGETHER) + 1
    assert starts[:last] == (0, *stops[: last - 1])
    assert starts[last:] == (0,)
    assert stops[last:] == (40,)
    assert stops[:4] == (20, 40, 80, 160)
    assert all(found == list(range(start, stop)) for start, stop, found in zip(starts, stops, rows, strict=True))
    assert 0.6 * most < max(np.subtract(stops, starts)) < most + 20
    assert len(asked) < 12


def turning(t):
    """C (1, 2) of a constraint that turns, and its rate."""
    return np.array([[[np.cos(t), np.sin(t)]], [[-np.sin(t), np.cos(t)]]])


def held_at_rates(mass, stiffness, force):
    """E (STEPS, 2) from rest by the trapezoidal rule, C e' + C' e zero at every sample, one step after another."""
    found, (e, e_t), none = [], np.zeros((2, 2)), np.zeros((1, 1))
    C, _ = turning(0.0)
    a = np.linalg.solve(np.block([[mass, C.T], [C, none]]), [1.0, 0.0, 0.0])[:2]
    for t, f in zip(TIMES, force, strict=True):
        (C, C_t), before = turning(t), e_t
        e_t = e_t + H / 2 * a
        e = e + H / 2 * (before + e_t)
        whole = np.block([[mass + H**2 / 4 * stiffness, C.T], [H / 2 * C + H**2 / 4 * C_t, none]])
        a = np.linalg.solve(whole, [*(f - stiffness @ e), -(C @ e_t + C_t @ e).item()])[:2]
        e, e_t = e + H**2 / 4 * a, e_t + H / 2 * a
        found.append(e)
    return np.array(found)


@pytest.mark.parametrize("block", [1, 7, STEPS])
def test_drift_of_constraints(block):
    """Of a mass between springs, on a line that turns by 0.02 rad a step, pushed along and across."""
    mass, stiffness, none = np.diag([1.0, 2.0]), np.diag([9.0, 8.0]), np.zeros((2, 2))
    force, times, found, added = np.column_stack([np.cos(TIMES), np.sin(2 * TIMES)]), np.append(0.0, TIMES), [], []
    tangents = [Tangent(t, mass, none, stiffness, turning(t)[0], turning(t)[0]) for t in times]
    feedback, drift = Feedback(Scheme.of_radius(1.0)), JointDrift(2, lambda count: None)
    feedback.start(tangents[0], np.array([1.0, 0.0]))
    drift.start(tangents[0])
    for first in range(0, STEPS, block):
        part = slice(first, first + block)
        drift.begin(len(TIMES[part]))
        e, _ = feedback.advance(TIMES[part], force[part], times[first:], tangents[first:].__getitem__, late=[drift])
        found.append(e[0])
        added.append(drift.added[0])
    truth, found, added = held_at_rates(mass, stiffness, force), np.concatenate(found), np.concatenate(added)
    missed = np.abs(truth - found).max() / np.abs(added).max()
    assert missed < 2e-4  # 6e-5 where rates of C know nothing of what follows
    assert np.abs(added).max() > 1e-4 * np.abs(truth).max()
