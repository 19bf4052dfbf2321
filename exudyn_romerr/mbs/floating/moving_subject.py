"""MovingSubject: adapts a body in a floating frame to a monitor (theory.md 7).

The frame's inertia terms, the loads and the wrenches of joints are inputs of a linear body: R = M V q'' + ... - B u.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...basis.basis import Basis
from ...checks import check_finite
from ...errors import AssumptionError
from ...linalg.blocked_products import consecutive
from ...linear.residual.problem import Deferred
from ...linear.run.prepare import BoundOptions, prepare
from ...linear.trajectory.input_signal import InputSignal
from ...model.floating_frame import FramePose, Jitter
from ...report.data import Plan, line_of
from ...report.scope import COMPLETE, COUPLED, FROZEN, FULL_MODEL, Scene
from ..access.mbs_items import load_factor, node_coordinates
from ..access.reduced_damping import damping_text, require_modal_damping
from .floating_body import read_object
from .frame_support import read_support, require_free_node
from .input_terms import InputTerms
from .reference_search import held_body, seen_body, stiff_space
from .sampler import Sampler
from .scope_decision import Wanted, find_scope
from .sensor_outputs import NO_SENSOR, BodySensors, body_sensors

BY_MECHANISM = "linearised mechanism: modes by {} vectors, rigid interfaces by those that deform them; time steps"
VECTORS = 26  # static ones of a body, beside those that deform rigid interfaces

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...linear.run.offline import Offline
    from ...model.body import ElasticBody
    from ...model.outputs import Output, View
    from .actions import Actions
    from .floating_body import FloatingBody, ReducedMatrices
    from .frame_support import Support
    from .reference_search import Reference
    from .scope_decision import Found


class _Seen(NamedTuple):
    """What an mbs has of a body now: reduced matrices, what acts on it, what holds it, the full body."""

    model: ReducedMatrices
    actions: Actions
    reference: Reference
    support: Support
    body: ElasticBody


class SampledSignal(InputSignal):
    """u(t) of a function that takes many times (T,) and returns (T, p)."""

    def __init__(self, f: Callable, p: int):
        self._f, self.p = f, p

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Return u (T, p) at times t (T,)."""
        u = self._f(np.asarray(t))
        check_finite("loads over time", u)
        return u

    def at(self, t: float) -> np.ndarray:
        """Return u (p,) at one time."""
        return self(np.array([t]))[0]


