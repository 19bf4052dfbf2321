"""MeasuredRemainder: what a mechanism's linear equations leave out of their prediction, by its shadow."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import RunError
from ...linalg.blocked_products import rows_times
from ...online.kept_estimate import LOST
from ...trajectory.estimate import LINEARISED, PROVISIONAL
from .looks import Jumps, look_together, middles
from .measured import LOOKED, NOT_LINEAR, OF_THIRD_ORDER, SAMPLED, Measured, joined
from .remainder import Remainder, march_together
from .shadow_mbs import Shadow

if TYPE_CHECKING:
    from ...estimates.march import Steps, Tangent
    from ...estimates.residual_passes import JointDrift
    from ...trajectory.estimate import TimeStep
    from ..derivatives.linearisation import Tangents
    from ..mechanism.enriched_body import EnrichedBody
    from ..mechanism.step_errors import StepErrors

    Parts = Sequence[tuple[EnrichedBody, slice]]

TOLD = 0.03  # of errors by time steps: less than LINEARISED of them, but for looks now and then, which show more
INCREMENTS = "rotations of Lie group nodes are increments"
LEFT_OUT = "what linear equations leave out is taken for 1 % of what they predict, not measured: {}"


class MeasuredRemainder:
    """Remainders of what vectors predict, and of errors by time steps; what fails ends them, and nothing else.

    step_errors : errors by time steps, which have gone through steps before `follow` is called; drift : likewise, of
    joints, if the solver lets them.

    Attributes
    ----------
    found : what was measured of the vectors' prediction at the rows of the last call of open, go_on, following; None:
    nothing. notes : why, once.
    """

    def __init__(self, tangents: Tangents, parts: Parts, size: int, step_errors: StepErrors, drift: JointDrift):
        self._tangents, self._parts, self._size, self._step_errors = tangents, parts, size, step_errors
        self._drift, self._predicted = drift, np.zeros(1)
        self._most = np.zeros((2, len(parts) + 1))  # sizes so far of what is predicted, and of the motion
        sizes = partial(_sizes, tangents, *_mass_roots(parts, size))
        self._shadow: Shadow | None = None
        self._mbs, self._is_compared = None, True  # while rows are evaluated: the mbs, whether it is as it was
        self._of_vectors, self._of_steps = (
            Remainder(size, len(parts) + 1, sizes, at_once) for at_once in (False, True)
        )
        self._jumps, self._failure, self._is_doubted = Jumps(size, sizes), "", False
        self.found: Measured | None = None
        self.notes: list[str] = []

    def open(self, mbs: Any, tangent: Tangent, rows: Sequence[np.ndarray], e: np.ndarray) -> None:
        """Begin at the first of rows t (1,), q, q_t, q_tt (1, n), where e (3, 1, k) is predicted."""
        self._constraints = len(tangent.C)
        for one in (self._of_vectors, self._of_steps):
            one.start(float(rows[0][0]), self._constraints)
        self._try(self._make, mbs)
        with self._functions_kept():
            self._try(self._of_vectors.rest, tangent, self._wide(rows), e, self._residuals)
        self._open()

    def go_on(self, mbs: Any, before: MeasuredRemainder) -> None:
        """Go on from another run's."""
        self._of_vectors.go_on(before._of_vectors)
        self._of_steps.go_on(before._of_steps)
        self._jumps.go_on(before._jumps)
        self._most, self._predicted = before._most, before._predicted[-1:]
        self._failure, self._constraints = before._failure, before._constraints
        self._is_doubted = before._is_doubted  # who goes on has the message
        self._try(self._make, mbs)
        self._open()

    def _open(self) -> None:
        self.found = None if self._failure or not self._parts else self._of_vectors.at_start
        self._last: Measured | None = self._of_steps.at_start

    @property
    def state(self) -> np.ndarray:
        """What is added to e, e', e'' now, (3, k)."""
        return self._of_vectors.state

    @property
    def multipliers(self) -> np.ndarray:
        """Multipliers (S, c) of what the last call of follow has added."""
        return self._of_vectors.multipliers

    @property
    def left(self) -> list[np.ndarray] | None:
        """What the prediction may lack where that may be more than LINEARISED of it; None: unknown, or less."""
        return self.lacks if np.any(SAMPLED * self._of_vectors.shares > LINEARISED) else None

    @property
    def lacks(self) -> list[np.ndarray] | None:
        """What the prediction may lack, sum of the sizes of these (3, S, k); None: it is not known.

        What joints drift by is predicted but for its own size at most, and a share of what the simulation's drift by:
        that of the prediction in the motion. Linear equations leave out some, and how joints turn what has drifted.
        """
        if self.found is None:
            return None
        drift = [LOOKED * self._drift.added, np.minimum(1.0, SAMPLED * self._predicted)[:, None] * self._drift.own]
        return self.found.left() + [x for x in drift if x.any()]

    def share(self, i: int) -> float | None:
        """Size of what is left out of the deformation of body i over that of the prediction; None: not known."""
        return None if self._failure or not self._parts else float(self._of_vectors.shares[i])

    @contextmanager
    def following(self, mbs: Any, rows: Sequence[np.ndarray], forces: np.ndarray) -> Iterator[None]:
        """Go through steps to rows t (S,), q, q_t, q_tt (S, n), under forces (S, k) on vectors."""
        self._forces, self._predicted = forces, np.zeros(len(forces))
        self._mbs, self._is_compared = mbs, False
        rows = self._wide(rows)
        read = np.array([reading.t for reading in self._tangents.readings])
        due, restless = middles(rows[0], read), self._jumps.follow(rows[3])
        for one in (self._of_vectors, self._of_steps):
            one.begin(rows, self._residuals, due, restless)
        with self._functions_kept():
            yield
        self._finish()

    @contextmanager
    def _functions_kept(self) -> Iterator[None]:
        """What user functions keep is put back afterwards."""
        kept = ExitStack()
        if self._shadow is not None:
            self._try(kept.enter_context, self._shadow.functions_kept())
        try:
            yield
        finally:
            try:
                kept.close()
            except RunError as failure:
                self._fail(failure)

    def follow(self, steps: Steps, part: slice, e: np.ndarray) -> np.ndarray | None:
        """Return what is added to e, e', e'' (3, S, k) in some of the steps; None: nothing."""
        newest, drift, looks = self._step_errors.newest(len(steps)), None, {}
        if newest is not None:
            x, force, values = newest
            none = np.zeros((len(steps), self._constraints))
            drift = None if values is None else (0 * force, values + self._drift.values)
            if self._of_steps.adds or not self._failure:
                own = -force - self._forces[part], none
                looks[self._of_steps] = self._of_steps.go_to(steps, part, -x, own)
        of_vectors = self._of_vectors
        if self._parts and (of_vectors.adds or not self._failure):
            looks[of_vectors] = of_vectors.go_to(steps, part, e, drift)
            sizes = np.maximum.accumulate(np.hstack([self._most[:, None], of_vectors.beside]), axis=1)[:, 1:]
            self._most, (predicted, motion) = sizes[:, -1], sizes
            self._predicted[part] = np.max(predicted / np.maximum(motion, np.finfo(float).tiny), axis=1)
        look_together([*looks.values()])
        march_together(steps, {one: one.columns() for one in looks})
        return of_vectors.added

    def _finish(self) -> None:
        self._mbs = None
        self.found, steps = (one.found() for one in (self._of_vectors, self._of_steps))
        self.found = None if self._failure else self.found
        if self._parts and not self._is_doubted and self._of_vectors.matters(NOT_LINEAR, slice(-1)):
            self._is_doubted = True
            self.notes.append(OF_THIRD_ORDER)
        steps = steps if steps is not None and len(steps.times) == len(self._forces) else None  # it may have failed
        last, self._last = self._last, steps
        if last is not None and steps is not None:  # of the block before, where errors are provisional
            before = Measured(last.r[:, -PROVISIONAL:], last.added[:, -PROVISIONAL:], last.times[-PROVISIONAL:])
            self._last = joined([before, steps])

    def corrected(self, step: TimeStep | None) -> TimeStep | None:
        """Return errors by time steps, as found last, with what linear equations leave out of them."""
        if step is None or self._last is None:
            return step
        if self._last.r.shape[1] < step.x.shape[1]:  # it ended within a block
            return step._replace(left=())
        r, added, times = (x[..., -step.x.shape[1] :, :] for x in (*self._last[:2], self._last.times[:, None]))
        added = added if np.all(self._of_steps.shares < LOST) else 0.0 * added
        told = not self._failure and np.any(self._of_steps.shares > TOLD)
        left = Measured(r, added, times[:, 0] / times[:, 0]).left() if told else ()
        return step._replace(x=step.x - added, left=left)

    def _make(self, mbs: Any) -> None:
        """Make the shadow of this solve, if anything is predicted."""
        if not self._parts and self._step_errors.found is None:
            return
        if not self._tangents.differentiable.all():
            raise RunError(INCREMENTS)
        self._shadow = Shadow(mbs, self._parts, self._tangents)

    def _residuals(self, rows: Sequence[np.ndarray], e: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Those of the shadow in rows that e (3, S, k) moves, or None from where they are not to be had."""
        if not self._is_compared:
            self._try(self._shadow.compare, self._mbs)
            self._is_compared = True
        t, *states = rows
        return self._try(self._shadow.residuals, (t, *self._tangents.moved(states, e)))

    def _try(self, work: Callable, *arguments: Any) -> Any:
        """Do what is left to do unless something has failed; what fails ends the measurement, and nothing else."""
        if not self._failure:
            try:
                return work(*arguments)
            except Exception as failure:
                self._fail(failure)
        return None

    def _fail(self, failure: Exception) -> None:
        if not self._failure:
            self._failure = str(failure)
            self.notes.append(LEFT_OUT.format(failure))

    def _wide(self, rows: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Rows whose states have vectors, too, which do not move in the run."""
        t, *states = rows
        return [t, *(np.hstack([x, np.zeros((len(t), self._size - x.shape[1]))]) for x in states)]


def _sizes(tangents: Tangents, roots: np.ndarray, of_body: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Sizes (S, bodies + 1) of changes (3, S, k): of deformations in the mass norm, of all motion about so."""
    masses = tangents.readings[-1].masses
    of_bodies = rows_times(rows_times(x[0], roots) ** 2, of_body)
    return np.sqrt(np.column_stack([of_bodies, rows_times(x[0][:, : len(masses)] ** 2, masses[:, None])]))


def _mass_roots(parts: Parts, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return roots (size, n), by which motions become deformations in the mass norm; (n, bodies) whose these are."""
    roots = [body.offline.mass_root.T for body, _ in parts]
    ends = np.cumsum([0, *(root.shape[1] for root in roots)])
    whole, of_body = np.zeros((size, ends[-1])), np.zeros((ends[-1], len(parts)))
    for i, ((body, own), root) in enumerate(zip(parts, roots, strict=True)):
        columns = slice(ends[i], ends[i + 1])
        whole[np.r_[body.modal, own], columns], of_body[columns, i] = root, 1.0
    return whole, of_body
