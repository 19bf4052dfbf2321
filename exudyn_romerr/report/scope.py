"""Scopes of bounds: complete, coupled, inputs frozen; and Scene, what a scene adds to the body alone."""

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
NOT_CERTIFIED = "not certified"  # ends the reason of a scope: loads may be missing


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
