"""Marches with coordinates held at zero, against the march of the equations without these."""

import numpy as np
import pytest

from exudyn_romerr.estimates.march import Tangent
from exudyn_romerr.estimates.mechanism_feedback import Feedback
from exudyn_romerr.estimates.narrow_marches import NarrowMarches
from exudyn_romerr.trajectory.scheme import Scheme

K, CONSTRAINTS, STEPS = 12, 2, 150
SCHEME = Scheme(0.2, 0.4, 0.36, 0.7)
# of the largest coordinate: what inverses interpolated in time leave of a step, the square of INVERSE_ERROR
SAME = 1e-6


def tangents(rng):
    """Two tangents with M > 0, K > 0 and independent constraints."""
    made = []
    for t in (0.0, 1.0):
        M, D, stiffness = (A @ A.T + np.eye(K) for A in rng.standard_normal((3, K, K)))
        G = np.eye(CONSTRAINTS, K) + 0.05 * rng.standard_normal((CONSTRAINTS, K))
        made.append(Tangent(t, M, 0.1 * D, 30 * stiffness, G, G))
    near = 0.02  # as little changes between two readings of a mechanism
    first, other = (vars(tangent) for tangent in made)
    return made[0], Tangent(1.0, *(first[x] + near * (other[x] - first[x]) for x in "MDKGC"))


def part(tangent, kept):
    """The equations of some coordinates."""
    M, D, stiffness = (A[np.ix_(kept, kept)] for A in (tangent.M, tangent.D, tangent.K))
    return Tangent(tangent.t, M, D, stiffness, tangent.G[:, kept], tangent.C[:, kept])


@pytest.mark.parametrize("rest", [False, True])
@pytest.mark.parametrize("held", [(5, 9, 11), (7,), ()])
def test_held_coordinates_are_as_if_they_were_not_there(held, rest):
    """Two marches at once, in several calls; one of them holds nothing and is the main march."""
    rng = np.random.default_rng(3)
    ends, t = tangents(rng), np.linspace(0, 0.9, STEPS + 1)[1:]
    force = rng.standard_normal(K) * np.sin(np.outer(t, rng.uniform(2, 40, K)))
    start = force[0], force[1] if rest else None
    left_out = np.isin(np.arange(K), held)
    main, narrow = Feedback(SCHEME), NarrowMarches([left_out, np.zeros(K, dtype=bool)])
    main.start(ends[0], *start, 0.0)
    narrow.start(ends[0], *start)
    kept = np.flatnonzero(~left_out)
    alone, few = Feedback(SCHEME), [part(tangent, kept) for tangent in ends]
    alone.start(few[0], start[0][kept], None if start[1] is None else start[1][kept], 0.0)
    np.testing.assert_allclose(narrow.states[0][:, kept], alone.state, rtol=0, atol=1e-12 * np.abs(alone.state).max())
    whole, found, expected = [], [], []
    for steps in (slice(0, 40), slice(40, STEPS)):
        narrow.begin(force[steps])
        whole.append(main.advance(t[steps], force[steps], np.array([0.0, 1.0]), ends.__getitem__, [narrow])[0])
        found.append(narrow.found())
        expected.append(alone.advance(t[steps], force[steps][:, kept], np.array([0.0, 1.0]), few.__getitem__)[0])
    whole, expected = (np.concatenate(x, axis=1) for x in (whole, expected))
    found, unheld = np.concatenate(found, axis=2)
    for order in range(3):
        size = np.abs(expected[order]).max()
        assert np.abs(found[order][:, kept] - expected[order]).max() <= SAME * size
        assert np.abs(unheld[order] - whole[order]).max() <= SAME * np.abs(whole[order]).max()
    assert not found[..., left_out].any()
