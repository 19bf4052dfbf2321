"""Looks: loads that are known at all samples, of which as few are to be looked at as tell the rest."""

import numpy as np
import pytest

from exudyn_romerr.mbs.shadow import looks as module
from exudyn_romerr.mbs.shadow.looks import Looks, look_together

S = 64
t = 0.1 * np.arange(1, S + 1)
LAST = 0.1 * (S + 1)


def looks_at(loads, ends=LAST, calls=None, moved=0.0):
    """Looks at loads (S, 1) that are 0 before, where a prediction moves them, too; no constraints."""

    def residuals(rows, e):
        if calls is not None:
            calls.append(len(rows[0]))
        found = (loads(rows[0])[:, None] + e[0], np.zeros((len(rows[0]), 0)))
        return found if rows[0][-1] < ends else None

    rows, before = (t, *np.zeros((3, S, 1))), (0.0, np.zeros(1), np.zeros(0))
    return Looks(rows, np.full((3, S, 1), moved), None, before, residuals, lambda F, g: np.abs(F), np.zeros(1))


def every(count):
    return np.arange(S) % count == count - 1


def test_lines_are_confirmed_by_one_sample_each():
    looks = looks_at(lambda now: 2.0 * now)
    looks.at(every(16))
    looks.confirm(np.ones(S, dtype=bool))
    assert looks.known.sum() == 2 * S / 16
    np.testing.assert_allclose(looks.all[0][:, 0], 2.0 * t, rtol=1e-12)


def test_two_are_looked_at_at_once_and_keep_their_own():
    calls = []
    one, other = (looks_at(np.cos, LAST, calls, moved) for moved in (1.0, 2.0))
    one.at(every(32))
    for _ in range(2):  # the second time all of them are known
        look_together([(one, every(16)), (other, every(8))])
    assert calls == [S // 32, S // 16 - S // 32 + S // 8]
    for looks, moved, where in ((one, 1.0, every(16)), (other, 2.0, every(8))):
        np.testing.assert_array_equal(looks.known, where)
        np.testing.assert_array_equal(looks.all[0][where, 0], np.cos(t[where]) + moved)


def test_what_fails_ends_both():
    looks = [looks_at(np.cos, 3.0), looks_at(np.cos, 3.0)]
    look_together([(one, every(16)) for one in looks])
    assert all(one.ended and not one.known.any() for one in looks)


def test_what_sets_in_is_found_to_the_sample():
    loads = lambda now: np.where(now > 3.75, 1.0, 0.0)  # noqa: E731
    looks = looks_at(loads)
    looks.at(every(16))
    looks.confirm(np.ones(S, dtype=bool))
    assert looks.known.sum() < S / 3
    np.testing.assert_array_equal(looks.all[0][:, 0], loads(t))


def test_what_is_bent_is_known_as_well_as_lines_are_confirmed():
    """Halving a piece leaves a quarter of what is off in its middle."""
    loads = lambda now: np.sin(1.5 * now)  # noqa: E731
    looks = looks_at(loads)
    looks.at(every(8))
    looks.confirm(np.ones(S, dtype=bool))
    assert looks.known.sum() < S
    assert np.abs(looks.all[0][:, 0] - loads(t)).max() < module.CONFIRMED


@pytest.mark.parametrize("least", [0.0, 2.0])
def test_what_is_too_small_needs_no_look(least):
    """And only samples that are asked for do."""
    looks = looks_at(lambda now: (-1.0) ** np.round(now / 0.1))
    looks.at(every(16))
    before = looks.known.copy()
    looks.confirm(np.arange(S) < 32, least)
    assert looks.known[:31].sum() == (31 if least == 0.0 else 2 * 2 - 1)
    np.testing.assert_array_equal(looks.known[32:], before[32:])


def test_where_they_end_what_is_known_last_is_held():
    looks = looks_at(lambda now: now, ends=3.0)
    looks.at(every(8) & (t < 3.0))
    looks.at(every(8))
    assert looks.ended
    looks.confirm(np.ones(S, dtype=bool))
    assert looks.known.sum() == 3
    np.testing.assert_allclose(looks.all[0][24:, 0], t[23])
    assert looks.last[0] == t[23]
