"""von_mises: the von Mises stress of a report, with its bound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..model.solid_elements import STRAINS

if TYPE_CHECKING:
    from .report import BoundReport
    from .scope import Doubt


@dataclass(frozen=True)
class VonMises:
    """Von Mises stress along a run: |vM of the full model - value| <= bound, and <= corrected_bound of corrected.

    All (T,); corrected and corrected_bound are None where the report has no corrected output. uncertified : why these
    bounds are not certified, see BoundReport; empty: nothing speaks against them.
    """

    value: np.ndarray
    bound: np.ndarray
    corrected: np.ndarray | None
    corrected_bound: np.ndarray | None
    uncertified: tuple[Doubt, ...] = ()


def von_mises(report: BoundReport, name: str) -> VonMises:
    """Return the von Mises stress of a node_stress with all six components, and its bound.

    vM(s) is a seminorm: |vM(s + e) - vM(s)| <= vM(e), and where |e_i| <= b_i no vM(e) is larger than with the normal
    components b, one of them negative, and all shears b. A corrected output gives a second bound, |vM(corrected) -
    vM(value)| + corrected_bound; the smaller one counts.

    Parameters
    ----------
    report : BoundReport
        From monitor.report, evaluate or load_report.
    name : str
        Of the output.

    Returns
    -------
    VonMises

    Raises
    ------
    InputError
        Unknown output, or one that has not six rows.

    Notes
    -----
    The scope is that of the report. Does not cover: strains (node_strain), whose shears are twice eps_ij.
    """
    out = report.output(name)
    if out.value.shape[1] != len(STRAINS):
        raise InputError(
            f"output {name!r} has {out.value.shape[1]} rows; needed: the six of node_stress without component="
        )
    value, bound = _size(out.value), _largest_size(out.bound["best"])
    if out.corrected is None:
        return VonMises(value, bound, None, None, out.uncertified)
    corrected, left = _size(out.corrected), _largest_size(out.corrected_bound)
    if len(set(report.scope.values())) == 1:  # else the correction may say less than the best bound
        bound = np.minimum(bound, np.abs(corrected - value) + left)
    return VonMises(value, bound, corrected, left, out.uncertified)


def _size(stress: np.ndarray) -> np.ndarray:
    """Von Mises stress (T,) of components (T, 6)."""
    normal, shear = stress[:, :3], stress[:, 3:]
    return np.sqrt(((normal - np.roll(normal, 1, axis=1)) ** 2).sum(axis=1) / 2 + 3 * (shear**2).sum(axis=1))


def _largest_size(box: np.ndarray) -> np.ndarray:
    """Largest von Mises stress (T,) where the components are at most (T, 6) in absolute value; inf where one is."""
    finite = np.isfinite(box).all(axis=1)
    box = np.where(finite[:, None], box, 0.0)
    # convex, so largest at a vertex; of those the three where one normal component has the other sign are left
    signs = np.ones((3, 6)) - 2 * np.eye(3, 6)
    return np.where(finite, np.max([_size(box * sign) for sign in signs], axis=0), np.inf)
