"""Stream: all estimators on one trajectory, be it sampled, reconstructed, or the initial error alone."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np

from ..estimators.bounds import Bounds, KeptBounds, Worst, seen_in
from ..trajectory.segments import Block, Start

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from ..estimators.estimator import Estimator
    from .offline import Offline


class Stream:
    """Copies of the estimators, fed with blocks; remembers their bounds at the ends of steps.

    only_outputs: nothing else of the bounds is remembered.
    """

    def __init__(self, estimators: Mapping[str, Estimator], only_outputs: bool = False):
        self._only_outputs = only_outputs
        self.estimators = {name: copy.copy(e) for name, e in estimators.items()}
        self._kept = {name: KeptBounds() for name in estimators}
        self.worst: dict[str, Worst] = {}

    def start(self, start: Start, *widenings: tuple) -> None:
        """Begin at the first instant of a run; widenings: see advance."""
        for name, e in self.estimators.items():
            self._remember(name, e, e.start(start), slice(None), widenings)

    def go_on(self, before: Stream) -> None:
        """Begin where another stream ended."""
        self.estimators = {name: copy.copy(e) for name, e in before.estimators.items()}
        for name, kept in before._kept.items():
            self._kept[name].append(kept.read().at(slice(-1, None)))

    def advance(self, block: Block, step_end: np.ndarray, *widenings: tuple) -> None:
        """Take a block; step_end: index of the segment that ends each step.

        widenings : of position, velocity, outputs, each added to the bounds there.
        """
        for name, e in self.estimators.items():
            self._remember(name, e, e.advance(block), step_end, widenings)

    def _remember(self, name: str, e: Any, bounds: Bounds, ends: np.ndarray | slice, widenings: tuple) -> None:
        self._note(name, e, bounds, sum(float(np.max(position)) for position, *_ in widenings))
        bounds = bounds.at(ends)
        for widening in widenings:
            bounds = bounds.widened(*widening)
        self._kept[name].append(bounds.of_outputs() if self._only_outputs else bounds)

    def _note(self, name: str, e: Any, bounds: Bounds, widened: float) -> None:
        i = int(np.argmax(bounds.position))
        instant = e.instant(i)  # lets go of the block, also where it was larger before
        if name not in self.worst or bounds.position[i] > self.worst[name].position:
            self.worst[name] = Worst(bounds.position[i], instant, widened)

    def load_steps(self, z: np.ndarray, *widenings: tuple) -> None:
        """Take load steps z (S, k) of a static solve, which do not depend on one another."""
        for name, e in self.estimators.items():
            self._remember(name, e, e(z), slice(None), widenings)

    def last(self, count: int) -> list[Bounds]:
        """Return the bounds of all estimators at the last instants."""
        return [kept.read().at(slice(-count, None)) for kept in self._kept.values()]

    def bounds(self) -> dict[str, Bounds]:
        """Return the bounds of every estimator so far."""
        return {name: kept.read() for name, kept in self._kept.items()}


def best_outputs(offline: Offline, last: Sequence[Bounds], samples: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the smallest bound of each output (S, r) at some instants; samples: what is recorded there."""
    frames = samples["frames"]
    best = {}
    for out, part, view in zip(offline.outputs, offline.slices, offline.views, strict=True):
        seen = [b.of_rows(part) for b in last]
        best[out.name] = np.min([(b if view is None else seen_in(view, b, frames)).outputs for b in seen], axis=0)
    return best
