"""Track: makes what every step of a march through the linearised equations needs, from tangents now and then."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from ..errors import AssumptionError
from .march import Scheme, Steps, Tangent

INVERSE_ERROR = (
    1e-3  # of a solution: what interpolated inverses may miss at first; they are used twice, so its square is left
)
SAME_STEP = 1e-9  # of a step size: solvers add up their steps
# steps of one size between two tangents: fewer are inverted one by one, more interpolated in time
INTERPOLATED_FROM = 4
TOGETHER = 64  # steps that are made, and marched through, at once
IN_CACHE = 500_000  # or fewer, so that their matrices have no more numbers than this
AT_LEAST = 8
SINGULAR = (
    "the linearised equations of the mechanism are singular (constraints that contradict each other, or coordinates "
    "without mass); no auxiliary modes with feedback: pass scope='inputs frozen'"
)


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
        self._allocate(tangent(0))
        after = np.minimum(np.searchsorted(times, t, side="left"), len(times) - 1)
        other = np.flatnonzero((np.diff(after) > 0) | (np.abs(np.diff(h)) > SAME_STEP * h[1:])) + 1
        borders, found, done = {0, *other.tolist()}, Steps.none(), 0
        counts = dict(zip(sorted(borders), np.diff([0, *other, S]).tolist(), strict=True))
        for a, b in pairwise(sorted({*borders, *range(0, S, self._room), S})):
            if a in borders:
                ends = tangent(max(int(after[a]) - 1, 0)), tangent(int(after[a]))
                self._begin(*ends, float(h[a]), counts[a] >= INTERPOLATED_FROM)
            found = found + self._made(slice(a - done, b - done), h[a:b], _share(t[a:b], *ends))
            if b == S or b - done == self._room:
                yield slice(done, b), found
                found, done = Steps.none(), b

    def _begin(self, first: Tangent, last: Tangent, h: float, many: bool) -> None:
        """Begin with steps of size h between two tangents."""
        _cubic(first, last, self._cubic)
        (_, k), (mass, damping) = self._shape, self.scheme.mass_and_damping(h)
        self._scale = mass * self._heaviest
        of_K, of_D, of_A = (self._cubic[..., i * k : (i + 1) * k] for i in range(3))
        of_A *= mass
        of_A += damping * of_D
        of_A += of_K  # below, where M and D are 0: C
        self._polynomial = self._interpolated(first, last, h) if many else None

    def _allocate(self, tangent: Tangent) -> None:
        c, k = tangent.G.shape
        if self._shape == (c, k):
            return
        self._shape, n, self._heaviest = (c, k), k + c, np.abs(np.diag(tangent.M)).max()
        self._room = int(np.clip(IN_CACHE // (n * (2 * k + 2 * n)), AT_LEAST, TOGETHER))
        self._cubic, self._wide = np.zeros((4, n, 2 * k + n)), np.zeros((self._room, n, 2 * k + n))
        self._inverses, self._quadratic = np.zeros((self._room, n, n)), np.zeros((3, n, n))
        self._instant, self._latest, self._end = np.zeros((1, n, 2 * k + n)), np.zeros((n, n)), ()

    def _made(self, place: slice, h: np.ndarray, shares: np.ndarray) -> Steps:
        """Steps at shares of the time between the tangents."""
        wide, inverses = _at(shares, self._cubic, self._wide[place]), self._inverses[place]
        if self._polynomial is None:
            for one, inverse in zip(wide, inverses, strict=True):
                self._invert(one, inverse)
        else:
            _at(shares, self._polynomial, inverses)
        return Steps(self.scheme, h, list(wide), list(inverses))

    def _interpolated(self, first: Tangent, last: Tangent, h: float) -> np.ndarray | None:
        """Inverses as a polynomial of second degree, through three instants; None if that is not exact enough."""
        start, half, end = self._quadratic
        shares = (
            [0.5, 1.0]
            if self._end and self._end[0] is first and abs(self._end[1] - h) <= SAME_STEP * h
            else [0.0, 0.5, 1.0]
        )
        start[:] = self._latest
        for share, inverse in zip(shares, self._quadratic[-len(shares) :], strict=True):
            self._invert(_at(np.array([share]), self._cubic, self._instant)[0], inverse)
        self._end, self._latest[:] = (last, h), end
        half -= start  # from values at 0, 1/2, 1 to coefficients: 4 half - 3 start - end, 2 (start + end) - 4 half
        end -= start
        half *= 4.0
        half -= end
        end -= half
        x = _at(np.array([0.25]), self._cubic, self._instant)[0, :, -len(half) :] @ self._sizes
        off = np.array([1.0, 0.25, 0.0625]) @ (self._quadratic @ x) / self._sizes - 1.0
        return self._quadratic if np.abs(off).max() <= INVERSE_ERROR else None

    @property
    def _sizes(self) -> np.ndarray:
        """Of coordinates and multipliers, so that constraints are of the size of the other rows."""
        c, k = self._shape
        return np.append(np.ones(k), np.full(c, self._scale))

    def _invert(self, wide: np.ndarray, out: np.ndarray) -> None:
        """Write A^-1."""
        sizes = self._sizes
        A = wide[:, -len(wide) :] * sizes
        A *= sizes[:, None]
        try:
            np.multiply(np.linalg.inv(A), sizes, out=out)
        except np.linalg.LinAlgError as error:
            raise AssumptionError(SINGULAR) from error
        out *= sizes[:, None]


def _share(t: np.ndarray, first: Tangent, last: Tangent) -> np.ndarray:
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
    powers = np.vander(shares, len(coefficients), increasing=True)
    np.matmul(powers, coefficients.reshape(len(coefficients), -1), out=out.reshape(len(shares), -1))
    return out
