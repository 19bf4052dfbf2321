"""Advice: what to do next, from what the parts of the estimate say; where there is none, from those of the bound."""

from __future__ import annotations

from math import ceil, sqrt
from typing import TYPE_CHECKING

import numpy as np

from .estimate_wording import covers_more, estimate_scope, estimated_kind, is_enough, known, rest
from .scope import FROZEN, cures_of
from .wording import (
    CURES_OF_CAUSES,
    MEASURE_IT,
    MORE_VECTORS,
    STEPS,
    at_round_off,
    digits,
    error_kind,
    instant,
    not_certified,
    percent,
    permitted,
    rounded_up,
    under,
    widest_scope,
)

if TYPE_CHECKING:
    from .data import OutputData
    from .estimate_wording import Known

HALVED = 4.0  # times smaller errors of steps half as long
FAR = 3.0  # times the estimate with its half width: below it both say much the same, and modes lower both
ABOUT_ENOUGH, NOT_RESOLVED = "about enough", "not resolved"
RUN_ON = "run on without tolerance="
RUN_TO_END = "let it run to its end; the messages say what ended it, where that is known"
NO_BOUND = "no finite bound: the messages or reasons say why"


def judged(out: OutputData, time: str, scope: dict[str, str], row: int | None = None) -> str:
    """Return what is to be done about one row, or all: a key of STEPS, "enough", ABOUT_ENOUGH or NOT_RESOLVED."""
    found = known(out, row)
    if found is None:
        return by_bound(out, row) or _largest_cause(out, row)
    bounded = None if covers_more(out, time, scope) else by_bound(out, row)
    if bounded not in (None, "infinite"):
        return bounded
    if found.is_at_round_off or is_enough(out, found):
        return ABOUT_ENOUGH
    return max(found.parts, key=found.parts.get) if found.is_resolved else NOT_RESOLVED


def next_step(out: OutputData, time: str, scope: dict[str, str]) -> str:
    """Return in a few words, for a table, what to do about an output."""
    if out.stopped is not None:
        return _lowers_bound(out, None) or RUN_ON
    verdict, found = judged(out, time, scope), known(out)
    if holds_for_run_alone(out, scope, verdict):
        return MEASURE_IT
    if verdict == "enough":
        return f"enough{under(scope)}"
    if verdict == ABOUT_ENOUGH:
        by = "a smooth start" if found.rings else "more vectors"
        sharper = f"; {by} for the bound" if _slack(out, time, scope, None) else ""
        return f"{verdict}{sharper}"
    if verdict == NOT_RESOLVED:
        return found.cure
    return (found and _shorter_steps(out, verdict, None, found)) or STEPS[verdict]


def advice(out: OutputData, time: str, scope: dict[str, str], row: int | None = None) -> str:
    """Return what makes most of the error and what to do, or "enough"; of all rows, or of one."""
    if out.uncertified:
        return f"{not_certified(out.uncertified)}: {cures_of(out.uncertified)}"
    if out.stopped is not None:
        return f"{stop(out, time)}: {cure_of_stop(out, row)}"
    verdict, found = judged(out, time, scope, row), known(out, row)
    if holds_for_run_alone(out, scope, verdict):
        return _for_run_alone(out, time, row, verdict)
    if verdict == "round-off":
        return "nothing to improve: more modes or shorter steps do not show above rounding of the input"
    if verdict == "zero":
        return "nothing to improve"
    if verdict == "infinite":
        return NO_BOUND
    if verdict == "enough":
        return f"enough{under(scope)}: the bound of the {error_kind(time)} is within {permitted(out)[1]}"
    if found is None:
        return _of_bound(out, verdict, row)
    if verdict == ABOUT_ENOUGH:
        said = _about_enough(out, time, scope, row)
    elif verdict == NOT_RESOLVED:
        off = percent(found.half / found.size) if found.size > 0 else ""
        said = f"not resolved{off and f', the estimate may be off by {off}'}: {found.cure}"
    else:
        said = _of_estimate(out, verdict, row, found)
    sharper = "" if verdict == NOT_RESOLVED else _slack(out, time, scope, row)
    unbounded = "" if np.isfinite(out.bound["best"][:, _rows(row)]).all() else NO_BOUND
    return "; ".join(filter(None, [said, sharper, unbounded]))


def until_its_end(planned_end: float | None, said: str) -> str:
    """Return advice; of a run that ended before planned_end, that what is enough is so until then."""
    if planned_end is None or not said.startswith(("enough", ABOUT_ENOUGH, "nothing to improve")):
        return said
    return f"until the run ended {said}; {RUN_TO_END}"


def holds_for_run_alone(out: OutputData, scope: dict[str, str], verdict: str) -> bool:
    """Return whether what makes the verdict leaves out what joints and controllers do with other steps or modes.

    That may be many times larger: then nothing is known to be enough, nor what helps most.
    """
    if verdict in ("enough", "round-off", "zero"):
        return widest_scope(scope) == FROZEN
    return estimate_scope(out, scope) == FROZEN


def largest_part(out: OutputData, row: int) -> str:
    """Return what makes most of the error of a row that is too large, and what lowers that."""
    found = known(out, row)
    if found is None or not any(found.parts.values()):
        return _of_bound(out, _largest_cause(out, row), row)
    return _of_estimate(out, max(found.parts, key=found.parts.get), row, found)


def stop(out: OutputData, time: str) -> str:
    """Return in words that a tolerance stopped the run."""
    return f"the run was stopped at {instant(time, out.stopped)} by tolerance="


def cure_of_stop(out: OutputData, row: int | None = None) -> str:
    """Return how to see the rest of a run that a tolerance stopped, and what lowers its bound."""
    lower = _lowers_bound(out, row)
    return f"{RUN_ON}{lower and f', or lower the bound: {lower}'}"


