"""The motion of a frame that a joint prescribes as a function of time, from the function itself."""

from __future__ import annotations

import weakref
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np

from ...errors import AssumptionError
from ...model.floating_frame import FrameMotion
from ...trajectory.driven_inputs import Inputs
from ...trajectory.prescribed import Derivatives, Panels, has_kink, resolved
from ..access.load_functions import LATER, as_given
from ..memory.user_memory import memory_kept
from .scope_decision import AUTO

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...model.body import ElasticBody
    from .actions import Actions
    from .floating_body import ReducedMatrices
    from .frame_support import Support
    from .input_terms import InputTerms
    from .scope_decision import Wanted

SAME = 1e-6  # of places, angles and velocities at the start: Newton's tolerance leaves less
REMEMBERS = "the function remembers its calls, so it cannot be called away from the run"
HOLDS = "the function can reach what no call away from the run could put back: {}"
BEGINS_ELSEWHERE = (
    "it does not begin where the bodies are, but {:.2g} off and turned by {:.2g} rad: let it give at t = {:g} s "
    "where they are (zeros if nothing has moved), or put the bodies there; solvers of index 2, such as "
    "TrapezoidalIndex2, do not move a joint by its offset"
)
BEGINS_MOVING = (
    "it begins with a velocity that the bodies do not have: let it begin smoothly (0.01 sin(30 t)^2 for "
    "0.01 sin(30 t)), or give the body that velocity: AddObjectFFRFreducedOrder(..., initialVelocity=[{}], "
    "initialAngularVelocity=[{}])"
)
BEGINS_ROUGHLY = "its velocity jumps or has no end where it begins: let it begin smoothly, as 0.01 sin(30 t)^2 does"
ALONGSIDE = "its function is used alongside a run, with scope='auto', time='reconstructed', initial=None"
SHORT = 0.01  # rad of the first mode: how far a driven motion is looked at to tell the velocity that it begins with
PARTS = 4  # of a step: panels are not made shorter


@dataclass(frozen=True)
class DrivenFrame:
    """Frame with r = place + f_0..2 - A arm, A = left Q right, Q = Rx(f_3) Ry(f_4) Rz(f_5).

    offset : function t -> (6,). Exudyn's GenericJoint with all axes locked: positions differ by f_0..2 in global
    axes, rotations by Q in those of marker 0. back : the body has marker 0, its r has -f_0..2 and its A has Q^T.
    short : a short time, to look at the beginning with. since : a time from which on the function may be called.
    function : the user's own, of an mbs, a weak reference.
    """

    function: Callable
    mbs: Callable[[], Any]
    offset: Callable[[float], Any]
    place: np.ndarray
    left: np.ndarray
    right: np.ndarray
    arm: np.ndarray
    back: bool
    short: float
    since: float

    def inputs(
        self, terms: InputTerms, actions: Actions, t: np.ndarray, q: np.ndarray, q_t: np.ndarray, *span: float
    ) -> Inputs:
        """Return the inputs at times t (S,) and states q, q_t (S, n) inside a span: its start and end, its steps."""
        start, end, step = span
        end = end if end > start else start + self.short  # a run's first sample
        d = self.over(start, end, min(step, end - start))(t)
        motion, (off_r, off_al) = self.motion(d), self._off(d)
        u = terms.values(actions, t, motion, q, q_t, None)  # no mode has a rigid part here
        off, n = np.zeros_like(u), q.shape[1]
        off[:, :3], off[:, 3:12] = off_r[:, None], off_al[:, None]
        off[:, 12 : 12 + 9 * n] = np.tile(off_al[:, None] * np.abs(q), 9)
        return Inputs(u, motion.rows(), off)

    def over(self, start: float, end: float, step: float) -> Panels:
        """Return the function as polynomials on [start, end]; AssumptionError if it remembers its calls."""
        shortest = step / PARTS  # that much before, too: there may be a kink at the start itself
        begin = max(start - shortest, min(self.since, start))
        with memory_kept(self.mbs(), [self.function]) as memory:
            found = resolved(self.values, begin, end, shortest)
            self.offset(end - shortest)  # the run may be at the end, where memory of the time would be what it was
        if memory.was_changed:
            raise AssumptionError(f"{REMEMBERS}; pass scope='inputs frozen'")
        return found

    def motion(self, d: Derivatives) -> FrameMotion:
        """Return the motion of the frame."""
        from scipy.spatial.transform import Rotation  # here, for it takes long to import, and few frames need it

        sign = -1.0 if self.back else 1.0
        Q = Rotation.from_euler("XYZ", d.f[:, 3:]).as_matrix()
        w, al = _turning(d)
        if self.back:
            w, al, Q = -np.einsum("sij,sj->si", Q, w), -np.einsum("sij,sj->si", Q, al), Q.swapaxes(1, 2)
        A, w, al = self.left @ Q @ self.right, w @ self.right, al @ self.right
        arm = np.broadcast_to(self.arm, w.shape)
        speed, bend = np.cross(w, arm), np.cross(al, arm) + np.cross(w, np.cross(w, arm))
        parts = zip((arm, speed, bend), (d.f, d.f_t, d.f_tt), strict=True)
        r, r_t, r_tt = (sign * f[:, :3] - np.einsum("sij,sj->si", A, x) for x, f in parts)
        return FrameMotion(self.place + r, r_t, r_tt, A, w, al)

    def _off(self, d: Derivatives) -> tuple[np.ndarray, np.ndarray]:
        """Return estimated errors (S,) of r'' and al."""
        al = d.off[:, 3:].sum(axis=1)
        return np.linalg.norm(d.off[:, :3], axis=1) + np.linalg.norm(self.arm) * al, al

    def values(self, t: np.ndarray) -> np.ndarray:
        """Return the function at times t (T,), (T, 6)."""
        return np.array([self.offset(x) for x in t.tolist()], dtype=float).reshape(len(t), 6)


