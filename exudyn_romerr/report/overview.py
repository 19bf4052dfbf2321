"""The table at the head of a report of several outputs: a line for each, with its verdict and the next step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .scope import NOT_CERTIFIED
from .wording import STEPS, advises, error_kind, is_uncertified, judged, percent, rounded_up, under, widest_scope

if TYPE_CHECKING:
    from .data import OutputData, ReportData


def overview(report: ReportData) -> list[tuple[str, ...]]:
    """Return head and lines of the table, of every output all rows together; empty if there is only one output."""
    if len(report.outputs) < 2:
        return []
    head = ("output", "largest value", f"{error_kind(report.time)} at most", "scope", "next step")
    scope = widest_scope(report.scope) + (f", {NOT_CERTIFIED}" if is_uncertified(report) else "")
    return [head, *((out.name, *_verdict(report, out), scope, _next(report, out)) for out in report.outputs.values())]


def aligned(rows: list[tuple[str, ...]]) -> list[str]:
    """Return lines of text whose columns begin below each other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def _verdict(report: ReportData, out: OutputData) -> tuple[str, str]:
    """The largest value, and the largest bound with what it holds under: nothing else is said "at most"."""
    largest, most, unit = np.max(np.abs(out.value)), np.max(out.bound["best"]), out.unit
    if judged(out) == "round-off":
        said = f"{rounded_up(np.max(out.bound['best'] + out.round_off), 1)} {unit}, at round-off{under(report.scope)}"
    elif np.isfinite(most):
        share = (percent(most / largest) or " (> 1000 %)") if largest > 0 else ""
        said = f"{rounded_up(most)} {unit}{share}{under(report.scope)}"
    else:
        said = "not bounded"
    return f"{largest:.4g} {unit}", said


def _next(report: ReportData, out: OutputData) -> str:
    if not advises(report):
        return "see the messages"
    found = judged(out)
    return f"enough{under(report.scope)}" if found == "enough" else STEPS[found]
