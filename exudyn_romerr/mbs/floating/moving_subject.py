"""MovingSubject: adapts a body in a floating frame to a monitor (theory.md 7).

The frame's inertia terms, the loads and the wrenches of joints are inputs of a linear body: R = M V q'' + ... - B u.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...basis.basis import Basis
from ...checks import check_finite
from ...errors import AssumptionError
from ...linalg.blocked_products import consecutive
from ...linear.residual.input_signal import InputSignal
from ...linear.residual.problem import Deferred
from ...linear.run.prepare import BoundOptions, prepare
from ...model.floating_frame import FramePose, Jitter, translations
from ...report.data import Plan, line_of
from ...report.scope import COMPLETE, COUPLED, FROZEN, FULL_MODEL, Scene
from ..access.mbs_items import Items, is_active, node_coordinates, numbers
from ..access.solvers import load_factor
from .built_in import as_built_in
from .floating_body import read_object
from .loads_and_joints import require_free_node
from .modal_damping import damping_text, require_modal_damping
from .reference_search import VECTORS, seen_body
from .sampler import InputTerms, Sampler, wrenches_from_balance
from .sensor_outputs import NO_SENSOR, BodySensors, body_sensors

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...linear.run.prepare import Offline
    from ...model.body import ElasticBody
    from ...model.outputs import Output, View
    from .floating_body import FloatingBody, ReducedMatrices
    from .loads_and_joints import Actions
    from .reference_search import SeenBody

GROUND = ("Ground", "PointGround")
AUTO = "auto"
ASKABLE = (AUTO, COUPLED, FROZEN)
OF_A_FILE = "of a file"
# scopes that leave the feedback of a mechanism out, and why
WITHOUT_FEEDBACK = {
    OF_A_FILE: "a file is evaluated for one body alone, attach before the solve has those of all",
    FROZEN: f"scope={FROZEN!r} was asked for",
}
FEWEST = 6  # vectors: of fewer no part tells what is left out


@dataclass(frozen=True)
class Support:
    """at_rest: the frame does not move; else functions of time move it, or it reacts to the body."""

    at_rest: bool
    text: str


@dataclass(frozen=True)
class Level:
    """What bounds cover: scope and its reason. note : why it is no wider, if the user may do something about it."""

    support: Support
    scope: str
    reason: str
    note: str = ""


def why_not_told(scope: str, options: BoundOptions) -> str:
    """Return why no linearised mechanism can tell what attach was asked for; empty: it can."""
    if scope in WITHOUT_FEEDBACK:
        return WITHOUT_FEEDBACK[scope]
    asked, count = options.estimators, options.auxiliary_modes
    if asked not in (AUTO, "auxiliary") and set(asked) != {"auxiliary"}:
        return f"estimators={asked!r} are known with frozen inputs only: 'auto' asks for the mechanism's"
    if options.initial is not None or len(options.jumps):
        return (
            "initial= and jumps= are covered with frozen inputs only; after SolveStatic a solve starts in its "
            "equilibrium"
        )
    is_known = count == AUTO or count >= FEWEST
    return "" if is_known else f"auxiliary_modes={count} is too few to check what they leave out: {FEWEST} or more"


def find_level(scope: str, actions: Actions, support: Support, why_not: str) -> Level:
    """Return what bounds of the body alone cover. scope : asked for; why_not : no mechanism tells more."""
    reacting = [place.name for place in actions.wrenches] + [load.name for load in actions.loads if load.follows]
    if not support.at_rest:
        reacting.insert(0, "the frame")
    if not reacting:
        return Level(support, COMPLETE, f"{support.text}; loads do not depend on the body's deformation")
    note = f"no coupled bound: {why_not}"
    reason = (
        f"{note}; these react to the body's deformation: {', '.join(reacting)}; the bound holds for the full body "
        "under the motion of the frame, the loads and the wrenches of this simulation; their feedback, and what "
        "other steps make of them, is not covered and may make the error of the whole mechanism many times larger"
    )
    return Level(support, FROZEN, reason, note="" if scope == FROZEN else note)


def read_support(items: Items, model: ReducedMatrices, reference_markers: set[int]) -> Support:
    """Return how the frame is held: by a weld of its reference interface to the ground, or of its own node."""
    for i, item in enumerate(items.objects):
        if not is_active(item) or not _welds(items, item, reference_markers):
            continue
        if item["offsetUserFunction"]:
            return Support(False, f"object {i} ({item['name']}) moves the reference interface by its function")
        return Support(True, f"object {i} ({item['name']}) welds the reference interface to the ground")
    held = _held_coordinates(items, model)
    if len(held) >= model.frame.size - (model.frame.size == 7):  # Euler parameters: the last follows from the others
        return Support(True, f"coordinate constraints hold the frame's node {model.nodes[0]}")
    return Support(False, "the frame moves as joints, connectors and loads let it")


def _welds(items: Items, item: dict, reference_markers: set[int]) -> bool:
    """Whether the object locks all six axes between a marker of the reference interface and the ground."""
    markers = numbers(item, "markerNumbers")
    if item["objectType"] != "JointGeneric" or not all(item["constrainedAxes"]) or not markers & reference_markers:
        return False
    return all(_is_on_ground(items, number) for number in markers - reference_markers)


def _is_on_ground(items: Items, number: int) -> bool:
    bodies, nodes = (numbers(items.markers[number], key) for key in ("bodyNumber", "nodeNumber"))
    kinds = [*(items.objects[i]["objectType"] for i in bodies), *(items.nodes[i]["nodeType"] for i in nodes)]
    return any(kind in GROUND for kind in kinds)


def _held_coordinates(items: Items, model: ReducedMatrices) -> set[int]:
    """Coordinates of the frame's node that constraints tie to the ground."""
    held = set()
    for item in items.objects:
        if item["objectType"] != "ConnectorCoordinate" or not is_active(item):
            continue
        markers = numbers(item, "markerNumbers")
        own = {n for n in markers if model.nodes[0] in numbers(items.markers[n], "nodeNumber")}
        moves = item["offsetUserFunction"] or item["velocityLevel"]
        if len(own) == 1 and len(markers) == 2 and all(_is_on_ground(items, n) for n in markers - own) and not moves:
            held |= {int(items.markers[n]["coordinate"]) for n in own}
    return held