def _turning(d: Derivatives) -> tuple[np.ndarray, np.ndarray]:
    """Angular velocity and acceleration (S, 3) of Rx(a) Ry(b) Rz(c), in the axes that it turns."""
    (_, b, c), (a_t, b_t, c_t), (a_tt, b_tt, c_tt) = (x[:, 3:].T for x in d[:3])
    sb, cb, sc, cc = np.sin(b), np.cos(b), np.sin(c), np.cos(c)
    w = [cb * cc * a_t + sc * b_t, -cb * sc * a_t + cc * b_t, sb * a_t + c_t]
    al = [
        cb * cc * a_tt + sc * b_tt - (sb * b_t * cc + cb * sc * c_t) * a_t + cc * c_t * b_t,
        -cb * sc * a_tt + cc * b_tt + (sb * b_t * sc - cb * cc * c_t) * a_t - sc * c_t * b_t,
        sb * a_tt + c_tt + cb * b_t * a_t,
    ]
    return np.stack(w, axis=1), np.stack(al, axis=1)


def find_motion(mbs: Any, support: Support, model: ReducedMatrices, short: float, goes_on: bool) -> DrivenFrame | str:
    """Return the frame's motion as the joint prescribes it, or why it cannot be had.

    It has to begin where the bodies are, and (but where a run goes on) with their velocity: a jump of velocity sets
    off all modes at once.
    """
    system, size = mbs.systemData, model.frame.size
    first = mbs.GetNodeODE2Index(model.nodes[0])
    q, q_t = (x[None, first : first + size] for x in (system.GetODE2Coordinates(), system.GetODE2Coordinates_t()))
    now = model.frame.motion(q, q_t, np.zeros((1, size)))
    t = system.GetTime()
    driven = _read(mbs, support, now, short, t - short if goes_on else t)
    return _tried(mbs, driven, now, t, goes_on) or driven


def _read(mbs: Any, support: Support, now: FrameMotion, short: float, since: float) -> DrivenFrame:
    item, number, owner = mbs.GetObject(support.item), support.item, weakref.ref(mbs)
    f, parameters = item["offsetUserFunction"]["function"], item["offsetUserFunctionParameters"]
    f = f if callable(f) else f.Evaluate  # a symbolic function

    def offset(t: float) -> Any:
        return f(owner(), t, number, as_given(parameters))

    markers = [int(n) for n in item["markerNumbers"]]
    back = markers[0] in support.markers
    body, ground = markers if back else markers[::-1]
    (p_body, A_body), (p_ground, A_ground) = _pose(mbs, body), _pose(mbs, ground)
    axes = [np.asarray(item.get(f"rotationMarker{i}", np.eye(3)), dtype=float) for i in (0, 1)]
    of_body, of_ground = axes if back else axes[::-1]
    A = now.A[0]
    arm, own = A.T @ (p_body - now.r[0]), A.T @ A_body @ of_body
    return DrivenFrame(f, owner, offset, p_ground, A_ground @ of_ground, own.T, arm, back, short, since)


