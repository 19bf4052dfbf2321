"""Pairs of numbers of modes and of steps: what a run forecasts of others, and the cheapest that is enough."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..report.answers import Answer, worst
from ..report.verdicts import CAUSES, LOWEST_ORDER, MOST_TIMES, NONE, SECOND_ORDER
from .search import cheapest

if TYPE_CHECKING:
    from ..report.verdicts import Row, Verdict
    from .modal_content import Content

SPARE = 0.95  # of a tolerance: what forecasts may use, for a run has to confirm them
COARSER = 6.0  # times the step of a run: as far as its estimates are believed
CHEAPER = 0.8  # of the time of what was found: only then one more run is worth it
RESOLVED_STEP = 1e-2  # of a tolerance: smaller errors of steps tell no order
HIGHEST_ORDER = 4.0  # in which errors of steps are taken to fall where runs show a higher one
FEWEST = 1  # modes of a call: of none many scripts print or draw something
APART = 1.3  # times as many modes: of fewer times are not known well enough to tell how they grow
ALIKE = 1.1  # times the least time: what times of runs do not tell apart; fewer modes are taken then
WITHIN = 0.01  # of itself: how far a number of times need be known
LESS = 0.9  # of the error: what more modes have to bring it below to be worth a run that is not enough yet


class Pair(NamedTuple):
    """Numbers of modes of each call that makes some, and how many steps."""

    numbers: tuple[int, ...]
    steps: int


class Expected(NamedTuple):
    """What is known or expected of a row.

    ratio : of its whole error, or a cause that is larger alone, to its tolerance. of : cause -> size and half width
    together, "sum" too.
    """

    ratio: float
    row: Row
    of: dict[str, float]


@dataclass(frozen=True)
class PairRun:
    """A run that was made with a pair.

    rows : of those sensors that have a tolerance. contents : of (solve, sensor). seconds : CPU
    time of its solves; all_seconds : of the whole run, watched.
    """

    pair: Pair
    rows: Sequence[Row]
    contents: dict[tuple[int, str], Content]
    seconds: float
    all_seconds: float = 0.0

    @property
    def answer(self) -> Answer:
        """The answer that counts for all rows: of whole errors, and of a cause that is too large alone.

        Causes that cancel each other are enough for just these modes and steps: finer steps make the error larger.
        """
        causes = (verdict.answer for row in self.rows for verdict in row.of.values())
        too_large = [answer for answer in causes if answer is Answer.TOO_LARGE]
        return worst([*(row.answer for row in self.rows), *too_large])

    @property
    def is_enough(self) -> bool:
        """Whether every error is within its tolerance, by the run's own estimates."""
        return self.answer is Answer.ENOUGH

    is_likely = is_enough

    @property
    def cost(self) -> float:
        """What is to be small: CPU time of the solves, s."""
        return self.seconds

    @property
    def is_covered(self) -> bool:
        """Whether there is an estimate of everything."""
        return bool(self.rows) and all(row.of["sum"].how != NONE for row in self.rows)

    @cached_property
    def most(self) -> dict[int, int]:
        """The largest number of modes of which anything is forecast, of each call whose modes a body has."""
        return {call: len(parts) for content in self.contents.values() for call, parts in content.parts.items()}

    def counts(self, numbers: Sequence[int]) -> str:
        """Return those numbers of modes that are of calls whose modes a body has."""
        return ", ".join(str(numbers[call]) for call in sorted(self.most))

    @property
    def worst(self) -> Expected:
        """What the run has found of the row that is worst beside its tolerance."""
        found = [(row, {cause: _most(verdict) for cause, verdict in row.of.items()}) for row in self.rows]
        ratios = [Expected(max(of.values()) / row.tolerance, row, of) for row, of in found]
        return max(ratios, key=lambda one: one.ratio)

    def expected(self, pair: Pair, order: float) -> Expected:
        """Return what is expected of the worst row with another pair."""
        found, times = [], (self.pair.steps / pair.steps) ** order
        for row in self.rows:
            of = self._causes(row, pair.numbers)
            if "step" in of:
                of["step"] *= times
            of["sum"] = self._whole(row, pair.numbers)(times)
            found.append(Expected(of["sum"] / row.tolerance, row, of))
        return max(found, key=lambda one: one.ratio)

    def steps_for(self, numbers: tuple[int, ...], order: float, times: float = 1.0) -> float:
        """Return how few steps are expected to keep `times` the tolerances; inf: no number of them does."""
        most, least = COARSER**order, MOST_TIMES**-order  # times the error of the run's own steps
        for row in self.rows:
            most = _largest_below(self._whole(row, numbers), SPARE * times * row.tolerance, least, most)
        return self.pair.steps * most ** (-1 / order) if most > 0 else math.inf

    def fewest_first(self) -> Iterator[tuple[int, ...]]:
        """Yield numbers of modes, the fewest first, then one more of that call which takes most off."""
        numbers = [min(n, FEWEST) if call in self.most else n for call, n in enumerate(self.pair.numbers)]
        yield tuple(numbers)
        while open_calls := [call for call, most in self.most.items() if numbers[call] < most]:
            more = [tuple(n + (i == call) for i, n in enumerate(numbers)) for call in open_calls]
            numbers = [*min(more, key=self._by_modes)]
            yield tuple(numbers)

    def _by_modes(self, numbers: tuple[int, ...]) -> float:
        return max(self._causes(row, numbers)["modes"] / row.tolerance for row in self.rows if "modes" in row.of)

    def _whole(self, row: Row, numbers: tuple[int, ...]) -> Callable[[float], float]:
        """The whole error with its half width as a function of how many times the error by steps is that of the run.

        Over time where that is known, for causes are largest at different times; at least each cause alone.
        """
        of, content = self._causes(row, numbers), self.contents.get((row.solve, row.name))
        step, alone = of.pop("step", 0.0), max(of.values(), default=0.0)
        if content is None or not math.isfinite(step + sum(of.values())):
            return lambda times: sum(of.values()) + step * times
        modes = content.by_modes(row.component, numbers, self.pair.numbers)
        y, steps = modes + content.rest[:, row.component], content.step[:, row.component]
        halves = {cause: row.of[cause].half_width for cause in of} | {"step": 0.0}
        of_step = row.of["step"].half_width if "step" in row.of else 0.0
        all_of_them = sum(halves.values()) + of_step
        others = sum(halves.values()) + of["modes"] - np.abs(modes).max() - halves["modes"]
        together = min((row.of["sum"].half_width or 0.0) / all_of_them, 1.0) if all_of_them else 1.0

        def whole(times: float) -> float:
            found = float(np.abs(y + times * steps).max()) + together * (others + of_step * times)
            return max(found, alone, step * times)

        return whole

    def _causes(self, row: Row, numbers: tuple[int, ...]) -> dict[str, float]:
        """Size and half width by cause with other numbers of modes, and the steps of the run."""
        of = {cause: _most(row.of[cause]) for cause in CAUSES if cause in row.of}
        content = self.contents.get((row.solve, row.name))
        if content is not None and numbers != self.pair.numbers and math.isfinite(of.get("modes", math.inf)):
            size = np.abs(content.by_modes(row.component, numbers, self.pair.numbers)).max()
            now = row.of["modes"].size
            of["modes"] = size + row.of["modes"].half_width * (size / now if now else 1.0)
        return of


