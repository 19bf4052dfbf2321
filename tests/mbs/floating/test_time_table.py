"""TimeTable: values of a function of time are kept, in whatever order times are asked for."""

import numpy as np

from exudyn_romerr.mbs.floating.time_table import TimeTable


def test_no_time_is_asked_for_twice():
    """Times of samples, those between, the same again, some of both and new ones, backwards and repeated."""
    asked = []

    def f(t):
        assert np.all(np.diff(t) > 0)
        asked.extend(t.tolist())
        return np.stack([t, t**2], axis=1)

    table, rng = TimeTable(), np.random.default_rng(2)
    samples, between = np.arange(8.0), np.arange(8.0)[:, None] + np.array([0.25, 0.5])
    mixed = np.concatenate([samples[3:], [0.1, 7.7], between.ravel()[:5]])
    for t in (
        samples,
        between.ravel(),
        between.ravel(),
        samples[::-1],
        mixed,
        np.tile(mixed, 2),
        rng.permutation(mixed),
    ):
        found = table.at(t, f)
        np.testing.assert_array_equal(found, np.stack([t, t**2], axis=1))
        found[:] = np.nan  # what was returned is the caller's
    assert len(asked) == len(set(asked)) == 8 + 16 + 2
