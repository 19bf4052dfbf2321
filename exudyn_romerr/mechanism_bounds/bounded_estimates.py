"""What bounds make of estimates: the static rest of the mesh is added, and half widths that are wider go."""

from __future__ import annotations

import numpy as np

from ..mechanism_errors.half_widths import CauseEstimate
from ..report.causes import LINEAR_MODES, STEPS_OF_MODES
from .bounds import Proved

WORTH = 10.0  # times estimates: bounds that are farther off in half of all rows tell nobody anything
MOVES = 0.5  # of the largest estimate, in units of energy: what is less tells of no other row
MISSED = 32.0  # times what comes of forces that a few rows show to be missed: not where most is missed
# times what these rows show to be missed of constraints, whose errors add up; times rad by which errors turn nodes:
# steps obey Newmark's formulas in Euler parameters, of whose second order 0.3 to 13 times that is off, less with h^2
SECOND_ORDER = np.array([256.0, 32.0])
ROUNDING = 1e-6  # of estimates: what differences and Newton leave
PROVED = "proved"


def with_bounds(by_cause: dict[str, CauseEstimate], proved: Proved) -> np.ndarray | None:
    """Make estimates of the modes what is proved; return bounds (T, R) of errors by modes and interfaces.

    None: what estimates miss may be many times as large as they are, and nothing is told of that.
    """
    modes, rows = by_cause["modes"], proved.rows
    whole = sum(by_cause[x].over_time[:, rows] for x in ("modes", "interfaces") if x in by_cause) + proved.static
    largest = np.abs(whole).max(axis=0)
    own = np.abs(proved.missed).max(axis=0)
    modes.half_widths[LINEAR_MODES][rows] += own  # at stops few rows do not show it
    share = ROUNDING + SECOND_ORDER @ proved.second_order
    margin = share * largest + MISSED * np.maximum(own, _share(proved, own, largest) * largest)
    miss = proved.miss + np.outer(_begun(whole, largest), margin)
    if np.median(miss.max(axis=0) - WORTH * largest) > 0:
        return None
    modes.over_time[:, rows] += proved.static
    bound = np.full(modes.over_time.shape, np.inf)
    bound[:, rows] = np.abs(whole) + miss
    if "interfaces" not in by_cause:
        _narrow(modes, rows, miss.max(axis=0))
    return bound


def _share(proved: Proved, own: np.ndarray, largest: np.ndarray) -> float:
    """Largest that is missed of a row, own (n,), over the row's largest estimate (n,), of rows that move most."""
    seen = largest / np.where(proved.sizes > 0, proved.sizes, np.inf)
    moves = seen > MOVES * seen.max(initial=0.0)
    return float((own[moves] / largest[moves]).max(initial=0.0))


def _begun(whole: np.ndarray, largest: np.ndarray) -> np.ndarray:
    """Share (T,) of its largest that the estimate of any row has had: what one body lacks moves all others."""
    had = np.maximum.accumulate(np.abs(whole), axis=0) / np.where(largest > 0, largest, 1.0)
    return had.max(axis=1, initial=0.0)


def _narrow(modes: CauseEstimate, rows: np.ndarray, most: np.ndarray) -> None:
    """The bound in place of checks where it is less than all of them; the steps' part of what modes miss stays."""
    checks = [name for name in modes.half_widths if name != STEPS_OF_MODES]
    is_less = most < sum(modes.half_widths[name][rows] for name in checks)
    for name in checks:
        modes.half_widths[name][rows[is_less]] = 0.0
    modes.half_widths[PROVED] = np.zeros(modes.over_time.shape[1])
    modes.half_widths[PROVED][rows[is_less]] = most[is_less]
