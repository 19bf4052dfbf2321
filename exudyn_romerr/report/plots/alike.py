"""What of an output covers the same: that alone is drawn together, for a bound of the modes is none of the steps."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...linear.estimators.causes import BY_STEPS
from ..scope import NOT_CERTIFIED, SCOPES
from ..wording import covers_time, estimate_scope, under, widest, widest_scope

if TYPE_CHECKING:
    from ..data import OutputData, ReportData

WHOLE, OF_MODES = "error", "error of the modes"


class Alike(NamedTuple):
    """Of one row what is of the same error: `kind`; what is None is not known of it, or not drawn.

    bounds : (T,) by estimator, of those that cover most. estimate, error : (T,), signed. half : of the estimate.
    left_out : what is not drawn beside these, in words.
    """

    kind: str
    bounds: dict[str, np.ndarray]
    estimate: np.ndarray | None
    half: np.ndarray | None
    error: np.ndarray | None
    left_out: tuple[str, ...] = ()


def kind_of_bound(report: ReportData) -> str:
    """Return what the bounds bound."""
    return OF_MODES if report.time == "sampled" else WHOLE


def has_estimate(report: ReportData, out: OutputData) -> bool:
    """Return whether there is an estimate of all that the bound is of, or of more."""
    if out.estimate is None:
        return False
    return SCOPES.index(estimate_scope(out, report.scope)) <= SCOPES.index(widest_scope(report.scope))


def bound_covers(report: ReportData, out: OutputData) -> bool:
    """Return whether the bound is of all that the estimate is of, the whole error if there is no estimate."""
    if not has_estimate(report, out):
        return True
    return _same_scope(report, out) and not _has_steps_alone(report, out)


def alike(report: ReportData, out: OutputData, row: int) -> Alike:
    """Return what is drawn together of a row: of the modes where the bound is of these alone.

    Of the whole error where a truth was compared that has other steps, where the bound takes forces as they are, or
    where no bound is finite.
    """
    bounds = {e: out.bound[e][:, row] for e in widest(report.scope) if e in out.bound}
    error = None if out.error is None else out.error[:, row]
    if not has_estimate(report, out):
        return Alike(kind_of_bound(report), bounds, None, None, error, _narrower(report))
    whole, half = out.estimate[:, row], out.uncertainty[:, row]
    if bound_covers(report, out):
        kind = WHOLE if covers_time(out, report.time) else kind_of_bound(report)
        return Alike(kind, bounds, whole, half, error, _narrower(report))
    if not any(np.isfinite(bound).any() for bound in bounds.values()):
        return Alike(WHOLE, {}, whole, half, error, ("no finite bound",))
    modes, half_of_modes = _of_modes(out, row)
    if _same_scope(report, out) and (error is None or _off(error, modes) < _off(error, whole)):
        return Alike(OF_MODES, bounds, modes, half_of_modes, error, _narrower(report))
    why = "of the modes alone" if _same_scope(report, out) else under(report.scope).removeprefix(", ")
    doubt = f", {NOT_CERTIFIED}" if out.uncertified else ""
    return Alike(WHOLE, {}, whole, half, error, (f"bound {why}{doubt}: not drawn",))


def _same_scope(report: ReportData, out: OutputData) -> bool:
    return estimate_scope(out, report.scope) == widest_scope(report.scope)


def _has_steps_alone(report: ReportData, out: OutputData) -> bool:
    """Whether the estimate has time steps in it, which the bound has not."""
    return report.time == "sampled" and covers_time(out, report.time)


def _narrower(report: ReportData) -> tuple[str, ...]:
    """Estimators whose bounds cover less than those of others."""
    names = [e for e in report.scope if e not in widest(report.scope)]
    return tuple(f"'{e}'{under(report.scope, e)}: not drawn" for e in names)


def _of_modes(out: OutputData, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Estimate and half width of a row without time steps."""
    steps = out.estimate_parts.get("time step", np.zeros_like(out.estimate))
    halves = [x[:, row] for check, x in out.uncertainty_parts.items() if check not in BY_STEPS]
    return out.estimate[:, row] - steps[:, row], np.zeros(len(out.value)) + sum(halves)


def _off(error: np.ndarray, estimate: np.ndarray) -> float:
    return float(np.max(np.abs(error - estimate), initial=0.0))
