"""Errors in the last row of a run, from which the next run goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..mechanism.unknowns import Unknowns
from .march import State


@dataclass(frozen=True)
class EndState:
    """What a run leaves wrong: by parts of the modes, what corrects their sums, by the time integration.

    unknowns : of the run. parts, corrections : of the marches. added : of what is missed; None: nothing was.
    steps (columns, 2 n_q) : coordinates and rates.
    """

    unknowns: Unknowns
    parts: State
    corrections: State
    added: State | None
    steps: np.ndarray

    def of(self, unknowns: Unknowns, shapes: Sequence[np.ndarray], balancing: Sequence[int] = ()) -> EndState:
        """Return the same in other unknowns.

        Parameters
        ----------
        shapes : of each body (k, k before), coordinates of its shapes before in those that it has now
        balancing : see State
        """
        marches = (
            None if x is None else State(_of(x.x, self.unknowns, unknowns, shapes), x.p, balancing)
            for x in (self.parts, self.corrections, self.added)
        )
        more = unknowns.n_q - self.unknowns.n_q  # coordinates of first order, after a static solve
        steps = np.pad(self.steps.reshape(-1, 2, self.unknowns.n_q), ((0, 0), (0, 0), (0, more)))
        return EndState(unknowns, *marches, steps.reshape(len(steps), -1))


def _of(x: np.ndarray, before: Unknowns, now: Unknowns, shapes: Sequence[np.ndarray]) -> np.ndarray:
    """States (4, n, columns) in other unknowns."""
    found = np.zeros((x.shape[0], now.n, x.shape[2]))
    for was, at, turn in zip(_places(before), _places(now), shapes, strict=True):
        found[:, at[:6]] = x[:, was[:6]]
        found[:, at[6:]] = turn @ x[:, was[6:]]
    first, own = before.blocks[-1].stop, now.blocks[-1].stop
    found[:, own : own + before.n_a - first] = x[:, first : before.n_a]
    return found


def _places(unknowns: Unknowns) -> list[np.ndarray]:
    """Of each body its frame, modes, kept vectors, oscillators."""
    return [np.r_[at, own] for at, own in zip(unknowns.blocks, unknowns.waves, strict=True)]
