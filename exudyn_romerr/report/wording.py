"""Words that verdicts, advice, files and pictures share: causes and cures, scopes, numbers, what is enough."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import floor, log10

import numpy as np

from ..errors import InputError
from .data import OutputReport, ReportData
from .scope import (
    COMPLETE,
    COUPLED,
    COVERS,
    FROZEN,
    FULL_MODEL,
    NOT_CERTIFIED,
    PAGE,
    SCOPES,
    Doubt,
    causes_of,
    remedies,
    with_doubts,
)

NAMES = 8  # of outputs or rows of which the same is said
LONGEST = 1e4  # numbers below it are written without an exponent
AS_IN_THIS_RUN = "under the frame motion, loads and joint forces of this run"  # a bound with frozen inputs holds so
NOT_THE_MECHANISM = (
    "what joints and controllers do with other steps or modes is not covered and may be many times larger"
)
FROZEN_FIRST = (
    "only the error under the forces, controller actions and frame motion of this run. What joints and controllers "
    "(PreStep functions) do differently with other steps or modes is not in it, and may be many times larger. To "
    "measure it, type: romerr verify your_script.py"
)
REMAINDER = "linear equations leave out about {} % of the deformation that {!r} predicts, as measured"
NO_OUTPUTS = (
    "no outputs: only the body's position as a whole is bounded, and not at a point. Pass "
    "outputs=[romerr.node_displacement('tip', node=..., component='z')], or add sensors of displacement, position or "
    "velocity on mesh nodes to a body in a floating frame"
)
SAMPLED = (
    "reduction error at sampled residuals; the error of the time integration is not covered, nor what the residual "
    "does between the samples"
)
MEASURE_IT = "romerr verify your_script.py measures the whole error"
NOT_AT_NODES = (
    "the error of this body is as large as its deformation: what it is at nodes is not known. " + MEASURE_IT
)
SHORT = {COUPLED: ", to first order", FROZEN: ", inputs frozen"}


def listed(names: list[str]) -> str:
    """Return names with commas; more than NAMES are counted."""
    return ", ".join(names[:NAMES]) + (f" and {len(names) - NAMES} more" if names[NAMES:] else "")


def digits(x: float, count: int = 3) -> str:
    """Return x in so many digits, below 1e4 without an exponent: 310 where Python's format says 3.1e+02."""
    text = f"{x:.{count}g}"
    return f"{float(text):g}" if "e+" in text and abs(float(text)) < LONGEST else text


def rounded_up(x: float, count: int = 3) -> str:
    """Return x >= 0 in so many digits, rounded up: printing must not make a bound smaller."""
    text = digits(x, count)
    return text if float(text) >= x else digits(float(text) + 10.0 ** (floor(log10(x)) - count + 1), count)


def rounded_down(x: float) -> str:
    """Return x >= 0 in three digits, rounded down: printing must not make more of what is proved."""
    text = digits(x)
    return text if float(text) <= x else digits(x - 0.5 * 10.0 ** (floor(log10(x)) - 2))


def with_unit(number: str, unit: str) -> str:
    """Return a number with its unit, if that is known."""
    return f"{number} {unit}" if unit else number


def axis_label(what: str, unit: str) -> str:
    """Return what an axis of a picture shows, with its unit, if that is known."""
    return f"{what} / {unit}" if unit else what


def percent(share: float) -> str:
    """Return a share in %, in two digits, never as 1.4e+02; nothing where a percentage says nothing any more."""
    return f"{float(f'{100 * share:.2g}'):g} %" if share <= 10 else ""


def widest_scope(scope: dict[str, str]) -> str:
    """Return the scope that covers most; that of bound["best"]."""
    return min(scope.values(), key=SCOPES.index)


def widest(scope: dict[str, str]) -> list[str]:
    """Return the estimators whose scope covers most."""
    return [e for e in scope if scope[e] == widest_scope(scope)]