def _starts_off(driven: DrivenFrame, now: FrameMotion, t: float, goes_on: bool) -> str:
    """Say how the frame at time t differs from what is prescribed then; empty if it does not."""
    panels = driven.over(t, t + driven.short, driven.short)
    d = panels(np.array([t]))
    f = driven.values(np.array([t]))  # what polynomials miss of it is no other place, but another velocity
    there, size = driven.motion(d._replace(f=f)), np.linalg.norm(driven.arm)
    turned = np.linalg.norm(there.A - now.A)
    if turned > SAME or np.linalg.norm(there.r - now.r) > SAME * (size + np.linalg.norm(there.r) + np.abs(d.f).max()):
        return BEGINS_ELSEWHERE.format(np.linalg.norm(there.r - now.r), turned / np.sqrt(2), t)
    if not goes_on and np.abs(d.f - f).max() > SAME * (size + np.abs(f).max()):
        return BEGINS_ROUGHLY
    if goes_on:
        return "its velocity jumps where the run goes on" if has_kink(driven.values, t, driven.short) else ""
    speeds = [np.linalg.norm(x) for x in (there.r_t - now.r_t, there.w - now.w)]
    sizes = np.abs(panels(np.linspace(t, t + driven.short, PARTS)).f_t).max(), *map(np.linalg.norm, (now.r_t, now.w))
    if max(speeds) > SAME * max(sizes) + d.off.max() * driven.short:
        needed = (", ".join(f"{x:.6g}" for x in v + 0.0) for v in (there.r_t[0], np.ravel(there.A @ there.w[0])))
        return BEGINS_MOVING.format(*needed)
    return ""


def _tried(mbs: Any, driven: DrivenFrame, now: FrameMotion, t: float, goes_on: bool) -> str:
    """Say why the function cannot be called away from the run, or how it starts off; empty if neither is so."""
    try:
        with memory_kept(mbs, [driven.function]) as memory:
            if memory.lost:
                return HOLDS.format(memory.lost)
            values = [driven.offset(x) for x in (t, t, t + LATER * max(abs(t), 1.0))]
            if memory.changed:  # before the next call, which may lead back
                return REMEMBERS
            reason = _starts_off(driven, now, t, goes_on)
            values[2] = driven.offset(t)  # after others
            remembers = memory.changed or not all(np.array_equal(values[0], x) for x in values)
    except Exception as error:  # whatever a user's function cannot do
        return f"the function cannot be called away from the run: {type(error).__name__}: {error}"
    return REMEMBERS if remembers else reason


def _pose(mbs: Any, marker: int) -> tuple[np.ndarray, np.ndarray]:
    kinds = exu.OutputVariableType
    position, rotation = (mbs.GetMarkerOutput(marker, kind) for kind in (kinds.Position, kinds.RotationMatrix))
    return np.asarray(position, dtype=float), np.asarray(rotation, dtype=float).reshape(3, 3)


class PrescribedMotion:
    """Whether solves take the motion of a body's frame from its function.

    driven : the motion, once it was. last_time : of the samples taken last.
    """

    def __init__(self) -> None:
        self.driven: DrivenFrame | None = None
        self.last_time: float | None = None
        self._known = False  # whether the last solve took the frame's motion from a function

    def taken(self, mbs: Any, model: ReducedMatrices, support: Support, body: ElasticBody, wanted: Wanted) -> Support:
        """Take the motion of a driven frame from its function, where that can be had; tell why where not."""
        if not support.driven:
            return support
        options = wanted.options
        if wanted.scope != AUTO or options.time != "reconstructed" or options.initial is not None:
            return replace(support, unknown=ALONGSIDE)
        t = mbs.systemData.GetTime()
        goes_on = self._known and self.last_time is not None and t >= self.last_time
        found = find_motion(mbs, support, model, SHORT / float(body.modes(1).omega[0]), goes_on)
        self._known = not isinstance(found, str)
        if not self._known:
            return replace(support, unknown=found)
        self.driven = found
        return replace(support, known=True)