def _lowers_bound(out: OutputData, row: int | None) -> str:
    """What lowers a bound above its tolerance, whatever the estimate says; empty: another output's is above."""
    most = np.max(out.bound["best"])
    if out.tolerance is None or most <= out.tolerance:
        return ""
    cause = "infinite" if most == np.inf else _largest_cause(out, row)
    known_part = 0.0 if out.corrected is None else np.max(np.abs(out.corrected - out.value))
    is_left = cause in ("basis", "interfaces") and most > FAR * known_part  # by vectors, more of which were tried
    return (out.beside_steps or ("more modes",))[0] if is_left else STEPS[cause]


def _of_estimate(out: OutputData, cause: str, row: int | None, found: Known) -> str:
    share, cure = found.parts[cause] / sum(found.parts.values()), CURES_OF_CAUSES[cause]
    if shorter := _shorter_steps(out, cause, row, found):
        cure = f"step size, not the basis: {shorter}"
    return f"{100 * share:.0f} % of it from the {cure}{rest(out, cause, row)}"


def _shorter_steps(out: OutputData, cause: str, row: int | None, found: Known) -> str:
    """Return how much shorter steps a tolerance asks for, whose error falls with their square; empty: half will do.

    Or half is a begin: no tolerance says how far to go, or what else is wrong is above it.
    """
    if cause != "time step" or out.tolerance is None:
        return ""
    left = np.max(np.abs(out.estimate - out.estimate_parts[cause])[:, _rows(row)])
    if left >= out.tolerance or found.parts[cause] <= HALVED * (out.tolerance - left):
        return ""
    return f"take steps {ceil(sqrt(found.parts[cause] / (out.tolerance - left)))} times as short"


def _for_run_alone(out: OutputData, time: str, row: int | None, verdict: str) -> str:
    """What is known under the forces of a run, and what measures the whole."""
    if verdict == "infinite":
        return f"{NO_BOUND}; {MEASURE_IT}"
    found, estimate = known(out, row), f"the estimate of the {estimated_kind(out, time)}"
    if verdict in CURES_OF_CAUSES:
        said = _of_bound(out, verdict, row) if found is None else _of_estimate(out, verdict, row, found)
        return f"under this run's forces {said}; {MEASURE_IT}"
    if verdict == NOT_RESOLVED:
        return f"under this run's forces {estimate} is not resolved: {MEASURE_IT}"
    estimated = verdict == ABOUT_ENOUGH
    of = estimate if estimated else f"the bound of the {error_kind(time)}"
    at_floor = verdict == "round-off" or (estimated and not is_enough(out, found))
    size = "zero" if verdict == "zero" else "at round-off" if at_floor else f"within {permitted(out)[1]}"
    return f"under this run's forces {of} is {size}: {MEASURE_IT}"


def _about_enough(out: OutputData, time: str, scope: dict[str, str], row: int | None) -> str:
    """The estimate is small enough; whether the bound is too, if it is of less."""
    kind, of_bound, (allowed, of) = estimated_kind(out, time), error_kind(time), permitted(out)
    said = f"about enough: the estimate of the {kind} is"
    if not is_enough(out, known(out, row)):
        return f"{said} at round-off"
    bound = np.max((out.bound["best"] + out.round_off)[:, _rows(row)])
    condition = f"{under(scope)}," if under(scope) else ""
    which = f" of the {of_bound}" if kind != of_bound else ""
    too = f", the bound{which}{condition} is {'too' if bound <= allowed else 'not'}" if np.isfinite(bound) else ""
    return f"{said} within {of}{too}"


def _slack(out: OutputData, time: str, scope: dict[str, str], row: int | None) -> str:
    """That the bound is far above the estimate, where both are of the same; empty if it is not, or there is none."""
    found, bound = known(out, row), np.max(out.bound["best"][:, _rows(row)])
    if covers_more(out, time, scope) or not FAR * found.most < bound < np.inf or found.most == 0:
        return ""
    by = "loads that begin smoothly" if found.rings else MORE_VECTORS
    return f"the bound is {digits(bound / found.most, 2)} times the estimate: {by} sharpen it"


def by_bound(out: OutputData, row: int | None = None) -> str | None:
    """Return what the bound alone decides; None: it is finite, and larger than what is enough."""
    rows = _rows(row)
    bound, at = out.bound["best"][:, rows], _worst(out, rows)
    if at_round_off(out)[rows][at[1]]:
        return "round-off"
    if not 0 < bound[at] < np.inf:
        return "zero" if bound[at] == 0 else "infinite"
    return "enough" if np.max(bound + out.round_off[:, rows]) <= permitted(out)[0] else None


def _largest_cause(out: OutputData, row: int | None) -> str:
    rows = _rows(row)
    return max(out.causes, key=lambda cause: out.causes[cause][:, rows][_worst(out, rows)])


def _of_bound(out: OutputData, verdict: str, row: int | None) -> str:
    """The cause that dominates the bound at its worst instant, and what would be left without it."""
    rows = _rows(row)
    bound, cause, at = out.bound["best"][:, rows], out.causes[verdict][:, rows], _worst(out, rows)
    without = np.max(bound - cause)
    left = f"; the rest alone bounds it by {rounded_up(without)} {out.unit}" if without > 0 else ""
    share = cause[at] / sum(x[:, rows][at] for x in out.causes.values())
    return f"{100 * share:.0f} % of it from the {CURES_OF_CAUSES[verdict]}{left}"


def _rows(row: int | None) -> slice:
    return slice(None) if row is None else slice(row, row + 1)


def _worst(out: OutputData, rows: slice) -> tuple:
    bound = out.bound["best"][:, rows]
    return np.unravel_index(np.argmax(bound), bound.shape)