def _largest_below(f: Callable[[float], float], limit: float, least: float, most: float) -> float:
    """The largest x, least to most, of a convex f with f(x) <= limit, if f(least) is; else 0."""
    if most < least or not f(least) <= limit:
        return 0.0
    if f(most) <= limit:
        return most
    while most > least * (1 + WITHIN):
        middle = math.sqrt(least * most)
        least, most = (middle, most) if f(middle) <= limit else (least, middle)
    return least


def _most(verdict: Verdict) -> float:
    """Without rounding of the input, which neither modes nor steps change."""
    return verdict.most - verdict.floor


class PairSearch:
    """Which pair is worth the next run.

    varies_modes, varies_steps : whether they may be others than the script's. static : modes that each call makes
    beside those that vary, whose number a step's time depends on, too. fewest : steps that there have to be.
    """

    def __init__(self, varies_modes: bool = True, varies_steps: bool = True, static: int = 0, fewest: float = 1.0):
        self._varies_modes, self._varies_steps, self._static = varies_modes, varies_steps, static
        self._fewest = fewest

    def wanted(self, tried: Sequence[PairRun]) -> Pair | None:
        """Return the cheapest pair expected to be enough, if cheaper than what was found; None: there is none."""
        base, best = tried[-1], cheapest(tried)
        if not base.is_covered:
            return None
        limit = math.inf if best is None else CHEAPER * best.seconds
        found = [
            pair
            for pair in self.front(tried, base)
            if self._is_new(pair, tried) and self.seconds(pair, tried) < limit
        ]
        if found or best is not None:
            return self.cheapest(found, tried)
        return self._nearest(tried)

    def cheapest(self, pairs: Sequence[Pair], tried: Sequence[PairRun]) -> Pair | None:
        """Return the first pair that is as cheap as the cheapest, as far as times are known; None: there is none."""
        limit = ALIKE * min((self.seconds(pair, tried) for pair in pairs), default=0.0)
        return next((pair for pair in pairs if self.seconds(pair, tried) <= limit), None)

    def front(self, tried: Sequence[PairRun], base: PairRun, times: float = 1.0) -> list[Pair]:
        """Return all numbers of modes, with steps, that base forecasts to be enough for `times` the tolerances."""
        found = []
        for numbers in base.fewest_first() if self._varies_modes else [base.pair.numbers]:
            steps = base.steps_for(numbers, order_of(tried), times)
            if not self._varies_steps:
                steps = math.inf if steps > base.pair.steps else base.pair.steps
            if math.isfinite(steps):
                found.append(Pair(numbers, _rounded_up(max(steps, self._fewest))))
        return found

    def _is_new(self, pair: Pair, tried: Sequence[PairRun]) -> bool:
        """Whether no run with as many modes and steps was not enough, and it was not tried."""
        return not any(run.pair == pair or (not run.is_enough and _is_within(pair, run.pair)) for run in tried)

    def _nearest(self, tried: Sequence[PairRun]) -> Pair | None:
        """Where none is expected to be enough: the most modes, if these lower the error; their run forecasts more."""
        base, order = tried[-1], order_of(tried)
        *_, numbers = base.fewest_first() if self._varies_modes else [base.pair.numbers]
        pair = Pair(numbers, base.pair.steps)
        is_less = base.expected(pair, order).ratio < LESS * base.expected(base.pair, order).ratio
        return pair if is_less and self._is_new(pair, tried) else None

    def seconds(self, pair: Pair, tried: Sequence[PairRun]) -> float:
        """Return about how long the solves take, s: by the nearest run, and by how time grows with modes in runs."""
        near = min(tried, key=lambda run: abs(math.log(run.pair.steps / pair.steps)))
        if pair == near.pair:
            return near.seconds
        size = [self._static + sum(one.numbers) for one in (pair, near.pair)]
        return near.seconds * pair.steps / near.pair.steps * (size[0] / size[1]) ** self._power(tried)

    def _power(self, tried: Sequence[PairRun]) -> float:
        """In which power of the number of modes a step's time grows: 1 until two runs tell that are far apart."""
        of = [(self._static + sum(run.pair.numbers), run.seconds / run.pair.steps) for run in tried]
        (n, t), (more, longer) = min(of), max(of)
        return min(max(math.log(longer / t) / math.log(more / n), 0.0), 3.0) if more > APART * n and t else 1.0