BY_MECHANISM = "linearised mechanism: modes by {} vectors, rigid interfaces by those that deform them; time steps"


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

    scope : asked for. alone : whether nobody else estimates the other sensors of the mbs. flex : the body. body : the
    full one, as the last solve saw it. sensors : on the body, if they are outputs. floor : see SolverFacts. is_live :
    whether bounds are needed while a solve goes on, in mechanisms of scope "inputs frozen".
    """

    def __init__(self, flex: FloatingBody, options: BoundOptions, scope: str, alone: bool):
        self.item, self.flex, self.scope, self._alone = flex.number, flex, scope, alone
        self._by_sensors, self.sensors = options.outputs is None, BodySensors((), ())
        self._options, self.is_live = replace(options, outputs=options.outputs or ()), options.tolerance is not None
        self.columns = np.zeros(0, dtype=int)
        self._made: dict[tuple, Sampler] = {}  # for this solve and one before: a static one, most often
        self.body: ElasticBody | None = None

    def _seen(self, mbs: Any, static: bool, why_not: str) -> tuple[SeenBody, Level]:
        """Read body, joints and loads, how they hold its frame, and what bounds of the body alone cover then."""
        seen, items = seen_body(mbs, self.flex, load_factor(mbs) if static else None)
        self.body, self._model = seen.held, seen.model
        self.columns = consecutive(np.concatenate([node_coordinates(mbs, node) for node in seen.model.nodes]))
        support = read_support(items, seen.model, seen.idle)
        return seen, find_level(self.scope, seen.actions, support, why_not)

    def read(self, mbs: Any, static: bool = False, why_not: str = "") -> Offline | None:
        """Return what bounds of the body alone need; None: the linearised mechanism tells of it.

        why_not : it cannot in this mbs.

        Raises
        ------
        AssumptionError
            The mechanism was asked for and cannot.
        """
        refusal = why_not_told(self.scope, self._options) or why_not
        seen, level = self._seen(mbs, static, refusal)
        if level.scope == COMPLETE or (refusal and self.scope != COUPLED):
            return self._offline(mbs, seen, level)
        if refusal:
            raise AssumptionError(f"scope={COUPLED!r} cannot be had: {refusal}; or pass scope={FROZEN!r}")
        self._lines = seen.basis, *self._found(seen, level.support)
        self._take_sensors(mbs, level)
        return None

    def read_alone(self, mbs: Any, static: bool, why_not: str) -> Offline:
        """Return what bounds of the body alone need although the mechanism is to tell of it; why_not : not these."""
        return self._offline(mbs, *self._seen(mbs, static, why_not))

    @property
    def vectors(self) -> int:
        """How many vectors the mechanism is told of."""
        asked = self._options.auxiliary_modes
        return VECTORS if asked == "auto" else int(asked)

    def told_plan(self) -> Plan:
        """Return what the mechanism will tell."""
        of = (line_of(out) for out in self.outputs if out.is_requested)
        return Plan((BY_MECHANISM.format(self.vectors), *self._lines, *of), self._left_out())

    def _found(self, seen: SeenBody, support: Support) -> tuple[str, ...]:
        """Lines of the plan that say what was found."""
        damping = damping_text(self.flex.modal_damping, seen.model.rayleigh)
        return *seen.reference.lines, damping, f"frame: {support.text}", *seen.actions.lines()

    def _left_out(self) -> tuple[tuple[str, str], ...]:
        if not self._by_sensors:
            return ()
        return (*self.sensors.left_out, *(() if self.sensors.measured else [("outputs", NO_SENSOR)]))

    def _offline(self, mbs: Any, seen: SeenBody, level: Level) -> Offline:
        """Do the offline work of the body alone, unless that was done for this solve or the one before."""
        model, actions, body = seen.model, seen.actions, seen.held
        if model.rigid is not None:
            require_free_node(Items(mbs), model)
        if body.modal is not None:
            require_modal_damping(body, model.held, model.D)
        self._take_sensors(mbs, level)
        signature = (model.V.tobytes(), id(body), level, self.sensors, *actions.signature())
        known = self._made.pop(signature, None)
        if known is None:
            terms = InputTerms(seen, level.support.at_rest)
            offline = self._prepare(seen, terms, self._scene(seen, terms, level))
            known = Sampler(model.frame, actions, terms, offline, wrenches_from_balance(offline, terms, actions))
        self._made = dict([*self._made.items()][-1:])
        # functions of time may be other ones
        self._made[signature] = self._sampler = replace(known, actions=actions)
        self._now = mbs.systemData.GetODE2Coordinates()[self.columns][: model.frame.size]
        self.floor = actions.weight(model.V.T @ translations(self.flex.mass))
        return self._sampler.offline

    @property
    def outputs(self) -> tuple[Output, ...]:
        """What is bounded."""
        return tuple(self._options.outputs)

    def modes(self, mbs: Any) -> tuple[np.ndarray, Any]:
        """Return V (N, n) and the full K (N, N)."""
        return read_object(as_built_in(mbs, [self.flex]), self.flex).V, self.flex.stiffness

    def add(self, outputs: Sequence[Output]) -> None:
        """Bound further outputs, from the next solve on."""
        self._options = replace(self._options, outputs=[*self._options.outputs, *outputs])
        self._made = {}

    def frames(self, *states: np.ndarray) -> np.ndarray:
        """Return the motion (S, 24) of the frame in rows q, q_t, q_tt (S, all coordinates of the mbs)."""
        frame = self._model.frame
        return frame.motion(*(x[:, self.columns][:, : frame.size] for x in states)).rows()

    def views(self) -> list[View | None]:
        """Return how each of the outputs is seen."""
        return [out.view(self.body) for out in self.outputs]

    def _take_sensors(self, mbs: Any, level: Level) -> None:
        """Where no outputs were asked for, take those that the sensors show; those that were added stay."""
        if not self._by_sensors:
            return
        sensors = body_sensors(mbs, self.flex, self._alone)
        sensors = sensors if level.scope == COMPLETE else sensors.in_the_frame_too()
        if sensors != self.sensors:
            added = self._options.outputs[len(self.sensors.measured) :]
            outputs = (*(item.output() for item in sensors.measured), *added)
            self._options, self.sensors = replace(self._options, outputs=outputs), sensors

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

    def _prepare(self, seen: SeenBody, terms: InputTerms, scene: Scene) -> Offline:
        known = SampledSignal(self._known_inputs, terms.columns.shape[1]) if terms.by_function else None
        model = seen.model
        return prepare(
            seen.held,
            Basis(model.held, note=f"{model.V.shape[1]} modes of object {self.item}"),
            replace(self._options, inputs=Deferred(lambda: terms.columns), input_function=known),
            sampled_inputs=not terms.by_function,
            scene=scene,
        )

    def _known_inputs(self, t: np.ndarray) -> np.ndarray:
        """Inputs (T, p) of a frame at rest where it was when the solve began."""
        q = np.zeros((len(t), self._model.V.shape[1]))
        terms, actions = self._sampler.terms, self._sampler.actions
        return terms.values(actions, t, self._model.frame.at_rest(self._now, len(t)), q, q, q)

    def _scene(self, seen: SeenBody, terms: InputTerms, level: Level) -> Scene:
        flex, model, actions, support = self.flex, seen.model, seen.actions, level.support
        full = f"{FULL_MODEL}: all of the fem, interfaces {flex.interfaces}, held by {seen.reference.source}"
        pose = FramePose(*model.frame.reference_pose())
        left_out = [(name, "held by the reference conditions, what acts there does no work") for name in actions.idle]
        left_out += [(f"wrench at {name}", "no load, joint or connector acts there") for name in actions.free]
        left_out += [("terms of a turning frame", support.text)] if support.at_rest else []
        left_out += self._left_out()
        return Scene(
            scope=level.scope,
            reason=f"{level.reason}. {full}",
            note=level.note,
            unknown=terms.unknown,
            turns=not support.at_rest,
            checked=terms.unknown < model.V.shape[1],
            pose=pose,
            jitter=Jitter.of(flex.mass, flex.positions, model.held, pose) if support.at_rest else None,
            first_load=terms.first_load,
            stiff=seen.stiff,
            computed=self._found(seen, support),
            left_out=tuple(left_out),
        )
