"""RunRecord: what a run has found so far, from which reports are made; Stream: the bounds along one trajectory."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from ...linalg.blocked_products import norms_times
from ...model.outputs import Output, View
from ...report.data import NodeFields
from ...report.scope import Doubt, beside_steps
from ..estimators.bounds import Bounds, Estimator, Worst, of_output
from ..estimators.round_off import Rounded
from ..residual.reconstruction import Quintic
from ..residual.samples import Block, GrowingArray, Samples, Start
from .balance import Balance, SolverFacts
from .prepare import Offline


class Internal(NamedTuple):
    """Outputs of a run beside those that were asked for, corrected (T, r), None: they cannot be.

    frames : (T, 24), motion of the frame, if outputs need it. outputs, views : all of them, and how they are seen.
    """

    corrected: dict[str, np.ndarray | None]
    frames: np.ndarray
    outputs: Sequence[Output]
    views: Sequence[View | None]


BOUNDS = tuple(field.name for field in fields(Bounds))


class Stream:
    """Copies of the estimators, fed with blocks; remembers their bounds at the ends of steps.

    only_outputs: nothing else of the bounds is remembered. worst: where each estimator's bound of |e|_M is largest.
    """

    def __init__(self, estimators: Mapping[str, Any], only_outputs: bool = False):
        self._only_outputs = only_outputs
        self.estimators: dict[str, Any] = {name: copy.copy(e) for name, e in estimators.items()}
        self._kept: dict[str, dict[str, GrowingArray]] = {name: {} for name in estimators}
        self.worst: dict[str, Worst] = {}

    def start(self, start: Start, *widenings: tuple) -> None:
        """Begin at the first instant of a run; widenings: see advance."""
        for name, e in self.estimators.items():
            self._remember(name, e, e.start(start), slice(None), widenings)

    def go_on(self, before: Stream) -> None:
        """Begin where another stream ended."""
        self.estimators = {name: copy.copy(e) for name, e in before.estimators.items()}
        for name, bounds in before.bounds().items():
            self._keep(name, bounds.at(slice(-1, None)))

    def advance(self, block: Block, step_end: np.ndarray | slice, *widenings: tuple) -> None:
        """Take a block; step_end: index of the segment that ends each step.

        widenings : of position, velocity, outputs, each added to the bounds there.
        """
        for name, e in self.estimators.items():
            self._remember(name, e, e.advance(block), step_end, widenings)

    def bounds(self) -> dict[str, Bounds]:
        """Return the bounds of every estimator so far."""
        found = {name: {x: rows.read() for x, rows in kept.items()} for name, kept in self._kept.items()}
        return {name: Bounds(*map(of.get, BOUNDS)) for name, of in found.items()}

    def _remember(self, name: str, e: Estimator, bounds: Bounds, ends: np.ndarray | slice, widenings: tuple) -> None:
        at_ends = bounds.at(ends)
        for widening in widenings:
            at_ends = at_ends.widened(*widening)
        i = int(np.argmax(at_ends.position))
        instant = e.instant(np.arange(len(bounds.position))[ends][i])  # lets go of the block, needed or not
        if name not in self.worst or at_ends.position[i] > self.worst[name].position:
            kept, widened = self._kept[name].get("outputs", ()), sum(float(np.max(x)) for x, *_ in widenings)
            self.worst[name] = Worst(at_ends.position[i], len(kept) + i, instant, widened)
        self._keep(name, at_ends.of_outputs() if self._only_outputs else at_ends)

    def _keep(self, name: str, bounds: Bounds) -> None:
        for x in BOUNDS:
            if (rows := getattr(bounds, x)) is not None:
                self._kept[name].setdefault(x, GrowingArray()).append(rows)


class RunRecord:
    """What a run has found up to some instant: samples, bounds at them, and what is to be said of these.

    Attributes
    ----------
    tolerances : output -> what its bound was asked to stay below. messages : what was noted along the run.
    begins_late : errors before its first sample are in no bound. continues : it has the error that the run before
    ended with. last : the last sample that was bounded; None before the first. quintic : the reconstruction between
    samples; None if there is none.
    """

    begins_late = continues = False
    last: Samples | None = None
    quintic: Quintic | None = None

    def __init__(self, offline: Offline, solver: SolverFacts, tolerances: dict[str, float] | None, is_static: bool):
        self.offline, self.solver, self.tolerances, self.is_static = offline, solver, tolerances or {}, is_static
        self.messages: list[str] = []
        # "t" last: what is longer is of samples whose bounds failed in part
        self._kept = {name: GrowingArray() for name in ("values", "round_off", "frames", "sizes", "static", "t")}
        # time and q where the bound of |e|_M by an estimator is largest: of all samples q would be long
        self._worst: dict[str, tuple[float, np.ndarray]] = {}
        self._own: float | np.ndarray = 0.0  # size of the full body's own motion, for its rounding
        self._balance, self._streams = Balance(offline), dict[str, Stream]()

    @property
    def _total(self) -> Stream:
        return self._streams.get("total", self._streams["reduction"])

    def _record(self, new: Samples, rounded: Rounded) -> None:
        """Keep further samples, whose bounds are there; rounded: what rounding of the computation may move."""
        offline, root, first = self.offline, self.offline.mass_root.T, len(self._kept["t"])
        rounded = offline.input_rounding(new, self._own) if offline.input_rounding else rounded
        found = {"values": offline.outputs_of(new.q, new.q_t), "round_off": rounded.outputs}
        if any(offline.views):  # outputs in global axes
            found["frames"] = new.frame
        found["sizes"] = np.stack([norms_times(x, root) for x in (new.q, new.q_tt)], axis=1)
        if offline.static_errors is not None:
            z = offline.coordinates(new.q, new.q_t, new.q_tt, new.u)
            found["static"] = np.einsum("sk,erk->ser", z, offline.static_errors, optimize=True)
        for name, rows in (found | {"t": new.t}).items():
            self._kept[name].append(rows)
        for name, worst in self._total.worst.items():
            if worst.sample >= first:
                self._worst[name] = float(new.t[worst.sample - first]), new.q[worst.sample - first].copy()
        self.last = new.part(slice(-1, None)).copy()  # or all of a block are kept

    def kept(self, name: str) -> np.ndarray:
        """Return what is kept of the samples.

        "t" (T,); "values" (T, R), outputs of the reduced body; "round_off" (T, R), what rounding of the input may
        move these by; "frames" (T, 24) or (0,), motion of the frame if outputs need it; "sizes" (T, 2), |V qr|_M and
        |V qr''|_M; "static" (T, 2, R), see linear/residual/interface_stiffening.py, (0,) if no interface is rigid.
        """
        return self._kept[name].read()[: len(self._kept["t"])]

    @property
    def times(self) -> np.ndarray:
        """Times (T,) of the samples."""
        return self.kept("t")

    @property
    def time(self) -> str:
        """What the bounds cover of time, "reconstructed", "sampled", or "static"."""
        return "static" if self.is_static else self.offline.time

    def doubts(self) -> tuple[Doubt, ...]:
        """Return why no bound so far is certified; empty: the run is balanced, and they hold from its start on."""
        return tuple(dict.fromkeys([*self._balance.doubts(self.solver), *doubts_in(self.messages)]))

    def streams(self) -> dict[str, dict[str, Bounds]]:
        """Return the bounds so far, rounding included: stream -> estimator -> bounds; "total" is what counts."""
        there = slice(len(self.times))
        found = {
            name: {e: bounds.at(there) for e, bounds in stream.bounds().items()}
            for name, stream in self._streams.items()
        }
        return {"total": found["reduction"], **found}

    def best_of_last(self, count: int) -> dict[str, np.ndarray]:
        """Return the smallest bound of each output (count, r) at the last steps given."""
        frames = self._kept["frames"].read()[-count:]
        last = [bounds.at(slice(-count, None)) for bounds in self._total.bounds().values()]
        return {
            out.name: np.min([of_output(bounds, part, view, frames).outputs for bounds in last], axis=0)
            for out, part, view in self.offline.shown
        }

    def node_fields(self) -> NodeFields:
        """Return what is known at every node at the worst instant, by every estimator; full-size work."""
        found = self.offline.nodes(self._total.worst)
        return NodeFields(
            bound={e: x.bound for e, x in found.items()},
            estimate={e: x.estimate for e, x in found.items() if x.estimate is not None},
            displacement={e: self.offline.moved(self._worst[e][1]) for e in found},
            instant={e: self._worst[e][0] for e in found},
            positions=self.offline.positions,
        )

    def assumptions(self) -> dict[str, str]:
        """Return what each estimator assumes."""
        return {name: e.assumes for name, e in self._total.estimators.items()}

    @property
    def planned_end(self) -> float | None:
        """Where the solver was to go to, if the run ends before; None: it does not, or that is not known."""
        return self.solver.end_time if self.solver.ends_early(self.times[-1]) else None

    @property
    def stopped(self) -> float | None:
        """Where a tolerance stopped the solver before its end; None: none did."""
        t = float(self.times[-1])
        return t if self.solver.is_stopped and self.solver.ends_early(t) is not False else None

    @property
    def beside_steps(self) -> tuple[str, ...]:
        """What helps beside shorter steps where the body rings, for something acts on it at once; else nothing."""
        return () if self.begins_late else beside_steps(self.kept("sizes"), self.offline.omega_1)


def doubts_in(messages: Iterable[str]) -> list[Doubt]:
    """Return those messages that say why no bound of a run, or of one that goes on from it, is certified."""
    return [message for message in messages if isinstance(message, Doubt)]
