"""Mechanism: what all stages of a solve share, once it has ended and its equations were read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .outputs import Outputs
from .readings import Readings
from .rows import Rows
from .scheme import Scheme
from .unknowns import Unknowns

ROUNDED = 1e3 * np.finfo(float).eps  # of a body's size: motion that is rounding


class OtherEquations(Protocol):
    """Equations of all but the floating bodies, with kept vectors.

    independent : numbers of constraints that no others imply. felt : unknowns on which forces act at all.
    loads_know_motion : whether user functions of loads may know more than the time.
    """

    independent: np.ndarray
    felt: np.ndarray
    loads_know_motion: bool

    def unbalanced(self, rows: Rows) -> np.ndarray:
        """Return M a - f + G^T lam (T, n_a) at rows of the run, in axes of bodies."""

    def moved_forces(
        self, t: np.ndarray, states: Sequence[np.ndarray], kept: np.ndarray, lam: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return M a - f + G^T lam (T, n_a) in axes of bodies, g (T, all); kept (T, 3, kept) : beside q, v, a."""

    def loads(self, t: np.ndarray, states: Sequence[np.ndarray], kept: np.ndarray) -> np.ndarray:
        """Return what user functions of loads give that may know more than the time, (T, .); kept : as above."""

    def along(self, states: Rows) -> tuple[np.ndarray, np.ndarray]:
        """Return M a - f + G^T lam (T, n_q) and g (T, all) in states of the run, in coordinates of the mbs."""

    def delay(self, rows: Rows) -> np.ndarray:
        """Return forces (T, n_q) that a feedback of the same instant has beside one of the step's begin."""


@dataclass
class Mechanism:
    """What all stages of a solve share.

    projectors : of each body, (PARTS, m, m) of its kept vectors and oscillators. is_rigid : whether modes make
    interfaces rigid. has_user_functions : which may do between samples what these do not tell.
    has_forces_by_users : whether some of them are of joints, springs and other objects.
    sign : of multipliers as sensors know them. sensors : rows of each.
    """

    unknowns: Unknowns
    rows: Rows
    scheme: Scheme
    equations: OtherEquations
    readings: Readings
    outputs: Outputs
    projectors: Sequence[np.ndarray]
    is_rigid: bool
    has_user_functions: bool
    has_forces_by_users: bool
    sign: float
    sensors: Sequence[slice]

    def all_multipliers(self, lam: np.ndarray) -> np.ndarray:
        """Return multipliers (T, all, columns) of those of independent constraints (T, c, columns)."""
        wide = np.zeros((len(lam), self.rows.multipliers.shape[1], lam.shape[-1]))
        wide[:, self.equations.independent] = self.sign * lam
        return wide


def rests(unknowns: Unknowns, rows: Rows) -> bool:
    """Return whether coordinates change by rounding alone."""
    return bool(np.abs(rows.q - rows.q[0]).max(initial=0.0) <= ROUNDED * unknowns.largest_size)


def unbalanced_share(unknowns: Unknowns, rows: Rows, equations: OtherEquations, readings: Readings) -> float:
    """Return the largest M a - f + G^T lam of the reduced mechanism at rows that were read, over the largest force.

    It is far above Newton's tolerance where something acts that is no function of time and state.
    """
    part = rows[readings.at]
    left = equations.unbalanced(part)
    size = np.abs(left).max(initial=0.0)
    for body, at in zip(unknowns.bodies, unknowns.blocks, strict=True):
        forces = body.residual(body.motion(part))[:, : 6 + body.na]
        left[:, at] += forces
        size = max(size, np.abs(forces).max(initial=0.0))
    return float(np.abs(left[:, unknowns.own]).max(initial=0.0) / size) if size else 0.0
