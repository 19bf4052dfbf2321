"""What an estimate covers, how it is split by cause, and how far it is from a truth, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .scope import FROZEN
from .wording import FROZEN_FIRST, SHORT, digits, error_kind, for_run_alone, percent, widest_scope

if TYPE_CHECKING:
    from .data import OutputData, ReportData


def is_known(out: OutputData, row: int | None = None) -> bool:
    """Return whether there is an estimate of one row, or of all, at every instant."""
    rows = slice(None) if row is None else slice(row, row + 1)
    return out.estimate is not None and bool(np.isfinite(out.estimate[:, rows]).all())


def parts_of(out: OutputData) -> dict[str, np.ndarray]:
    """Return the estimate by cause; rigid interfaces that it does not tell from missing modes as the bound does."""
    parts, zero = dict(out.estimate_parts), np.zeros_like(out.estimate)
    stiff, modes = (out.causes.get(cause, zero) for cause in ("interfaces", "basis"))
    if np.any(parts.get("interfaces", zero)) or not np.any(stiff):
        return parts
    share = np.divide(stiff, stiff + modes, out=zero, where=(stiff > 0) & np.isfinite(modes))
    return {**parts, "basis": (1 - share) * parts["basis"], "interfaces": share * parts["basis"]}


def covers_time(out: OutputData, time: str) -> bool:
    """Return whether the estimate has the error of the time steps in it, which sampled bounds have not."""
    return time != "sampled" or bool(np.any(out.estimate_parts.get("time step", 0.0)))


def estimated_kind(out: OutputData, time: str) -> str:
    """Return what the estimate is an estimate of."""
    return "error" if covers_time(out, time) else error_kind(time)


def estimate_scope(out: OutputData, scope: dict[str, str]) -> str:
    """Return what the estimate covers."""
    return out.estimate_scope or widest_scope(scope)


def said_first(report: ReportData) -> str:
    """Return what a report with frozen inputs says before all else; empty: they are not frozen."""
    if widest_scope(report.scope) != FROZEN:
        return ""
    outputs = report.outputs.values()
    if outputs and all(estimate_scope(out, report.scope) != FROZEN for out in outputs):
        return f"bounds hold {for_run_alone(report.scope)}. Estimates are those of the mechanism, and cover both"
    return FROZEN_FIRST


def estimated_under(out: OutputData, scope: dict[str, str]) -> str:
    """Return what must be said with an estimate, in two words; "about" says that it is of first order."""
    return SHORT[FROZEN] if estimate_scope(out, scope) == FROZEN else ""


def off_by(out: OutputData, row: int | None = None) -> str:
    """Return in words how far the estimate of one row, or of all, is from the true error that was compared.

    A truth with the same time steps has nothing of their error: then of the estimate without it, too.
    """
    rows = slice(None) if row is None else slice(row, row + 1)
    true, of_steps = out.error[:, rows], out.estimate_parts.get("time step", np.zeros_like(out.estimate))[:, rows]
    off, without = (_largest(true - out.estimate[:, rows] + part) for part in (0.0, of_steps))
    said, other = (_share_of_it(x, _largest(true), out.unit) for x in (off, without))
    beside = f", without its time steps by {other}" if without < off else ""
    return f"the estimate is off by up to {said}{beside}"


def _share_of_it(x: float, of: float, unit: str) -> str:
    share = (percent(x / of) or "more than 1000 %") if of > 0 else ""
    return f"{digits(x, 2)} {unit}{share and f' ({share} of it)'}"


def _largest(x: np.ndarray) -> float:
    return float(np.max(np.abs(x), initial=0.0))
