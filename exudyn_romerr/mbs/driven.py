"""The motion of a frame that a joint prescribes as a function of time, from the function itself."""

from __future__ import annotations

import copy
import weakref
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np
from scipy.spatial.transform import Rotation

from ..frame import FrameMotion, FrameRows
from ..prescribed import Derivatives, Panels, resolved
from .scene import numbers

if TYPE_CHECKING:
    from collections.abc import Callable

    from .support import Support

SAME = 1e-6  # of places, angles and velocities at the start: Newton's tolerance leaves less
PARTS = 4  # of a step: panels are not made shorter


@dataclass(frozen=True)
class DrivenFrame:
    """Frame with r = p0 + sign f_0..2 - A arm, A = left Q right; Q = Rx(f_3) Ry(f_4) Rz(f_5), or that turned back.

    offset : function t -> (6,). Exudyn's GenericJoint with all axes locked: positions differ by f_0..2 in global axes,
    rotations by Q in those of marker 0; turned back where the body has marker 0.
    """

    offset: Callable[[float], Any]
    place: np.ndarray
    left: np.ndarray
    right: np.ndarray
    arm: np.ndarray
    back: bool

    def over(self, start: float, end: float, step: float) -> Panels:
        """Return the function as polynomials on [start, end]."""
        return resolved(self._values, start, end, step / PARTS)

    def motion(self, d: Derivatives) -> FrameMotion:
        """Return the motion of the frame."""
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

    def off(self, d: Derivatives) -> tuple[np.ndarray, np.ndarray]:
        """Return estimated errors (S,) of r'' and al."""
        al = d.off[:, 3:].sum(axis=1)
        return np.linalg.norm(d.off[:, :3], axis=1) + np.linalg.norm(self.arm) * al, al

    def _values(self, t: np.ndarray) -> np.ndarray:
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


def read_driven(mbs: Any, support: Support, frame: FrameMotion) -> DrivenFrame | str:
    """Return the frame's motion as the joint prescribes it, or why it cannot be had; frame: as it is now."""
    item = mbs.GetObject(support.item)
    f, owner, number = item["offsetUserFunction"]["function"], weakref.ref(mbs), support.item
    parameters = item["offsetUserFunctionParameters"]
    f = f if callable(f) else f.Evaluate

    def offset(t: float) -> Any:
        return f(owner(), t, number, parameters)

    markers = [int(n) for n in item["markerNumbers"]]
    back = markers[0] in support.markers
    body, ground = markers if back else markers[::-1]
    (p_body, A_body), (p_ground, A_ground) = _pose(mbs, body), _pose(mbs, ground)
    J0, J1 = (np.asarray(item[f"rotationMarker{i}"], dtype=float) for i in (0, 1))
    of_ground, of_body = (J1, J0) if back else (J0, J1)
    A = frame.A[0]
    arm, own = A.T @ (p_body - frame.r[0]), A.T @ A_body @ of_body
    driven = DrivenFrame(offset, p_ground, A_ground @ of_ground, own.T, arm, back)
    return _varies(mbs, driven) or driven


def starts_off(driven: DrivenFrame, frame: FrameMotion, t: float, short: float) -> str:
    """Say how the frame at time t differs from what is prescribed then; empty if it does not. short: a short time."""
    panels = driven.over(t, t + short, short)
    d = panels(np.array([t]))
    now, size = driven.motion(d), np.linalg.norm(driven.arm)
    change = np.abs(panels(np.linspace(t, t + short, 5)).f_t).max(initial=0.0)
    unsure = d.off.max() * short
    place = np.linalg.norm(now.r - frame.r) + size * np.linalg.norm(now.A - frame.A)
    if np.linalg.norm(now.A - frame.A) > SAME or place > SAME * (size + np.linalg.norm(now.r) + np.abs(d.f).max()):
        return "it does not begin where the bodies are"
    speed = max(np.linalg.norm(now.r_t - frame.r_t), np.linalg.norm(now.w - frame.w))
    if speed > SAME * max(change, np.linalg.norm(frame.r_t), np.linalg.norm(frame.w)) + unsure:
        return f"it begins with a velocity that the bodies do not have (off by {speed:.2g})"
    return ""


def _varies(mbs: Any, driven: DrivenFrame) -> str:
    """Say why the function cannot be called away from the run; empty if it can."""
    t = mbs.systemData.GetTime()
    try:
        before = copy.deepcopy(dict(mbs.variables))
        values = [driven._values(np.array([t])) for _ in range(2)]
        unchanged = dict(mbs.variables) == before
    except Exception as error:  # whatever a user's function, or what it keeps in mbs.variables, cannot do
        return f"it cannot be called away from the run ({type(error).__name__}: {error})"
    if not unchanged or not np.array_equal(*values):
        return "it remembers its calls, and cannot be called away from the run"
    return ""


def _pose(mbs: Any, marker: int) -> tuple[np.ndarray, np.ndarray]:
    kinds = exu.OutputVariableType
    position, rotation = (mbs.GetMarkerOutput(marker, kind) for kind in (kinds.Position, kinds.RotationMatrix))
    return np.asarray(position, dtype=float), np.asarray(rotation, dtype=float).reshape(3, 3)
