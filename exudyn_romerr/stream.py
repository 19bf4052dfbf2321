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
    """Copies of the estimators, fed with blocks; remembers their bounds at the ends of steps."""

    def __init__(self, estimators: Mapping[str, Any]):
        self.estimators = {name: copy.copy(e) for name, e in estimators.items()}
        self._chunks: dict[str, list[Bounds]] = {name: [] for name in estimators}
        self._worst = dict.fromkeys(estimators, 0.0)
        self.worst: dict[str, tuple] = {}  # what the outputs were bounded with where |e|_M has its largest bound

    def start(self, start: Start) -> None:
        """Begin at the first instant of a run."""
        for name, e in self.estimators.items():
            self._chunks[name].append(self._noted(name, e, e.start(start)))

    def go_on(self, before: Stream) -> None:
        """Begin where another stream ended."""
        self.estimators = {name: copy.copy(e) for name, e in before.estimators.items()}
        for name, chunks in before._chunks.items():
            self._chunks[name].append(chunks[-1].at(np.array([-1])))

    def advance(self, block: Block, step_end: np.ndarray, widening: tuple | None = None) -> None:
        """Take a block; step_end: index of the segment that ends each step; widening: added there to the bounds."""
        for name, e in self.estimators.items():
            bounds = self._noted(name, e, e.advance(block)).at(step_end)
            self._chunks[name].append(bounds if widening is None else bounds.widened(*widening))

    def _noted(self, name: str, e: Any, bounds: Bounds) -> Bounds:
        i = int(np.argmax(bounds.position))
        if not self.worst or bounds.position[i] > self._worst[name]:
            self._worst[name], self.worst[name] = bounds.position[i], e.instant(i)
        return bounds

    def load_steps(self, z: np.ndarray) -> None:
        """Take load steps z (S, k) of a static solve, which do not depend on one another."""
        for name, e in self.estimators.items():
            self._chunks[name].append(self._noted(name, e, e(z)))

    def now(self, names: Collection[str]) -> list[Bounds]:
        """Return the bounds of some estimators at the last instant."""
        return [chunks[-1].at(np.array([-1])) for name, chunks in self._chunks.items() if name in names]

    def bounds(self) -> dict[str, Bounds]:
        """Return the bounds of every estimator so far."""
        return {name: Bounds.joined(chunks) for name, chunks in self._chunks.items()}


def best_output(bounds: Sequence[Bounds], part: slice, view: View | None, frame: np.ndarray) -> np.ndarray:
    """Return the smallest bound (r,) of the output that has some of the rows, at one instant."""
    seen = [b.of_rows(part) for b in bounds]
    return np.min([(b if view is None else view.bounds(b, frame)).outputs[0] for b in seen], axis=0)
