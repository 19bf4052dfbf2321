"""ExtendedTangents: the linearised equations of a mechanism with auxiliary vectors of its bodies, over time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...estimates.march import Tangent

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..access.linearisation import Reading
    from .enriched_body import EnrichedBody


class ExtendedTangents:
    """Tangents with the vectors behind the coordinates of the mechanism, on a spline in time through its readings.

    Made when asked for, two kept. t : their times, those of the readings.
    """

    def __init__(self, readings: Sequence[Reading], size: int, parts: Sequence[tuple[EnrichedBody, slice]]):
        """Size counts the coordinates of mechanism and vectors; parts: bodies, and where their vectors are."""
        self._size = size
        times = np.array([reading.t for reading in readings])
        states = [np.array([reading.state[k] for reading in readings]) for k in range(3)]
        coupled = [(body.couplings(times, [x[:, body.columns] for x in states]), body, own) for body, own in parts]
        whole = np.array([self._whole(j, reading, coupled) for j, reading in enumerate(readings)])
        self.t = times
        self._spline, self._turning = _held(whole[0]), _held(readings[0].C)
        if len(times) > 1:
            from scipy.interpolate import CubicHermiteSpline, CubicSpline  # here, for it takes long to import

            varies = (whole != whole[0]).any(axis=0)  # of two bodies much is zero, and stays so
            self._spline = _filled(whole[0], varies, CubicSpline(times, whole[:, varies]))
            # rates of the motion itself: where pieces of splines meet, C would have a kink
            C, C_t = (np.array([getattr(reading, name) for reading in readings]) for name in ("C", "C_t"))
            self._turning = CubicHermiteSpline(times, C, C_t)
        self._made: dict[int, Tangent] = {}

    def __getitem__(self, j: int) -> Tangent:
        if j not in self._made:
            self._made = {i: tangent for i, tangent in self._made.items() if i == j - 1}
            self._made[j] = replace(self._tangent(j, 0), rate=self._tangent(j, 1))
        return self._made[j]

    def _tangent(self, j: int, order: int) -> Tangent:
        """The tangent, or its rate."""
        n, t = self._size, self.t[j]
        turning, whole = self._turning(t, order), self._spline(t, order)
        C = np.hstack([turning, np.zeros((len(turning), n - turning.shape[1]))])
        return Tangent(t, *whole[: 3 * n].reshape(3, n, n), whole[3 * n :], C)

    def _whole(self, j: int, reading: Reading, parts: Sequence[tuple]) -> np.ndarray:
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


def _filled(value: np.ndarray, varies: np.ndarray, spline: Callable) -> Callable[[float, int], np.ndarray]:
    """What changes with time in some entries, by a spline, and its rate."""

    def at(t: float, order: int) -> np.ndarray:
        found = _held(value)(t, order).copy()
        found[varies] = spline(t, order)
        return found

    return at


def _held(value: np.ndarray) -> Callable[[float, int], np.ndarray]:
    """What does not change with time, and its rate."""
    return lambda _, order: np.zeros_like(value) if order else value
