"""OutputEstimates: from errors of a mechanism's coordinates to those of a body's outputs as they are shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...estimators.coupled_energy import LINEARISED

if TYPE_CHECKING:
    from ...online.run import Run
    from .enriched_body import EnrichedBody

States = Sequence[np.ndarray]  # q, q_t, q_tt (S, k + m) of frame, modes and vectors
REPLACED = 4  # instants whose time-step error may be handed over again


class OutputEstimates:
    """What moves a body's outputs, instant by instant; its run keeps it.

    Outputs are read in the moved motion and in the computed one, and subtracted: the frame's motion is in what is
    shown in global axes, its rotation with it. Parameters of a rotation that are off to first order leave their
    constraint to second order, as what was linearised does.
    """

    def __init__(self, body: EnrichedBody):
        self._body, self._last = body, [np.zeros((0, 0))] * 3

    def take_basis(self, run: Run, here: States, moved: States) -> None:
        """Take the computed motion, and where auxiliary vectors move it.

        The static rest -C K^-1 R(u + du) in the frame, which the companion of the run has, is part of it.
        """
        at, base = self._shown(here), self._rows(here)[0]
        values, frame = self._rows(moved)
        rest = run.companion.corrections(len(base)) - (values - base)
        change = self._body.offline.shown(values + rest, frame) - at
        missed = change - (self._body.offline.shown(values, frame) - at)
        run.estimate.put({"basis": change}, {"vectors": np.abs(missed), "linearisation": LINEARISED * np.abs(change)})

    def take_time_step(self, run: Run, here: States, x: States, sizes: dict[str, States], replaced: int = 0) -> None:
        """Take what is computed minus exact, x, and what checks it, sizes by check; some instants once more."""
        here = [np.vstack([before, new]) for before, new in zip(self._kept(here), here, strict=True)]
        self._last = [state[-REPLACED:] for state in here]
        here = [state[len(state) - len(x[0]) :] for state in here]
        run.estimate.put(
            {"time step": -self._change(here, x)},
            {check: np.abs(self._change(here, size)) for check, size in sizes.items()},
            replaced,
        )

    def _kept(self, here: States) -> States:
        return self._last if self._last[0].size else [state[:0] for state in here]

    def _change(self, here: States, x: States) -> np.ndarray:
        return self._shown([state + dx for state, dx in zip(here, x, strict=True)]) - self._shown(here)

    def _shown(self, states: States) -> np.ndarray:
        return self._body.offline.shown(*self._rows(states))

    def _rows(self, states: States) -> tuple[np.ndarray, np.ndarray]:
        """Rows of outputs (S, R) in the frame, and the motion of the frame (S, 24)."""
        size = self._body.frame_size
        frame = self._body.sampler.frame.motion(*(state[:, :size] for state in states))
        q, q_t = (state[:, size:] for state in states[:2])
        return self._body.offline.outputs_of(q, q_t), frame.rows()
