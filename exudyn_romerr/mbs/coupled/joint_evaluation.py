"""Mechanism: all monitored bodies of an mbs are evaluated together, since coupled bounds need one another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...errors import AssumptionError, InputError, RunError
from ...estimates.mechanism_feedback import Feedback
from ...online.coupled_runs import Connectors, FirstSteps, join_extensions, joined_openings, turned_in
from ...trajectory.scheme import Scheme
from ..access.mbs_items import first_step, scheme_of, share_of
from ..control.connectors import connectors
from ..control.steady_gains import SteadyGains
from ..derivatives.linearisation import Tangents
from ..mechanism.kept_equations import KeptEquations
from ..mechanism.late_readings import LateReadings
from ..mechanism.step_errors import StepErrors
from ..mechanism.stored_residuals import StoredResiduals
from ..shadow.seen_vectors import seen_vectors
from .feedback_runs import Reaction
from .watches_together import (
    check_extensions,
    check_openings,
    end_with,
    fall_back,
    open_together,
    require_vectors,
    why_not_coupled,
)

# Exudyn holds rates of constraints with this rule only. Multipliers, and errors of errors by time steps, ring with it
# here, where positions are held; with a damped one vectors do not ring as bodies do: errors were 112 times the bound
TRAPEZOIDAL = Scheme.of_radius(1.0)


class Mechanism:
    """All watches of one solve. Those of scope "coupled (linearised)" share one energy.

    Where only the bounds of that scope are refused, the mechanism still has estimates: what ends these ends nothing
    else, and the report falls back on those under frozen inputs.

    Attributes
    ----------
    tangents : what auxiliary vectors react through; None if no body has such. equations : set by begin.
    """

    tangents: Tangents | None = None

    def __init__(self, watches: Sequence[Any], before: Mechanism | None = None, sensors: Sequence = ()):
        self._watches, self._before, self._sensors = watches, before and before._reaction, sensors
        self._coupled: list[Any] = []
        self._partners: list[Any] = []  # the coupled ones; those of which there are estimates, if none is coupled
        self._ended: Exception | None = None  # why there are none, until it is said
        self._reaction: Reaction | None = None
        self._failure: Exception | None = None  # of the tangent
        self._at_hand: tuple = (None, None)  # while rows are evaluated: the mbs, their multipliers

    def begin(self, mbs: Any, may_change: bool) -> None:
        """A solve begins, and the watches have read the mbs; may_change: by a PostStep function, along the run."""
        self.equations, self._gains = KeptEquations(mbs, may_change), SteadyGains(mbs)
        self._coupled = [watch for watch in self._watches if watch.is_coupled]
        self._check_others(self._watches)
        known = connectors(mbs, self._compliance) if self._coupled else Connectors()
        self._first_steps = FirstSteps(scheme_of(mbs), None, known, first_step(mbs))
        self._partners = self._coupled or [x for x in self._watches if x.is_frozen and x.enriched is not None]
        if self._coupled:
            self._together(self._prepare, mbs)
        elif self._partners:
            self._estimate(self._prepare_reaction, mbs)
        for sensors in self._sensors:
            sensors.begin(mbs, self.tangents, why_not_coupled(self._watches))

    def _compliance(self, marker: int) -> tuple[float, float] | None:
        found = (watch.subject.compliance(marker) for watch in self._coupled if watch.error is None)
        return next((one for one in found if one is not None), None)

    def read_tangent(self, mbs: Any, t: float) -> int:
        """Read the tangent now; return after how many steps it is to be read again, 0: not at all."""
        if self.tangents is None or self._has_failed:
            return 0
        try:
            return self.tangents.read(mbs, t)
        except Exception as error:
            self._failure = error
            return 0

    @property
    def _has_failed(self) -> bool:
        """Whether coupled bounds have ended in this solve."""
        return self._failure is not None or any(watch.error for watch in self._partners)

    def evaluate(self, mbs: Any, *rows: np.ndarray) -> None:
        """Evaluate accepted steps: t (S,) and q, q_t, q_tt, multipliers (S, ...)."""
        self.read_late(mbs, *rows)
        self._gains.look(self._coupled, mbs, *rows)
        self._at_hand = mbs, rows[-1]
        try:
            self.take(*rows[:-1])
        finally:
            self._at_hand = None, None

    def read_late(self, mbs: Any, t: np.ndarray, *states: np.ndarray) -> None:
        """Read the tangents that stored steps need: t (S,) and q, q_t, q_tt, multipliers (S, ...)."""
        if self.tangents is None or not self.tangents.readings or self._has_failed:
            return
        late = LateReadings(self.tangents, mbs, t, states, self._reaction)
        late.read()
        self._failure = late.failure
        for watch in self._partners if late.note else ():
            watch.note(late.note)

    def take(self, *rows: np.ndarray) -> None:
        """Evaluate accepted steps: t (S,) and q, q_t, q_tt (S, all coordinates of the mbs)."""
        if self._failure is not None and not self._coupled:
            self._end_estimates(self._failure)
        rows = self._before_failure(rows)
        for watch in self._watches:
            watch.receive(*rows)
        open_together(self._coupled)
        self._together(self._join_openings)
        for watch in self._watches:
            watch.open()
        self._react(self._open_reaction, rows, check_openings, self._before)
        for watch in self._watches:
            watch.admit()
        for watch in self._watches:
            watch.segment()
        self._together(self._join_extensions)
        for watch in self._watches:
            watch.advance()
        self._react(self._advance_reaction, rows, check_extensions, len(rows[0]))
        self._check_others(self._coupled)
        for watch in self._watches:
            watch.settle()
            watch.forget_block()
        self._fail(self._failure)
        if self._ended is not None and fall_back(self._partners, self._ended):
            self._ended = None

    def _before_failure(self, rows: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        """Return the rows up to the last tangent that was read, if one could not be."""
        if self._failure is None:
            return rows
        good = self.tangents.readings[-1].t if self.tangents.readings else -np.inf
        return tuple(x[rows[0] <= good] for x in rows)

    def _prepare(self, mbs: Any) -> None:
        kinds = {(watch.enriched is None, *watch.kind) for watch in self._coupled}
        if len(kinds) > 1:
            raise InputError(
                "bodies of one mechanism were attached with different estimators or time; coupled bounds need the "
                "same for all: 'energy' or 'auxiliary' or both, and one time"
            )
        if self._coupled[0].enriched is not None:
            self._prepare_reaction(mbs)

    def _prepare_reaction(self, mbs: Any) -> None:
        if not self._coupled:
            require_vectors(self._watches)
        if (of_solver := scheme_of(mbs)) is None:
            raise AssumptionError("the solver is not kept in mbs.sys; call SolveDynamic without storeSolver=False")
        settings = mbs.sys["simulationSettings"]
        self.tangents = Tangents(mbs, settings.parallel.numberOfThreads)
        holds_rates = settings.timeIntegration.generalizedAlpha.useIndex2Constraints
        self._reaction = self._reaction_of(TRAPEZOIDAL if holds_rates else of_solver, holds_rates, mbs)
        self._reaction.extended.seen = seen_vectors(mbs, self._reaction.parts, self.tangents)

    def _reaction_of(self, scheme: Scheme, holds_rates: bool, mbs: Any) -> Reaction:
        residuals = StoredResiduals(self.tangents, mbs) if self._partners[0].enriched.midpoint_residual else None
        share = None if holds_rates else share_of(mbs)
        first = FirstSteps(scheme, share, self._first_steps.connectors, self._first_steps.step)
        steps = first, self.tangents, StepErrors(self.tangents, residuals, holds_rates, self.equations)
        return Reaction(self._partners, Feedback(scheme), *steps, self._sensors)

    def _join_openings(self) -> None:
        if self._opens:
            for watch in self._coupled:
                watch.run.partners = tuple(other.run for other in self._coupled if other is not watch)
            pairs = [(watch.run, watch.opening) for watch in self._coupled if watch.shares_energy]
            joined = joined_openings(*zip(*pairs, strict=True)) if pairs else []
            note = self._first_steps.open(*zip(*pairs, strict=True)) if pairs else ""
            for watch in self._coupled if note and self._reaction is None else ():
                watch.note(note)
            for watch, opening in zip(self._coupled, joined, strict=False):
                watch.opening = opening

    @property
    def _opens(self) -> bool:
        return all(watch.opening is not None for watch in self._partners)

    def _open_reaction(self, rows: tuple[np.ndarray, ...]) -> None:
        if self._reaction is not None and self._opens:
            if not self.tangents.readings:
                raise RunError("the solve was interrupted before anything was bounded; solve again")
            rows = self._with_multipliers(rows)
            self._reaction.open(rows, self._before, self._at_hand[0])
            self._before = None

    def _join_extensions(self) -> None:
        pairs = [(watch.run, watch.extension) for watch in self._coupled if watch.shares_energy]
        if pairs and all(extension is not None for _, extension in pairs):
            (t, *_), frames = self._coupled[0].rows, [watch.rows[-1] for watch in self._coupled]
            turning = 0 * t if self._reaction is None else self._reaction.extended.now().turning(t)
            turned = turned_in(pairs[0][1], frames, turning)
            join_extensions(*zip(*pairs, strict=True), self._first_steps, turned)

    def _advance_reaction(self, rows: tuple[np.ndarray, ...]) -> None:
        if self._reaction is not None and all(watch.extension is not None for watch in self._partners):
            rows = tuple(x[int(self._opens) :].copy() for x in self._with_multipliers(rows))
            self._reaction.advance(rows, self._at_hand[0])

    def _with_multipliers(self, rows: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        """The rows, which may be the first of those at hand."""
        multipliers = self._at_hand[1]
        return *rows, np.zeros((len(rows[0]), 0)) if multipliers is None else multipliers[: len(rows[0])]

    def _together(self, work: Callable, *arguments: Any) -> None:
        """Do what concerns all coupled bodies; an error is one of all of them."""
        self._check_others(self._coupled)
        if not self._coupled or any(watch.error for watch in self._coupled):
            return
        try:
            work(*arguments)
        except Exception as error:
            self._fail(error)

    def _react(self, work: Callable, rows: tuple[np.ndarray, ...], check: Callable, known: Any) -> None:
        """Go on with the reaction: as what bounds need, or for the sake of estimates alone."""
        if self._coupled:
            self._together(work, rows)
        elif self._reaction is not None:
            self._estimate(check, self._partners, known)
            if self._reaction is not None:
                self._estimate(work, rows)

    def _estimate(self, work: Callable, *arguments: Any) -> None:
        """Do what estimates alone need."""
        try:
            work(*arguments)
        except Exception as error:
            self._end_estimates(error)

    def _end_estimates(self, error: Exception) -> None:
        self.tangents, self._reaction, self._failure, self._ended = None, None, None, error

    def _fail(self, error: Exception | None) -> None:
        for watch in self._coupled if error is not None else ():
            watch.error = watch.error or error

    def _check_others(self, watches: Sequence[Any]) -> None:
        """Where one body has no bound, coupled bounds of the others have none either."""
        end_with([watch for watch in watches if watch.error is not None], self._coupled)
