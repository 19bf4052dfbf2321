"""Paired runs: variants of a scene in turn (A B C A B C ...), compared pair by pair in CPU time of the process.

A machine that changes its speed changes it for all variants alike; what others run does not count. Sensors are off:
they would only make the simulation itself slower. Offline work (attach) is timed apart.
"""

from __future__ import annotations

import os
from importlib.util import find_spec
from time import perf_counter, process_time
from typing import NamedTuple

import exudyn as exu
import numpy as np


class Variant:
    """A scene in an mbs of its own, to be solved again and again; nothing beside it.

    limit : of the ratio of run times with and without bounds, what the project promises. offline : wall time of
    prepare() in s.
    """

    label = "without bounds"
    limit: float | None = None
    mbs: exu.MainSystem
    settings: exu.SimulationSettings

    def timed_prepare(self) -> None:
        """Prepare; the wall time it takes is kept."""
        begin = perf_counter()
        self.prepare()
        self.offline = perf_counter() - begin

    def prepare(self) -> None:
        """Add what runs beside the simulation: nothing here."""

    def finish(self) -> None:
        """Do what is left to do when the solver has returned."""

    @property
    def steps(self) -> int:
        """Steps of a run."""
        return int(self.settings.timeIntegration.numberOfSteps)

    def seconds(self) -> float:
        """Solve once; return CPU time in s, finish() included."""
        begin = process_time()
        self.mbs.SolveDynamic(self.settings)
        self.finish()
        return process_time() - begin


class Ratio(NamedTuple):
    """Median and quartiles of run time over that of the first variant, and of the time of a step (bare) in us."""

    variant: Variant
    step: float
    low: float
    middle: float
    high: float


def quiet(settings: exu.SimulationSettings, steps: int, h: float) -> exu.SimulationSettings:
    """Return the settings for so many steps of h (s), with nothing written or printed."""
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, steps * h
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = settings.solution.sensors.active = False
    return settings


def measure(variants: list[Variant], pairs: int) -> np.ndarray:
    """Return run times in s, (pairs, variants); one round before is not counted."""
    rounds = [[variant.seconds() for variant in variants] for _ in range(1 + pairs)]
    return np.array(rounds[1:])


def ratios(variants: list[Variant], times: np.ndarray) -> list[Ratio]:
    """Return the ratios to the first variant, pair by pair, one of each variant."""
    quartiles = np.percentile(times / times[:, :1], (25, 50, 75), axis=0).T
    steps = 1e6 * np.median(times, axis=0) / variants[0].steps
    return [Ratio(*row[:2], *row[2]) for row in zip(variants, steps, quartiles, strict=True)]


def added(variants: list[Variant], times: np.ndarray) -> np.ndarray:
    """Return what each variant adds to a step of the first one, in us: medians of the pairs' differences."""
    return 1e6 * np.median(times - times[:, :1], axis=0) / variants[0].steps


def kept(found: float, limit: float) -> str:
    """Return the verdict."""
    return "kept" if found <= limit else "NOT KEPT"


def threads() -> str:
    """Say how many threads BLAS has, which times depend on; set before Python starts."""
    found = "one of them in our evaluation" if find_spec("threadpoolctl") else "threadpoolctl is not installed"
    return f"OPENBLAS_NUM_THREADS={os.environ.get('OPENBLAS_NUM_THREADS', 'unset')}, {found}"


def print_ratios(variants: list[Variant], times: np.ndarray, scene: str) -> None:
    """Print step times, ratios and what was promised."""
    h = variants[0].settings.timeIntegration.endTime / variants[0].steps
    print(f"{variants[0].steps:g} steps of {1e3 * h:g} ms, {len(times)} rounds, {scene}; {threads()}")
    print(f"{'variant':<38}{'us a step':>10}{'ratio, median':>15}{'quartiles':>15}")
    found = ratios(variants, times)
    for variant, step, low, middle, high in found:
        print(f"{variant.label:<38}{step:10.2f}{middle:15.3f}{low:9.3f}..{high:.3f}")
    for variant, _, _, middle, _ in found:
        if variant.limit is not None:
            verdict = f"promised at most {variant.limit:g}: {kept(middle, variant.limit)}"
            print(f"{variant.label}: offline {1e3 * variant.offline:.3g} ms; {verdict}")