def order_of(tried: Sequence[PairRun]) -> float:
    """Return in which order errors of steps fall: as runs show it, or the second."""
    one, other = (f(tried, key=lambda run: run.pair.steps) for f in (min, max))
    if one.pair.steps == other.pair.steps:
        return SECOND_ORDER
    finer = {(row.solve, row.name, row.component): row.of.get("step") for row in other.rows}
    found = []
    for row in one.rows:
        both = row.of.get("step"), finer.get((row.solve, row.name, row.component))
        if all(x is not None and x.size is not None and x.size > RESOLVED_STEP * row.tolerance for x in both):
            found.append((both[0].size / row.tolerance, math.log(both[0].size / both[1].size)))
    if not found:
        return SECOND_ORDER
    order = max(found)[1] / math.log(other.pair.steps / one.pair.steps)
    return min(max(order, LOWEST_ORDER), HIGHEST_ORDER)


def _is_within(pair: Pair, of: Pair) -> bool:
    fewer = all(a <= b for a, b in zip(pair.numbers, of.numbers, strict=True))
    return fewer and pair.steps <= of.steps


def _rounded_up(steps: float) -> int:
    """A number of two digits, as a user would write it."""
    unit = 10 ** max(math.floor(math.log10(max(steps, 1.0))) - 1, 0)
    return math.ceil(steps / unit - 1e-9) * unit
