"""Looks: loads that are known at all samples, of which as few are to be looked at as tell the rest."""

import numpy as np
import pytest

from exudyn_romerr.mbs.shadow import looks as module
from exudyn_romerr.mbs.shadow.looks import Looks

S = 64
t = 0.1 * np.arange(1, S + 1)
LAST = 0.1 * (S + 1)


def looks_at(loads, ends=LAST):
    """Looks at loads (S, 1) that are 0 before; no constraints."""

    def residuals(rows, _):
        return (loads(rows[0])[:, None], np.zeros((len(rows[0]), 0))) if rows[0][-1] < ends else None

    rows, before = (t, *np.zeros((3, S, 1))), (0.0, np.zeros(1), np.zeros(0))
    return Looks(rows, np.zeros((3, S, 1)), None, before, residuals, lambda F, g: np.abs(F), np.zeros(1))


def every(count):
    return np.arange(S) % count == count - 1


def test_lines_are_confirmed_by_one_sample_each():
    looks = looks_at(lambda now: 2.0 * now)
    looks.at(every(16))
    looks.confirm(np.ones(S, dtype=bool))
    assert looks.known.sum() == 2 * S / 16
    np.testing.assert_allclose(looks.all[0][:, 0], 2.0 * t, rtol=1e-12)


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
