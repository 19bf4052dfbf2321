"""Feedback between auxiliary modes and a mechanism: its linearised equations over time (theory.md 7).

    M e'' + D e' + K e + G^T l = f(t) ,   C e = 0 ,

e the error of all coordinates of the mechanism and the coordinates of auxiliary modes. Matrices are cubic in time
between tangents that know their rates, linear between others; where C has a kink, constraints strike the mechanism.
The time integration is that of the simulation, so that e is what auxiliary modes would have added to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

import numpy as np

from ..errors import AssumptionError
from ..linalg.blocked_products import rows_times
from ..trajectory.scheme import Scheme
from .columns import Columns
from .march import Steps, Tangent
from .track import SINGULAR, Track, share

GROWN = 1e60  # its square, times masses, is still a number
TOO_SENSITIVE = (
    "the error of the linearised mechanism has grown beyond all numbers: its motion is too sensitive to be "
    "linearised for so long. Ask for estimators='energy', for scope='inputs frozen', or solve for a shorter time"
)


class Companion(Protocol):
    """What goes through the steps of Feedback together with it."""

    def columns(self, steps: Steps) -> Columns | None:
        """Its right-hand sides in the next of the steps, or None."""

    def take(self, steps: Steps, found: np.ndarray, multipliers: np.ndarray) -> None:
        """Take what these come to, (S, 4, k, columns), and the multipliers that go with them (S, c, columns)."""


class Late(Protocol):
    """What goes through the steps of Feedback after it, and needs what it found there.

    multipliers : (S, c), of what the last call of follow has added.
    """

    multipliers: np.ndarray | float

    def follow(self, steps: Steps, part: slice, e: np.ndarray) -> np.ndarray | None:
        """Go through some steps, which end at a part of the rows of `advance`; return what that adds to e there.

        e : (3, S, k), with what those before have added; None: nothing is added.
        """


class Feedback:
    """e, e' and e'' along a run that starts without error.

    Attributes
    ----------
    multipliers : l (S, c) at the samples of the last call of start or advance.
    """

    def __init__(self, scheme: Scheme):
        self._track = Track(scheme)

    def start(
        self, tangent: Tangent, force: np.ndarray, rest: np.ndarray | None = None, t: float | None = None
    ) -> None:
        """Begin under the force (k,), without error or in equilibrium with `rest`, at t if not the tangent's time."""
        k = len(force)
        e = np.zeros(k) if rest is None else held(tangent.K, tangent, rest)
        e_tt, forces = solved(tangent.M, tangent, force - tangent.K @ e)
        self.multipliers = forces[None]
        self.t = tangent.t if t is None else t
        self._moving = np.array([e, np.zeros(k), e_tt, e_tt])

    @property
    def state(self) -> np.ndarray:
        """e, e', e'' (3, k) now."""
        return self._moving[:3]

    def go_on(self, before: Feedback, tangent: Tangent, force: np.ndarray) -> None:
        """Go on as another solve does from the one before, with accelerations under the force (k,) of its own."""
        (e, e_t, *_), self.t = before._moving, before.t
        e_tt, forces = solved(tangent.M, tangent, force - tangent.D @ e_t - tangent.K @ e)
        self.multipliers = forces[None]
        self._moving = np.array([e, e_t, e_tt, e_tt])

    def advance(
        self,
        t: np.ndarray,
        force: np.ndarray,
        times: np.ndarray,
        tangent: Callable[[int], Tangent],
        others: Sequence[Companion] = (),
        late: Sequence[Late] = (),
    ) -> tuple[np.ndarray, np.ndarray]:
        """Go on to times t (S,) under forces (S, k); return e, e', e'' (3, S, k) and the mass norm (S,) of e'.

        times : (T,) of tangents, the first not after the last time before t; the last one is held. tangent : i -> it.
        others : what else goes through the same steps, some of them at a time; late : what does after these, in turn,
        and is part of what is returned.
        """
        e = np.zeros((3, *force.shape))
        self.multipliers = np.zeros((len(t), self.multipliers.shape[1]))
        for i, steps in self._track.steps(self.t, t, times, tangent):
            beside = [(other, columns) for other in others if (columns := other.columns(steps)) is not None]
            own = Columns(self._moving[..., None], force[i, :, None])
            (of_own, forces), *of_others = steps.march(own, *(columns for _, columns in beside), multipliers=True)
            self._moving, self.multipliers[i] = of_own[-1, ..., 0], forces[..., 0]
            for (other, _), of_other in zip(beside, of_others, strict=True):
                other.take(steps, *of_other)
            e[:, i] = of_own[:, :3, :, 0].swapaxes(0, 1)
            check_size(e[:, i])
            for one in late:
                added = one.follow(steps, i, e[:, i])
                if added is not None:
                    e[:, i] += added
                    self.multipliers[i] += one.multipliers
        self.t = float(t[-1]) if len(t) else self.t
        check_size(e)
        return e, mass_norms(e[1], t, times, tangent)


def mass_norms(x: np.ndarray, t: np.ndarray, times: np.ndarray, tangent: Callable[[int], Tangent]) -> np.ndarray:
    """Mass norms (S,) of x (S, k) at times t (S,), masses cubic in time between tangents, as those of Track."""
    after, squares = np.minimum(np.searchsorted(times, t, side="left"), len(times) - 1), np.zeros(len(t))
    for i in np.unique(after).tolist():
        here, first, last = np.flatnonzero(after == i), tangent(max(i - 1, 0)), tangent(i)
        own, weights = x[here], _masses(share(t[here], first, last), first, last)
        squares[here] = sum(w * np.einsum("sk,sk->s", rows_times(own, M), own) for w, M in weights)
    return np.sqrt(np.maximum(squares, 0.0))


def _masses(s: np.ndarray, first: Tangent, last: Tangent) -> Iterator[tuple[np.ndarray | float, np.ndarray]]:
    """Yield what M (k, k) are added up with which weights (S,) at shares s of the time between two tangents."""
    if first is last:
        yield 1.0, first.M
        return
    up = s * s * (3 - 2 * s)
    yield from ((1 - up, first.M), (up, last.M))
    for one, slope in ((first, s * (1 - s) ** 2), (last, -s * s * (1 - s))):
        if one.rate is None:
            yield from ((slope, last.M), (-slope, first.M))
        else:
            yield slope * (last.t - first.t), one.rate.M


def check_size(found: np.ndarray) -> None:
    """AssumptionError if the equations were singular, or their solution has grown too much."""
    if not np.isfinite(found).all():
        raise AssumptionError(SINGULAR)
    if np.max(np.abs(found), initial=0.0) > GROWN:
        raise AssumptionError(TOO_SENSITIVE)


def held(A: np.ndarray, tangent: Tangent, force: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
    """Solve A x + G^T l = force, C x = values (c,), 0 if None, for x (k,)."""
    return solved(A, tangent, force, values)[0]


def solved(
    A: np.ndarray, tangent: Tangent, force: np.ndarray, values: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The same, for x (k,) and l (c,)."""
    c, k = tangent.G.shape
    scale = np.abs(np.diag(A)).max()
    whole = np.block([[A, scale * tangent.G.T], [scale * tangent.C, np.zeros((c, c))]])
    try:
        found = np.linalg.solve(whole, np.append(force, np.zeros(c) if values is None else scale * values))
        return found[:k], scale * found[k:]
    except np.linalg.LinAlgError as error:
        raise AssumptionError(SINGULAR) from error