class MovingSubject:
    """Reads the mbs when a solve begins, and turns rows of its coordinates into samples of a run.

    What reacts to the body's deformation is frozen, as this simulation has it.

    alone : whether nobody else estimates the other sensors of the mbs. flex : the body. sensors : on the body, if
    they are outputs.
    """

    def __init__(self, flex: FloatingBody, options: BoundOptions, scope: str, alone: bool):
        self.item, self.flex, self._options, self._alone = flex.number, flex, options, alone
        self._by_sensors, self.sensors = options.outputs is None, BodySensors((), ())
        self._wanted = Wanted(scope, options)
        self._use(options.outputs or ())
        self.columns = np.zeros(0, dtype=int)
        self._signature = self._before = ()  # of this solve; what was made for one before: a static one, most often
        self._body: ElasticBody | None = None

    def _seen(self, mbs: Any, static: bool) -> _Seen:
        """Read body, joints and loads; its sensors, where these are the outputs."""
        model, actions, reference = seen_body(mbs, self.flex, load_factor(mbs) if static else None)
        body = self._made_body(model, reference)
        support = read_support(mbs, model, actions.drop_idle(body))
        return _Seen(model, actions, reference, support, body)

    def is_told(self, mbs: Any, static: bool, why_not: str) -> bool:
        """Return whether the linearised mechanism tells of the body; why_not : it cannot in this mbs.

        Raises
        ------
        AssumptionError
            It was asked for and cannot.
        """
        refusal = self._wanted.why_not_told or why_not
        if refusal and self._wanted.scope != COUPLED:
            return False
        model, actions, reference, support, _ = self._seen(mbs, static)
        scope = find_scope(self._wanted, actions, support, refusal)
        if scope.name == COMPLETE:
            return False
        self._require_other(refusal)
        self._lines = self._found(model, actions, reference, support)
        self._take_sensors(mbs, scope)
        self.columns, self._model = _columns(mbs, model), model
        return True

    def _require_other(self, refusal: str) -> None:
        if refusal and self._wanted.scope == COUPLED:
            raise AssumptionError(f"scope={COUPLED!r} cannot be had: {refusal}; or pass scope={FROZEN!r}")

    def require_frozen(self, error: Exception) -> None:
        """Raise the error that the mechanism cannot tell for, if that was asked for by its name."""
        if self._wanted.scope == COUPLED:
            raise error

    def at_every_step(self) -> None:
        """Let bounds be known while a solve goes on, of scope "inputs frozen" in mechanisms."""
        self._wanted = replace(self._wanted, every_step=True)

    @property
    def is_live(self) -> bool:
        """Whether bounds are needed while a solve goes on."""
        return self._wanted.is_live

    @property
    def vectors(self) -> int:
        """How many vectors the mechanism is told of."""
        asked = self._options.auxiliary_modes
        return VECTORS if asked == "auto" else int(asked)

    def told_plan(self) -> Plan:
        """Return what the mechanism will tell."""
        of = (line_of(out) for out in self.outputs if out.is_requested)
        return Plan((BY_MECHANISM.format(self.vectors), *self._lines, *of), self._left_out())

    def _found(
        self, model: ReducedMatrices, actions: Actions, reference: Reference, support: Support
    ) -> tuple[str, ...]:
        """Lines of the plan that say what was found."""
        damping = damping_text(self.flex.modal_damping, model.rayleigh)
        return *reference.lines, damping, f"frame: {support.text}", *actions.lines()

    def _left_out(self) -> tuple[tuple[str, str], ...]:
        if not self._by_sensors:
            return ()
        return (*self.sensors.left_out, *(() if self.sensors.measured else [("outputs", NO_SENSOR)]))

    def read(self, mbs: Any, static: bool = False, why_not: str = "") -> Offline:
        """Do the offline work of the body alone, unless nothing of it changed since; why_not : no mechanism tells."""
        model, actions, reference, support, body = self._seen(mbs, static)
        refusal = self._wanted.why_not_told or why_not
        if model.rigid is not None:
            require_free_node(mbs, model)
        if body.modal is not None:
            require_modal_damping(body, model.held, model.D)
        scope = find_scope(self._wanted, actions, support, refusal)
        self._take_sensors(mbs, scope)
        signature = (model.V.tobytes(), id(body), support, scope, self.sensors, *actions.signature())
        if signature != self._signature:
            now = (self._signature, self._sampler) if self._signature else ()
            before, self._before, self._signature = self._before, now, ()  # until all of what follows was done
            if before and before[0] == signature:
                _, self._sampler = before
            else:
                terms = InputTerms(actions, support, self.flex, model.held, model.rigid)
                scene = self._scene(model, actions, terms, reference, support, scope)
                offline = self._prepare(body, model, terms, scene)
                self._sampler = Sampler.of(model.frame, actions, terms, offline)
            self._signature = signature
        self._sampler = replace(self._sampler, actions=actions)  # functions of time may be other ones
        self.columns, self._model = _columns(mbs, model), model
        self._now = mbs.systemData.GetODE2Coordinates()[self.columns][: model.frame.size]
        self.floor = self._sampler.weight(model.V.T @ self.flex.carried)
        return self._sampler.offline

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
        return read_object(mbs, self.flex).V, self.flex.stiffness

    def add(self, outputs: Sequence[Output]) -> None:
        """Bound further outputs, from the next solve on."""
        self._use([*self._options.outputs, *outputs])
        self._signature = self._before = ()

    def frames(self, *states: np.ndarray) -> np.ndarray:
        """Return the motion (S, 24) of the frame in rows q, q_t, q_tt (S, all coordinates of the mbs)."""
        frame = self._model.frame
        return frame.motion(*(x[:, self.columns][:, : frame.size] for x in states)).rows()

    def views(self) -> list[View | None]:
        """Return how each of the outputs is seen."""
        return [out.view(self._body) for out in self.outputs]

    def _take_sensors(self, mbs: Any, scope: Found) -> None:
        """Where no outputs were asked for, take those that the sensors show."""
        if not self._by_sensors:
            return
        sensors = body_sensors(mbs, self.flex, self._alone)
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
        return self._sampler(t, *states)

    def _made_body(self, model: ReducedMatrices, reference: Reference) -> ElasticBody:
        held = (model.rayleigh, reference.fixed, reference.rigid)
        if self._body is None or self._body_key != (reference.source, *held):
            self._body = held_body(self.flex, model.rayleigh, reference)
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

    def _scene(
        self,
        model: ReducedMatrices,
        actions: Actions,
        terms: InputTerms,
        reference: Reference,
        support: Support,
        scope: Found,
    ) -> Scene:
        flex = self.flex
        full = f"{FULL_MODEL}: all of the fem, interfaces {flex.interfaces}, held by {reference.source}"
        r, A = model.frame.reference_pose()
        left_out = [(name, "held by the reference conditions, what acts there does no work") for name in actions.idle]
        left_out += [(f"wrench at {name}", "no load, joint or connector acts there") for name in actions.free]
        left_out += [("terms of a turning frame", support.text)] if support.at_rest else []
        left_out += self._left_out()
        return Scene(
            scope=scope.name,
            reason=f"{scope.reason}. {full}",
            note=scope.note,
            unknown=terms.unknown,
            turns=not support.at_rest,
            checked=terms.unknown < model.V.shape[1],
            pose=FramePose(r, A),
            jitter=Jitter.of(flex.mass, flex.positions, model.held, FramePose(r, A)) if support.at_rest else None,
            first_load=terms.first_load,
            stiff=stiff_space(flex, model.V, actions.interfaces()),
            computed=self._found(model, actions, reference, support),
            left_out=tuple(left_out),
        )


def _columns(mbs: Any, model: ReducedMatrices) -> slice | np.ndarray:
    """Where a body's coordinates are among those of the mbs."""
    return consecutive(np.concatenate([node_coordinates(mbs, node) for node in model.nodes]))
