"""Stream: all estimators on one trajectory, be it sampled, reconstructed, or the initial error alone."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from ..estimators.bounds import Bounds, Estimator, Worst
from ..residual.samples import GrowingArray
from ..residual.segments import Block, Start


class KeptBounds:
    """The bounds of one estimator so far."""

    def __init__(self) -> None:
        self._fields: dict[str, GrowingArray] = {}
        self.count = 0

    def append(self, bounds: Bounds) -> None:
        """Add bounds at further instants."""
        for name, x in vars(bounds).items():
            if x is not None and name not in self._fields:
                self._fields[name] = GrowingArray()
                self._fields[name].append(np.zeros((self.count, *x.shape[1:])))  # no jumps before the first
            if name in self._fields:
                self._fields[name].append(np.zeros_like(bounds.outputs) if x is None else x)
        self.count += len(bounds.outputs)

    def read(self) -> Bounds:
        """Return all of them."""
        names = (field.name for field in fields(Bounds))
        return Bounds(*(self._fields[name].read() if name in self._fields else None for name in names))


class Stream:
    """Copies of the estimators, fed with blocks; remembers their bounds at the ends of steps.

    only_outputs: nothing else of the bounds is remembered. worst: where each estimator's bound of |e|_M is largest.
    """

    def __init__(self, estimators: Mapping[str, Any], only_outputs: bool = False):
        self._only_outputs = only_outputs
        self.estimators: dict[str, Any] = {name: copy.copy(e) for name, e in estimators.items()}
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

    def advance(self, block: Block, step_end: np.ndarray | slice, *widenings: tuple) -> None:
        """Take a block; step_end: index of the segment that ends each step.

        widenings : of position, velocity, outputs, each added to the bounds there.
        """
        for name, e in self.estimators.items():
            self._remember(name, e, e.advance(block), step_end, widenings)

    def _remember(self, name: str, e: Estimator, bounds: Bounds, ends: np.ndarray | slice, widenings: tuple) -> None:
        kept, at_ends = self._kept[name], bounds.at(ends)
        for widening in widenings:
            at_ends = at_ends.widened(*widening)
        i = int(np.argmax(at_ends.position))
        instant = e.instant(np.arange(len(bounds.position))[ends][i])  # lets go of the block, needed or not
        if name not in self.worst or at_ends.position[i] > self.worst[name].position:
            widened = sum(float(np.max(position)) for position, *_ in widenings)
            self.worst[name] = Worst(at_ends.position[i], kept.count + i, instant, widened)
        kept.append(at_ends.of_outputs() if self._only_outputs else at_ends)

    def last(self, count: int) -> list[Bounds]:
        """Return the bounds of all estimators at the last instants."""
        return [kept.read().at(slice(-count, None)) for kept in self._kept.values()]

    def bounds(self) -> dict[str, Bounds]:
        """Return the bounds of every estimator so far."""
        return {name: kept.read() for name, kept in self._kept.items()}
