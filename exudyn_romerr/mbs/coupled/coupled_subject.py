"""CoupledSubject: a body in a floating frame whose mechanism reacts to its errors (theory.md 7)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...estimators.coupled_energy import MechanismEnergy
from ...report.scope import COUPLED
from ...residual.free_mass import FreeMass
from ..floating.moving_subject import MovingSubject
from ..mechanism.enriched_body import EnrichedBody
from ..mechanism.extended_tangents import FixedFreedoms
from .coupled_scope import feedback_of

if TYPE_CHECKING:
    from ...offline.options import BoundOptions
    from ...offline.prepared import Offline
    from ...report.scope import Scene
    from ..floating.floating_body import FloatingBody
    from ..floating.scope_decision import Feedback, Found

TANGENT = "tangent of the mechanism: read by a solver of its own, the simulation stays the same bit for bit"
ESTIMATE = "estimate of the error: modes by these vectors, time steps from the samples, reaction of the mechanism"
BETWEEN = ("loads between samples, in the estimate of the error by time steps", "midpoint_residual=False")
BY_MECHANISM = "estimate by the linearised mechanism"


class CoupledSubject(MovingSubject):
    """As MovingSubject, with auxiliary vectors that react with the mechanism where that can be had."""

    enriched: EnrichedBody | None = None

    def __init__(self, flex: FloatingBody, options: BoundOptions, scope: str, alone: bool):
        # imported in the solve, when tangents are read, it takes as long as some runs
        import scipy.integrate
        import scipy.interpolate  # noqa: F401

        super().__init__(flex, options, scope, alone)

    def read(self, mbs: Any, *solve: Any, **options: Any) -> Offline:
        """As MovingSubject.read; vectors take the loads whose functions of time may be other ones than before."""
        offline = super().read(mbs, *solve, **options)
        if self.enriched is not None:
            self.enriched.use(self._sampler.actions)
        return offline

    def read_alone(self, mbs: Any) -> None:
        """Read what is free to move in the mechanism, of which no other body is attached."""
        if self.enriched is not None:
            FixedFreedoms([self.enriched], mbs.systemData.ODE2Size()).prepare(mbs)

    @property
    def why_not_coupled(self) -> str:
        """Why the last solve has no linearised mechanism; empty: it has one, or nothing reacts to the body."""
        scene = self._sampler.offline.scene
        if scene.coupled:
            return "" if scene.feedback else scene.frozen.rpartition("; ")[2]
        return super().why_not_coupled

    def compliance(self, marker: int) -> tuple[float, float] | None:
        """Return what a unit force and torque at a marker accelerate it by at most; None: it is not on the body."""
        place = self._sampler.actions.places.get(marker)
        return None if place is None else FreeMass.of(self._body).compliance(place.columns)

    def _feedback(self, mbs: Any, *scene: Any) -> Feedback:
        return feedback_of(mbs, self._wanted, *scene)

    def _reacting(self, scene: Scene, scope: Found, body, model, actions, support, columns, terms) -> Scene:
        """Make the body with vectors if the mechanism answers its errors; return the scene, which says so."""
        self.enriched = None
        scene = replace(scene, coupled_energy=MechanismEnergy) if scene.coupled else scene
        if not (scene.feedback or scope.answers):
            return scene
        kept = (self._flex, body, model, actions, support, replace(scene, scope=COUPLED, feedback=True))
        try:
            self.enriched = EnrichedBody(*kept, columns, terms, self._options)
        except Exception as error:
            if scene.feedback:
                raise
            return replace(scene, left_out=(*scene.left_out, (BY_MECHANISM, str(error))))
        computed = (*scene.computed, self.enriched.note, TANGENT, ESTIMATE)
        left_out = scene.left_out if self._options.midpoint_residual else (*scene.left_out, BETWEEN)
        return replace(scene, computed=computed, left_out=left_out)
