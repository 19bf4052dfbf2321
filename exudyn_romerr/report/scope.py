"""What bounds cover: scopes; Scene, what a scene adds to the body alone; Reason, why no bound is certified."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

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
RADIUS_OF_ONE = "set generalizedAlpha.spectralRadius = 1"
SAME_LOADS = "give user functions of loads the same value in both"
NO_CHANGES = (
    "change no parameters before report() is asked, but let user functions depend on time; if nothing was changed, "
    "Newton's tolerances are too loose: a smaller newton.relativeTolerance"
)


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
    THIRD_ORDER = (
        "the error is too large to be linear",
        "add modes, or let loads and motion begin smoothly",
        "linear equations leave out more than {} % of the deformation that they predict, as measured: what is of "
        "third order in the error is in no bound",
    )
    REPEATED = (
        "adaptive steps that were repeated, with a spectral radius below 1",
        f"{RADIUS_OF_ONE}, or choose a step that need not be repeated (numberOfSteps)",
        "steps are not of the size that was asked for: what Exudyn repeats with a smaller one goes on with "
        "accelerations of the first try",
    )
    STARTS_DAMPED = (
        "sudden start with dampers, and unknown springs or another integrator",
        f"{SMOOTHLY}; if they cannot, {RADIUS_OF_ONE}, without useNewmark, which may widen bounds",  # once 2.9 times
        "the run starts suddenly, there are dampers beside those of the bodies, and what first steps make of both "
        "is not known: the stiffness of a spring cannot be read from the mbs, or the integrator is another one",
    )
    BEGUN_ANEW = (
        "a solve that goes on from another one, with a spectral radius below 1",
        f"{RADIUS_OF_ONE}, or make one solve of both",
        "the solver begins anew with the accelerations that it finds: what it does in its first steps then, with "
        "modes that ring and that they do not resolve, is not in the bound",
    )
    GOES_ON = (
        "it goes on from a solve before whose error is not known",
        "make one solve of both",
        "the run goes on from another one, and what that has left wrong is not known, or not in these vectors",
    )
    OTHER_INDEX = (
        "useIndex2Constraints in a solve that goes on from one without",
        "set useIndex2Constraints in both solves, or in none",
        "a solve with useIndex2Constraints goes on from one without: what it does as velocities jump to where "
        "constraints of velocities have them is not in the bound",
    )
    OTHER_LOADS = (
        "other loads at the start than in the static solve before",
        SAME_LOADS,
        "loads at the start are not those that the static solve before ended with: a jump rings in all modes, below "
        "the step size too, and no basis or bound follows that",
    )
    NO_ACCELERATIONS = (
        "the solver has no accelerations at its start",
        "take an implicit solver with generalizedAlpha.computeInitialAccelerations = True",
        "the solver has no accelerations at its start: bounds begin at t = {:g} s, where the full body is taken to "
        "be as the reduced one; what was wrong by then is in no bound and no estimate",
    )
    UNKNOWN_SCHEME = (
        "the solver is not known",
        "call SolveDynamic without storeSolver=False",
        "the solver is not kept in mbs.sys: what it does in the first steps after a sudden start, with modes that "
        "they do not resolve, is not in the bound",
    )
    CHANGED = ("the mbs was changed along the run", NO_CHANGES, "")
    UNSEEN = (
        "changes along the run could not be looked for",
        NO_CHANGES,
        "whether the PostStep function changes the mechanism is not known, for its states cannot be asked: {}",
    )
    CONTROLLER = (
        "a controller switches, or its gains do work",
        "let the user function be smooth, within steps too, passive, without memory; or pass scope='inputs frozen'",
        "",
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

    scope, reason : what the bounds cover; a coupled scope is that of estimators "energy" and, where auxiliary vectors
    react with the mechanism (feedback), "auxiliary"; frozen : why others have another. corrected : these are the
    bounds of the trajectory with auxiliary vectors. coupled_energy : makes the estimator of a coupled scope of a
    Problem and the number `unknown`. unknown : number of trailing inputs, wrenches of a mechanism.
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
    coupled_energy: Callable[..., Any] | None = None
    unknown: int = 0
    turns: bool = False
    checked: bool = True
    pose: FramePose | None = None
    coupled_energy: Callable[..., Any] | None = None
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

    def is_coupled(self, name: str) -> bool:
        """Whether an estimator's bound is that of a mechanism."""
        return self.coupled and self.scope_of(name) == COUPLED

    def widest(self, names: Iterable[str]) -> list[str]:
        """Return the estimators whose bounds cover most: the others' may be smaller, but say less."""
        scopes = {name: self.scope_of(name) for name in names}
        best = min(scopes.values(), key=SCOPES.index, default=COMPLETE)
        return [name for name, scope in scopes.items() if scope == best]
