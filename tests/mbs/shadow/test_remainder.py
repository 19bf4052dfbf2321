"""Remainder: Duffing oscillators, whose nonlinear motion under the same scheme is the truth."""

from functools import cache

import numpy as np
import pytest

from exudyn_romerr.estimates.march import Tangent
from exudyn_romerr.estimates.mechanism_feedback import Feedback
from exudyn_romerr.mbs.shadow import looks
from exudyn_romerr.mbs.shadow import remainder as module
from exudyn_romerr.mbs.shadow.remainder import Remainder, march_together
from exudyn_romerr.trajectory.scheme import Scheme

SCHEME = Scheme.of_radius(0.9)
T, STEPS = 6.0, 480
t = np.linspace(0.0, T, STEPS + 1)
M, D, K = np.eye(2), 0.05 * np.eye(2), np.array([[5.0, -1.0], [-1.0, 8.0]])
G = np.zeros((0, 2))
FORCE = np.stack([np.sin(1.5 * t), np.sin(4.0 * t)], axis=1)


def cubic(x, hardening):
    return hardening * x**3


@cache
def nonlinear(hardening):
    """e, e', e'' (3, STEPS, 2) of M e'' + D e' + K e + hardening e^3 = FORCE by the scheme."""
    return solved(FORCE, lambda x: cubic(x, hardening))


def solved(force, law):
    """The same for any force (STEPS + 1, 2) and any law; fixed-point iteration."""
    e, before = linear(force[1:]), np.inf
    while not np.abs(e - before).max() < 1e-9 * np.abs(e).max():  # each leaves a third or less
        e, before = linear(force[1:] - law(e[0])), e
    return e


def linear(force, late=()):
    feedback, tangent = Feedback(SCHEME), Tangent(0.0, M, D, K, G, G)
    feedback.start(tangent, np.zeros(2))
    return feedback.advance(t[1:], force, np.zeros(1), lambda j: tangent, (), late)[0]


def sizes(x):
    return np.linalg.norm(x[0], axis=1)[:, None]


class Late:
    """A remainder about no motion, with the calls of residuals."""

    def __init__(self, hardening, ends=np.inf, force=FORCE, law=None, **options):
        self.looked, self.force, self.ends = [], force, ends
        self.law = law or (lambda x: cubic(x, hardening))
        self.remainder = Remainder(2, 1, sizes, **options)
        self.remainder.start(0.0, 0)
        none = np.zeros((STEPS, 2))
        self.remainder.begin((t[1:], none, none, none), self.residuals)
        self.predicted, self.added = [], np.zeros((3, STEPS, 2))

    def residuals(self, rows, e):
        """Nonlinear equations less forces, which the linear ones answer."""
        now, (q, q_t, q_tt) = rows[0], (x + dx for x, dx in zip(rows[1:], e, strict=True))
        self.looked += now.tolist()
        at = np.searchsorted(t, now - 1e-9)
        left = q_tt @ M + q_t @ D + q @ K + self.law(q) - self.force[at]
        return (left, np.zeros((len(now), 0))) if now[-1] < self.ends else None

    def follow(self, steps, part, e):
        self.remainder.go_to(steps, part, e)
        march_together(steps, {self.remainder: self.remainder.columns()})
        added, self.multipliers = self.remainder.added, self.remainder.multipliers
        if added is not None:
            self.added[:, part] = added
        return added


def measured(hardening, **options):
    late = Late(hardening, **options)
    e = linear(late.force[1:], [late])
    return e - late.added, late, late.remainder.found()


def off(found, wanted):
    return np.abs(found - wanted).max() / np.abs(wanted).max()


@pytest.fixture
def everywhere(monkeypatch):
    """All samples are looked at, and nothing is added."""
    monkeypatch.setattr(module, "EVERY", 1)
    monkeypatch.setattr(module, "FARTHER", 1)
    monkeypatch.setattr(module, "PAYS", np.inf)


@pytest.mark.parametrize("hardening", [1.0, -1.0])
def test_remainder_is_what_linear_equations_leave_out(hardening, everywhere):
    """To second order: of r it misses three times its share of the prediction, for (e + r)^3 = e^3 + 3 e^2 r."""
    e, late, found = measured(hardening)
    true = nonlinear(hardening) - e
    share = np.abs(true[0]).max() / np.abs(e[0]).max()
    assert 0.02 < share < 0.3
    assert off(found.r[0], true[0]) < 3 * share
    assert not found.added.any()
    assert late.remainder.shares == pytest.approx(share, rel=0.3)


def test_a_look_now_and_then_tells_the_size(monkeypatch):
    monkeypatch.setattr(module, "PAYS", np.inf)
    e, late, found = measured(0.1)
    true = nonlinear(0.1) - e
    assert np.abs(found.r[0]).max() == pytest.approx(np.abs(true[0]).max(), rel=0.3)
    assert len(late.looked) < STEPS / 8


@pytest.mark.parametrize("at_once", [False, True])
def test_what_pays_is_added_and_what_does_not_is_not(at_once):
    e, late, found = measured(1.0, at_once=at_once)
    assert late.remainder.adds
    true = nonlinear(1.0) - e
    begin = np.argmax(found.added.any(axis=(0, 2)))
    assert 0 < len(late.looked) <= (0.7 if at_once else 1.0) * STEPS
    assert off(found.added[0, begin + module.RAMP :], true[0, begin + module.RAMP :]) < 0.3
    if not at_once:  # it sets in without a jump
        assert np.abs(found.added[:2, begin]).max() < 1e-3 * np.abs(found.added[:2]).max()
    little = measured(1e-3)[1]
    assert not little.remainder.adds
    assert not little.added.any()


