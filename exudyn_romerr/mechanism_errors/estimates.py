"""All stages in their order, for one solve that has ended: rows in, errors of every sensor by cause out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..mechanism.tangents import block_of
from .modes import Modes
from .steps import Steps

if TYPE_CHECKING:
    from ..mechanism.mechanism import Mechanism
    from .half_widths import CauseEstimate

BLOCK, NEIGHBOURS = 128, 2  # rows that are worked at once, and beside them


def estimates(of: Mechanism, is_static: bool) -> dict[str, CauseEstimate]:
    """Return the errors by "modes", "interfaces" where these are rigid, and "step"; of static rows not of steps."""
    modes, steps, S = Modes(of), Steps(of), len(of.rows)
    for a in range(0, S, BLOCK):
        own = slice(a, min(a + BLOCK, S))
        near = slice(max(a - NEIGHBOURS, 0), min(a + BLOCK + NEIGHBOURS, S))
        wide, inner = (
            block_of(of.rows[near], of.unknowns, of.rest),
            slice(own.start - near.start, own.stop - near.start),
        )
        modes.take(wide[inner], a)
        if not is_static:
            steps.take(wide, inner, a)
    return modes.estimates() | ({} if is_static else {"step": steps.estimate(modes.steps_of_modes)})
