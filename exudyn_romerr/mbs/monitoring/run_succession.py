"""Succession: the runs of one body, and which of them the next one goes on from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ...linear.run.offline import Offline
    from ...linear.run.run import Run
    from ..access.linear_adapter import LinearSubject
    from ..floating.moving_subject import MovingSubject

SAME_TIME = 1e-9  # of a time: solvers add up their steps, and users give the next start as they think of it


class Succession:
    """The runs of one body, oldest first.

    last : time, q, q_t, q_tt of the last row that was bounded.
    """

    def __init__(self) -> None:
        self.runs: list[Run] = []
        self.last: tuple | None = None
        self._begins = True  # whether the last run has gone on from no other
        self._source: Offline | None = None  # what the last run was read as; its own may be one from a static run

    def add(self, run: Run, source: Offline, first: tuple) -> None:
        """Add a run that has begun with its first row; source: what the mbs was read as."""
        self.runs.append(run)
        self._source, self.last = source, first

    def before(self, offline: Offline, t: float, q: np.ndarray, q_t: np.ndarray) -> tuple[Run | None, str]:
        """Return the run in whose last state another one starts, or None and why it does not go on, if it might.

        None if there is none, or what bounds are of was changed; also a static one, if no initial state was given. A
        solve, static or not, that failed in its first step has left nothing to go on from; a static one of a frame
        that is free begins with the load step after, where what acts on the body is not in balance before.
        """
        before, why_not = self._before(offline, t, q, q_t)
        if before is not None and len(before.times) == 1:
            made_a_step = before.begins_late if before.is_static else not self._begins
            before = before if made_a_step else None
        self._begins = before is None
        return before, why_not

    def _before(self, offline: Offline, t: float, q: np.ndarray, q_t: np.ndarray) -> tuple[Run | None, str]:
        if not self.runs:
            return None, ""
        before, (t_last, q_last, q_t_last, _) = self.runs[-1], self.last
        if not np.array_equal(q, q_last):
            return None, ""
        if before.is_static:
            released = offline.initial is None and not q_t.any()
            return (before if released and before.last.u.shape[1] == offline.coordinates.p else None), ""
        if abs(t - t_last) > SAME_TIME * abs(t_last) or not np.array_equal(q_t, q_t_last):
            return None, ""
        return (before, "") if self._source is offline else (None, _other_bounds(self._source, offline))

    def first_sample(
        self, subject: LinearSubject | MovingSubject, before: Run | None, t: float, *states: np.ndarray
    ) -> tuple | None:
        """Return the first sample of a run; if need be with the accelerations that the run before ended with."""
        first = subject.first(t, *states)
        if first is None and before is not None:
            first = subject.first(t, *states[:2], self.last[3], may_be_late=True)
        return first


def _other_bounds(before: Offline, now: Offline) -> str:
    """Why a run does not go on from one before in whose last state it starts."""
    was, scene, reason = before.scene, now.scene, "the mbs was changed since the run before"
    if (was.scope, was.note) != (scene.scope, scene.note):
        reason = f"bounds cover something else than in the run before ({was.scope!r}, now {scene.scope!r}"
        reason += f": {scene.note})" if scene.note else ")"
    return f"{reason}; its error so far is not carried over"
