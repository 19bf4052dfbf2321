"""Run: bounds of one dynamic solve, fed with blocks of accepted steps; small arrays only."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import RunError
from ..trajectory.reconstruction import Linear, Quintic
from ..trajectory.samples import Extension, Samples, checked_states, make_jumps
from ..trajectory.segments import turn_of
from .bound_stream import Stream, best_outputs
from .galerkin_defect import Defect
from .messages import doubts_of
from .record import UNKNOWN, Internal, RecordedSamples, RunRecord, SolverFacts
from .start import IN_THE_SPAN, start_of
from .summary import assemble, internal_reports

if TYPE_CHECKING:
    from ...report.data import NodeFields
    from ...report.report import BoundReport
    from ..estimators.bounds import Bounds
    from ..residual.round_off import Rounded
    from ..trajectory.segments import Start
    from .offline import Offline

BLOCK = 1024  # steps evaluated at once: 512 cost 8 % more in Python calls, larger blocks leave the cache


class Opening(NamedTuple):
    """First sample of a run, with its inputs (p,), and the run that it goes on from or what estimators start with.

    rest : inputs (p,) that the full body is in equilibrium with before, after a static run.
    """

    first: Samples
    before: Run | None
    start: Start | None
    rest: np.ndarray | None = None
    inputs: np.ndarray | None = None


class Run:
    """The bounds along one dynamic solve."""

    is_static = begins_late = False  # late: errors before its first sample are in no bound
    continues = False  # whether it has the error that the run before ended with

    def __init__(self, offline: Offline, solver: SolverFacts = UNKNOWN, tolerances: dict[str, float] | None = None):
        self.offline, self.solver, self.tolerances = offline, solver, tolerances or {}
        self.messages: list[str] = []
        self._recorded = RecordedSamples(offline, lambda: self._total.bounds())
        self._last: Samples | None = None
        self._rest: np.ndarray | None = None  # where a frame at rest is
        self.balance, self._settled = Defect(), slice(None)
        self._own: float | np.ndarray = 0.0  # size of the full body's own motion, for its rounding
        self._jumps = make_jumps(offline.jumps, offline.signal, offline.jump_response) if offline.jumps else []
        self._segmenters = {"reduction": Linear(offline.coordinates, self._jumps)}
        if offline.time == "reconstructed":
            known = (offline.coordinates, self._jumps, offline.signal, offline.measure, offline.omega_1)
            self._segmenters["total"] = Quintic(*known, offline.mass_root if offline.scene.turns else None)
        last = list(self._segmenters)[-1]
        self._streams = {name: Stream(offline.estimators, name != last) for name in self._segmenters}
        if offline.initial is not None:
            self._streams["initial"] = Stream(offline.estimators, only_outputs=True)

    @property
    def _total(self) -> Stream:
        return self._streams.get("total", self._streams["reduction"])

    def start(self, t: float, q, q_t, q_tt, u=None, frame=None, after: Run | None = None) -> None:
        """Take the first sample: q, q_t, q_tt (n,), u (p,) unless the input function is known, frame (24,) if any.

        after: a run that this one goes on from; from a static one (offline: `from_static`) at its own rest.
        """
        self.open(self.opening(t, q, q_t, q_tt, u, frame, after))

    def opening(self, t: float, q, q_t, q_tt, u=None, frame=None, after: Run | None = None, rest=None) -> Opening:
        """Check the first sample; `open` begins with what is returned here. rest: see Opening."""
        first = self._checked(np.array([t], dtype=float), *(np.asarray(x)[None] for x in (q, q_t, q_tt)), u, frame)
        if after is not None and not after.is_static:
            return Opening(first, after, None)
        rest = rest if after is None else after._inputs_given[0]
        start = start_of(self.offline, first, self._jumps, rest)
        if start.y0 is None and (first.q.any() or first.q_t.any()):
            self.messages.append(IN_THE_SPAN)
        return Opening(first, None, start, rest, self._inputs_given[0])

    def open(self, opening: Opening) -> None:
        """Begin the run."""
        first, before, start, *_ = opening
        self.continues = before is not None
        self._own = self.offline.own_motion(start) if before is None else before._own
        rounded = self.offline.rounded(first, self._own)
        if start is not None:
            for name in self._segmenters:
                self._streams[name].start(start, rounded)
            if "initial" in self._streams:
                self._streams["initial"].start(replace(start, z=0 * start.z))
        else:
            for name, stream in self._streams.items():
                stream.go_on(before._streams[name])
            self.messages.append(f"continues the run before from t = {first.t[0]:g} s")
            self.balance.go_on(before.balance)
        self._record(first, rounded)

    def extend(self, t, q, q_t, q_tt, u=None, frame=None) -> None:
        """Take further accepted steps: t (S,), q, q_t, q_tt (S, n), u (S, p) unless the input function is known."""
        if self._last is None:
            raise RunError("extend was called before start; give the first sample to start")
        if np.size(t):
            self.advance(self.extension(t, q, q_t, q_tt, u, frame))

    def extension(self, t, q, q_t, q_tt, u=None, frame=None) -> Extension:
        """Check further samples and make segments of them; `advance` goes on with what is returned here."""
        new = self._checked(np.asarray(t, dtype=float), q, q_t, q_tt, u, frame)
        samples = new.after(self._last)
        segments = {name: segmenter(samples) for name, segmenter in self._segmenters.items()}
        reduction = segments["reduction"][0]
        for block, _ in segments.values():
            block.share_ends(reduction)
            block.turn = turn_of(block, samples.frame) if self.offline.scene.turns else None
        return Extension(new, segments)

    def advance(self, extension: Extension) -> None:
        """Go on by checked samples."""
        new, segments = extension
        rounded = self.offline.rounded(new, self._own)
        for name, (block, step_end) in segments.items():
            skipped = [] if block.skipped is None else [self.offline.distance_of(block.skipped[step_end])]
            self._streams[name].advance(block, step_end, rounded, *skipped)
        if "initial" in self._streams:
            block, step_end = segments["reduction"]
            self._streams["initial"].advance(block.without_residual(), step_end)
        self._record(new, rounded)

    def best_of_last(self, count: int) -> dict[str, np.ndarray]:
        """Return the smallest bound of each output (count, r) at the last steps given."""
        return best_outputs(self.offline, self._total.last(count), self._recorded.read(slice(-count, None)))

    def estimators(self, stream: str) -> dict[str, Any]:
        """Return the estimators of a stream as they stand now."""
        return self._streams[stream].estimators

    @property
    def defect(self) -> float:
        """Galerkin defect so far: the largest W^T R, but for rounding, over the largest of its terms."""
        return self.balance.share(self.solver.floor)

    def doubts(self) -> tuple[str, ...]:
        """Return why no bound so far is certified, see report.scope.Doubt."""
        return doubts_of(self)

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return self._inputs_given.shape[1]

    @property
    def times(self) -> np.ndarray:
        """Times (T,) of the samples that count."""
        return self._recorded.t.read()[self._settled]

    def settle(self) -> None:
        """Let only the samples so far count: later ones may be bounded in part when something fails."""
        self._settled = slice(len(self._recorded.t))

    def report(self) -> BoundReport:
        """Return what was bounded so far; RunError before the first sample."""
        if self._last is None:
            raise RunError("report was asked before the first sample of the run")
        return assemble(self.record())

    def internal(self) -> Internal:
        """Return outputs beside those that were asked for."""
        record, offline = self.record(), self.offline
        corrected = {name: out.corrected for name, out in internal_reports(record).items()}
        return Internal(corrected, record.frames, offline.outputs, offline.views)

    def record(self) -> RunRecord:
        """Return what was found so far."""
        quintic = self._segmenters.get("total")
        return RunRecord(
            offline=self.offline,
            solver=self.solver,
            time="static" if self.is_static else self.offline.time,
            **self._recorded.read(self._settled),
            streams=self.streams(),
            assumptions=self.assumptions(),
            nodes=self.node_fields,
            messages=tuple(self.messages),
            doubts=self.doubts(),
            begins_late=self.begins_late,
            tolerances=self.tolerances,
            rounding_share=None if quintic is None else quintic.rounding_share,
            largest_miss=None if quintic is None else quintic.largest_miss,
        )

    def streams(self) -> dict[str, dict[str, Bounds]]:
        """Return the bounds so far, rounding included: stream -> estimator -> bounds; "total" is what counts."""
        found = {
            name: {e: b.at(self._settled) for e, b in stream.bounds().items()}
            for name, stream in self._streams.items()
        }
        return {"total": found["reduction"], **found}

    def node_fields(self) -> NodeFields:
        """Return what is known at every node at the worst instant, by every estimator; full-size work."""
        return self._recorded.fields_of(self.offline.nodes(self._total.worst), self.streams()["total"])

    def assumptions(self) -> dict[str, str]:
        """Return what each estimator assumes."""
        return {name: e.assumes for name, e in self._total.estimators.items()}

    def _checked(self, t: np.ndarray, q, q_t, q_tt, u, frame=None) -> Samples:
        last = -np.inf if self._last is None else float(self._last.t[-1])
        states = checked_states(t, (q, q_t, q_tt), self.offline.coordinates.n, last)
        frame = np.zeros((len(t), 0)) if frame is None else np.asarray(frame, dtype=float).reshape(len(t), -1)
        u = self.offline.checked_inputs(t, u)
        rows = self.offline.balance_rows
        z, jitter = self.offline.coordinates(*states, u), self.offline.scene.jitter
        if jitter is not None:
            self._rest = frame[0] if self._last is None else self._rest
            z, rows = np.hstack([z, jitter.accelerations(frame, self._rest)]), np.hstack([rows, jitter.rows])
        self.balance.measure(rows, z, self.offline.rounding.in_balance(states[0]))
        self._inputs_given = u[-1:].copy()
        return Samples(t, *states, u, frame)

    def _record(self, new: Samples, rounded: Rounded) -> None:
        self._recorded.append(new, rounded, self._own)
        self._last = Samples(*(x[-1:].copy() for x in vars(new).values()))  # or all of a block are kept
