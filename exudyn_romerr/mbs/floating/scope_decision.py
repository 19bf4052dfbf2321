"""Decides on the scope of a floating body's bounds: complete, coupled, or inputs frozen, and why (theory.md 7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...report.scope import COMPLETE, COUPLED, FROZEN

if TYPE_CHECKING:
    from ...linear.run.prepare import BoundOptions
    from .actions import Actions
    from .frame_support import Support

AUTO = "auto"
ASKABLE = (AUTO, COUPLED, FROZEN)
NO_COUPLED = "no coupled bound: "  # begins the reason of frozen inputs
REACTING = "; these react to the body's deformation: "  # goes on with what they are
OF_A_FILE = "of a file"
# scopes that leave the feedback of a mechanism out, and why
WITHOUT_FEEDBACK = {
    OF_A_FILE: "a file is evaluated for one body alone, attach before the solve has those of all",
    FROZEN: f"scope={FROZEN!r} was asked for",
}
ONLY_VECTORS = "estimators={!r} are known with frozen inputs only: 'auto' asks for the mechanism's"
FEWEST = 6  # vectors: of fewer no part tells what is left out
TOO_FEW = f"auxiliary_modes={{}} is too few to check what they leave out: {FEWEST} or more"
GIVEN_START = (
    "initial= and jumps= are covered with frozen inputs only; after SolveStatic a solve starts in its equilibrium"
)


@dataclass(frozen=True)
class Wanted:
    """What was asked for: scope, and the options of attach. every_step : whether bounds are shown at each step."""

    scope: str
    options: BoundOptions
    every_step: bool = False

    @property
    def why_not_told(self) -> str:
        """Why no linearised mechanism can tell what was asked for; empty: it can."""
        if self.scope in WITHOUT_FEEDBACK:
            return WITHOUT_FEEDBACK[self.scope]
        asked = self.options.estimators
        if asked not in (AUTO, "auxiliary") and set(asked) != {"auxiliary"}:
            return ONLY_VECTORS.format(asked)
        if self.options.initial is not None or len(self.options.jumps):
            return GIVEN_START
        count = self.options.auxiliary_modes
        return TOO_FEW.format(count) if count != AUTO and count < FEWEST else ""

    @property
    def is_live(self) -> bool:
        """Whether bounds are needed while the solve goes on; those of a mechanism are told when it has ended."""
        return self.every_step or self.options.live


@dataclass(frozen=True)
class Found:
    """Scope and its reason. note : why it is no wider, if the user may do something about it."""

    name: str
    reason: str
    note: str = ""


def find_scope(wanted: Wanted, actions: Actions, support: Support, why_not: str) -> Found:
    """Return what bounds of the body alone cover. why_not : no mechanism tells more."""
    reacting = [place.name for place in actions.wrenches] + [load.name for load in actions.loads if load.follows]
    if not support.at_rest:
        reacting.insert(0, "the frame")
    if not reacting:
        return Found(COMPLETE, f"{support.text}; loads do not depend on the body's deformation")
    frozen = (
        f"{', '.join(reacting)}; the bound holds for the full body under the "
        "motion of the frame, the loads and the wrenches of this simulation; their feedback, and what other steps "
        "make of them, is not covered and may make the error of the whole mechanism many times larger"
    )
    note = f"{NO_COUPLED}{why_not}"
    return Found(FROZEN, f"{note}{REACTING}{frozen}", note="" if wanted.scope == FROZEN else note)
