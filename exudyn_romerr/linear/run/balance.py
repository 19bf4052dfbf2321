"""Galerkin's balance: W^T R is zero along a reduced trajectory unless a load is missing or a step was not solved.

SolverFacts: what the solver tells, by which it is judged.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...linalg.blocked_products import largest_sizes, rows_times
from ...report.scope import Doubt, Reason

if TYPE_CHECKING:
    from .prepare import Offline

TOGETHER = 256  # samples that are looked at together: what is made of them stays in the cache
GALERKIN_DEFECT = 1e-6  # of the largest term: above it, and above the solver's tolerance, a load was missed
TOLERANCES = 10  # of Newton's relative tolerance may be left in W^T R
LAGS = "VelocityVerlet"
OF_THE_SOLVER = (
    f"of the largest term: {LAGS} leaves accelerations that are not those of its states where forces depend on "
    "velocities; whether a load is missing, too, is not seen beside that"
)
OTHER_SOLVER = f"take another solver than {LAGS}, such as solverType=exu.DynamicSolverType.RK44 in SolveDynamic"


class SolverFacts(NamedTuple):
    """What the solver of a run tells about itself.

    end_time : where it was to go, None if not known. newton_tolerance : relative. floor : size of terms of W^T R that
    cancelled before they came here. is_stopped : whether a tolerance of any body in the mbs stopped it.
    name : its own.
    """

    end_time: float | None = None
    newton_tolerance: float = 0.0
    floor: float = 0.0
    is_stopped: bool = False
    name: str = ""

    def ends_early(self, t: float) -> bool | None:
        """Return whether a run that is at t ends before its solver was to; None: not known."""
        return None if self.end_time is None else bool(t < self.end_time * (1 - 1e-9))


UNKNOWN = SolverFacts()


class Balance:
    """The largest Galerkin residual W^T R = rows z so far, and the largest of its terms."""

    def __init__(self, offline: Offline):
        self._checked, self._precision = offline.scene.checked, offline.samples_precision
        self._left = np.zeros(1)  # the largest, in every mode
        self._terms = 0.0  # the largest term in any mode
        self._noise = 0.0  # what rounding may leave

    def measure(self, rows: np.ndarray, z: np.ndarray, noise: float) -> None:
        """Look at samples z (S, k)."""
        sizes = np.abs(rows).T
        for first in range(0, len(z), TOGETHER):
            part = z[first : first + TOGETHER]
            self._left = np.maximum(self._left, largest_sizes(rows_times(part, rows.T)))
            self._terms = max(self._terms, float(np.max(rows_times(np.abs(part), sizes))))
        self._noise = max(self._noise, noise)

    def go_on(self, before: Balance) -> None:
        """Begin with what another run has left."""
        self._left = np.maximum(self._left, before._left)
        self._terms, self._noise = max(self._terms, before._terms), max(self._noise, before._noise)

    def share(self, floor: float) -> float:
        """Return the largest W^T R, but for rounding, over the largest of its terms, or over the floor."""
        terms = max(self._terms, floor)
        return max(float(self._left.max()) - self._noise, 0.0) / terms if terms else 0.0

    def doubts(self, solver: SolverFacts) -> list[Doubt]:
        """Return why it speaks against the run's bounds; empty: no more is left than by the solver."""
        if not self._checked:
            return [Reason.UNCHECKED.doubt()]
        defect, limit = self.share(solver.floor), limit_of(solver.newton_tolerance + self._precision)
        if defect <= limit:
            return []
        found = f"Galerkin defect {defect:.1e}"
        if LAGS in solver.name:
            return [Reason.UNBALANCED.doubt(said=f"{found} {OF_THE_SOLVER}", beside=found, cure=OTHER_SOLVER)]
        said = (
            f"{found} of the largest term, in mode {np.argmax(self._left)} (expected below {limit:.1e}): a load on "
            "the body is not known here, or depends on more than time, or damping differs, or a step was too long to "
            "be solved well; bounds hold for the loads known"
        )
        return [Reason.UNBALANCED.doubt(said=said, beside=found)]


def limit_of(tolerance: float) -> float:
    """Return what may be left in W^T R, of the largest term, by a solver of that relative tolerance."""
    return GALERKIN_DEFECT + TOLERANCES * tolerance
