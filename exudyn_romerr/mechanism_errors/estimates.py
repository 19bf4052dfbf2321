"""All stages in their order, for one solve that has ended: rows in, errors of every sensor by cause out."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..mechanism.tangents import block_of, rows_at_once
from ..report.causes import FEEDBACK, LINEAR_INTERFACES, LINEAR_MODES, LINEAR_STEPS
from .end_state import EndState
from .linearity import Linearity, UnmovedForces
from .missed import MissedFeedback
from .modes import Marched, Modes, OfBody
from .steps import Steps

if TYPE_CHECKING:
    from ..mechanism.mechanism import Mechanism
    from .half_widths import CauseEstimate

LINEARISED = {"modes": LINEAR_MODES, "interfaces": LINEAR_INTERFACES, "step": LINEAR_STEPS}  # checks by cause
MISSED = {"modes": LINEAR_MODES, "step": FEEDBACK}  # the same of what is not linear of a sampled feedback
NEIGHBOURS = 2  # rows beside a block


def estimates(
    of: Mechanism,
    is_static: bool,
    before: EndState | None = None,
    bounds: Callable[[Marched], None] | None = None,
    content: Callable[[Marched, int], None] | None = None,
) -> tuple[dict[str, CauseEstimate], EndState, list[OfBody]]:
    """Return errors by "modes", "interfaces" where these are rigid, "step"; what the run leaves wrong; of each body.

    is_static : whether rows are load steps, in which nothing moves. before : what the run begins with. bounds : is
    given every block of the modes' errors; content : these and the number of their first row.
    """
    modes, S = Modes(of, before, bounds is not None), len(of.rows)
    steps, linearity = Steps(of, before), Linearity(of)
    feedback = {cause: MissedFeedback(of) for cause in MISSED} if of.readings.splined.is_sampled else {}
    count = rows_at_once(of.unknowns)
    for a in range(0, S, count):
        own = slice(a, min(a + count, S))
        near = slice(max(a - NEIGHBOURS, 0), min(a + count + NEIGHBOURS, S))
        wide = block_of(of.rows[near], of.unknowns, of.readings.splined)
        inner = slice(own.start - near.start, own.stop - near.start)
        block, unmoved = wide[inner], UnmovedForces(of, of.rows[own])
        modes.take(block, a, unmoved)
        if bounds is not None:
            bounds(modes.now)
        if content is not None:
            content(modes.now, a)
        e, lam = modes.now.e, modes.now.lam
        if feedback:
            feedback["modes"].take(block, a, e[..., : of.unknowns.n_a], lam, unmoved)
        if not is_static:
            of_steps, forces = steps.take(wide, inner, a)
            e, lam = e - of_steps, lam - forces[:, of.equations.independent]
        e = e[..., : of.unknowns.n_a]
        linearity.take(block.as_if_at_once(), a, e, lam, unmoved)
        if feedback:
            feedback["step"].take(block, a, e, lam, unmoved)
    found = modes.estimates() | ({} if is_static else {"step": steps.estimate()})
    for cause, check in LINEARISED.items():
        if cause in found:
            found[cause].half_widths[check] += linearity.share * np.abs(found[cause].over_time).max(axis=0)
    for cause, missed in feedback.items():
        found[cause].half_widths[MISSED[cause]] += missed.largest["feedback"]
    return found, EndState(of.unknowns, *modes.end, steps.flow.e), modes.of_bodies
