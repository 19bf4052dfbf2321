"""ExtendedTangents: the linearised equations of a mechanism with auxiliary vectors of its bodies, over time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...estimates.march import Tangent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..access.linearisation import Reading
    from .enriched_body import EnrichedBody


class ExtendedTangents:
    """Tangents with the vectors behind the coordinates of the mechanism, and rates of a spline in time through them.

    Made when asked for, two kept. t : their times, those of the readings.
    """

    def __init__(self, readings: Sequence[Reading], size: int, parts: Sequence[tuple[EnrichedBody, slice]]):
        """Size counts the coordinates of mechanism and vectors; parts: bodies, and where their vectors are."""
        self._size = size
        times = np.array([reading.t for reading in readings])
        states = [np.array([reading.state[k] for reading in readings]) for k in range(3)]
        coupled = [(body.couplings(times, [x[:, body.columns] for x in states]), body, own) for body, own in parts]
        whole = np.array([self._extended(j, reading, coupled) for j, reading in enumerate(readings)])
        self.t = times
        self._whole, self._rates = whole, np.zeros_like(whole)
        if len(times) > 1:
            from scipy.interpolate import CubicSpline  # here, for it takes long to import: see floating_adapter

            varies = (whole != whole[0]).any(axis=0)  # of two bodies much is zero, and stays so
            slopes = CubicSpline(times, np.eye(len(times)))(times, 1)  # of values at these times
            self._rates[:, varies] = slopes @ (whole[:, varies] - whole[0, varies])
        # rates of the motion itself: where pieces of splines meet, C would have a kink
        self._turning = [(reading.C, reading.C_t if len(times) > 1 else 0 * reading.C) for reading in readings]
        self._made: dict[int, Tangent] = {}

    def __getitem__(self, j: int) -> Tangent:
        if j not in self._made:
            self._made = {i: tangent for i, tangent in self._made.items() if i == j - 1}
            self._made[j] = replace(self._tangent(j, 0), rate=self._tangent(j, 1))
        return self._made[j]

    def _tangent(self, j: int, order: int) -> Tangent:
        """The tangent, or its rate."""
        n, turning, whole = self._size, self._turning[j][order], (self._whole, self._rates)[order][j]
        C = np.hstack([turning, np.zeros((len(turning), n - turning.shape[1]))])
        return Tangent(self.t[j], *whole[: 3 * n].reshape(3, n, n), whole[3 * n :], C)

    def _extended(self, j: int, reading: Reading, parts: Sequence[tuple]) -> np.ndarray:
        """M, D, K and G of reading j with the vectors, one upon another."""
        n = len(reading.M)
        M, D, K = np.zeros((3, self._size, self._size))
        M[:n, :n], D[:n, :n], K[:n, :n] = reading.M, reading.D, reading.K
        for of, body, own in parts:
            rows = np.concatenate([body.columns, np.arange(own.start, own.stop)])
            M[rows, own], D[rows, own], K[rows, own] = of.M[j], of.D[j], of.K[j]
            M[own, body.columns] = of.M[j][: len(body.columns)].T
            D[own, body.columns], K[own, body.columns] = of.D_rows[j], of.K_rows[j]
        G = np.zeros((len(reading.G), self._size))
        G[:, :n] = reading.G
        return np.vstack([M, D, K, G])
