"""Decides on the scope of a floating body's bounds: complete, coupled, or inputs frozen, and why (theory.md 7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from ...report.scope import COMPLETE, COUPLED, FROZEN

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...offline.options import BoundOptions
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
DRIVEN = (
    "the bound holds for the full body under the motion of the frame that this simulation computed, at its samples "
    "and linear between them; how far that is from the function, what time steps do to the frame's motion, is not "
    "covered"
)
BY_FUNCTION = (
    "which gives the frame's motion between time steps too; its derivatives are those of polynomials through it, and "
    "what they miss is estimated and added"
)
TO_FIRST_ORDER = (
    "joints, springs and dampers react to the body's deformation, and the bound covers that to first order: for the "
    "mechanism linearised about its computed motion, all attached bodies together, outputs as the body's frame sees "
    "them, displacements and positions in global axes too. Neglected, but for what auxiliary vectors carry: how "
    "directions of joints and internal forces turn with the error, its centrifugal and gyroscopic terms"
)


@dataclass(frozen=True)
class Wanted:
    """What was asked for: scope, and the options of attach."""

    scope: str
    options: BoundOptions


@dataclass(frozen=True)
class Found:
    """Scope and its reason; of a coupled one, why other estimators are frozen, and whether auxiliary ones react.

    note : why it is no wider, if the user may do something about it. answers : whether the linearised mechanism has
    an estimate of the error, though no bound.
    """

    name: str
    reason: str
    frozen: str = ""
    feedback: bool = False
    note: str = ""
    answers: bool = False


class Feedback(NamedTuple):
    """Whether a bound can cover the feedback of joints, springs and dampers.

    refusal : why it cannot; empty: it can. without : why auxiliary vectors cannot react with the mechanism. answers :
    whether the linearised mechanism has an estimate, though no bound.
    """

    refusal: str
    without: str = ""
    answers: bool = False


def find_scope(
    wanted: Wanted, actions: Actions, support: Support, static: bool, feedback: Callable[[], Feedback]
) -> Found:
    """Return the widest scope that the scene allows, or the one asked for.

    feedback : is asked where something reacts to the body's deformation.
    """
    reacting = [place.name for place in actions.wrenches] + [load.name for load in actions.loads if load.follows]
    if not support.at_rest and not support.driven:
        reacting.insert(0, "the frame")
    if not reacting and support.driven and not static and not support.known:
        why = f" ({support.unknown})" if support.unknown else ""
        text = f"{support.text}; {DRIVEN}{why}; loads do not depend on the body's deformation"
        return Found(FROZEN, text, note=f"the frame's motion is that of this run, not its function's{why}")
    if not reacting and support.known:
        return Found(COMPLETE, f"{support.text}, {BY_FUNCTION}; loads do not depend on the body's deformation")
    if not reacting:
        return Found(COMPLETE, f"{support.text}; loads do not depend on the body's deformation")
    refusal, without, answers = feedback()
    frozen = (
        f"{', '.join(reacting)}; the bound holds for the full body under the "
        "motion of the frame, the loads and the wrenches of this simulation; their feedback, and what other steps "
        "make of them, is not covered and may make the error of the whole mechanism many times larger"
    )
    if refusal:
        note = f"{NO_COUPLED}{refusal}"
        told = "" if wanted.scope == FROZEN else note
        return Found(FROZEN, f"{note}{REACTING}{frozen}", note=told, answers=answers)
    frozen = f"{REACTING.removeprefix('; ')}{frozen}"
    return Found(COUPLED, TO_FIRST_ORDER, f"{frozen}; {without}" if without else frozen, feedback=not without)
