"""Stream: one way of looking at a trajectory (sampled, reconstructed, initial error alone) through all estimators."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np

from .estimators.base import Block, Bounds, Start

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence
    from typing import Any

    from .views import View


class Stream:
    """Copies of the estimators, fed with blocks; remembers their bounds at the ends of steps.

    only_outputs: nothing else of the bounds is remembered.
    """

    def __init__(self, estimators: Mapping[str, Any], only_outputs: bool = False):
        self._only_outputs = only_outputs
        self.estimators = {name: copy.copy(e) for name, e in estimators.items()}
        self._chunks: dict[str, list[Bounds]] = {name: [] for name in estimators}
        self._worst = dict.fromkeys(estimators, 0.0)
        self.worst: dict[str, tuple] = {}  # what the outputs were bounded with where |e|_M has its largest bound

    def start(self, start: Start, *widenings: tuple) -> None:
        """Begin at the first instant of a run; widenings: see advance."""
        for name, e in self.estimators.items():
            self._remember(name, self._noted(name, e, e.start(start)), widenings)

    def go_on(self, before: Stream) -> None:
        """Begin where another stream ended."""
        self.estimators = {name: copy.copy(e) for name, e in before.estimators.items()}
        for name, chunks in before._chunks.items():
            self._chunks[name].append(chunks[-1].at(np.array([-1])))

    def advance(self, block: Block, step_end: np.ndarray, *widenings: tuple) -> None:
        """Take a block; step_end: index of the segment that ends each step.

        widenings : of position, velocity, outputs, each added to the bounds there.
        """
        for name, e in self.estimators.items():
            self._remember(name, self._noted(name, e, e.advance(block)).at(step_end), widenings)

    def _remember(self, name: str, bounds: Bounds, widenings: tuple) -> None:
        for widening in widenings:
            bounds = bounds.widened(*widening)
        self._chunks[name].append(bounds.of_outputs() if self._only_outputs else bounds)

    def _noted(self, name: str, e: Any, bounds: Bounds) -> Bounds:
        i = int(np.argmax(bounds.position))
        if name not in self.worst or bounds.position[i] > self._worst[name]:
            self._worst[name], self.worst[name] = bounds.position[i], e.instant(i)
        return bounds

    def load_steps(self, z: np.ndarray, *widenings: tuple) -> None:
        """Take load steps z (S, k) of a static solve, which do not depend on one another."""
        for name, e in self.estimators.items():
            self._remember(name, self._noted(name, e, e(z)), widenings)

    def now(self, names: Collection[str]) -> list[Bounds]:
        """Return the bounds of some estimators at the last instant."""
        return [chunks[-1].at(np.array([-1])) for name, chunks in self._chunks.items() if name in names]

    def bounds(self) -> dict[str, Bounds]:
        """Return the bounds of every estimator so far."""
        self._chunks = {name: [Bounds.joined(chunks)] for name, chunks in self._chunks.items()}  # none kept twice
        return {name: chunk for name, (chunk,) in self._chunks.items()}


def best_output(bounds: Sequence[Bounds], part: slice, view: View | None, frame: np.ndarray) -> np.ndarray:
    """Return the smallest bound (r,) of the output that has some of the rows, at one instant."""
    seen = [b.of_rows(part) for b in bounds]
    return np.min([(b if view is None else view.bounds(b, frame)).outputs[0] for b in seen], axis=0)
