"""What coupled bounds of mechanisms, and estimates of the whole error, cost beside a simulation.

The pendulum of models/floating.py with 14 modes, and the double pendulum of models/mechanisms.py with 30 modes a bar,
with the scenes' own Newton settings; one output a body. Variants run in turn and are compared pair by pair, in CPU
time, sensors off, offline work excluded: as in floating_cost.py, which does the same for bounds with frozen inputs.

    python benchmarks/mechanism_cost.py [--scenes pendulum double] [--steps 3000] [--pairs 11]
"""

import argparse
import os
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine threads wait for one another

import numpy as np

import exudyn_romerr as romerr
from benchmarks import floating_cost, pairs
from exudyn_romerr.mbs.coupled.feedback_runs import Reaction
from exudyn_romerr.mbs.mechanism.step_errors import StepErrors
from models import floating, mechanisms

VECTORS = 20
# what makes the estimate, and what it returns where there is none
ESTIMATE = ((StepErrors, "open", None), (Reaction, "_take_errors", None), (Reaction, "_left_out", []))
ADDED = 0.3  # of a bare step: what the estimate without midpoint residuals may add to the bound
# estimators (none: without bounds), and what is estimated of the whole error
VARIANTS = (
    ((), ""),
    (("auxiliary",), ""),
    (("auxiliary",), "estimate"),
    (("auxiliary",), "estimate, midpoint residuals"),
    (("energy",), ""),
)


@dataclass(frozen=True)
class Case:
    """A scene with n eigenmodes a body, step h in s; limit: of the ratio with bounds, what the project promises."""

    text: str
    make: Any
    n: int
    h: float
    limit: float


CASES = {
    "pendulum": Case("pendulum of 14 modes", floating.pendulum, 8, 1e-4, 1.3),
    "double": Case("double pendulum of two times 30 modes", mechanisms.double_pendulum, 24, 2e-4, 1.5),
}


class Variant(floating_cost.Bare):
    """A scene in an mbs of its own, with coupled bounds of all its bodies and the estimate, or without."""

    def __init__(self, case: Case, estimators: tuple[str, ...], estimate: str, steps: int):
        self.case, self.estimators, self.estimate = case, estimators, estimate
        self.limit = case.limit if estimators and not estimate else None
        if estimators:
            self.label = f"coupled {estimators[0]}" + f" {VECTORS}" * ("auxiliary" in estimators)
            self.label += f", {estimate}" * bool(estimate)
        super().__init__(steps, case.h)
        self.settings = self.scene.settings
        self.settings.solution.sensors.active = False

    def build(self, h: float, t_end: float) -> Any:
        """Return the scene."""
        return self.case.make(self.case.n, h=h, t_end=t_end)

    def prepare(self) -> None:
        """Attach monitors, and do their offline work."""
        bodies = getattr(self.scene, "bodies", None) or (self.scene.items,)
        self.monitors = [self.monitor(i, items) for i, items in enumerate(bodies)] if self.estimators else []
        self.scene.mbs.Assemble()
        self.plans = [monitor.plan for monitor in self.monitors]

    def monitor(self, i: int, items: dict[str, int]) -> Any:
        """Attach a monitor to body i."""
        node = int(floating.interface(self.scene.fem, "tip")[0][0])
        return romerr.attach(
            self.scene.mbs,
            romerr.floating_body(self.scene.fem, items),
            outputs=[romerr.node_displacement(f"tip {i + 1}", node=node, component="z")],
            estimators=self.estimators,
            auxiliary_modes=VECTORS,
            time="sampled",
            midpoint_residual="midpoint" in self.estimate,
            scope="coupled (linearised)",
        )

    def seconds(self) -> float:
        """Solve once; without the estimate, which no option leaves out, what makes it is."""
        with ExitStack() as stack:
            if not self.estimate:
                for of, name, found in ESTIMATE:
                    stack.enter_context(mock.patch.object(of, name, return_value=found))
            return super().seconds()

    def finish(self) -> None:
        """Ask for the reports: they evaluate the last block."""
        self.reports = [monitor.report() for monitor in self.monitors]


def variants_of(case: Case, steps: int) -> list[Variant]:
    """Return the scene without bounds and with each estimator."""
    return [Variant(case, *variant, steps) for variant in VARIANTS]


def print_added(variants: list[Variant], times: np.ndarray) -> None:
    """Print what the estimate adds to the bound, of a bare step."""
    for i, variant in enumerate(variants):
        if variant.estimate:
            low, middle, high = np.percentile((times[:, i] - times[:, 1]) / times[:, 0], (25, 50, 75))
            line = f"{variant.estimate}: {middle:.3f} ({low:.3f}..{high:.3f}) of a bare step more than the bound"
            promised = f"; promised at most {ADDED:g}: {pairs.kept(middle, ADDED)}"
            print(line + promised * (variant.estimate == "estimate"))


def main(arguments: list[str] | None = None) -> dict[str, tuple[list[Variant], np.ndarray]]:
    """Measure and print; return variants and their run times in s, (pairs, variants), scene by scene."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--scenes", choices=CASES, nargs="+", default=list(CASES))
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--pairs", type=int, default=11)
    options = parser.parse_args(arguments)
    found = {}
    for name in options.scenes:
        variants = variants_of(CASES[name], options.steps)
        found[name] = variants, pairs.measure(variants, options.pairs)
        pairs.print_ratios(*found[name], f"{CASES[name].text}, one output a body")
        print_added(*found[name])
    return found


if __name__ == "__main__":
    main()
