"""What auxiliary vectors add to tangents: made once for a reading, whatever is read between and before."""

from types import SimpleNamespace

import numpy as np
import pytest

from exudyn_romerr.mbs.derivatives.tangent_reading import Reading, admitted
from exudyn_romerr.mbs.mechanism.enriched_body import Couplings
from exudyn_romerr.mbs.mechanism.extended_tangents import ExtendedReadings, ExtendedTangents

N, M, C = 4, 3, 2  # coordinates, vectors, constraints
ROUNDING = 1e-14  # of sums of ten numbers of order 1


class Body:
    """Couplings that are polynomials of time; times: of which they were asked for."""

    columns = np.array([1, 2, 3])

    def __init__(self):
        self.times = []

    def couplings(self, t, states):
        self.times += t.tolist()
        shapes, by = [(6, M)] * 3 + [(M, 3)] * 2, t[:, None, None] ** 2
        return Couplings(*((i + by) * np.ones(shape) for i, shape in enumerate(shapes)))


def reading(t):
    rng = np.random.default_rng(round(100 * t))
    K, D = rng.normal(size=(2, N, N))
    G, C_t = rng.normal(size=(2, C, N))
    state = (*rng.normal(size=(3, N)), np.zeros(C))
    return Reading(t, state, np.eye(N) * (1 + t), D, K, G, G, C_t, np.ones(N), np.ones(N))


def test_what_is_made_of_a_reading_is_not_made_again():
    body, tangents = Body(), SimpleNamespace(readings=[reading(t) for t in (0.0, 0.2, 0.7)])
    tangents.forget = lambda: tangents.readings.__delitem__(slice(None, -2))
    parts, size = [(body, slice(N, N + M))], N + M
    made = ExtendedReadings(tangents, size, parts)
    assert made.now() is made.now()
    tangents.readings.insert(2, reading(0.5))
    made.now()
    assert body.times == [0.0, 0.2, 0.7, 0.5]
    made.forget()
    tangents.readings.append(reading(0.9))
    found = made.now()
    assert body.times == [0.0, 0.2, 0.7, 0.5, 0.9]
    whole = ExtendedTangents(tangents.readings, size, parts)
    for j in range(3):
        for one, other in ((found[j], whole[j]), (found[j].rate, whole[j].rate)):
            for name in ("t", "M", "D", "K", "G", "C"):
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("c", [0, 2])
def test_motions_that_constraints_admit(c):
    G = np.random.default_rng(c).normal(size=(3, c, N))
    found = admitted(G)
    assert found.shape == (3, N, N - c)
    assert np.abs(G @ found).max(initial=0.0) < ROUNDING
    assert np.abs(found.swapaxes(1, 2) @ found - np.eye(N - c)).max() < ROUNDING
