"""OutputEstimates: from errors of a mechanism's coordinates to those of a body's outputs as they are shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...online.kept_estimate import REMAINDER
from ...trajectory.estimate import PROVISIONAL

if TYPE_CHECKING:
    from ...online.run import Run
    from ...trajectory.estimate import TimeStep
    from .enriched_body import EnrichedBody

States = Sequence[np.ndarray]  # q, q_t, q_tt (S, k + m) of frame, modes and vectors


class OutputEstimates:
    """What moves a body's outputs, instant by instant; its run keeps it.

    Outputs are read in the moved motion and in the computed one, and subtracted: the frame's motion is in what is
    shown in global axes, its rotation with it. Parameters of a rotation that are off to first order leave their
    constraint to second order, as what was linearised does.
    """

    def __init__(self, body: EnrichedBody):
        self._body = body
        self._last: States = ()  # computed motion where the time-step error is provisional

    def take_basis(
        self,
        run: Run,
        t: np.ndarray,
        here: States,
        moved: States,
        fewer: States,
        rigid: States | None = None,
        left: Sequence[States] | None = None,
    ) -> None:
        """Take the computed motion at times t (S,), and where auxiliary vectors move it.

        The static rest -C K^-1 R(u + du) in the frame is part of it, and checks it. fewer : by so many vectors less
        that the difference checks it, too; rigid : by those that keep interfaces as rigid as the
        modes make them, None: these make none rigid. What is above the latter is the part "interfaces". left : what
        `moved` may lack, the sum of the sizes of these; None: it was not measured.
        """
        (base, turned), (values, frame), shown = self._rows(here), self._rows(moved), self._body.offline.shown
        rest, at = run.companion.corrections(len(base)) - (values - base), shown(base, turned)
        change = shown(values + rest, frame) - at
        checked = self._completed(fewer, self._body.static_rest(t, fewer))
        before = shown(values, frame)
        # no vector holds the static rest, so its own inertia, and what it makes the mechanism do, are left out
        sizes = np.maximum(np.abs(change + at - checked), np.abs(change + at - before))
        parts, checks = {"basis": change}, {"vectors": sizes}
        if rigid is not None:  # R of u + du, whose wrenches are those of all vectors
            parts["basis"] = self._completed(rigid, self._body.static_rest(t, moved, keeps=True)) - at
            parts["interfaces"] = change - parts["basis"]
        if left is not None:
            checks[REMAINDER] = sum(np.abs(self._moved(moved, x) - before) for x in left)
        run.estimate.put(parts, checks)

    def _completed(self, states: States, rest: np.ndarray) -> np.ndarray:
        """Outputs as shown in a motion, with a static rest (S, R)."""
        values, frame = self._rows(states)
        return self._body.offline.shown(values + rest, frame)

    def take_time_step(self, run: Run, here: States, step: TimeStep) -> None:
        """Take the computed motion, and what time steps make wrong there and, once more, at some instants before."""
        here = [np.vstack(pair) for pair in zip(self._last, here, strict=True)] if self._last else here
        self._last = [states[-PROVISIONAL:] for states in here]
        here = [states[len(states) - step.x.shape[1] :] for states in here]
        at = self._shown(here)
        run.estimate.put_time_step(step, lambda x: self._moved(here, x) - at)

    def _moved(self, here: States, x: np.ndarray) -> np.ndarray:
        return self._shown([states + dx for states, dx in zip(here, x, strict=True)])

    def _shown(self, states: States) -> np.ndarray:
        return self._body.offline.shown(*self._rows(states))

    def _rows(self, states: States) -> tuple[np.ndarray, np.ndarray]:
        """Rows of outputs (S, R) in the frame, and the motion of the frame (S, 24)."""
        q, q_t = (state[:, self._body.frame_size :] for state in states[:2])
        return self._body.offline.outputs_of(q, q_t), self._body.sampler.held_frame(*states)
