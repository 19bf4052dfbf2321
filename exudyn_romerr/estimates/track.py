"""Track: makes what every step of a march through the linearised equations needs, from tangents now and then."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from ..errors import AssumptionError
from ..linalg.blocked_products import combine
from ..trajectory.scheme import Scheme
from .march import Steps, Tangent, parted

# of a solution: what interpolated inverses may miss at first, where they are used twice, so that its square is left;
# and where they are used once
INVERSE_ERROR, USED_ONCE = 3e-4, 1e-8
SAME_STEP = 1e-9  # of a step size: solvers add up their steps
# inverses that a polynomial in time goes through, those of a shorter row among them; steps of one size from which on
NODES = {3: 4, 5: 6, 9: 12}
INTERPOLATED_FROM = NODES[3]
TOGETHER = 128  # steps that are made, and marched through, at once
IN_CACHE = 2_000_000  # or fewer, so that their matrices have no more numbers than this
AT_LEAST = 8
TRIED = (0.1, 0.7)  # shares of a piece that is as smooth everywhere, far from the nodes of all rows
SINGULAR = (
    "the linearised equations of the mechanism are singular (constraints that contradict each other, or coordinates "
    "without mass); no auxiliary modes with feedback: pass scope='inputs frozen'"
)


class _Piece(NamedTuple):
    """Steps up to a share `high` of the time between two tangents.

    values : inverses at nodes, by which those of the steps are polynomials; None: steps are inverted one by one.
    once : whether it is enough to use them once.
    """

    high: float
    values: np.ndarray | None
    once: bool


class Track:
    """Makes the steps of a run, some at a time, in memory of its own: fresh memory costs more than what fills it."""

    def __init__(self, scheme: Scheme):
        self.scheme = scheme
        self._shape = (-1, -1)  # of G
        self._room = TOGETHER

    def steps(
        self, start: float, t: np.ndarray, times: np.ndarray, tangent: Callable[[int], Tangent]
    ) -> Iterator[tuple[slice, Steps]]:
        """Steps from `start` to times t (S,), TOGETHER at a time; matrices are cubic in time between tangents.

        times : (T,) of tangents, the first not after `start`; the last one is held. tangent : i -> it.
        """
        h, S = np.diff(t, prepend=start), len(t)
        maps = self.scheme.ahead(h), self.scheme.next(h)
        self._allocate(tangent(0))
        after = np.minimum(np.searchsorted(times, t, side="left"), len(times) - 1)
        other = np.flatnonzero((np.diff(after) > 0) | (np.abs(np.diff(h)) > SAME_STEP * h[1:])) + 1
        borders, done = {0, *other.tolist()}, 0
        counts = dict(zip(sorted(borders), np.diff([0, *other, S]).tolist(), strict=True))
        for a, b in pairwise(sorted({*borders, *range(0, S, self._room), S})):
            if a in borders:
                ends = tangent(max(int(after[a]) - 1, 0)), tangent(int(after[a]))
                self._begin(*ends, float(h[a]), counts[a])
            self._make(slice(a - done, b - done), share(t[a:b], *ends))
            if b == S or b - done == self._room:
                made = (of[: b - done] for of in (*self._matrices, self._inverses, self._once))
                part = slice(done, b)
                yield part, Steps(self.scheme, h[part], *made, tuple(of[part] for of in maps))
                done = b

    def _begin(self, first: Tangent, last: Tangent, h: float, count: int) -> None:
        """Begin with so many steps of size h between two tangents."""
        _cubic(first, last, self._cubic)
        (_, k), (mass, damping) = self._shape, self.scheme.mass_and_damping(h)
        self._sizes[self._shape[1] :] = mass * self._heaviest
        moved, whole = parted(self._cubic, *self._shape)
        of_A = whole[:, :k, :k]
        of_A *= mass
        of_A += damping * moved[:, :k, k:]
        of_A += moved[:, :k, :k]
        self._pieces = [_Piece(1.0, None, False)]
        if count >= INTERPOLATED_FROM:
            before, step, start = self._end
            if before is not first or abs(step - h) > SAME_STEP * h:
                start = self._inverse(0.0)
            self._end = last, h, self._inverse(1.0)
            self._solved = whole @ self._sizes  # A times the solution that inverses are tried on
            self._pieces = self._interpolated(0.0, 1.0, count, start, self._end[2])

    def _allocate(self, tangent: Tangent) -> None:
        c, k = tangent.G.shape
        if self._shape == (c, k):
            return
        self._shape, n, self._heaviest = (c, k), k + c, np.abs(np.diag(tangent.M)).max()
        numbers = n * (2 * k + n)
        self._room = int(np.clip(IN_CACHE // (numbers + n * n), AT_LEAST, TOGETHER))
        self._cubic, self._instant = np.zeros((4, numbers)), np.zeros((1, n, n))
        self._of_parts = np.split(self._cubic, [n * 2 * k], axis=1)
        self._matrices = np.empty((self._room, n, 2 * k)), np.empty((self._room, n, n))
        self._once, self._inverses = np.zeros(self._room, dtype=bool), np.empty((self._room, n, n))
        self._sizes = np.ones(n)  # of coordinates and multipliers, so that constraints are of the size of other rows
        self._end: tuple[Tangent | None, float, np.ndarray | None] = (None, 0.0, None)

    def _make(self, place: slice, shares: np.ndarray) -> None:
        """Make steps at shares of the time between the tangents; A of the first, and of those that are corrected."""
        (moved, whole), (of_moved, of_whole) = (of[place] for of in self._matrices), self._of_parts
        inverses = self._inverses[place]
        _at(shares, of_moved, moved)
        _at(shares[:1], of_whole, whole[:1])
        low, done = 0.0, 0
        for high, values, exact in self._pieces:
            part = slice(done, int(np.searchsorted(shares, high, side="right")))
            if not exact and part.stop > done:
                _at(shares[part], of_whole, whole[part])
            if values is None:
                for one, inverse in zip(whole[part], inverses[part], strict=True):
                    inverse[:] = self._inverted(one)
            elif part.stop > done:
                weights = _weights((shares[part] - low) / (high - low), len(values))
                _combined(weights, values, inverses[part])
            self._once[place][part] = exact
            low, done = high, part.stop

    def _interpolated(self, low: float, high: float, count: int, start: np.ndarray, end: np.ndarray) -> list[_Piece]:
        """Return pieces of so many steps between two shares of the time; start, end : the inverses at both."""
        if count < INTERPOLATED_FROM:
            return [_Piece(high, None, False)]
        values = np.array([start, end])
        for nodes in [nodes for nodes, least in NODES.items() if count >= least]:
            values = self._between(low, high, values, nodes)
            off = max(self._off(share, low + share * (high - low), values) for share in TRIED)
            if off <= USED_ONCE:
                break
        if off <= INVERSE_ERROR:
            return [_Piece(high, values, off <= USED_ONCE)]
        if not off <= INVERSE_ERROR * (count / INTERPOLATED_FROM) ** len(values):  # out of reach: halves are better
            return [_Piece(high, None, False)]
        middle, half = (low + high) / 2, values[len(values) // 2]
        first = self._interpolated(low, middle, count // 2, start, half)
        return first + self._interpolated(middle, high, count // 2, half, end)

    def _between(self, low: float, high: float, values: np.ndarray, count: int) -> np.ndarray:
        """Inverses at so many nodes, of which every second one is known."""
        found = np.empty((count, *values.shape[1:]))
        found[::2] = values
        for i in range(1, count, 2):
            found[i] = self._inverse(low + _nodes(count)[i] * (high - low))
        return found

    def _off(self, share: float, of_all: float, values: np.ndarray) -> float:
        """What inverses miss of a solution at a share of a piece, which is one of the time between the tangents."""
        x = np.vander([of_all], 4, increasing=True)[0] @ self._solved
        off = _weights_of(share, len(values)) @ (values @ x) / self._sizes - 1.0
        return float(np.abs(off).max())

    def _inverse(self, share: float) -> np.ndarray:
        return self._inverted(_at(np.array([share]), self._of_parts[1], self._instant)[0])

    def _inverted(self, whole: np.ndarray) -> np.ndarray:
        """A^-1."""
        sizes = self._sizes
        A = whole * sizes
        A *= sizes[:, None]
        try:
            inverse = np.linalg.inv(A)
        except np.linalg.LinAlgError as error:
            raise AssumptionError(SINGULAR) from error
        inverse *= sizes
        inverse *= sizes[:, None]
        return inverse


def share(t: np.ndarray, first: Tangent, last: Tangent) -> np.ndarray:
    """Where times are between two tangents, 0..1; the last one is held."""
    return 0.0 * t if first is last else np.clip((t - first.t) / (last.t - first.t), 0.0, 1.0)


def _cubic(first: Tangent, last: Tangent, out: np.ndarray) -> None:
    """Write coefficients (4, ...) of the matrices between two tangents, by the share of the time gone."""
    value, slope, square, cube = out
    first.write(value)
    if first is last:
        out[1:] = 0.0
        return
    dt = last.t - first.t
    last.write(cube)
    cube -= value  # the change; then slopes at start and end
    for end, row in ((first, slope), (last, square)):
        if end.rate is None:
            row[:] = cube
        else:
            end.rate.write(row)
            row *= dt
    cube *= -2.0
    cube += slope
    cube += square
    square += slope  # slopes s0, s1, bend b = s0 + s1 - 2 change: change - s0 - b = (s0 + s1 - b)/2 - s0 - b
    square -= 3.0 * cube
    square /= 2.0
    square -= slope


def _at(shares: np.ndarray, coefficients: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Write polynomials (S, ...) at shares of the time, by their coefficients (degree + 1, ...)."""
    return _combined(np.vander(shares, len(coefficients), increasing=True), coefficients, out)


def _combined(weights: np.ndarray, values: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Write sums (S, ...) of values (n, ...) with weights (S, n)."""
    combine(weights, values.reshape(len(values), -1), out.reshape(len(weights), -1))
    return out


@cache
def _nodes(count: int) -> np.ndarray:
    """Where a polynomial goes through what it interpolates, 0..1: extremes of Chebyshev's."""
    return (1 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2


def _weights(shares: np.ndarray, count: int) -> np.ndarray:
    """Weights (S, count) of values at the nodes, for polynomials at shares."""
    return chebvander(2 * shares - 1, count - 1) @ _to_chebyshev(count)


@cache
def _weights_of(share: float, count: int) -> np.ndarray:
    """Weights (count,) at one of the few shares that are tried."""
    return _weights(np.array([share]), count)[0]


@cache
def _to_chebyshev(count: int) -> np.ndarray:
    """Coefficients of Chebyshev's polynomials from values at their extremes: sums of cosines."""
    j, ends = np.arange(count), np.ones(count)
    ends[[0, -1]] = 0.5
    signs = ends * (-1.0) ** j
    return 2 / (count - 1) * signs[:, None] * np.cos(np.pi * np.outer(j, j) / (count - 1)) * ends