def test_what_drives_it_goes_on_from_one_block_of_steps_to_the_next(monkeypatch):
    """Held from the last look on, it jumped by 45 % of its largest where new looks told what had been between."""
    monkeypatch.setattr(module, "PAYS", np.inf)
    late = Late(0.1, at_once=True)
    driven, columns = [], late.remainder.columns

    def kept():
        found = columns()
        driven.append(found.force[..., 0])
        return found

    monkeypatch.setattr(late.remainder, "columns", kept)
    linear(late.force[1:], [late])
    assert len(driven) > 2
    force = np.concatenate(driven)
    jumps = np.abs(np.diff(force, axis=0)).max(axis=1)
    borders = np.cumsum([len(x) for x in driven])[:-1] - 1
    within = np.delete(jumps, borders).max()
    assert jumps[borders].max() < 1.2 * within


def test_what_is_as_large_as_the_prediction_is_not_added(monkeypatch):
    monkeypatch.setattr(module, "LOST", 0.01)
    _, late, found = measured(1.0)
    assert np.abs(found.r).max() > 0
    assert not late.remainder.adds


def test_where_residuals_end_nothing_more_is_asked():
    _, late, _ = measured(1e-3, ends=3.0)
    assert max(late.looked) < 5.0  # within those that are marched through together
    assert not late.remainder.adds


def test_left_covers_what_is_left():
    """Of the prediction with what was added: at every instant, largest so far."""
    for hardening in (0.1, 1.0, -1.0):
        e, late, found = measured(hardening)
        true = np.abs(nonlinear(hardening)[0] - e[0] - late.added[0])
        left = sum(np.abs(x[0]) for x in found.left())
        allowed = np.maximum.accumulate(left)
        assert np.all(true <= allowed + 1e-3 * np.abs(true).max())


def swept(t):
    """Of a load that passes through both natural frequencies."""
    return np.sin(1.0 * t + 0.35 * t**2)


SOFT = np.sqrt((13 - np.sqrt(13)) / 2)  # rad/s: the lower natural frequency
BREAKING = {  # factors of the load over time
    "sets in suddenly, late": lambda t: np.where(t > 3.1, 1.0, 0.0),
    "small before that": lambda t: np.where(t > 3.1, 1.0, 1e-3) * np.sin(9.0 * t),
    "ends": lambda t: np.where(t < 3.1, np.sin(2.0 * t), 0.0),
    "lasts 12 steps": lambda t: np.where((t > 3.1) & (t < 3.25), 5.0, 0.0),
    "grows by resonance": lambda t: 0.2 * np.sin(SOFT * t),
    "spins up": swept,
    "alternates": lambda t: 20.0 * (-1.0) ** np.round(t / (T / STEPS)),
}


def contact(x):
    """A stop that the motion reaches now and then."""
    return 1.5 * np.sign(x) * np.maximum(np.abs(x) - 0.15, 0.0)


@pytest.mark.parametrize(
    "law", [lambda x: cubic(x, 1.0), lambda x: cubic(x, 0.05), contact], ids=["1", "0.05", "stop"]
)
@pytest.mark.parametrize("load", BREAKING)
def test_left_covers_what_sets_in_between_looks(load, law):
    """Nothing tells the remainder of these but what it looks at, and the prediction."""
    force = BREAKING[load](t)[:, None] * np.array([1.0, 0.3])
    e, late, found = measured(None, force=force, law=law)
    true = np.abs(solved(force, law)[0] - e[0] - late.added[0])
    left = np.maximum.accumulate(sum(np.abs(x[0]) for x in found.left()))
    assert np.all(true <= left + 1e-3 * np.abs(e[0]).max())


def test_a_second_run_goes_on_from_the_first():
    whole = measured(1.0)[2]
    first = Late(1.0)
    feedback, tangent = Feedback(SCHEME), Tangent(0.0, M, D, K, G, G)
    feedback.start(tangent, np.zeros(2))
    half = 256  # steps: a border of those that are marched through together
    parts = []
    late = first
    for part in (slice(0, half), slice(half, STEPS)):
        none = np.zeros((part.stop - part.start, 2))
        late.remainder.begin((t[1:][part], none, none, none), late.residuals)
        feedback.advance(t[1:][part], FORCE[1:][part], np.zeros(1), lambda j: tangent, (), [late])
        parts.append(late.remainder.found())
        after = Late(1.0)
        after.remainder.go_on(late.remainder)
        late = after
    for k in range(2):
        np.testing.assert_allclose(
            np.concatenate([x[k] for x in parts], axis=1), whole[k], rtol=0, atol=1e-10 * np.abs(whole[k]).max()
        )


def test_samples_after_a_jump_of_accelerations_are_looked_at():
    """Blocks of 20 steps: a jump in one counts in the next, too; a smooth swing is none."""
    jumps = looks.Jumps(2, sizes)
    swing = np.sin(t[1:])[:, None] * np.ones(2)
    swing[150:] += 5.0
    found = [jumps.follow(swing[begin : begin + 20]) for begin in range(0, STEPS, 20)]
    wanted = np.zeros(STEPS, dtype=bool)
    wanted[150 : 150 + looks.DENSE] = True
    np.testing.assert_array_equal(np.concatenate(found), wanted)
