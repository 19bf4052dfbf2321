"""Offline: what a run needs of the full model, small arrays only; made by prepare."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...checks import check_finite
from ...errors import InputError
from ...linalg.blocked_products import row_norms
from ..residual.segments import Start

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...model.outputs import Output, View
    from ...report.data import Plan
    from ...report.scope import Scene
    from ..estimators.energy import StaticError
    from ..estimators.estimator import Estimator
    from ..estimators.round_off import RoundOff
    from ..residual.input_signal import InputSignal
    from ..residual.residual import Coordinates


@dataclass(frozen=True)
class Offline:
    """What a run needs of the full model: small arrays, nothing of size N (but for residual='direct').

    estimators : name -> estimator that starts copies of itself. views : how outputs are seen from outside a moving
    frame. value_rows (R, n): C V. balance_rows (n, k): those of W^T R = rows z, for checks, and for wrenches that
    follow from it. jump_response (n, p): jump of qr'' per jump of u. modes: number of auxiliary ones. mass_root (n,
    n): |V qr|_M = |mass_root qr|. static_errors: see linear/residual/interface_stiffening.py. measure: norm of R(z)
    that knots of the reconstruction are chosen by. rounding: of the computation; input_rounding: of the input, None
    if all of it has 16 digits; single: names of what has fewer. initial: None, "equilibrium" or "state". notes: what
    the reader must know. nodes: what is known of the error at every node, moved: their displacements at q, on demand;
    positions: where they are. static, from_static: made when a static solve, or a run from its end, begins.
    """

    coordinates: Coordinates
    signal: InputSignal | None
    estimators: dict[str, Estimator]
    outputs: tuple[Output, ...]
    slices: tuple[slice, ...]
    velocity_rows: np.ndarray
    value_rows: np.ndarray
    balance_rows: np.ndarray
    jump_response: np.ndarray
    mass_root: np.ndarray
    static_errors: np.ndarray | None
    rounding: RoundOff
    input_rounding: RoundOff | None
    single: tuple[str, ...]
    samples_precision: float
    measure: Callable
    omega_1: float
    jumps: tuple[float, ...]
    initial: str | None
    time: str
    total_mass: float | None
    modes: int
    plan: Plan
    views: tuple[View | None, ...]
    scene: Scene
    notes: tuple[str, ...]
    nodes: Callable[[dict], dict]
    moved: Callable[[np.ndarray], np.ndarray]
    positions: np.ndarray | None
    static: Callable[[], StaticError]
    from_static: Callable[[], Offline]

    @property
    def width(self) -> int:
        """Numbers at the control points of a step: coordinates of the residual, and auxiliary modes."""
        return (6 if self.time == "reconstructed" else 2) * (self.coordinates.k + self.modes)

    def outputs_of(self, q: np.ndarray, q_t: np.ndarray) -> np.ndarray:
        """Return the output rows (S, R) of the reduced body at q, q_t (S, n)."""
        rows = self.value_rows.T
        return np.where(self.velocity_rows, q_t @ rows, q @ rows)

    def distance_of(self, skipped: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return |V dq|_M, |V dq'|_M (S,), and |outputs| (S, R) of dq, dq' (S, 2, n)."""
        dq, dq_t = skipped[:, 0], skipped[:, 1]
        position, velocity = (row_norms(x @ self.mass_root.T) for x in (dq, dq_t))
        return position, velocity, np.abs(self.outputs_of(dq, dq_t))

    def checked_inputs(self, t: np.ndarray, u: Any) -> np.ndarray:
        """Return inputs (S, p) at t (S,): those given, or of the input function; InputError if they do not fit."""
        if self.signal is not None and u is None:
            return self.signal(t)
        p = self.coordinates.p
        u = np.zeros((len(t), 0)) if u is None else np.asarray(u, dtype=float).reshape(len(t), -1)
        if u.shape != (len(t), p):
            raise InputError(f"u has shape {u.shape}; needed: ({len(t)}, {p})")
        check_finite("u", u)
        return u

    def own_motion(self, start: Start) -> float:
        """Size of what the full body starts with, and may ring in all along, see RoundOff."""
        if self.initial != "equilibrium":
            return self.rounding.of_start
        u = start.y0[None, self.coordinates.input_slot]  # of the loads before, which may be others
        return float(self.rounding.of_equilibrium(u)[0])
