"""Estimate: the error itself as far as it is known, by cause, and how far that can be trusted (estimates.md)."""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

import numpy as np

from .bounds import Bounds

RESOLVED = 0.3  # half width over the largest estimate: above it no digit of the estimate is right
CAUSES = ("basis", "interfaces", "time step", "initial", "jumps")
REDUCTION = CAUSES[:2]  # of what a run with all modes and the same steps has
LINEAR, LINEAR_STEPS = "linearisation", "linearisation of steps"  # what linear equations miss of each
# checks of the march of a whole mechanism, which tells interfaces and modes apart: vectors that it has not, and what
# linear equations miss
FURTHER, LINEAR_MODES = "further vectors", "linearisation of modes"
FURTHER_INTERFACES, LINEAR_INTERFACES = "further vectors of interfaces", "linearisation of interfaces"
# what steps make wrong of what modes leave out: of the whole error, of neither cause alone
STEPS_OF_MODES = "steps of what modes leave out"
FEEDBACK = "sampled feedback"  # what is not linear of a PreStep function: where there is one steps are of first order
BY_STEPS = ("time step", "steps", LINEAR_STEPS, "loads", FEEDBACK)


class Estimate(NamedTuple):
    """Signed error of an output by cause, its half width by check; each (T, r)."""

    parts: dict[str, np.ndarray]
    half_widths: dict[str, np.ndarray]

    @property
    def total(self) -> np.ndarray:
        """The estimate (T, r)."""
        return sum(self.parts.values())

    @property
    def uncertainty(self) -> np.ndarray:
        """Its half width (T, r)."""
        return reduce(np.add, self.half_widths.values())  # of one: that array, no copy of it


def estimated(streams: dict[str, dict[str, Bounds]], name: str, interfaces: np.ndarray | float = 0.0) -> Estimate:
    """Return what estimator `name` knows of an output's error; what it leaves is bounded, which is the half width.

    Where the scope is complete that is proved; elsewhere it holds under what the scope says.

    interfaces : their share (r,) in what the basis makes, that of static errors. The part follows the whole in time:
    static errors lack the frequencies that free interfaces lower, 60 to 80 % off where a bar rings.
    """
    total, reduction = streams["total"][name], streams["reduction"][name].correction
    none = np.broadcast_to(0.0, total.correction.shape)  # takes no memory
    initial = streams["initial"][name].correction if "initial" in streams else None
    initial = none if initial is None else initial
    basis = reduction - initial
    of_basis = ((1 - interfaces) * basis, interfaces * basis) if np.any(interfaces) else (basis, none)
    known = (*of_basis, total.correction - reduction, initial, none)
    return Estimate(dict(zip(CAUSES, known, strict=True)), {"proved": total.correction_bound})
