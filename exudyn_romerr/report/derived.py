"""What is derived of outputs, with its error: peak, RMS and value at the end; von Mises stress.

A peak does not care about phase: its error may be a hundredth of the largest error over time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..model.solid_elements import STRAINS
from .answers import Answer
from .data import Feature, OutputReport, ReportData, extents
from .scope import FROZEN, Doubt
from .verdict_text import size_in_words
from .verdicts import ESTIMATED, Verdict
from .wording import covers_time, digits, estimate_scope

NAMES = ("peak", "rms", "end")
TITLE = "{} (full model less this: about)"


def features_of(report: ReportData, out: OutputReport) -> dict[str, Feature]:
    """Return the features of an output by NAMES; errors are those of the whole error, or None as its verdict."""
    y, off, weights = out.value, out.uncertainty, _weights(report.t)
    own = _numbers(y, weights)
    is_known = out.estimate is not None and estimate_scope(out, report.scope) != FROZEN
    if not is_known or not covers_time(out, report.time):
        return {name: Feature(x, None, None) for name, x in own.items()}
    better = y + out.estimate
    full = _numbers(better, weights)
    most, least = extents(np.abs(better) + off), extents(np.maximum(np.abs(better) - off, 0.0))
    peak = np.maximum(most - full["peak"], full["peak"] - least)
    half = {"peak": peak, "rms": _rms(off, weights), "end": off[-1]}
    return {name: Feature(own[name], full[name] - own[name], half[name]) for name in NAMES}


def _numbers(y: np.ndarray, weights: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(NAMES, (extents(y), _rms(y, weights), y[-1]), strict=True))


def _rms(y: np.ndarray, weights: np.ndarray) -> np.ndarray:
    size = extents(y)
    scale = np.where(np.isfinite(size) & (size > 0), size, 1.0)  # squares may be too large for a float
    return scale * np.sqrt(weights @ (y / scale) ** 2)


def _weights(t: np.ndarray) -> np.ndarray:
    """Shares (T,) of the run that instants stand for."""
    if len(t) < 2:
        return np.ones(len(t))
    h = np.diff(t)
    return (np.append(h, 0.0) + np.append(0.0, h)) / 2 / (t[-1] - t[0])


def features_table(reports: Sequence[ReportData]) -> list[tuple[str, ...]]:
    """Return head and a line for every component of every output, of several runs one behind the other."""
    lines = [("sensor", *(TITLE.format(name) for name in NAMES))]
    for report in reports:
        for out in report.outputs.values():
            found = features_of(report, out).values()
            lines += [(name, *(_cell(x, i, out.unit) for x in found)) for i, name in enumerate(out.row_names)]
    return lines


def _cell(feature: Feature, i: int, unit: str) -> str:
    value = f"{digits(feature.value[i], 4)} {unit}".rstrip()
    if feature.error is None:
        return f"{value} ({Answer.NOT_COVERED.value})"
    error, half = float(feature.error[i]), float(feature.half_width[i])
    if not np.isfinite(half):
        return f"{value} ({Answer.NOT_KNOWN.value})"
    verdict = Verdict(abs(error), half, ESTIMATED, Answer.NOT_KNOWN)
    sign = ("-" if error < 0 else "+") if verdict.is_resolved else ""
    return f"{value} ({sign}{size_in_words(verdict)})"


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


def von_mises(report: ReportData, name: str) -> VonMises:
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
