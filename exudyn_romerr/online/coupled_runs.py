"""Runs of the bodies of one mechanism, whose bounds share one energy (theory.md 7, "coupled")."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..estimators.coupled_energy import MechanismEnergy, joint_growth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..trajectory.samples import Extension
    from .run import Opening, Run


def shared_energy(run: Run, stream: str) -> MechanismEnergy:
    """Return the estimator of a stream that bounds the energy of the mechanism."""
    return next(e for e in run.estimators(stream).values() if isinstance(e, MechanismEnergy))


def joined_openings(runs: Sequence[Run], openings: Sequence[Opening]) -> list[Opening]:
    """Return the openings with the energy that all bodies start with together."""
    if any(opening.start is None for opening in openings):  # they go on from runs before, with one energy already
        return list(openings)
    pairs = [(shared_energy(run, "reduction"), o.start) for run, o in zip(runs, openings, strict=True)]
    joint = tuple(np.linalg.norm([energy.energies_at(start) for energy, start in pairs], axis=0).tolist())
    return [o._replace(start=replace(o.start, joint=joint)) for o in openings]


def join_extensions(runs: Sequence[Run], extensions: Sequence[Extension]) -> None:
    """Tell every block what energy all bodies have together at the ends of its segments."""
    for stream in extensions[0].segments:
        blocks = [extension.segments[stream][0] for extension in extensions]
        energies = [shared_energy(run, stream) for run in runs]
        joint = joint_growth(energies, blocks)
        for block in blocks:
            block.joint = joint
