"""What bounds cover: scopes; Scene, what a scene adds to the body alone; Doubt, why no bound is certified."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from ..model.admissible_space import Space
    from ..model.floating_frame import FramePose, Jitter
    from ..trajectory.driven_inputs import Inputs

COMPLETE, COUPLED, FROZEN = SCOPES = ("complete", "coupled (linearised)", "inputs frozen")  # the widest first
COVERS = {
    COMPLETE: "the whole error",
    COUPLED: "modes, to first order",
    FROZEN: "for this run's forces",
}
FULL_MODEL = "Full model"  # begins the part of a scope's reason that names the truth
PAGE = "docs/reading_a_bound.md#scopes"
ATTACH_ALL = "attach all flexible bodies"
UNATTACHED = "flexible bodies of this mbs are not attached"  # in the reason of a scope that is no wider for that
NOT_CERTIFIED = "not certified"  # said with every bound of a run of which there is a Doubt


class Doubt(str):
    """Why no bound of a run is certified: a message; and in few words, for a sentence, its cause, and the cure."""

    cause: str
    cure: str
    said: str

    def __new__(cls, cause: str, cure: str, said: str = "") -> Doubt:
        """Return the message; said : what it says of the cause, if that is more."""
        made = super().__new__(cls, f"{said or cause}. No bound of this run is certified: {cure}")
        made.cause, made.cure, made.said = cause, cure, said or cause
        return made

    def __getnewargs__(self) -> tuple[str, str, str]:
        """How copies, those of pickle too, are made."""
        return self.cause, self.cure, self.said


def causes_of(doubts: Iterable[Doubt]) -> str:
    """Return why bounds are not certified, in few words; empty: they are."""
    return "; ".join(dict.fromkeys(doubt.cause for doubt in doubts))


def cures_of(doubts: Iterable[Doubt]) -> str:
    """Return what to do about it."""
    return "; ".join(dict.fromkeys(doubt.cure for doubt in doubts))


def remedies(doubts: Iterable[Doubt]) -> list[str]:
    """Return why bounds are not certified, each cause once, with what to do about it."""
    return list(dict.fromkeys(f"{doubt.cause}: {doubt.cure}" for doubt in doubts))


def with_doubts(reason: str, doubts: Iterable[Doubt]) -> str:
    """Return the reason of a scope, and why nothing in it is certified."""
    causes = causes_of(doubts)
    return "; ".join(filter(None, [reason, causes and f"{causes}: {NOT_CERTIFIED}"]))


@dataclass(frozen=True)
class Scene:
    """What a scene adds to what is known of the body alone.

    scope, reason : what the bounds cover; a coupled scope is that of estimators "energy" and, where auxiliary vectors
    react with the mechanism (feedback), "auxiliary"; frozen : why others have another. corrected : these are the
    bounds of the trajectory with auxiliary vectors. unknown : number of trailing inputs, wrenches of a mechanism.
    turns : the body is in a frame that may turn. checked : whether W^T R is a check, not used up by wrenches that
    follow from it. pose : of the frame in the reference configuration.
    driven : inputs and motion of a frame that moves as a function of time says, see driven_inputs.py; None: those of
    the run. jitter : what a solver leaves of the accelerations of a frame at rest; None of a frame that moves, or of
    none. minor : inputs of a turning frame that are small, see packed_residual.py. stiff : the body's coordinates
    with the rigid interfaces of its modes, where the truth has free ones; None: no such interfaces. note : why the
    scope is no wider, if the user may do something about it. computed, left_out : lines of the plan.
    """

    scope: str = COMPLETE
    reason: str = ""
    frozen: str = ""
    feedback: bool = False
    corrected: bool = False
    unknown: int = 0
    turns: bool = False
    checked: bool = True
    pose: FramePose | None = None
    driven: Callable[..., Inputs] | None = None
    jitter: Jitter | None = None
    minor: slice | None = None
    stiff: Space | None = None
    note: str = ""
    computed: tuple[str, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()

    @property
    def coupled(self) -> bool:
        """Whether the bounds are those of a mechanism."""
        return self.scope == COUPLED

    @property
    def has_companion(self) -> bool:
        """Whether a run beside this one has the bounds of "auxiliary"."""
        return self.feedback and not self.corrected

    def scope_of(self, name: str) -> str:
        """Return the scope of an estimator's bound."""
        covers = name == "energy" or (name == "auxiliary" and (self.feedback or self.corrected))
        return self.scope if covers or not self.coupled else FROZEN

    def widest(self, names: Iterable[str]) -> list[str]:
        """Return the estimators whose bounds cover most: the others' may be smaller, but say less."""
        scopes = {name: self.scope_of(name) for name in names}
        best = min(scopes.values(), key=SCOPES.index, default=COMPLETE)
        return [name for name, scope in scopes.items() if scope == best]
