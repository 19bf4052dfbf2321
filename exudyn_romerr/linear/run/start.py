"""Initial condition of the estimators: the first sample of a run, and the state that the full body starts in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..trajectory.segments import Start

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..trajectory.samples import Jump, Samples
    from .offline import Offline

IN_THE_SPAN = (
    "the full body is taken to start exactly in the reduced state (initial=None); if it starts elsewhere, in its own "
    "equilibrium say, pass initial='equilibrium' or initial=(q0, q0_t)"
)

OTHER_LOADS = (
    "loads at the start are not those that the static solve before ended with: a jump rings in all modes, below the "
    "step size too, and no basis or bound follows that. Give user functions of loads the same value in both"
)
JUMP = 1e-6  # of the loads


def start_of(offline: Offline, first: Samples, jumps: Sequence[Jump], rest: np.ndarray | None) -> Start:
    """Return the start of a run at its first sample; rest: inputs (p,) that the full body was in equilibrium with."""
    layout = offline.coordinates
    q, q_t, q_tt, u = (x[0] for x in (first.q, first.q_t, first.q_tt, first.u))
    t, z = float(first.t[0]), layout(q, q_t, q_tt, u)
    if offline.initial is None:
        return Start(t, z)
    if offline.initial == "equilibrium":  # K e0 = B u - K V qr
        u, z = _before_the_first_jump(layout, first, jumps, z) if rest is None else (rest, z)
        y0, y0_t = -layout(q, 0 * q, 0 * q, u), np.zeros(layout.k)
    else:  # the last two columns are K q0 and M q0'
        y0, y0_t = np.zeros((2, layout.k + 2))
        y0[layout.stiffness_slot] = -q
        y0[layout.k], y0_t[layout.k + 1] = 1.0, 1.0
    y0_t[layout.mass_slot] = -q_t
    return Start(t, z, y0, y0_t)


def _before_the_first_jump(layout, first: Samples, jumps: Sequence[Jump], z) -> tuple[np.ndarray, np.ndarray]:
    """Inputs and z that the body was in equilibrium with: those before a load jump at the start itself."""
    q, q_t, q_tt, u = (x[0] for x in (first.q, first.q_t, first.q_tt, first.u))
    for jump in jumps:
        if jump.t == first.t[0] and not jump.is_before(jump.t, u):
            return jump.u_left, layout(q, q_t, q_tt - jump.dq_tt, jump.u_left)
    return u, z


def loads_jump(offline: Offline, first: Samples, rest: np.ndarray | None) -> list[str]:
    """Return what is said where known loads at the start are not those, `rest` (p,), of the equilibrium before."""
    scene = offline.scene
    if rest is None or not scene.turns:
        return []
    known = slice(scene.first_load, len(rest) - scene.unknown)
    before, now = rest[known], first.u[0][known]
    if np.all(np.abs(now - before) <= JUMP * np.max(np.abs([before, now]), initial=0.0)):
        return []
    return [OTHER_LOADS]
