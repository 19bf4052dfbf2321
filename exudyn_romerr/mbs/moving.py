"""MovingSubject: a body in a floating frame, as a watch sees it (theory.md 7).

The frame's inertia terms, the loads and the wrenches of joints are inputs of a linear body: R = M V q'' + ... - B u.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..basis import Basis
from ..body import ElasticBody
from ..errors import AssumptionError
from ..frame import FrameMotion, FramePose, translations
from ..inputs import SampledSignal
from ..offline import Scene, prepare
from .actions import read_actions
from .floating import read_object
from .reference import find_reference
from .scene import load_factor
from .support import read_support
from .terms import InputTerms

if TYPE_CHECKING:
    from ..offline import Balance, Offline
    from .actions import Actions
    from .floating import FloatingBody, ReducedMatrices
    from .reference import Reference
    from .support import Support

UNSET = 1e-3  # of the largest term of V^T R: with accelerations of zero a loaded body is out of balance by far more
TOLD_APART = 1e-8  # smallest singular value of the wrenches in V^T R = 0, of the largest, that still tells them


class MovingSubject:
    """Reads the mbs when a solve begins, and turns rows of its coordinates into samples of a run."""

    def __init__(self, flex: FloatingBody, options: dict[str, Any]):
        self.item, self._flex, self._options = flex.number, flex, options
        self.columns = np.zeros(0, dtype=int)
        self._signature: tuple = ()
        self._body: ElasticBody | None = None

    def read(self, mbs: Any, static: bool = False) -> Offline:
        """Read body, joints and loads; do the offline work unless nothing of it changed since."""
        model = read_object(mbs, self._flex)
        actions = read_actions(mbs, self._flex, model, load_factor(mbs) if static else None)
        reference = find_reference(self._flex, model.V, actions.interfaces())
        body = self._made_body(model, reference)
        idle = actions.drop_idle(body)
        support = read_support(mbs, model, idle)
        columns = np.concatenate([_coordinates(mbs, node) for node in model.nodes])
        signature = (model.V.tobytes(), id(body), support, *actions.signature())
        if signature != self._signature:
            terms = InputTerms(actions, support, self._flex, model.V)
            scene = self._scene(model, actions, terms, reference, support)
            offline = self._prepare(body, model, terms, scene)
            self._wrench_rows = _wrenches_from_balance(offline.balance, terms, actions)
            self._terms, self._offline, self._signature = terms, offline, signature
        self.columns, self._model, self._actions = columns, model, actions
        self._now = mbs.systemData.GetODE2Coordinates()[columns][: model.frame.size]
        self.floor = self._weight(mbs)
        return self._offline

    def _weight(self, mbs: Any) -> float:
        """Largest entry of V^T M e_j times the size of gravity at the start: terms that may cancel in free fall."""
        gravity = sum((np.abs(np.asarray(g(0.0), dtype=float)) for g in self._actions.gravity), np.zeros(3))
        return float(np.max(np.abs(self._model.V.T @ translations(self._flex.mass)) @ gravity, initial=0.0))

    def first(self, t: float, *states: np.ndarray, may_be_late: bool = False) -> tuple | None:
        """Return q, q_t, q_tt, u and the frame of a run's first sample; None if its accelerations are not set.

        Explicit solvers leave them at zero until their first step is done. may_be_late: they are of another solve.
        """
        rows = self.sampled(np.array([t]), *(state[None] for state in states))
        if (may_be_late or not states[2].any()) and self._unbalanced(t, rows):
            return None
        return tuple(None if x is None else x[0] for x in rows)

    def _unbalanced(self, t: float, rows: tuple) -> bool:
        q, q_t, q_tt, u, _ = rows
        u = self._offline.signal(np.array([t])) if u is None else u
        balance = self._offline.balance
        terms = balance.coordinates(q, q_t, q_tt, u)[0] * balance.rows
        return bool(np.max(np.abs(terms.sum(axis=1))) > UNSET * np.max(np.abs(terms).sum(axis=1)))

    def sampled(self, t: np.ndarray, *states: np.ndarray) -> tuple:
        """Return q, q_t, q_tt (S, n), u (S, p) and the frame (S, 21) of accepted steps."""
        size = self._model.frame.size
        motion = self._model.frame.motion(*(state[:, :size] for state in states))
        q, q_t, q_tt = (state[:, size:] for state in states)
        u = None if self._terms.by_function else self._inputs(t, motion, q, q_t, q_tt)
        return q, q_t, q_tt, u, motion.rows()

    def _inputs(self, t: np.ndarray, motion: FrameMotion, q, q_t, q_tt) -> np.ndarray:
        """Inertia, loads, and the wrenches that V^T R = 0 leaves."""
        u = self._terms.values(self._actions, t, motion, q, q_t)
        if self._terms.unknown:
            left = self._offline.balance.coordinates(q, q_t, q_tt, u) @ self._offline.balance.rows.T
            u[:, -self._terms.unknown :] = left @ self._wrench_rows
        return u

    def _made_body(self, model: ReducedMatrices, reference: Reference) -> ElasticBody:
        body, flex = self._body, self._flex
        key = (model.rayleigh, reference.source, reference.fixed, reference.rigid)
        if body is None or self._body_key != key:
            self._body = ElasticBody(
                flex.mass,
                flex.stiffness,
                rayleigh=model.rayleigh,
                fixed=reference.fixed,
                positions=flex.positions,
                reference=reference.conditions,
                rigid=reference.rigid,
            )
            self._body_key = key
        return self._body

    def _prepare(self, body: ElasticBody, model: ReducedMatrices, terms: InputTerms, scene: Scene) -> Offline:
        known = SampledSignal(self._known_inputs, terms.columns.shape[1]) if terms.by_function else None
        return prepare(
            body,
            Basis(model.V, note=f"{model.V.shape[1]} modes of object {self.item}"),
            inputs=terms.columns,
            input_function=known,
            sampled_inputs=not terms.by_function,
            scene=scene,
            **self._options,
        )

    def _known_inputs(self, t: np.ndarray) -> np.ndarray:
        """Inputs (T, p) of a frame at rest where it was when the solve began."""
        pose, rest = np.tile(self._now, (len(t), 1)), np.zeros((len(t), len(self._now)))
        q = np.zeros((len(t), self._model.V.shape[1]))
        return self._terms.values(self._actions, t, self._model.frame.motion(pose, rest, rest), q, q)

    def _scene(
        self, model: ReducedMatrices, actions: Actions, terms: InputTerms, reference: Reference, support: Support
    ) -> Scene:
        scope, reason = _scope(actions, support)
        reason += f". Full model: all of the fem, interfaces {self._flex.interfaces}, held by {reference.source}"
        r, A = model.frame.reference_pose()
        left_out = [(name, "the reference conditions hold it: what acts there does no work") for name in actions.idle]
        if support.at_rest:
            left_out.append(("terms of a turning frame", support.text))
        return Scene(
            scope=scope,
            reason=reason,
            turns=not support.at_rest,
            checked=terms.unknown < model.V.shape[1],
            pose=FramePose(r, A),
            minor=None if support.at_rest else slice(12, 12 + 9 * model.V.shape[1]),
            computed=(
                f"floating body, held in its frame by {reference.source}",
                f"damping alpha = {model.rayleigh[0]:.6g} 1/s, beta = {model.rayleigh[1]:.6g} s",
                f"frame: {support.text}",
                *(f"known: {load.name}" for load in actions.loads),
                *(f"wrench from V^T R = 0: {place.name}" for place in actions.wrenches),
            ),
            left_out=tuple(left_out),
        )


def _wrenches_from_balance(balance: Balance, terms: InputTerms, actions: Actions) -> np.ndarray:
    """Return rows (n, unknown): V^T R without wrenches to the wrenches that make it least, in the norm of V^T K V."""
    if not terms.unknown:
        return np.zeros((len(balance.rows), 0))
    layout, G = balance
    root = np.linalg.cholesky(G[:, layout.stiffness_slot])
    columns = np.linalg.solve(root, -G[:, -terms.unknown :])
    size = np.linalg.norm(columns, axis=0)
    values = np.linalg.svd(columns / np.where(size > 0, size, 1.0), compute_uv=False)
    if len(values) < terms.unknown or not size.all() or values[-1] < TOLD_APART * values[0]:
        raise AssumptionError(
            f"the wrenches at {', '.join(place.name for place in actions.wrenches)} cannot be told from "
            f"the motion of {len(root)} modes: joints need interfaces with static modes (Craig-Bampton), or more "
            "modes than their wrenches have components"
        )
    return np.linalg.solve(root.T, np.linalg.pinv(columns).T)


def _scope(actions: Actions, support: Support) -> tuple[str, str]:
    """Return the scope of the bounds and why."""
    reacting = [place.name for place in actions.wrenches] + [load.name for load in actions.loads if load.follows]
    if not support.at_rest and not support.driven:
        reacting.insert(0, "the frame")
    if not reacting:
        return "complete", f"{support.text}; loads do not depend on the body's deformation"
    return "inputs frozen", (
        f"these react to the body's deformation: {', '.join(reacting)}; the bound holds for the full body under the "
        "motion of the frame, the loads and the wrenches of this simulation; their feedback is not covered and may "
        "make the error of the whole mechanism several times larger"
    )


def _coordinates(mbs: Any, node: int) -> np.ndarray:
    first = mbs.GetNodeODE2Index(node)
    item = mbs.GetNode(node)
    return np.arange(first, first + len(item["referenceCoordinates"]))
