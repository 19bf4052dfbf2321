"""Run: bounds of one dynamic solve, fed with blocks of accepted steps; small arrays only."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..checks import check_finite
from ..errors import InputError, RunError
from ..linalg.blocked_products import row_norms
from ..model.floating_frame import FrameRows, Turn
from ..trajectory.growing_array import Rows
from ..trajectory.reconstruction import Linear, Quintic
from ..trajectory.samples import Samples, make_jumps
from ..trajectory.segments import Cut
from .bound_stream import Stream, best_output
from .galerkin_defect import Defect
from .initial_condition import IN_THE_SPAN, start_of
from .summary import assemble

if TYPE_CHECKING:
    from typing import Any

    from ..offline.prepare import Offline
    from ..report.report import BoundReport
    from ..residual.round_off import Rounded
    from ..trajectory.bounds import Bounds
    from ..trajectory.segments import Block, Start

BLOCK = 1024  # steps evaluated at once: 512 cost 8 % more in Python calls, larger blocks leave the cache


class Opening(NamedTuple):
    """The first sample of a run, and the run that it goes on from or what the estimators start with.

    rest : inputs (p,) that the full body is in equilibrium with before, after a static run.
    """

    first: Samples
    before: Run | None
    start: Start | None
    rest: np.ndarray | None = None


class Extension(NamedTuple):
    """Further samples, and stream -> (their segments, index of the segment that ends each step)."""

    new: Samples
    segments: dict[str, tuple[Block, np.ndarray]]


class Run:
    """The bounds along one dynamic solve.

    companion : in a mechanism, the run of the trajectory with auxiliary vectors, whose bounds are this body's too.
    source : what the offline part was read as; another one before a static solve.
    """

    companion: Run | None = None
    source: Offline | None = None
    is_static = False

    def __init__(self, offline: Offline):
        self.offline = offline
        self.messages: list[str] = []
        self._defect = Defect()
        self.end_time: float | None = None  # where the solver was to go, if known
        self.newton_tolerance = 0.0  # of the solver, relative
        self.floor = 0.0  # size of terms of W^T R that cancelled before they came here
        self._t, self._values, self._round_off, self._frames = (Rows() for _ in range(4))
        self._last: Samples | None = None
        self._settled = slice(None)
        layout = offline.coordinates
        self._jumps = make_jumps(offline.jumps, offline.signal, offline.jump_response) if offline.jumps else []
        self._segmenters = {"reduction": Linear(layout, self._jumps)}
        if offline.time == "reconstructed":
            root = offline.mass_root if offline.scene.turns else None
            choice = (offline.measure, offline.omega_1, root)
            self._segmenters["total"] = Quintic(layout, self._jumps, offline.signal, *choice)
        last = list(self._segmenters)[-1]
        self._streams = {name: Stream(offline.estimators, name != last) for name in self._segmenters}
        if offline.initial is not None:
            self._streams["initial"] = Stream(offline.estimators, only_outputs=True)

    @property
    def _total(self) -> Stream:
        return self._streams.get("total", self._streams["reduction"])

    def start(self, t: float, q, q_t, q_tt, u=None, frame=None, after: Run | None = None) -> None:
        """Take the first sample: q, q_t, q_tt (n,), u (p,) unless the input function is known, frame (21,) if any.

        after: a run whose last state this one starts in; its bounds go on. After a static run the full body starts in
        its own equilibrium under the static run's last loads (the run's offline part must be `from_static`).
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
        return Opening(first, None, start, rest)

    def open(self, opening: Opening) -> None:
        """Begin the run."""
        first, before, start, _ = opening
        rounded = self._rounding(first)
        if start is not None:
            for name in self._segmenters:
                self._streams[name].start(start, rounded)
            if "initial" in self._streams:
                self._streams["initial"].start(replace(start, z=0 * start.z))
        else:
            for name, stream in self._streams.items():
                stream.go_on(before._streams[name])
            self.messages.append(f"continues the run before from t = {first.t[0]:g} s")
            self._defect.go_on(before._defect)
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
        cut = Cut.between(samples.cut)
        for block, _ in segments.values():
            block.turn, block.cut = self._turn(samples, block), cut
        return Extension(new, segments)

    def advance(self, extension: Extension) -> None:
        """Go on by checked samples."""
        new, segments = extension
        rounded = self._rounding(new)
        for name, (block, step_end) in segments.items():
            skipped = [] if block.skipped is None else [self._off_the_samples(block.skipped[step_end])]
            self._streams[name].advance(block, step_end, rounded, *skipped)
        if "initial" in self._streams:
            block, step_end = segments["reduction"]
            self._streams["initial"].advance(replace(block, c=0 * block.c, joint=None, added=None), step_end)
        self._record(new, rounded)

    def best_now(self) -> dict[str, np.ndarray]:
        """Return the smallest bound of each output (r,) at the last step given."""
        frame, widest = self._last.frame, self.offline.scene.widest(self.assumptions())
        totals = [run._total for run in (self, self.companion) if run is not None]
        now = [bounds for total in totals for bounds in total.now(widest)]
        rows = zip(self.offline.outputs, self.offline.slices, self.offline.views, strict=True)
        return {out.name: best_output(now, part, view, frame) for out, part, view in rows}

    def estimators(self, stream: str) -> dict[str, Any]:
        """Return the estimators of a stream as they stand now."""
        return self._streams[stream].estimators

    @property
    def defect(self) -> float:
        """Galerkin defect: the largest W^T R, but for rounding, over the largest of its terms, so far."""
        return self._defect.share(self.floor)

    @property
    def worst_mode(self) -> int:
        """Row of W^T R that the defect is found in."""
        return self._defect.worst_mode

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return self._inputs_given.shape[1]

    @property
    def last_time(self) -> float:
        """Time of the last sample."""
        return float(self._t.read()[self._settled][-1])

    def settle(self) -> None:
        """Let only the samples so far count: later ones may be bounded in part when something fails."""
        self._settled = slice(len(self._t))

    @property
    def quintic(self) -> Quintic | None:
        """The reconstruction between samples; None if the residual is sampled."""
        return self._segmenters.get("total")

    @property
    def time(self) -> str:
        """What the bounds cover of time: "reconstructed", "sampled", or "static"."""
        return self.offline.time

    def report(self) -> BoundReport:
        """Return what was bounded so far; RunError before the first sample."""
        if self._last is None:
            raise RunError("report was asked before the first sample of the run")
        return assemble(self)

    def streams(self) -> dict[str, dict[str, Bounds]]:
        """Return the bounds so far, rounding included: stream -> estimator -> bounds; "total" is what counts."""
        found = {name: stream.bounds() for name, stream in self._streams.items()}
        for name in found if self.companion is not None else ():
            found[name].update(self.companion._streams[name].bounds())
        found = {name: {e: b.at(self._settled) for e, b in bounds.items()} for name, bounds in found.items()}
        return {"total": found["reduction"], **found}

    def samples(self) -> tuple[np.ndarray, ...]:
        """Return t (T,), output rows of the reduced body (T, R), their round-off (T, R), frames (T, 21) or (0,)."""
        kept = self._t, self._values, self._round_off, self._frames
        return tuple(rows.read()[self._settled] for rows in kept)

    def node_bounds(self) -> dict[str, np.ndarray]:
        """Return the bounds at every node at the worst instant, by every estimator; full-size work."""
        own = self.offline.nodes(self._total.worst)
        return own if self.companion is None else {**own, **self.companion.node_bounds()}

    def assumptions(self) -> dict[str, str]:
        """Return what each estimator assumes."""
        own = {name: e.assumes for name, e in self._total.estimators.items()}
        return own if self.companion is None else {**own, **self.companion.assumptions()}

    def _turn(self, samples: Samples, block: Block) -> Turn | None:
        if not self.offline.scene.turns:
            return None
        rows = FrameRows.of(samples.frame)
        turn = Turn.between(rows.w, rows.al)
        return turn if turn is None or block.bent is None else turn.of_curve(block.bent, block.moved, rows)

    def _checked(self, t: np.ndarray, q, q_t, q_tt, u, frame=None) -> Samples:
        n = self.offline.coordinates.n
        states = [np.asarray(x, dtype=float) for x in (q, q_t, q_tt)]
        if t.ndim != 1 or any(x.shape != (len(t), n) for x in states):
            raise InputError(f"trajectory arrays have shapes {[x.shape for x in states]}; needed: ({len(t)}, {n})")
        for name, x in zip(("t", "q", "q_t", "q_tt"), (t, *states), strict=True):
            check_finite(name, x)
        before = -np.inf if self._last is None else self._last.t[-1]
        steps = np.diff(t, prepend=before)
        if np.any(steps <= 0):
            at = int(np.argmax(steps <= 0))
            raise InputError(f"t does not increase at entry {at}: {t[at]:.9g} s after {([before, *t])[at]:.9g} s")
        frame = np.zeros((len(t), 0)) if frame is None else np.asarray(frame, dtype=float).reshape(len(t), -1)
        u, cut = self._inputs(t, u), np.zeros((len(t), 0))
        if not self.offline.scene.corrected:  # what its balance lacks is in its bounds
            layout, rows = self.offline.balance
            self._defect.measure(rows, layout(*states, u), self.offline.rounding.in_balance(states[0]))
        self._inputs_given = u[-1:]  # as they are, also where they are packed below
        if self.offline.packing is not None:
            u, cut = self.offline.packing(u)
        return Samples(t, *states, u, frame, cut)

    def _inputs(self, t: np.ndarray, u) -> np.ndarray:
        if self.offline.signal is not None and u is None:
            return self.offline.signal(t)
        p = self.offline.balance.coordinates.p
        u = np.zeros((len(t), 0)) if u is None else np.asarray(u, dtype=float).reshape(len(t), -1)
        if u.shape != (len(t), p):
            raise InputError(f"u has shape {u.shape}; needed: ({len(t)}, {p})")
        check_finite("u", u)
        return u

    def _rounding(self, new: Samples) -> Rounded:
        return self.offline.rounding(new.q, new.q_t, new.q_tt, new.u)

    def _off_the_samples(self, skipped: np.ndarray) -> tuple:
        """Distance of samples from the trajectory that is bounded: position, velocity, outputs."""
        dq, dq_t = skipped[:, 0], skipped[:, 1]
        position, velocity = (row_norms(x @ self.offline.mass_root.T) for x in (dq, dq_t))
        return position, velocity, np.abs(self._outputs_of(dq, dq_t))

    def _outputs_of(self, q: np.ndarray, q_t: np.ndarray) -> np.ndarray:
        rows = self.offline.value_rows.T
        return np.where(self.offline.velocity_rows, q_t @ rows, q @ rows)

    def _record(self, new: Samples, rounded: Rounded) -> None:
        self._t.append(new.t)
        self._values.append(self._outputs_of(new.q, new.q_t))
        of_input = self.offline.input_rounding
        self._round_off.append((of_input(new.q, new.q_t, new.q_tt, new.u) if of_input else rounded).outputs)
        if any(self.offline.views):  # outputs in global axes
            self._frames.append(new.frame)
        self._last = new.part(slice(-1, None))
