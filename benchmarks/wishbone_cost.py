"""What coupled bounds cost beside the quarter car of examples/wishbone_suspension.py: 14 modes, steps of 0.5 ms.

Paired runs, CPU time: see pairs.py. Every run is the drive over the bump, the first one from the equilibrium on;
where others begin is not the full body's, and "auto" would try more vectors for what that makes of bounds.

    python benchmarks/wishbone_cost.py [--end 0.2] [--pairs 7]
"""

import argparse
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine threads wait for one another

import numpy as np

from benchmarks import pairs
from benchmarks.mechanism_cost import VECTORS
from examples import wishbone_suspension

SCENE = "quarter car, arm of 14 modes, one output of 3 rows"


LIMITS = {"estimate": 1.15, "estimate, midpoint residuals": 1.25}


class Drive(pairs.Variant):
    """The drive to `end` in s, with bounds and an estimate (one of LIMITS) or without."""

    def __init__(self, end: float, estimate: str = ""):
        self.estimate = estimate
        if estimate:
            self.label, self.limit = f"coupled auxiliary {VECTORS}, {estimate}", LIMITS[estimate]
        self.end = end
        self.timed_prepare()

    def prepare(self) -> None:
        """Build the scene, find its equilibrium; with bounds, their offline work is the static solve's, too."""
        scene, self.monitor = wishbone_suspension.scene_of(
            *wishbone_suspension.SHOWN,
            self.end,
            bounds=bool(self.estimate),
            vectors=VECTORS,
            midpoint_residual="midpoint" in self.estimate,
        )
        self.scene, self.mbs = scene, scene.mbs  # the scene holds the road
        h = wishbone_suspension.STEP
        self.settings = pairs.quiet(scene.settings, round(self.end / h), h)

    def finish(self) -> None:
        """Ask for the report: it evaluates the last block."""
        if self.monitor is not None:
            self.report = self.monitor.report()


def variants_of(end: float) -> list[Drive]:
    """Return the drive without and with bounds and estimates."""
    return [Drive(end, estimate) for estimate in ("", *LIMITS)]


def main(arguments: list[str] | None = None) -> tuple[list[Drive], np.ndarray]:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--end", type=float, default=0.2, help="simulated time in s")
    parser.add_argument("--pairs", type=int, default=7)
    options = parser.parse_args(arguments)
    variants = variants_of(options.end)
    times = pairs.measure(variants, options.pairs)
    pairs.print_ratios(variants, times, SCENE)
    return variants, times


if __name__ == "__main__":
    main()
