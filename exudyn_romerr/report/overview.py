"""The table at the head of a report of several outputs: a line for each, with its verdict and the next step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .advice import by_bound, next_step
from .estimate_wording import about_all, estimated_kind
from .scope import ATTACH_ALL, NOT_CERTIFIED, UNATTACHED, cures_of
from .wording import RINGS, advises, digits, error_kind, percent, rounded_up, under, widest_scope

if TYPE_CHECKING:
    from .data import OutputData, ReportData


def overview(report: ReportData) -> list[tuple[str, ...]]:
    """Return head and lines of the table, of every output all rows together; empty if there is only one output."""
    if len(report.outputs) < 2:
        return []
    head = ("output", "largest value", *_heads(report), "scope", "next step")
    return [head, *(_line(report, out, len(head)) for out in report.outputs.values())]


def aligned(rows: list[tuple[str, ...]]) -> list[str]:
    """Return lines of text whose columns begin below each other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def _heads(report: ReportData) -> list[str]:
    """Of estimates, if there are any, and bounds; what both are of is said once."""
    kind, outputs = error_kind(report.time), report.outputs.values()
    bounded = "bound" if any(out.uncertified for out in outputs) else "at most"
    estimated = [estimated_kind(out, report.time) for out in outputs if out.estimate is not None]
    if not estimated:
        return [f"{kind} {bounded}"]
    of = min(estimated, key=len)  # "error" if any estimate has the time steps in it
    return [f"{of} about", bounded if of == kind else f"{kind} {bounded}"]


def _line(report: ReportData, out: OutputData, columns: int) -> tuple[str, ...]:
    estimate = [about_all(out, report.scope)] if columns == 6 else []
    scope = widest_scope(report.scope) + (f", {NOT_CERTIFIED}" if out.uncertified else "")
    step = _next_step(report, out) if out.uncertified or advises(report) else "see the messages"
    largest = np.max(np.abs(out.value))
    return (out.name, f"{digits(largest, 4)} {out.unit}", *estimate, _at_most(report, out, largest), scope, step)


def _next_step(report: ReportData, out: OutputData) -> str:
    """What helps most: under the forces of a run whose other bodies' errors are not known, to know these."""
    if out.uncertified:
        return cures_of(out.uncertified)
    if UNATTACHED in report.scope_reason:
        return ATTACH_ALL
    return next_step(out, report.time, report.scope).removesuffix(RINGS)  # the advice below says it


def _at_most(report: ReportData, out: OutputData, largest: float) -> str:
    """The largest bound with what it holds under: nothing else is said "at most"."""
    most, condition = np.max(out.bound["best"]), under(report.scope, doubts=out.uncertified)
    if by_bound(out) == "round-off":
        floor = rounded_up(np.max(out.bound["best"] + out.round_off), 1)
        return f"{floor} {out.unit}, at round-off{condition}"
    if not np.isfinite(most):
        return "not bounded"
    share = (percent(most / largest) or "> 1000 %") if largest > 0 else ""
    return f"{rounded_up(most)} {out.unit}{share and f' ({share})'}{condition}"
