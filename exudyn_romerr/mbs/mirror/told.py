"""Told: what is known of a run that has ended, and the reports that are made of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...report.data import NodeFields, Plan, line_of, made_here
from ...report.mechanism_report import MechanismReport, OfBodies
from ...report.report import OutputReport
from ...report.scope import COUPLED, Doubt

if TYPE_CHECKING:
    from ...mode_selection.modal_content import Content
    from ...mode_selection.without_modes import WithoutModes

ESTIMATOR = "auxiliary"  # of the report: vectors beside the modes that react with the mechanism
OF_ESTIMATE = "linearised mechanism: all bodies, joints, springs and loads of this run, to first order"


class Told(NamedTuple):
    """What is known of a run.

    t : (T,) s. sensors, of_bodies : all sensors that were asked for, outputs of each body. left_out : (what, why).
    doubts : why nothing is certified. planned_end : s, where it was to go to, if it ended before; None: it did not.
    modes : tells of each mode, if asked.
    content : of each sensor, by name, if further modes are asked for. nodes : what is known at the
    mesh of each body.
    """

    t: np.ndarray
    sensors: Sequence[OutputReport]
    of_bodies: Sequence[Sequence[OutputReport]]
    left_out: Sequence[tuple[str, str]]
    doubts: Sequence[Doubt]
    is_static: bool
    planned_end: float | None
    modes: WithoutModes
    content: dict[str, Content]
    nodes: Sequence[NodeFields]

    def of_mechanism(self, bases: Sequence[str], messages: Sequence[str]) -> MechanismReport:
        """Return one report of all, with those of its bodies, which have what is known at their meshes.

        bases : how each body is reduced, in words.
        """
        outputs = [*self.sensors, *chain(*self.of_bodies)]
        report = self.report(outputs, Plan((*bases, *map(line_of, outputs)), ()), messages)
        return replace(report, bodies=tuple(self.report((), body=b) for b in range(len(self.nodes))))

    def report(
        self,
        outputs: Sequence[OutputReport],
        plan: Plan | None = None,
        messages: Sequence[str] = (),
        body: int | None = None,
    ) -> MechanismReport:
        """Return a report of some of these; plan : what was to be told; messages : beside those of the run.

        body : whose mesh it is to know; None: none.
        """
        plan = plan or Plan(tuple(map(line_of, outputs)), ())
        return MechanismReport(
            t=self.t,
            position_bound=OfBodies(),
            velocity_bound=OfBodies(),
            outputs={out.name: out for out in outputs},
            scope={ESTIMATOR: COUPLED},
            scope_reason="",
            reasons={ESTIMATOR: OF_ESTIMATE},
            plan=Plan(plan.computed, (*plan.left_out, *self.left_out)),
            messages=[*messages],
            time="static" if self.is_static else "sampled",
            total_mass=None,
            made=made_here(),
            planned_end=self.planned_end,
            uncertified=tuple(self.doubts),
            modes=self.modes,
            nodes=None if body is None else partial(self.nodes.__getitem__, body),
        )