def sharpest_at_nodes(report: ReportData) -> str:
    """Return, of the estimators whose scope covers most, the one whose largest bound at a node is smallest.

    Where there are no bounds: the one that has an estimate; InputError if that is not known either.
    """
    nodes = report.at_nodes()
    known = [e for e in widest(report.scope) if e in nodes.bound] or [*nodes.estimate]
    if not known:
        raise InputError(NOT_AT_NODES)
    return min(known, key=lambda e: np.max(nodes.bound.get(e, np.inf)))


def under(scope: dict[str, str], e: str = "best", doubts: Iterable[Doubt] = ()) -> str:
    """Return what must be said with a bound, in few words: nothing where the scope is complete, without doubts."""
    condition = SHORT.get(widest_scope(scope) if e == "best" else scope[e], "")
    return f"{condition}, {NOT_CERTIFIED}" if doubts else condition


def for_run_alone(scope: dict[str, str]) -> str:
    """Return that bounds leave out the mechanism's answer; empty: they do not."""
    return f"{AS_IN_THIS_RUN}; {NOT_THE_MECHANISM}" if widest_scope(scope) == FROZEN else ""


def at_most(out: OutputReport, bound: str) -> str:
    """Return the largest bound of an output in words, with why it is not certified: "at most" is said if it is."""
    why = not_certified(out.uncertified)
    return f"bounded by {bound} ({why})" if why else f"at most {bound}"


def not_certified(doubts: Iterable[Doubt]) -> str:
    """Return in words that bounds are not certified, and why; empty: they are."""
    causes = causes_of(doubts)
    return causes and f"{NOT_CERTIFIED}: {causes}"


def largest(x: np.ndarray) -> float:
    """Return the largest absolute value; 0 of nothing."""
    return float(np.max(np.abs(x), initial=0.0))


def corrected_within(out: OutputReport, scope: dict[str, str]) -> str:
    """Return in words how far the corrected output is from the full model: "within ..." only if the scope says so."""
    if not np.isfinite(out.corrected_bound).all():
        return "how far the corrected output is from the full model is not known at all instants"
    under_what, model = {
        FROZEN: (f"{AS_IN_THIS_RUN} ", "full body"),
        COUPLED: ("to first order ", "full model with the same time steps"),
        COMPLETE: ("", "full model"),
    }[widest_scope(scope)]
    left = with_unit(rounded_up(np.max(out.corrected_bound)), out.unit)
    doubt = f" ({NOT_CERTIFIED})" if out.uncertified else ""
    return f"{under_what}the corrected output is within {left} of the {model}{doubt}"


def error_kind(time: str) -> str:
    """Return what the bounds bound."""
    return "reduction error" if time == "sampled" else "error"


def instant(time: str, t: float) -> str:
    """Return in words where in a run, or in a static solve, something is."""
    return f"load factor {t:.4g}" if time == "static" else f"t = {t:.4g} s"


def estimator_lines(report: ReportData) -> list[str]:
    """Return a line for each estimator: its scope, the error of the whole body, what it assumes; then scope_lines."""
    if report.bodies:
        return [line for i, body in enumerate(report.bodies) for line in (f"  bodies[{i}]:", *estimator_lines(body))]
    divisor, what, unit = 1.0, "error in the mass norm", ""
    if report.total_mass is not None:
        divisor, what = np.sqrt(report.total_mass), "mass-weighted RMS error of position"
        unit = " in the model's unit of length"
    return [
        f"  {e:<13} scope {report.scope[e]}; {what}{under(report.scope, e, report.uncertified)} <= "
        f"{rounded_up(np.max(bound) / divisor)}{unit}; {report.reasons[e]}"
        for e, bound in report.position_bound.items()
    ] + [f"  {line}" for line in scope_lines(report)]


def shared_lines(report: ReportData) -> list[str]:
    """Return what is said of the bounds of all outputs: of a mechanism what all bodies share once."""
    if report.position_bound:
        return estimator_lines(report)
    return [f"  {line}" for line in assumed_lines(report)]


def assumed_lines(report: ReportData) -> list[str]:
    """Return what each estimator assumes, then scope_lines, of a mechanism what all bodies share once."""
    assumed = [f"{e}: {reason}" for e, reason in report.reasons.items()]
    return [*assumed, *numbered([scope_lines(one) for one in report.bodies or (report,)])]


