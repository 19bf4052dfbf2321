"""Multipliers of marched steps."""

import numpy as np
import pytest

from exudyn_romerr.estimates.march import Columns
from exudyn_romerr.estimates.mechanism_feedback import Feedback
from exudyn_romerr.estimates.track import Track
from tests.estimates.test_narrow_marches import CONSTRAINTS, SCHEME, STEPS, K, part, tangents

# of the largest force: what inverses interpolated in time leave of accelerations, the square of INVERSE_ERROR
BALANCED = 1e-6
SAME = 1e-12  # the same products of the same numbers


class Beside:
    """A march of its own beside Feedback's, under forces (S, K, columns), that keeps what it finds."""

    def __init__(self, force, held=()):
        self.force, self.held = force, held
        self.moving, self.found, self.multipliers, self.steps = np.zeros((4, K, self.force.shape[2])), [], [], []

    def columns(self, steps):
        done = sum(map(len, self.steps))
        return Columns(self.moving, self.force[done : done + len(steps)], held=self.held)

    def take(self, steps, found, given):
        [(same, multipliers)] = steps.march(self.columns(steps), multipliers=True)
        assert np.abs(given - multipliers).max() <= SAME * np.abs(multipliers).max()
        assert np.abs(same - found).max() <= SAME * np.abs(found).max()
        self.found.append(found)
        self.multipliers.append(multipliers)
        self.steps.append(steps)
        self.moving = found[-1]


def run(held=()):
    """A march beside that of Feedback, times, tangents."""
    rng = np.random.default_rng(8)
    ends, t = tangents(rng), np.linspace(0, 0.9, STEPS + 1)[1:]
    beside = Beside(rng.standard_normal((STEPS, K, 2)), held)
    feedback = Feedback(SCHEME)
    feedback.start(ends[0], np.zeros(K), None, 0.0)
    feedback.advance(t, np.zeros((STEPS, K)), np.array([0.0, 1.0]), ends.__getitem__, [beside])
    return beside, t, ends


@pytest.mark.parametrize("held", [(), (5, 9, 11)])
def test_multipliers_balance_the_equations_at_the_samples(held):
    """M e'' + D e' + K e + G^T l = f where tangents are linear in time, and nothing is held."""
    beside, t, (first, last) = run([np.array(held, dtype=int), np.array([], dtype=int)])
    found, forces = np.concatenate(beside.found), np.concatenate(beside.multipliers)
    assert forces.shape == (STEPS, CONSTRAINTS, 2)
    kept = np.setdiff1d(np.arange(K), held)
    for column, free in enumerate((kept, np.arange(K))):
        few = [part(tangent, free) for tangent in (first, last)]
        for s, now in enumerate(t):
            M, D, stiffness, G = (
                getattr(few[0], x) + now * (getattr(few[1], x) - getattr(few[0], x)) for x in "MDKG"
            )
            e, e_t, e_tt = found[s, :3, free, column].T
            left = M @ e_tt + D @ e_t + stiffness @ e + G.T @ forces[s, :, column] - beside.force[s, free, column]
            assert np.abs(left).max() <= BALANCED * np.abs(M @ e_tt).max()


def test_columns_that_are_equal_or_zero_are_as_if_marched_alone():
    """Bit for bit, held coordinates or not; zero ones stay zero."""
    rng = np.random.default_rng(4)
    ends, t = tangents(rng), np.linspace(0, 0.9, STEPS + 1)[1:]
    first, other = rng.standard_normal((2, STEPS, K, 1))
    force = np.concatenate([first, 0 * first, first, other, first], axis=2)
    held = [np.zeros(0, int)] * 4 + [np.array([7])]
    [(_, steps)] = Track(SCHEME).steps(0.0, t[:40], np.array([0.0, 1.0]), ends.__getitem__)
    moving = np.zeros((4, K, 5))
    together = steps.march(Columns(moving, force[:40], held=held), multipliers=True)[0]
    alone = [
        steps.march(Columns(moving[..., :1], force[:40, :, j : j + 1], held=held[j : j + 1]), multipliers=True)[0]
        for j in range(5)
    ]
    for found, single in zip(together, zip(*alone, strict=True), strict=True):
        assert np.array_equal(found, np.concatenate(single, axis=-1))
        assert not found[..., 1].any()
        assert np.array_equal(found[..., 0], found[..., 2])
        assert not np.array_equal(found[..., 0], found[..., 4])
