"""StaticRun: the errors of one static solve."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..trajectory.samples import Extension
from .bound_stream import Stream
from .record import UNKNOWN
from .run import Opening, Run

if TYPE_CHECKING:
    from ..trajectory.samples import Samples
    from .offline import Offline
    from .record import SolverFacts


class StaticRun(Run):
    """The error along one static solve: K e = -R at every load step, hence exact, C e = -C K^-1 R.

    t is the load factor. q_t and q_tt are ignored; dynamic estimators are left out.
    """

    is_static = True

    def __init__(self, offline: Offline, solver: SolverFacts = UNKNOWN, tolerances: dict[str, float] | None = None):
        super().__init__(offline, solver, tolerances)
        self._segmenters = {}
        self._streams = {"reduction": Stream({"static": offline.static()})}

    def start(self, t: float, q, q_t=None, q_tt=None, u=None, frame=None) -> None:
        """Take the first load step: q (n,)."""
        self.open(self.opening(t, q, q_t, q_tt, u, frame))

    def opening(self, t: float, q, q_t=None, q_tt=None, u=None, frame=None, after: Run | None = None) -> Opening:
        """Check the first load step; load steps do not depend on what was before."""
        return Opening(self._steps(np.array([t], dtype=float), np.asarray(q)[None], u, frame), None, None)

    def open(self, opening: Opening) -> None:
        """Begin the run."""
        self._take(opening.first)

    def extend(self, t, q, q_t=None, q_tt=None, u=None, frame=None) -> None:
        """Take further load steps: t (S,), q (S, n)."""
        if np.size(t):
            self.advance(self.extension(t, q, q_t, q_tt, u, frame))

    def extension(self, t, q, q_t=None, q_tt=None, u=None, frame=None) -> Extension:
        """Check further load steps."""
        return Extension(self._steps(np.asarray(t, dtype=float), q, u, frame), {})

    def advance(self, extension: Extension) -> None:
        """Go on by checked load steps."""
        self._take(extension.new)

    def _steps(self, t: np.ndarray, q: np.ndarray, u, frame) -> Samples:
        q = np.asarray(q, dtype=float)
        return self._checked(t, q, 0 * q, 0 * q, u, frame)

    def _take(self, new: Samples) -> None:
        z = self.offline.coordinates(new.q, new.q_t, new.q_tt, new.u)
        self._own = self.offline.rounding.of_equilibrium(new.u)
        rounded = self.offline.rounded(new, self._own)
        self._streams["reduction"].load_steps(z, rounded)
        self._record(new, rounded)
