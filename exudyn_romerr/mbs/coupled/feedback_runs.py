"""Reaction: auxiliary vectors of all bodies of a mechanism react with it; runs of the trajectories they add up to."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ...estimates.mechanism_feedback import Feedback
from ...estimates.narrow_marches import NarrowMarches
from ...estimates.residual_passes import JointDrift, ResidualPasses
from ...linalg.blocked_products import consecutive
from ...model.floating_frame import Veer
from ...online.coupled_runs import FirstSteps, join_extensions, joined_openings, shared_energy, turned_in
from ...online.run import Opening, Run
from ...trajectory.segments import Added
from ..mechanism.extended_tangents import ExtendedReadings, ExtendedTangents, FixedFreedoms
from ..mechanism.global_positions import GlobalPositions
from ..mechanism.mechanism_residuals import MechanismResiduals
from ..mechanism.output_estimates import OutputEstimates
from ..shadow.measured_remainder import MeasuredRemainder

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...trajectory.estimate import TimeStep
    from ...trajectory.samples import Extension
    from ..derivatives.linearisation import Tangents
    from ..mechanism.enriched_body import EnrichedBody
    from ..mechanism.step_errors import StepErrors
    from .other_sensors import OtherSensors

STREAM = "reduction"  # of a mechanism's bounds, which are those at samples
NO_POSITIONS = "positions in global axes have an estimate only: {}"


class Reaction:
    """The linearised mechanism with the vectors of its bodies behind its own coordinates (theory.md 7).

    size : coordinates of mechanism and vectors. parts : bodies, where these are. extended : tangents.
    """

    def __init__(
        self,
        watches: Sequence[Any],
        feedback: Feedback,
        first_steps: FirstSteps,
        tangents: Tangents,
        step_errors: StepErrors,
        sensors: Sequence[OtherSensors] = (),
    ):
        self._watches, self._feedback, self._tangents = watches, feedback, tangents
        self._first_steps, self._step_errors, self._sensors = first_steps, step_errors, sensors
        self._estimates = [OutputEstimates(watch.enriched) for watch in watches]
        self.size = tangents.size
        self.parts: list[tuple[EnrichedBody, slice]] = []
        for body in (watch.enriched for watch in watches):
            self.parts.append((body, slice(self.size, self.size + body.m)))
            self.size += body.m
        self.extended = ExtendedReadings(tangents, self.size, self.parts)
        self._narrow = NarrowMarches(self._left_out())
        self._passes = ResidualPasses(MechanismResiduals(self.parts), self.size)
        self._drift, self._drifts = JointDrift(self.size, step_errors.drift), step_errors.holds_rates
        self._remainder = MeasuredRemainder(tangents, self.parts, self.size, step_errors, self._drift)
        self._fixed = FixedFreedoms([body for body, _ in self.parts], tangents.size)
        coupled = bool(watches) and all(watch.is_coupled for watch in watches)
        self._positions = GlobalPositions.of(self.parts, self.size) if coupled else None

    def _left_out(self) -> list[np.ndarray]:
        """Vectors (size,) without which the prediction is made once more: to check it, and with rigid interfaces."""
        checked, rigid = np.zeros((2, self.size), dtype=bool)
        for body, own in self.parts:
            checked[own], rigid[own] = ~body.first, ~body.keeps
        return [checked, rigid][: len(self.parts) and 1 + rigid.any()]

    @property
    def time_step(self) -> TimeStep | None:
        """Error by time steps of all coordinates, at the rows of the last call of open or advance, or None."""
        return self._remainder.corrected(self._step_errors.found)

    def open(self, rows: tuple[np.ndarray, ...], before: Reaction | None, mbs: Any = None) -> None:
        """Open the companions of runs that have just opened, at the first of the rows of the mbs: as in advance."""
        *first, multipliers = (x[:1] for x in rows)
        goes_on = before is not None and all(watch.opening.before is not None for watch in self._watches)
        readings = [reading for reading in self._tangents.readings if reading.t <= first[0][0]][-1:]
        extended = self.extended.of(readings)
        tangent, samples = extended[0], [watch.sampled(*first) for watch in self._watches]
        forces = self._forces(samples, 1)[0]
        if goes_on:
            self._fixed = before._fixed
            self._feedback.go_on(before._feedback, tangent, forces)  # in steps of its own integrator
            self._narrow.go_on(before._narrow, tangent, forces)
            self._passes.go_on(before._passes)
            self._drift.go_on(before._drift)
            self._remainder.go_on(mbs, before._remainder)
            self._step_errors.open(self.size, (*first, multipliers), before._step_errors)
        else:
            start = tangent, forces, self._forces_at_rest()
            self._feedback.start(*start, float(first[0][0]))
            self._narrow.start(*start)
            self._step_errors.open(self.size, (*first, multipliers), None)
            self._drift.start(tangent)
            self._passes.start(tangent, first, self._feedback.state, start[-1] is not None)
            self._remainder.open(mbs, tangent, first, (self._feedback.state + self._passes.state)[:, None])
        e = (self._feedback.state + self._passes.state + self._drift.state + self._remainder.state)[:, None]
        runs, openings, lacks = [], [], self._remainder.lacks
        for i, (watch, (body, own)) in enumerate(zip(self._watches, self.parts, strict=True)):
            rest = watch.opening.rest
            after = watch.opening.before.companion if goes_on else None
            states, offline = body.moved(own, first[1:], e), body.offline if after is None else after.offline
            runs.append(Run(offline if rest is None else offline.from_static()))
            if rest is not None:
                rest = body.rest(states[0][0, body.frame_size :], rest)
            sample = (None if x is None else x[0] for x in body.sampler(first[0], *states))
            opening = runs[-1].opening(first[0][0], *sample, after=after, rest=rest)
            if rest is not None:
                opening = opening._replace(start=replace(opening.start, added=self._added(i, lacks, e, np.zeros(1))))
            openings.append(opening)
        self._say(list(filter(None, [self._first_steps.open(runs, openings) if runs else ""])))
        for watch, run, opening in zip(self._watches, runs, joined_openings(runs, openings), strict=True):
            run.open(opening)
            watch.run.companion = run
        self._fixed.open(mbs, self._tangents.readings, runs, openings)
        if self._positions is not None:
            g = shared_energy(runs[0], STREAM).g
            if goes_on:
                self._positions.go_on(before._positions)
            else:
                self._positions.start(float(first[0][0]), extended, readings, g, self._energy_at_rest(openings))
            self._keep_left(self._positions.opened(first[1], g))
        for one in self._sensors:
            one.open([watch.run for watch in self._watches], goes_on)
        self._feedback.multipliers = self._feedback.multipliers[-1:]
        self._take_errors(mbs, (*first, multipliers), e, self._narrow.states[:, :, None], lacks)
        if self._tangents.redundant:
            self._say([f"{self._tangents.redundant} redundant constraints are left out of the linearised mechanism"])
        self._say(self._step_errors.notes)
        self._say(self._remainder.notes)

    def advance(self, rows: tuple[np.ndarray, ...], mbs: Any) -> None:
        """Go on by rows of the mbs: t (S,), q, q_t, q_tt (S, all its coordinates), multipliers (S, ...)."""
        extended, steps = self.extended.now(), self._step_errors
        steps.begin(mbs, rows)
        *rows, multipliers = rows
        forces = self._forces([watch.rows[1:] for watch in self._watches], len(rows[0]))
        self._narrow.begin(forces)
        self._passes.begin(rows)
        others, late = [steps, self._narrow], [self._passes, *[self._drift] * self._drifts, self._remainder]
        with self._remainder.following(mbs, rows, forces):
            self._drift.begin(len(rows[0]))
            e, speed = self._feedback.advance(rows[0], forces, extended.t, extended.__getitem__, others, late)
        steps.finish()
        self._say(steps.notes)
        self._say(self._remainder.notes)
        runs, extensions, lacks = [watch.run.companion for watch in self._watches], [], self._remainder.lacks
        self._fixed.check(self._tangents.readings, runs)
        for i, (watch, run, (body, own)) in enumerate(zip(self._watches, runs, self.parts, strict=True)):
            sample = body.sampler(rows[0], *body.moved(own, rows[1:], e))
            extension, (*_, u, frame) = run.extension(rows[0], *sample), watch.rows
            veer = Veer.between(u[:, :3], e[2][:, body.columns[:3]], frame, sample[-1])
            beside = self._passes.residuals.size_beside(i, self._passes.beside)
            for block, _ in extension.segments.values():
                block.added = self._added(i, lacks, e, speed)._replace(veer=veer, beside=beside)
            extensions.append(extension)
            watch.run.estimate.remainder = self._remainder.share(i)
        if extensions:
            turned = turned_in(extensions[0], [watch.rows[-1] for watch in self._watches], extended.turning(rows[0]))
            self._say(join_extensions(runs, extensions, self._first_steps, turned))
            self._advance_positions(extended, tuple(rows[:2]), extensions, runs)
        for run, extension in zip(runs, extensions, strict=True):
            run.advance(extension)
        self.extended.forget()
        self._take_errors(mbs, (*rows, multipliers), e, self._narrow.found(), lacks)

    def _energy_at_rest(self, openings: Sequence[Opening]) -> float | None:
        """|R|_{K^-1} of all bodies in the equilibrium that the full ones start in; None: they start without error."""
        if self._forces_at_rest() is None:
            return None
        energies = (shared_energy(watch.run.companion, STREAM) for watch in self._watches)
        parts = (energy.norm(opening.start.z) for energy, opening in zip(energies, openings, strict=True))
        return float(np.linalg.norm([float(part) for part in parts]))

    def _advance_positions(
        self, tangents: ExtendedTangents, steps: tuple, extensions: Sequence[Extension], runs: Sequence[Run]
    ) -> None:
        """Go on with what is left of positions in global axes; before the runs do."""
        if self._positions is None:
            return
        energies = [shared_energy(watch.run.companion, STREAM) for watch in self._watches]
        blocks = [extension.segments[STREAM][0] for extension in extensions]
        joint = blocks[0].joint
        started = 0.0 if joint.started is None else joint.steps.norms[0] * joint.started
        g = np.array([joint.level, joint.peak]) + started
        impulses = sum(one.impulses(block) for one, block in zip(energies, blocks, strict=True))
        left = self._positions.advance(tangents, self._tangents.readings, steps, g, impulses)
        self._keep_left([rows + self._first_steps.seen(run) for rows, run in zip(left, runs, strict=True)])

    def _keep_left(self, left: list[np.ndarray]) -> None:
        for watch, rows in zip(self._watches, left, strict=True):
            watch.run.estimate.left.append(rows)
        self._say([NO_POSITIONS.format(self._positions.failure)] if self._positions.failure else [])

    def _take_errors(self, mbs: Any, rows: Sequence, e: np.ndarray, narrow: np.ndarray, lacks: list | None) -> None:
        """Let estimates of outputs have what vectors predict, all and fewer, and what time steps make wrong."""
        (t, *states, _), missed = rows, self._remainder.found
        narrow = narrow + np.where(np.reshape(self._left_out(), (-1, 1, 1, self.size)), 0.0, self._passes.added)
        narrow, step = narrow + self._drift.added + (0.0 if missed is None else missed.added), self.time_step
        for i, (watch, outputs) in enumerate(zip(self._watches, self._estimates, strict=True)):
            body, own = self.parts[i]
            here, *moved = (body.moved(own, states, x) for x in (0 * e, e, *narrow))
            columns = consecutive(np.r_[body.columns, own])  # of this body
            left = missed and [[x[:, columns] for x in of] for of in lacks]
            outputs.take_basis(watch.run, t, here, *moved, left=left)
            if step is not None:
                outputs.take_time_step(watch.run, here, step.of(columns))
        forces = [self._feedback.multipliers, *self._narrow.multipliers]
        moves = list(zip([e, *narrow], forces, strict=True))
        for sensors in self._sensors:
            sensors.take(mbs, rows, moves, step, self._remainder.left)

    def _say(self, notes: list[str]) -> None:
        """Say it once, in the reports of all bodies; what the runs say without vectors is not said by these."""
        for note, watch in product(notes, self._watches):
            watch.note(note)
        notes.clear()

    def _forces(self, samples: Sequence[tuple], count: int) -> np.ndarray:
        """-P^T R (S, all coordinates) of the reduced bodies, from S samples q, q_t, q_tt, u, frame of each."""
        forces = np.zeros((count, self.size))
        for (body, own), sample in zip(self.parts, samples, strict=True):
            forces[:, own] = body.forces(*sample[:4])
        return forces

    def _forces_at_rest(self) -> np.ndarray | None:
        """The same in the equilibrium that the full bodies start in; None if they start as the reduced ones."""
        if not self._watches or any(watch.opening.rest is None for watch in self._watches):
            return None
        openings = [watch.opening for watch in self._watches]
        samples = [(x.first.q, *np.zeros((2, *x.first.q.shape)), x.rest[None]) for x in openings]
        return self._forces(samples, 1)[0]

    def _added(self, i: int, lacks: list[np.ndarray] | None, e: np.ndarray, speed: np.ndarray) -> Added:
        """What is added to body i, and what that may lack."""
        body, own = self.parts[i]
        columns = consecutive(np.r_[body.modal, own])
        of_all, *left = (tuple(x[:, columns] for x in of[:2]) for of in (e, *(lacks or ())))
        return Added(*of_all, speed, left=None if lacks is None else left)
