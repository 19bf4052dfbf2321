"""What bounds cover: scopes; Scene, what a scene adds to the body alone; Reason, why no bound is certified."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..model.admissible_space import Space
    from ..model.floating_frame import FramePose, Jitter

COMPLETE, COUPLED, FROZEN = SCOPES = ("complete", "coupled (linearised)", "inputs frozen")  # the widest first
COVERS = {
    COMPLETE: "the whole error",
    COUPLED: "modes, to first order",
    FROZEN: "for this run's forces",
}
FULL_MODEL = "Full model"  # begins the part of a scope's reason that names the truth
PAGE = "docs/limits.md#scopes"
ATTACH_ALL = "attach all flexible bodies"
UNATTACHED = "flexible bodies of this mbs are not attached"  # in the reason of a scope that is no wider for that
NOT_CERTIFIED = "not certified"  # said with every bound of a run of which there is a Doubt


class Doubt(str):
    """Why no bound of a run is certified: a message; in few words, for a sentence, its cause, and the cure.

    reason : name of the Reason; empty: of a report that an older version has written.
    """

    cause: str
    cure: str
    said: str
    reason: str

    def __new__(cls, cause: str, cure: str, said: str = "", reason: str = "") -> Doubt:
        """Return the message; said : what it says of the cause, if that is more."""
        made = super().__new__(cls, f"{said or cause}. No bound of this run is certified: {cure}")
        made.cause, made.cure, made.said, made.reason = cause, cure, said or cause, reason
        return made

    def __getnewargs__(self) -> tuple[str, str, str, str]:
        """How copies, those of pickle too, are made."""
        return self.cause, self.cure, self.said, self.reason


SMOOTHLY = "let loads begin smoothly"
# of omega_1^2 max |V qr|_M: with as large a |V qr''|_M at first a body rings with that amplitude; where a load is
# there at once, and stays, it is 0.5 at least; where one grows over three quarters of the longest period, 0.15
AT_ONCE = 0.25


class Reason(Enum):
    """All reasons why no bound of a run is certified: the cause in few words, the cure, and what more is said of it.

    docs/limits.md has the table of them, and how often each is met.
    """

    UNCHECKED = (
        "a load that is not known here would not be noticed",
        "add eigenmodes",
        "the wrenches of joints use up the balance V^T R = 0 of all modes: a load that is not known here would not "
        "be noticed",
    )
    UNBALANCED = (
        "the run is not balanced by what is known of it",
        "make known all loads and the damping that act on the body, or take shorter steps",
        "",
    )
    GOES_ON = (
        "it goes on from a solve before whose error is not known",
        "make one solve of both",
        "the run goes on from another one, and what that has left wrong is not known, or not in these vectors",
    )
    NO_ACCELERATIONS = (
        "the solver has no accelerations at its start",
        "take an implicit solver with generalizedAlpha.computeInitialAccelerations = True",
        "the solver has no accelerations at its start: bounds begin at t = {:g} s, where the full body is taken to "
        "be as the reduced one; what was wrong by then is in no bound and no estimate",
    )

    @property
    def cause(self) -> str:
        """In few words."""
        return self.value[0]

    @property
    def cure(self) -> str:
        """What to do about it."""
        return self.value[1]

    def doubt(self, *found: object, said: str = "", beside: str = "", cure: str = "") -> Doubt:
        """Return it as met.

        found : what the sentence has places for; said : in its place; beside : the cause; cure : in place of its own.
        """
        cause = f"{self.cause}, {beside}" if beside else self.cause
        return Doubt(cause, cure or self.cure, said or self.value[2].format(*found), self.name)


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

    scope, reason : what the bounds cover. unknown : number of trailing inputs, wrenches of a mechanism.
    turns : the body is in a frame that may turn. checked : whether W^T R is a check, not used up by wrenches that
    follow from it. pose : of the frame in the reference configuration.
    jitter : what a solver leaves of the accelerations of a frame at rest; None of a frame that moves, or of
    none. first_load : number of inputs before loads. stiff : the body's coordinates
    with the rigid interfaces of its modes, where the truth has free ones; None: no such interfaces. note : why the
    scope is no wider, if the user may do something about it. computed, left_out : lines of the plan.
    """

    scope: str = COMPLETE
    reason: str = ""
    unknown: int = 0
    turns: bool = False
    checked: bool = True
    pose: FramePose | None = None
    jitter: Jitter | None = None
    first_load: int = 0
    stiff: Space | None = None
    note: str = ""
    computed: tuple[str, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()


def beside_steps(sizes: np.ndarray, omega_1: float) -> tuple[str, ...]:
    """Return what helps beside shorter steps where a body rings, for something acts on it at once; else nothing.

    sizes : (T, 2), of its deformation and of the acceleration of that. omega_1 : its lowest frequency, rad/s.
    """
    displaced, accelerated = np.max(sizes[:, 0]), np.max(sizes[:2, 1])
    return (SMOOTHLY,) if accelerated > AT_ONCE * omega_1**2 * displaced else ()
