"""The table at the head of a report of several outputs: a line for each, with its verdict and the next step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .advice import advice, by_bound, holds_for_run_alone, judged, next_step, until_its_end
from .estimate_wording import about_all, estimated_kind, estimated_under
from .scope import ATTACH_ALL, NOT_CERTIFIED, UNATTACHED, cures_of
from .wording import (
    CURES_OF_CAUSES,
    ENOUGH,
    RINGS,
    advises,
    digits,
    error_kind,
    listed,
    not_certified,
    percent,
    permitted,
    rounded_up,
    under,
    widest_scope,
)

if TYPE_CHECKING:
    from .data import OutputData, ReportData

NO_BOUND = "not bounded"


def overview(report: ReportData) -> list[tuple[str, ...]]:
    """Return head and lines of the table, of every output all rows together; empty if there is only one output."""
    if len(report.outputs) < 2:
        return []
    head = ("output", "largest value", *_heads(report), "scope", "next step")
    return [head, *(_line(report, out, len(head)) for out in report.outputs.values())]


def short_table(report: ReportData) -> list[tuple[str, ...]]:
    """Return the table without scope and next step; what all of a column hold under is in its head."""
    columns = [list(column) for column in zip(*(line[:-2] for line in overview(report)), strict=True)]
    outputs = report.outputs.values()
    conditions = {estimated_under(out, report.scope) for out in outputs}
    conditions |= {under(report.scope, doubts=out.uncertified) for out in outputs}
    for column in columns[2:]:
        said = [cell for cell in column[1:] if cell != "not known" and not cell.startswith(NO_BOUND)]
        common = max(
            (end for end in conditions if said and all(cell.endswith(end) for cell in said)), key=len, default=""
        )
        column[:] = [column[0] + common, *(cell.removesuffix(common) for cell in column[1:])]
    return list(zip(*columns, strict=True))


def next_steps(report: ReportData) -> list[str]:
    """Return what helps most, a line for outputs that share it."""
    shared: dict[str, list[str]] = {}
    for out in report.outputs.values():
        shared.setdefault(_what_to_do(report, out), []).append(out.name)
    if len(shared) == 1:
        return [f"next step: {todo}" for todo in shared]
    return [f"next step, {listed(names)}: {todo}" for todo, names in shared.items()]


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
    largest = np.max(np.abs(out.value))
    return (
        out.name,
        f"{digits(largest, 4)} {out.unit}",
        *estimate,
        _at_most(report, out, largest),
        scope,
        until_its_end(report.planned_end, _step(report, out)),
    )


def _what_to_do(report: ReportData, out: OutputData) -> str:
    """The next step with its reason; that a tolerance stopped the run."""
    if out.uncertified:
        return f"{cures_of(out.uncertified)} ({not_certified(out.uncertified)})"
    if out.stopped is not None:
        return advice(out, report.time, report.scope)
    step = _step(report, out)
    if "enough" in step:
        of_its_size = f"{100 * ENOUGH:g} % of the largest {'change' if out.of == 'position' else 'value'}"
        return until_its_end(
            report.planned_end, f"{step}: within {of_its_size if out.tolerance is None else permitted(out)[1]}"
        )
    if step not in next_step(out, report.time, report.scope):  # of the run, not of this output
        return step
    cause = judged(out, report.time, report.scope)
    if cause not in CURES_OF_CAUSES or holds_for_run_alone(out, report.scope, cause):
        return next_step(out, report.time, report.scope)
    return f"{next_step(out, report.time, report.scope)}, for {cause!r} makes most of the error"


def _step(report: ReportData, out: OutputData) -> str:
    return _next_step(report, out) if out.uncertified or advises(report) else "see the messages"


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
        lost = np.count_nonzero(np.isinf(out.bound["best"]).any(axis=1))
        return NO_BOUND if lost == len(report.t) else f"{NO_BOUND} at {lost} instants"
    share = (percent(most / largest) or "> 1000 %") if largest > 0 else ""
    return f"{rounded_up(most)} {out.unit}{share and f' ({share})'}{condition}"
