"""Verdicts in words: how large an output is, how wrong about and at most, and under what condition."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..estimates.estimate import RESOLVED
from ..estimates.kept_estimate import LINEAR
from .advice import advice, until_its_end
from .estimate_wording import about, estimate_scope, estimated_kind, known
from .scope import COUPLED, FROZEN, SMOOTHLY, cures_of
from .wording import (
    AS_IN_THIS_RUN,
    MORE_VECTORS,
    NOT_LINEAR,
    NOT_THE_MECHANISM,
    STEPS,
    at_most,
    at_round_off,
    best_estimator,
    digits,
    error_kind,
    largest,
    percent,
    rounded_up,
    under,
    widest_scope,
)

if TYPE_CHECKING:
    from .data import OutputData


def row_verdict(out: OutputData, row: int, time: str, scope: dict[str, str], is_first: bool = True) -> str:
    """Return one line of the summary: largest value, estimate, bound at the worst instant, whose bound that is.

    is_first : of lines below each other; the others say in two words what inputs that are frozen mean, and not again
        why bounds are not certified.
    """
    by = f", by '{best_estimator(out, row, scope)}'"
    size = f"{digits(largest(out.value, row), 4)} {out.unit}"
    return f"{out.row_names[row]}: up to {size}{_error(out, row, time, scope, by, is_first)}"


def sentence(
    out: OutputData,
    row: int,
    time: str,
    scope: dict[str, str],
    advised: bool = True,
    planned_end: float | None = None,
) -> str:
    """Return the verdict on one row of an output as a sentence that can stand alone, with advice or without."""
    todo = until_its_end(planned_end, advice(out, time, scope, row)) if advised else cures_of(out.uncertified)
    size = f"{digits(largest(out.value, row), 4)} {out.unit}"
    return f"{out.row_names[row]} is up to {size}{_error(out, row, time, scope)}{todo and f'; {todo}'}."


def _error(out: OutputData, row: int, time: str, scope: dict[str, str], by: str = "", is_first: bool = True) -> str:
    """Estimate and bound, each with what it is of and what it holds under: said once where that is the same."""
    found, kind, covers = known(out, row), error_kind(time), widest_scope(scope)
    bounded = _bounded(out, row, scope, by, found is None, is_first)
    is_bounded = np.isfinite(largest(out.bound["best"], row))
    bound_holds_under = covers if is_bounded else ""
    if found is None or (found.is_at_round_off and at_round_off(out)[row]):
        return _bound_alone(kind, bounded, bound_holds_under, ", ", is_first)
    estimate, of, is_frozen = about(out, found), estimated_kind(out, time), estimate_scope(out, scope) == FROZEN
    if of != kind or is_frozen != (covers == FROZEN):
        bound = _bound_alone(kind, bounded, bound_holds_under, "; ", is_first)
        return _estimate_alone(of, estimate, is_frozen, is_first) + bound
    if not is_bounded:
        return f"{_estimate_alone(of, estimate, is_frozen, is_first)}, {bounded}"
    if is_frozen:
        return _for_run_alone(kind, f"{estimate}, {bounded}", is_first)
    return f", {kind} {estimate}, {'to first order ' if covers == COUPLED else ''}{bounded}"


def _for_run_alone(kind: str, said: str, is_first: bool) -> str:
    if is_first:
        return f"; {AS_IN_THIS_RUN} the {kind} is {said} ({NOT_THE_MECHANISM})"
    return f"; inputs frozen, the {kind} is {said}"


def _estimate_alone(kind: str, estimate: str, is_frozen: bool, is_first: bool) -> str:
    return _for_run_alone(kind, estimate, is_first) if is_frozen else f", {kind} {estimate}"


def _bound_alone(kind: str, bounded: str, covers: str, begin: str, is_first: bool) -> str:
    """What is not bounded holds under nothing: covers is empty."""
    if covers == FROZEN:
        return _for_run_alone(kind, bounded, is_first)
    return f"{begin}{kind}{', to first order, ' if covers == COUPLED else ' '}{bounded}"


def _bounded(out: OutputData, row: int, scope: dict[str, str], by: str, with_share: bool, is_first: bool) -> str:
    """The largest bound; its share of the output only where no estimate has one."""
    if not np.isfinite(largest(out.bound["best"], row)):
        return f"not bounded{_where_finite(out, row, scope, is_first)}"
    if at_round_off(out)[row]:
        floor = rounded_up(largest(out.bound["best"], row) + largest(out.round_off, row), 1)
        rounding = f"{by} and by rounding of the input" if by else ", rounding of the input included"
        return f"at round-off: {at_most(out, f'{floor} {out.unit}', in_full=is_first)}{rounding}"
    size, bound = largest(out.value, row), largest(out.bound["best"], row)
    share = percent(bound / size) if with_share and size > 0 else ""
    vain = f", not informative: more than the output itself{_why(out, row, scope)}" if bound > size > 0 else ""
    return f"{at_most(out, f'{rounded_up(bound)} {out.unit}', share, is_first)}{vain}{by}"


def _why(out: OutputData, row: int, scope: dict[str, str]) -> str:
    """Why the bound is larger than the output where auxiliary vectors lower it, and what to do."""
    found, size = known(out, row), largest(out.value, row)
    if found is None or widest_scope(scope) != COUPLED or out.uncertified:
        return ""
    if not found.is_resolved and found.rings:
        return ""  # the estimate's cure, a few words before, is the bound's, too
    (error, cause), is_about = found.of_modes, "is about" if found.is_resolved else "may be"
    if error > RESOLVED * size:
        share = percent(error / size)
        return f", for the error itself {is_about} {f'{share} of it' if share else 'larger'}: {STEPS[cause]}"
    if not found.is_resolved and found.check == LINEAR:
        return f", {NOT_LINEAR}: {STEPS[cause]}"
    return f", for auxiliary vectors leave much: {SMOOTHLY if found.rings else MORE_VECTORS}"


def _where_finite(out: OutputData, row: int, scope: dict[str, str], is_first: bool) -> str:
    """What is known where an infinite bound is still finite."""
    bound = out.bound["best"][:, row]
    finite = bound[np.isfinite(bound)]
    if not finite.any():
        return ""
    most = at_most(out, f"{rounded_up(finite.max())} {out.unit}", in_full=is_first)
    return f" at {len(bound) - len(finite)} instants; at the others{under(scope)}{',' if under(scope) else ''} {most}"
