"""Run: bounds of one solve, fed with blocks of accepted steps; small arrays only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import RunError
from ...model.floating_frame import FrameMotion, Turn
from ...report.report import BoundReport
from ...report.scope import Reason
from ..residual.reconstruction import Linear, Quintic, Segmenter
from ..residual.samples import Block, Extension, Jump, Samples, Start, checked_states, make_jumps
from .balance import UNKNOWN, SolverFacts
from .prepare import Offline
from .record import Internal, RunRecord, Stream
from .summary import assemble, output_reports

BLOCK = 1024  # steps evaluated at once: 512 cost 8 % more in Python calls, larger blocks leave the cache

IN_THE_SPAN = (
    "the full body is taken to start exactly in the reduced state (initial=None); if it starts elsewhere, in its own "
    "equilibrium say, pass initial='equilibrium' or initial=(q0, q0_t)"
)


class Run(RunRecord):
    """The bounds along one solve; of a static one the errors at its load steps, exact, for there K e = -R.

    Of a static solve t is the load factor, q_t and q_tt are ignored, and no load step depends on another.
    """

    def __init__(
        self,
        offline: Offline,
        solver: SolverFacts = UNKNOWN,
        tolerances: dict[str, float] | None = None,
        is_static: bool = False,
    ):
        super().__init__(offline, solver, tolerances, is_static)
        self._rest: np.ndarray | None = None  # where a frame at rest is
        self._jumps = make_jumps(() if is_static else offline.jumps, offline.signal, offline.jump_response)
        self._segmenters: dict[str, Segmenter] = {"reduction": Linear(offline.coordinates, self._jumps)}
        if self.time == "reconstructed":
            known = (offline.coordinates, self._jumps, offline.signal, offline.measure, offline.omega_1)
            self.quintic = Quintic(*known, offline.mass_root if offline.scene.turns else None)
            self._segmenters["total"] = self.quintic
        last = list(self._segmenters)[-1]
        estimators = {"static": offline.static()} if is_static else offline.estimators
        self._streams = {name: Stream(estimators, name != last) for name in self._segmenters}
        if offline.initial is not None and not is_static:
            self._streams["initial"] = Stream(offline.estimators, only_outputs=True)

    def start(
        self, t: float, q, q_t=None, q_tt=None, u=None, frame=None, after: Run | None = None, is_late: bool = False
    ) -> None:
        """Take the first sample: q, q_t, q_tt (n,), u (p,) unless the input function is known, frame (24,) if any.

        after : a run that this one goes on from; from a static one (offline: `from_static`) at its own rest.
        is_late : whether the solve began before.
        """
        first = self._checked(np.array([t], dtype=float), *(np.asarray([x]) for x in (q, q_t, q_tt)), u, frame)
        self.begins_late = is_late
        if after is None or after.is_static:
            self._begin(first, None if after is None else after.last.u[0])
        else:
            self.messages.append(f"continues the run before from t = {after.last.t[-1]:g} s")
            self.continues, self._own, self.begins_late = True, after._own, is_late or after.begins_late
            for name, stream in self._streams.items():
                stream.go_on(after._streams[name])
            self._balance.go_on(after._balance)
        self.messages += [Reason.NO_ACCELERATIONS.doubt(t)] if is_late and not self.is_static else []
        self._record(first, self.offline.rounding(first, self._own))

    def _begin(self, first: Samples, rest: np.ndarray | None) -> None:
        """Begin at rest, or anywhere; rest : inputs (p,) that the full body is in equilibrium with before."""
        offline = self.offline
        start = start_of(offline, first, self._jumps, rest, self.is_static)
        if start.y0 is None and (first.q.any() or first.q_t.any()) and not self.is_static:
            self.messages.append(IN_THE_SPAN)
        self._own = offline.rounding.of_equilibrium(first.u) if self.is_static else offline.own_motion(start)
        rounded = offline.rounding(first, self._own)
        for name in self._segmenters:
            self._streams[name].start(start, rounded)
        if "initial" in self._streams:
            self._streams["initial"].start(replace(start, z=0 * start.z))

    def extend(self, t, q, q_t=None, q_tt=None, u=None, frame=None) -> None:
        """Take further accepted steps: t (S,), q, q_t, q_tt (S, n), u (S, p) unless the input function is known."""
        if self.last is None:
            raise RunError("extend was called before start; give the first sample to start")
        if np.size(t):
            self.advance(self.extension(t, q, q_t, q_tt, u, frame))

    def extension(self, t, q, q_t=None, q_tt=None, u=None, frame=None) -> Extension:
        """Check further samples and make segments of them; `advance` goes on with what is returned here."""
        new = self._checked(np.asarray(t, dtype=float), q, q_t, q_tt, u, frame)
        samples = new.after(self.last)
        segments = {name: segmenter(samples) for name, segmenter in self._segmenters.items()}
        for block, _ in segments.values():
            block.turn = _turn_of(block, samples.frame) if self.offline.scene.turns else None
        return Extension(new, segments)

    def advance(self, extension: Extension) -> None:
        """Go on by checked samples."""
        new, segments = extension
        if self.is_static:
            self._own = self.offline.rounding.of_equilibrium(new.u)
        rounded = self.offline.rounding(new, self._own)
        for name, (block, step_end) in segments.items():
            skipped = [] if block.skipped is None else [self.offline.distance_of(block.skipped[step_end])]
            self._streams[name].advance(block, step_end, rounded, *skipped)
        if "initial" in self._streams:
            block, step_end = segments["reduction"]
            self._streams["initial"].advance(block.without_residual(), step_end)
        self._record(new, rounded)

    def report(self) -> BoundReport:
        """Return what was bounded so far; RunError before the first sample."""
        if self.last is None:
            raise RunError("report was asked before the first sample of the run")
        return assemble(self)

    def internal(self) -> Internal:
        """Return outputs beside those that were asked for."""
        corrected = {name: out.corrected for name, out in output_reports(self, is_requested=False).items()}
        return Internal(corrected, self.kept("frames"), self.offline.outputs, self.offline.views)

    def _checked(self, t: np.ndarray, q, q_t, q_tt, u, frame: Any = None) -> Samples:
        before = -np.inf if self.last is None else float(self.last.t[-1])
        if self.is_static:
            q_t = q_tt = np.zeros(np.shape(q))
        states = checked_states(t, (q, q_t, q_tt), self.offline.coordinates.n, before)
        frame = np.zeros((len(t), 0)) if frame is None else np.asarray(frame, dtype=float).reshape(len(t), -1)
        u = self.offline.checked_inputs(t, u)
        z, rows = self.offline.coordinates(*states, u), self.offline.balance_rows
        jitter = self.offline.scene.jitter
        if jitter is not None:
            self._rest = frame[0] if self.last is None else self._rest
            z, rows = np.hstack([z, jitter.accelerations(frame, self._rest)]), np.hstack([rows, jitter.rows])
        self._balance.measure(rows, z, self.offline.rounding.in_balance(states[0]))
        return Samples(t, *states, u, frame)


def _turn_of(block: Block, frame: np.ndarray) -> Turn | None:
    """Return how the frame turns in every segment of a block; frame: its rows (S + 1, 24) at the samples."""
    rows = FrameMotion.of(frame)
    turn = Turn.between(rows.w, rows.al)
    return turn if turn is None or block.bent is None else turn.of_curve(block.bent, block.moved, rows)


def start_of(
    offline: Offline, first: Samples, jumps: Sequence[Jump], rest: np.ndarray | None, is_static: bool
) -> Start:
    """Return the start of a run at its first sample; rest: inputs (p,) that the full body was in equilibrium with."""
    layout = offline.coordinates
    q, q_t, q_tt, u = (x[0] for x in (first.q, first.q_t, first.q_tt, first.u))
    t, z = float(first.t[0]), layout(q, q_t, q_tt, u)
    if offline.initial is None or is_static:
        return Start(t, z)
    if offline.initial == "equilibrium":  # K e0 = B u - K V qr, u those before a jump at the start itself
        passed = [jump for jump in jumps if jump.t == t and not jump.is_before(t, u)]
        if rest is None and passed:
            u = passed[0].u_left
            z = layout(q, q_t, q_tt - passed[0].dq_tt, u)
        y0, y0_t = -layout(q, 0 * q, 0 * q, u if rest is None else rest), np.zeros(layout.k)
    else:  # the last two columns are K q0 and M q0'
        y0, y0_t = np.zeros((2, layout.k + 2))
        y0[layout.stiffness_slot] = -q
        y0[layout.k], y0_t[layout.k + 1] = 1.0, 1.0
    y0_t[layout.mass_slot] = -q_t
    return Start(t, z, y0, y0_t)
