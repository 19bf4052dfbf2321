"""Bounds at the instants of a run, of outputs in global axes too; Estimator: the contract of what makes them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...model.outputs import View


@dataclass(frozen=True)
class Bounds:
    """Bounds at S instants: position (S,) and velocity (S,) in the M-norm, outputs (S, R).

    jumped : (S, R), the share of load jumps in outputs; None: no jumps so far. correction : (S, R), the part of the
    outputs' error that is known with its sign; correction_bound : (S, R), what is left of the error then. None where
    an estimator has none. position, velocity: None where nobody asks (of_outputs).
    """

    position: np.ndarray | None
    velocity: np.ndarray | None
    outputs: np.ndarray
    jumped: np.ndarray | None = None
    correction: np.ndarray | None = None
    correction_bound: np.ndarray | None = None

    def at(self, index: np.ndarray | slice) -> Bounds:
        """Return the bounds at some of the instants."""
        return Bounds(*(None if x is None else x[index] for x in vars(self).values()))

    def widened(self, position: np.ndarray, velocity: np.ndarray, outputs: np.ndarray) -> Bounds:
        """Return the bounds with something added at every instant."""
        left = None if self.correction_bound is None else self.correction_bound + outputs
        return replace(
            self,
            position=None if self.position is None else self.position + position,
            velocity=None if self.velocity is None else self.velocity + velocity,
            outputs=self.outputs + outputs,
            correction_bound=left,
        )

    def of_outputs(self) -> Bounds:
        """Return the bounds of the outputs alone."""
        return Bounds(None, None, self.outputs, None, self.correction, self.correction_bound)


class Worst(NamedTuple):
    """Where |e|_M has its largest bound: that bound, at which sample, what bounds outputs, how much was added."""

    position: float
    sample: int
    instant: tuple
    widened: float


class Estimator:
    """Bounds of the error of one trajectory, segment by segment.

    1. It is made from a Problem, once: full-size work is done there.
    2. The one that was made is never run: each stream of a run starts a copy.copy of it. What changes along a run is
       hence replaced, not changed in place, or __copy__ says what else is to be copied.
    3. start(Start) comes first, then advance(Block) with blocks that follow one another without a gap; a run that
       goes on from another takes a copy of its estimator, and no start. Both return Bounds, at the first instant and
       at the ends of a block's segments, by _bounds, which keeps what it is given.
    4. Start and Block belong to all estimators and are not changed.
    5. Bounds are never nan: inf where there is no bound. They are those of exact arithmetic; a run adds what rounding
       of its input may do, an estimator the rounding of its own sums.
    6. instant and bounds_at serve other outputs at one instant, as at every mesh node: the instant of one estimator
       is given to another, made from the same problem with other displacements as outputs. It is asked for once after
       start and each advance, is small, and no view of what was made for a block.

    Attributes
    ----------
    assumes : what must hold of body and mechanism, for reports. inside : the largest |e|_M and |e'|_M (2, S) within
    the segments of the last block, if the estimator knows them, else None; asked for where the frame turns.
    """

    assumes: str
    inside: tuple[np.ndarray, np.ndarray] | None = None
    _given: tuple[np.ndarray, ...] = ()  # what _bounds was given last, one row an instant, or one for all

    def instant(self, i: int) -> tuple:
        """Return what bounds displacements at entry i of the bounds returned last."""
        given, self._given = self._given, ()
        return tuple(x[slice(i, i + 1) if len(x) > 1 else slice(1)].copy() for x in given)

    def bounds_at(self, instant: tuple) -> Bounds:
        """Return the bounds (1, R) of displacement outputs at an instant of an estimator with other outputs."""
        return self._bounds(*instant)


def of_output(bounds: Bounds, part: slice, view: View | None, frame: np.ndarray) -> Bounds:
    """Return the bounds of one output, rows `part`, as a view of it in global axes sees them; frame (S, 24)."""
    rows = (bounds.outputs, bounds.jumped, bounds.correction, bounds.correction_bound)
    own = Bounds(bounds.position, bounds.velocity, *(None if x is None else x[:, part] for x in rows))
    return own if view is None else seen_in(view, own, frame)


def seen_in(view: View, base: Bounds, frame: np.ndarray) -> Bounds:
    """Return the bounds of an output in global axes from those of its base rows, which the view is made of."""
    H = view.matrices(frame)
    if view.blind:
        return Bounds(base.position, base.velocity, np.full(H.shape[:2], np.inf))
    jumped = None if base.jumped is None else _spread(H, base.jumped)
    if base.correction is None:
        return replace(base, outputs=_spread(H, base.outputs), jumped=jumped)
    known, left = np.einsum("srk,sk->sr", H, base.correction), _spread(H, base.correction_bound)
    return replace(base, outputs=np.abs(known) + left, jumped=jumped, correction=known, correction_bound=left)


def _spread(H: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """|H| times bounds (S, R); an infinite bound counts only where H sees it."""
    finite = np.isfinite(bounds)
    spread = np.einsum("srk,sk->sr", np.abs(H), np.where(finite, bounds, 0.0))
    return np.where(((H != 0) & ~finite[:, None]).any(axis=2), np.inf, spread)
