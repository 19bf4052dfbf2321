"""MechanismRun: one solve of bodies that a mechanism reacts to; its rows are kept, and told when it has ended."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import RunError
from ...linear.run.record import Internal
from ...report.causes import REDUCTION
from ..access.solvers import SAME_TIME
from ..mirror.recorder import StoredRows, as_rows
from ..mirror.told import Told
from ..mirror.told_solve import Asked, Ended, told_solve

if TYPE_CHECKING:
    from ...mechanism.rows import Rows
    from ...report.mechanism_report import MechanismReport
    from ..floating.moving_subject import MovingSubject


class MechanismRun:
    """Rows of a solve so far, and what is known of the errors of its bodies.

    asked : what it is told of. end : s, where the solver is to go to. before : how the solve before
    has ended. known : what was told of the rows; None: nothing. error : why nothing can be told. due : s, from when
    on its rows are to be told. first_order : number of such coordinates.
    """

    def __init__(self, asked: Asked, end: float, before: Ended | None, first_order: int):
        self.asked, self._end, self._before = asked, end, before
        self._rows, self._size, self._first_order = StoredRows(), 0, first_order
        self.known: Told | None = None
        self.due = end - SAME_TIME * abs(end)
        self._count = 0  # rows that were told
        self.error: Exception | None = None

    def append(self, t: np.ndarray, *state: np.ndarray) -> None:
        """Keep rows t (S,), q, q_t, q_tt, multipliers and what is behind them (S, ...)."""
        self._size = state[0].shape[1]
        self._rows.append(np.hstack([t[:, None], *state]))

    def rows(self) -> Rows:
        """Return all so far."""
        return as_rows(self._rows.all().reshape(len(self._rows), -1), self._size, self._first_order)

    def tell(self, mbs: Any) -> Ended | None:
        """Find out what is known of the rows so far; return how they end, None: as before."""
        if (count := len(self._rows)) == self._count:
            return None
        rows, self._count, self.known, self.error = self.rows(), count, None, None
        ended, is_over = Ended(rows.q[-1], rows.v[-1]), rows.t[-1] >= self.due  # where nothing is known
        try:
            self.known, ended = told_solve(mbs, self.asked, rows, self._before, None if is_over else self._end)
        except Exception as error:  # whatever it is: the run of the user goes on, and the report says why
            self.error = error
        self._before = None if is_over else self._before  # which holds whole bodies
        return ended if count > 1 or self.asked.is_static else None

    def told(self) -> Told:
        """Return what is known; RunError: nothing was told yet, or else what `tell` met."""
        if self.error is not None:
            raise self.error
        if self.known is None:
            raise RunError("the run was not told yet; ask monitor.report()")
        return self.known


class BodyRun:
    """What a MechanismRun tells of its body number `body`. messages : at the head of reports."""

    continues = False

    def __init__(self, of: MechanismRun, body: int, subject: MovingSubject, tolerance: dict[str, float]):
        self.of, self._body, self._subject, self._tolerance = of, body, subject, tolerance
        self._plan = subject.told_plan()
        self._is_requested = {out.name: out.is_requested for out in subject.outputs}
        self.stopped: float | None = None  # s, where a tolerance has stopped the solve
        self.messages: list[str] = []

    @property
    def is_static(self) -> bool:
        """Whether rows are load steps."""
        return self.of.asked.is_static

    @property
    def times(self) -> np.ndarray:
        """Instants (T,) s, or load factors."""
        return self.of.rows().t

    def report(self) -> MechanismReport:
        """Return what was told; raises as MechanismRun.told."""
        told = self.of.told()
        asked = (out for out in told.of_bodies[self._body] if self._is_requested[out.name])
        asked = [replace(out, tolerance=self._tolerance.get(out.name), stopped=self.stopped) for out in asked]
        return told.report(asked, self._plan, self.messages, self._body)

    def internal(self) -> Internal:
        """Return outputs beside those that were asked for."""
        told, rows = self.of.told(), self.of.rows()
        shown = {out.name: out for out in told.of_bodies[self._body] if not self._is_requested[out.name]}
        corrected = {name: sum((x.estimate_parts[c] for c in REDUCTION), x.value) for name, x in shown.items()}
        subject, frames = self._subject, self._subject.frames(rows.q, rows.v, rows.a)
        return Internal(corrected, frames, subject.outputs, subject.views())
