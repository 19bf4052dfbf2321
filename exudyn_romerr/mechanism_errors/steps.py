"""Errors by the time integration, as sensors show them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..report.causes import FEEDBACK, LINEAR_STEPS
from .flow import Flow
from .half_widths import CauseEstimate, Largest, unchecked
from .inner_loads import TrueLoads
from .reduced_system import ReducedSystem

if TYPE_CHECKING:
    from ..mechanism.mechanism import Mechanism
    from ..mechanism.tangents import Block
    from .end_state import EndState

# times the share of rates that are off the constraints: where it was 1e-3 four of five numbers held, at 1e-1 few did
OF_DRIFT = 30.0
ORDER_4 = 8  # a cubic of loads is closer than straight ones, at least so many times, where both resolve them


class Steps:
    """Goes on from block to block. flow : of the reduced mechanism."""

    def __init__(self, of: Mechanism, before: EndState | None):
        self._of = of
        inner = TrueLoads(of.unknowns, of.equations, of.has_user_functions)
        self.flow = Flow(
            of.unknowns,
            of.equations.independent,
            of.rows.multipliers.shape[1],
            inner,
            None if before is None else before.steps,
        )
        self._largest, self._kept, self._is_sampled = Largest(), [], of.readings.splined.is_sampled

    def take(self, wide: Block, inner: slice, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Go on through rows `inner` of a block with neighbours; number `first` of the run is the first of these.

        Returns
        -------
        e (T, 3, n), multipliers (T, all) : what the steps make wrong
        """
        of, delay = self._of, None
        if self._is_sampled:
            delay, wide = of.equations.delay(wide.rows), wide.as_if_at_once()
        system = ReducedSystem.of(wide, of.unknowns)
        e, lam = self.flow(wide.rows, system, inner.start, inner.stop - inner.start, delay)
        rows = wide.rows[inner]
        e = of.unknowns.of_coordinates(rows.q, rows.v, rows.a, e)
        y = of.outputs(first, -e, -lam)
        self._largest.add(step=y[..., 0], loads=y[..., 0] - y[..., 1])
        if self.flow.columns > 2:
            self._largest.add(jumps=y[..., 0] - y[..., 2])
        if self._is_sampled and len(e) > 1:
            # what a delayed force makes of accelerations, and what deflections take back, is far larger than the rest
            other = e[..., :1].copy()
            other[:, 2] = np.gradient(other[:, 1], rows.t, axis=0)
            self._largest.add(delayed=y[..., 0] - of.outputs(first, -other, -lam[..., :1])[..., 0])
        self._kept.append(y[..., 0])
        return e[..., 0], lam[..., 0]

    def estimate(self) -> CauseEstimate:
        """Return what is known of the error by steps."""
        most = self._largest
        drift = min(1.0, OF_DRIFT * self.flow.drift)
        checks = {
            "loads": most["loads"] / ORDER_4 + (most["jumps"] if self.flow.columns > 2 else 0.0),
            LINEAR_STEPS: unchecked(most["step"], self._of.sensors) + drift * most["step"],
        }
        if self._is_sampled:
            checks[FEEDBACK] = most["delayed"]
        return CauseEstimate(np.concatenate(self._kept), checks)
