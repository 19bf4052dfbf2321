"""MovingSubject: adapts a body in a floating frame to a monitor (theory.md 7).

The frame's inertia terms, the loads and the wrenches of joints are inputs of a linear body: R = M V q'' + ... - B u.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...basis.basis import Basis
from ...linalg.blocked_products import consecutive
from ...model.floating_frame import FramePose, Jitter
from ...offline.options import BoundOptions
from ...offline.prepare import prepare
from ...report.scope import COMPLETE, FULL_MODEL, Scene
from ...residual.problem import Deferred
from ...trajectory.input_signal import SampledSignal
from ..access.mbs_items import load_factor, node_coordinates
from ..access.reduced_damping import damping_text, require_modal_damping
from .driven_frame import PrescribedMotion
from .floating_body import read_object
from .frame_support import read_support, require_free_node
from .input_terms import InputTerms
from .loads_and_joints import read_actions
from .reference_search import find_reference, held_body, stiff_space
from .sampler import Sampler
from .scope_decision import NO_COUPLED, REACTING, WITHOUT_FEEDBACK, Feedback, Wanted, find_scope
from .sensor_outputs import NO_SENSOR, BodySensors, body_sensors

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from ...model.body import ElasticBody
    from ...model.outputs import Output
    from ...offline.prepared import Offline
    from ...trajectory.driven_inputs import Inputs
    from .actions import Actions
    from .floating_body import FloatingBody, ReducedMatrices
    from .frame_support import Support
    from .reference_search import Reference
    from .scope_decision import Found


class MovingSubject:
    """Reads the mbs when a solve begins, and turns rows of its coordinates into samples of a run.

    What reacts to the body's deformation is frozen, as this simulation has it.

    alone : whether nobody else estimates the other sensors of the mbs. sensors : on the body, if they are outputs.
    """

    enriched: Any = None  # vectors that react with the mechanism

    def __init__(self, flex: FloatingBody, options: BoundOptions, scope: str, alone: bool):
        self.item, self._flex, self._options, self._alone = flex.number, flex, options, alone
        self._by_sensors, self.sensors = options.outputs is None, BodySensors((), ())
        self._wanted = Wanted(scope, options)
        self._use(options.outputs or ())
        self.columns, self._motion = np.zeros(0, dtype=int), PrescribedMotion()
        self._signature = self._before = ()  # of this solve; what was made for one before: a static one, most often
        self._body: ElasticBody | None = None

    def read(self, mbs: Any, static: bool = False, attached: Collection[int] = (), others: str = "") -> Offline:
        """Read body, joints and loads; do the offline work unless nothing of it changed since."""
        model = read_object(mbs, self._flex)
        actions = read_actions(mbs, self._flex, model, load_factor(mbs) if static else None)
        reference = find_reference(self._flex, model.V, actions.interfaces())
        model, body = reference.of(model), self._made_body(model, reference)
        if model.rigid is not None:
            require_free_node(mbs, model)
        if body.modal is not None:
            require_modal_damping(body, model.held, model.D)
        support = read_support(mbs, model, actions.drop_idle(body))
        if not static and model.rigid is None:  # else its function moves another frame than that of the mbs
            support = self._motion.taken(mbs, model, support, body, self._wanted)
        columns = np.concatenate([node_coordinates(mbs, node) for node in model.nodes])
        feedback = partial(self._feedback, mbs, model, static, attached, others)
        scope = find_scope(self._wanted, actions, support, static, feedback)
        self._take_sensors(mbs, scope)
        held = support if scope.name == COMPLETE else replace(support, known=False, unknown="")  # of no use in others
        signature = (model.V.tobytes(), id(body), held, scope, self.sensors, *actions.signature())
        if signature != self._signature:
            now = (self._signature, self._sampler, self.enriched) if self._signature else ()
            before, self._before, self._signature = self._before, now, ()  # until all of what follows was done
            if before and before[0] == signature:
                _, self._sampler, self.enriched = before
            else:
                terms = InputTerms(actions, support, self._flex, model.held, model.rigid)
                scene = self._scene(model, actions, terms, reference, support, scope)
                scene = self._reacting(scene, scope, body, model, actions, support, columns, terms)
                offline = self._prepare(body, model, terms, scene)
                self._sampler = Sampler.of(model.frame, actions, terms, offline)
            self._signature = signature
        self._sampler = replace(self._sampler, actions=actions)  # functions of time may be other ones
        self.columns, self._model = consecutive(columns), model
        self._now = mbs.systemData.GetODE2Coordinates()[columns][: model.frame.size]
        self.floor = self._sampler.weight(model.V.T @ self._flex.carried)
        return self._sampler.offline

    @property
    def why_not_coupled(self) -> str:
        """Why the last solve has no linearised mechanism; empty: it has one, or nothing reacts to the body."""
        found, _, _ = self._sampler.offline.scene.reason.partition(REACTING)
        return found.removeprefix(NO_COUPLED) if found.startswith(NO_COUPLED) else ""

    @property
    def body(self) -> ElasticBody:
        """The full body, as the last solve saw it."""
        return self._body

    @property
    def outputs(self) -> tuple[Output, ...]:
        """What is bounded."""
        return tuple(self._options.outputs)

    def modes(self, mbs: Any) -> tuple[np.ndarray, Any]:
        """Return V (N, n) and the full K (N, N)."""
        return read_object(mbs, self._flex).V, self._flex.stiffness

    def add(self, outputs: Sequence[Output]) -> None:
        """Bound further outputs, from the next solve on."""
        self._use([*self._options.outputs, *outputs])
        self._signature = self._before = ()

    def _feedback(self, *scene: Any) -> Feedback:
        """Why bounds leave the feedback of the mechanism out."""
        return Feedback(WITHOUT_FEEDBACK[self._wanted.scope])

    def _reacting(self, scene: Scene, *body: Any) -> Scene:
        """Return the scene with what reacts with the mechanism: nothing here."""
        return scene

    def _take_sensors(self, mbs: Any, scope: Found) -> None:
        """Where no outputs were asked for, take those that the sensors show."""
        if not self._by_sensors:
            return
        sensors = body_sensors(mbs, self._flex, self._alone)
        sensors = sensors if scope.name == COMPLETE else sensors.in_the_frame_too()
        if sensors != self.sensors:
            options, self.sensors = self._options_with(sensors), sensors
            self._use(options.outputs)

    def _options_with(self, sensors: BodySensors) -> BoundOptions:
        """Return the options with other sensors as outputs; those that were added stay."""
        added = self._options.outputs[len(self.sensors.measured) :]
        return replace(self._options, outputs=(*(item.output() for item in sensors.measured), *added))

    def _use(self, outputs: Sequence[Output]) -> None:
        self._options = replace(self._options, outputs=outputs)
        self._wanted = replace(self._wanted, options=self._options)

    def first(self, t: float, *states: np.ndarray, may_be_late: bool = False) -> tuple | None:
        """Return q, q_t, q_tt, u and the frame of a run's first sample; None if its accelerations are not set.

        Solvers may leave them at zero until their first step is done; in a frame at rest the balance tells them.
        may_be_late: they are of another solve.
        """
        rows = self.sampled(np.array([t]), *(state[None] for state in states))
        if may_be_late or not states[2].any():
            rows = self._sampler.accelerated(t, rows)
        return None if rows is None else tuple(None if x is None else x[0] for x in rows)

    def sampled(self, t: np.ndarray, *states: np.ndarray) -> tuple:
        """Return q, q_t, q_tt (S, n), u (S, p) and the frame (S, 24) of accepted steps."""
        self._motion.last_time = float(t[-1])
        return self._sampler(t, *states)

    def _made_body(self, model: ReducedMatrices, reference: Reference) -> ElasticBody:
        held = (model.rayleigh, reference.fixed, reference.rigid)
        if self._body is None or self._body_key != (reference.source, *held):
            self._body = held_body(self._flex, model.rayleigh, reference)
            self._body_key = (reference.source, *held)
        return self._body

    def _prepare(self, body: ElasticBody, model: ReducedMatrices, terms: InputTerms, scene: Scene) -> Offline:
        known = SampledSignal(self._known_inputs, terms.columns.shape[1]) if terms.by_function else None
        return prepare(
            body,
            Basis(model.held, note=f"{model.V.shape[1]} modes of object {self.item}"),
            replace(self._options, inputs=Deferred(lambda: terms.columns, terms.made_of), input_function=known),
            sampled_inputs=not terms.by_function,
            scene=scene,
        )

    def _known_inputs(self, t: np.ndarray) -> np.ndarray:
        """Inputs (T, p) of a frame at rest where it was when the solve began."""
        q = np.zeros((len(t), self._model.V.shape[1]))
        terms, actions = self._sampler.terms, self._sampler.actions
        return terms.values(actions, t, self._model.frame.at_rest(self._now, len(t)), q, q, q)

    def _driven_inputs(self, *of_curve: Any) -> Inputs:
        """Inputs of a frame that moves as its function says, see DrivenFrame.inputs."""
        return self._motion.driven.inputs(self._sampler.terms, self._sampler.actions, *of_curve)

    def _scene(
        self,
        model: ReducedMatrices,
        actions: Actions,
        terms: InputTerms,
        reference: Reference,
        support: Support,
        scope: Found,
    ) -> Scene:
        flex = self._flex
        full = f"{FULL_MODEL}: all of the fem, interfaces {flex.interfaces}, held by {reference.source}"
        r, A = model.frame.reference_pose()
        left_out = [(name, "held by the reference conditions, what acts there does no work") for name in actions.idle]
        left_out += [(f"wrench at {name}", "no load, joint or connector acts there") for name in actions.free]
        left_out += [("terms of a turning frame", support.text)] if support.at_rest else []
        if self._by_sensors:
            left_out += [*self.sensors.left_out, *(() if self.sensors.measured else [("outputs", NO_SENSOR)])]
        return Scene(
            scope=scope.name,
            reason=f"{scope.reason}. {full}",
            frozen=scope.frozen,
            note=scope.note,
            feedback=scope.feedback,
            unknown=terms.unknown,
            turns=not support.at_rest,
            checked=terms.unknown < model.V.shape[1],
            pose=FramePose(r, A),
            driven=self._driven_inputs if support.known and scope.name == COMPLETE else None,
            jitter=Jitter.of(flex.mass, flex.positions, model.held, FramePose(r, A)) if support.at_rest else None,
            minor=terms.minor,
            stiff=stiff_space(flex, model.V, actions.interfaces()),
            computed=(
                *reference.lines,
                damping_text(flex.modal_damping, model.rayleigh),
                f"frame: {support.text}",
                *actions.lines(),
            ),
            left_out=tuple(left_out),
        )
