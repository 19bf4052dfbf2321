"""A body of few nodes, a mass on a spring beside it, and what joins them, as arrays: what a march goes through."""

import numpy as np
import scipy.sparse as sp

from exudyn_romerr.mechanism.rotations import turned_parameters
from exudyn_romerr.mechanism.rows import Rows
from exudyn_romerr.mechanism.splined import Reading, Splined
from exudyn_romerr.mechanism.unknowns import Unknowns
from tests.helpers.small_body import SmallBody

H = 2e-3


class SmallMechanism:
    """A body, whose frame a constraint holds along x, and another node of three coordinates on a spring.

    rows : of a motion that is smooth, and turns where `turns`. unknowns, rest : as the stages have them. samples :
    whether forces are fed back by the begins of steps, too. first_order : how many coordinates of first order.
    """

    def __init__(self, T=12, turns=True, seed=0, samples=False, first_order=0):
        rng = np.random.default_rng(seed)
        self.small = SmallBody(seed)
        n_q = 7 + self.small.body.n + 3
        other = np.arange(7 + self.small.body.n, n_q)
        self.unknowns = Unknowns([self.small.body], [(other, None)], n_q, np.full(first_order, 7.0), H * T)
        self.rows, self._samples = self._motion(T, turns, self.unknowns.n_q, rng), samples
        readings = [self._reading(rng) for _ in range(2)]
        self.rest = Splined(
            self.rows[[0, -1]], readings, np.ones(self.unknowns.n_a), np.ones(readings[0].H.shape[-1])
        )

    def _motion(self, T, turns, n_q, rng):
        t, w = H * np.arange(T), 20.0
        shapes = rng.normal(size=(2, n_q)) * 0.1
        q = np.sin(w * t)[:, None] * shapes[0] + np.cos(w * t)[:, None] * shapes[1]
        v = w * (np.cos(w * t)[:, None] * shapes[0] - np.sin(w * t)[:, None] * shapes[1])
        a = -(w**2) * q
        reference = self.small.body.place.reference[3:]
        spin = rng.normal(size=3) * turns * 5.0

        turn = [t[:, None] * spin, np.tile(spin, (T, 1)), np.zeros((T, 3))]
        still = np.tile(reference, (T, 1))
        part = slice(3, 7)
        p, v[:, part], a[:, part] = turned_parameters([still, 0 * still, 0 * still], turn)
        q[:, part] = p - reference
        return Rows(t, q, v, a, rng.normal(size=(T, 1)))

    def _reading(self, rng):
        n = self.unknowns.n_a
        half, rates = rng.normal(size=(n, n)), self.unknowns.first_order
        at = np.arange(rates.start - 3, n)
        M, K = np.zeros((n, n)), half @ half.T
        M[at, at], K[:, rates] = 2.0, 0.0
        C = np.zeros((1, n))
        C[0, [0, rates.start - 3]] = 1.0, -0.5
        sampled = tuple(0.1**k * np.outer(*rng.normal(size=(2, n))) for k in range(2)) if self._samples else ()
        return Reading.of(M, 0.01 * half @ half.T, K, C, C, sp.csr_matrix((n * n, 1)), sampled=sampled)