def numbered(lines: Sequence[Sequence[str]]) -> list[str]:
    """Return lines that are those of all bodies once, others with the number of their body."""
    shared = [line for line in dict.fromkeys(lines[0]) if all(line in of for of in lines)]
    return shared + [f"bodies[{i}]: {line}" for i, of in enumerate(lines) for line in of if line not in shared]


def scope_lines(report: ReportData) -> list[str]:
    """Return what the bounds cover and where that is explained, the full model that is the truth, the remainder."""
    scope = widest_scope(report.scope)
    # with frozen inputs those of the body are in it, but not what joints and controllers do with other steps
    time = {"reconstructed": ", time steps too" if scope == COMPLETE else "", "sampled": ", no time steps"}
    lines = [f"scope: {scope}: {COVERS[scope]}{time.get(report.time, '')}; {PAGE}"]
    reason = report.scope_reason.removesuffix(with_doubts("", report.uncertified)).removesuffix("; ")
    _, known, model = reason.partition(f"{FULL_MODEL}: ")
    lines += [f"full model: {model}"] if known else []
    lines += [f"{NOT_CERTIFIED}: {remedy}" for remedy in remedies(report.uncertified)]
    return lines + [REMAINDER.format(digits(100 * share, 2), e) for e, share in report.remainder.items()]


def outside(out: OutputReport, row: int, time: str) -> str:
    """Return in words that the truth compared is farther away than bound and rounding allow; empty if it is not."""
    allowed = out.bound["best"][:, row] + out.round_off[:, row]
    count = np.count_nonzero(np.abs(out.error[:, row]) > allowed)
    where = f"at {count} instants the true error of {out.row_names[row]} is above the bound"
    if out.uncertified:
        where += f" ({not_certified(out.uncertified)})"
    steps = "the time steps, which it leaves out, make that, " if time == "sampled" else ""
    return f"{where}: {steps}that truth is not the full model's, or the bound fails" if count else ""


def is_known(out: OutputReport) -> bool:
    """Return whether there is an estimate of all rows at every instant."""
    return out.estimate is not None and bool(np.isfinite(out.estimate).all())


def parts_of(out: OutputReport) -> dict[str, np.ndarray]:
    """Return the estimate by cause; rigid interfaces that it does not tell from missing modes as the bound does."""
    parts, zero = dict(out.estimate_parts), np.zeros_like(out.estimate)
    stiff, modes = (out.causes.get(cause, zero) for cause in ("interfaces", "basis"))
    if np.any(parts.get("interfaces", zero)) or not np.any(stiff):
        return parts
    share = np.divide(stiff, stiff + modes, out=zero, where=(stiff > 0) & np.isfinite(modes))
    return {**parts, "basis": (1 - share) * parts["basis"], "interfaces": share * parts["basis"]}


def covers_time(out: OutputReport, time: str) -> bool:
    """Return whether the estimate has the error of the time steps in it, which sampled bounds have not."""
    return time != "sampled" or bool(np.any(out.estimate_parts.get("time step", 0.0)))


def estimated_kind(out: OutputReport, time: str) -> str:
    """Return what the estimate is an estimate of."""
    return "error" if covers_time(out, time) else error_kind(time)


def estimate_scope(out: OutputReport, scope: dict[str, str]) -> str:
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


def off_by(out: OutputReport) -> str:
    """Return in words how far the estimate is from the true error that was compared.

    A truth with the same time steps has nothing of their error: then of the estimate without it, too.
    """
    off, without = (largest(out.error - out.estimate + x) for x in (0.0, out.estimate_parts.get("time step", 0.0)))
    said, other = (_share_of_it(x, largest(out.error), out.unit) for x in (off, without))
    beside = f", without its time steps by {other}" if without < off else ""
    return f"the estimate is off by up to {said}{beside}"


def _share_of_it(x: float, of: float, unit: str) -> str:
    share = (percent(x / of) or "more than 1000 %") if of > 0 else ""
    return f"{with_unit(digits(x, 2), unit)}{share and f' ({share} of it)'}"
