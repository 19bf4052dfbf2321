"""Verdicts and advice in words: how large an output is, how wrong at most, under what condition, what to do."""

from __future__ import annotations

from math import floor, log10
from typing import TYPE_CHECKING

import numpy as np

from .scope import COUPLED, COVERS, FROZEN, FULL_MODEL, NOT_CERTIFIED, PAGE, SCOPES

if TYPE_CHECKING:
    from .data import OutputData, ReportData

CURES_OF_CAUSES = {
    "basis": "basis: add modes",
    "interfaces": "rigid (RBE2) interfaces, not from the number of modes: take RBE3 modes, or "
    "floating_body(..., interfaces='rigid') if they are rigid in reality",
    "time step": "step size, not the basis: halve it",
    "initial": "initial error: start from equilibrium, or add modes that hold the initial state",
    "jumps": "load jumps: add modes, or let the load grow over a short time",
}
STEPS = {  # in two words, for a table
    "basis": "add modes",
    "interfaces": "take RBE3 modes, or interfaces='rigid'",
    "time step": "halve the step",
    "initial": "start from equilibrium, or add modes",
    "jumps": "let loads grow, or add modes",
    "round-off": "nothing to improve",
    "zero": "nothing to improve",
    "infinite": "see the reasons",
}
ENOUGH = 1e-3  # of the largest value: nobody needs less who asked for no tolerance
AS_IN_THIS_RUN = "under the frame motion, loads and joint forces of this run"  # a bound with frozen inputs holds so
NOT_THE_MECHANISM = "the mechanism's answer is not covered and may be several times larger"
SHORT = {COUPLED: ", to first order", FROZEN: ", inputs frozen"}


def rounded_up(x: float, digits: int = 3) -> str:
    """Return x >= 0 in so many digits, rounded up: printing must not make a bound smaller."""
    text = f"{x:.{digits}g}"
    if float(text) >= x:
        return text
    return f"{float(text) + 10.0 ** (floor(log10(x)) - digits + 1):.{digits}g}"


def widest_scope(scope: dict[str, str]) -> str:
    """Return the scope that covers most; that of bound["best"]."""
    return min(scope.values(), key=SCOPES.index)


def widest(scope: dict[str, str]) -> list[str]:
    """Return the estimators whose scope covers most."""
    return [e for e in scope if scope[e] == widest_scope(scope)]


def under(scope: dict[str, str], e: str = "best") -> str:
    """Return what must be said with a bound, in two words: nothing where the scope is complete."""
    return SHORT.get(widest_scope(scope) if e == "best" else scope[e], "")


def corrected_within(out: OutputData, bound: np.ndarray, scope: dict[str, str]) -> str:
    """Return in words how far the corrected output is from the full model: "within ..." only if the scope says so."""
    if not np.isfinite(bound).all():
        return "how far the corrected output is from the full model is not known at all instants"
    left, widest = f"{rounded_up(np.max(bound))} {out.unit}", widest_scope(scope)
    if widest == FROZEN:
        return f"{AS_IN_THIS_RUN} the corrected output is within {left} of the full body"
    return f"{'to first order ' if widest == COUPLED else ''}the corrected output is within {left} of the full model"


def error_kind(time: str) -> str:
    """Return what the bounds bound."""
    return "reduction error" if time == "sampled" else "error"


def instant(time: str, t: float) -> str:
    """Return in words where in a run, or in a static solve, something is."""
    return f"load factor {t:.4g}" if time == "static" else f"t = {t:.4g} s"


def scope_lines(report: ReportData) -> list[str]:
    """Return what the bounds cover and where that is explained, and which full model is the truth."""
    scope = widest_scope(report.scope)
    time = {"reconstructed": "" if scope == COUPLED else ", time steps too", "sampled": ", no time steps"}
    lines = [f"scope: {scope}: {COVERS[scope]}{time.get(report.time, '')}; {PAGE}"]
    _, known, model = report.scope_reason.partition(f"{FULL_MODEL}: ")
    return lines + ([f"full model: {model}"] if known else [])


def is_uncertified(report: ReportData) -> bool:
    """Return whether the balance of the run speaks against all of its bounds."""
    return report.scope_reason.endswith(NOT_CERTIFIED)


def row_verdict(out: OutputData, row: int, time: str, scope: dict[str, str]) -> str:
    """Return one line of the summary: largest value, bound at the worst instant, the estimator that gave it."""
    kind, covers = error_kind(time), widest_scope(scope)
    by = f"by '{best_estimator(out, row, scope)}'"
    text = f"{out.row_names[row]}: up to {_largest(out.value, row):.4g} {out.unit}"
    if not np.isfinite(_largest(out.bound["best"], row)):
        return f"{text}, {kind} not bounded{_where_finite(out, row, scope)}"
    bound = f"at most {_wrong_by(out, row)}, {by}"
    if at_round_off(out)[row]:
        bound = f"at round-off: at most {_floor(out, row)}, {by} and by rounding of the input"
    if covers == FROZEN:
        return f"{text}; {AS_IN_THIS_RUN} the {kind} is {bound} ({NOT_THE_MECHANISM})"
    return f"{text}, {kind}{under(scope)}{', ' if covers == COUPLED else ' '}{bound}"


def advises(report: ReportData) -> bool:
    """Return whether the report gives advice: not if no bound is certified, or of a run's first instant only."""
    return not is_uncertified(report) and (report.time == "static" or len(report.t) > 1)


def sentence(out: OutputData, row: int, time: str, scope: dict[str, str], advised: bool = True) -> str:
    """Return the verdict on one row of an output as a sentence that can stand alone, with advice or without."""
    todo = advice(out, time, scope, row) if advised else ""
    text = f"{out.row_names[row]} is up to {_largest(out.value, row):.4g} {out.unit}"
    if not np.isfinite(_largest(out.bound["best"], row)):
        return f"{text}; how wrong it may be is not known{_where_finite(out, row, scope)}{todo and f': {todo}'}."
    covers = widest_scope(scope)
    if covers == FROZEN:
        text = f"{text}; {AS_IN_THIS_RUN} it is"
    else:
        text = f"{text},{' to first order' if covers == COUPLED else ''}"
    left_out = [
        NOT_THE_MECHANISM if covers == FROZEN else "",
        "time integration not covered" if time == "sampled" else "",
    ]
    only = f" ({'; '.join(filter(None, left_out))})" if any(left_out) else ""
    if at_round_off(out)[row]:
        return f"{text} wrong by at most {_floor(out, row)}{only}, which is round-off{todo and f': {todo}'}."
    return f"{text} wrong by at most {_wrong_by(out, row)}{only}{todo and f', {todo}'}."


def best_estimator(out: OutputData, row: int, scope: dict[str, str]) -> str:
    """Return the estimator with the smallest bound, of those whose scope covers most."""
    return min(widest(scope), key=lambda e: _largest(out.bound[e], row))


def at_round_off(out: OutputData) -> np.ndarray:
    """Return for each row (r,) whether the largest bound is below twice what rounding of the input may move."""
    return np.max(out.bound["best"], axis=0, initial=0.0) < 2 * np.max(out.round_off, axis=0, initial=0.0)


def permitted(out: OutputData) -> tuple[float, str]:
    """Return the bound that is enough, and in words: the tolerance, or ENOUGH of the largest value of all rows.

    A position is measured by how far it moves: where a body is says nothing about how much it deforms. Of an output
    that stays zero no bound is enough unless a tolerance says so.
    """
    if out.tolerance is not None:
        return out.tolerance, f"the tolerance of {out.tolerance:g} {out.unit}"
    moves = out.of == "position"
    largest = np.max(np.ptp(out.value, axis=0) if moves else np.abs(out.value), initial=0.0)
    of_all = f" of {out.name}" if out.value.shape[1] > 1 else ""
    return ENOUGH * largest, f"{100 * ENOUGH:g} % of the largest {'change' if moves else 'value'}{of_all}"


def judged(out: OutputData, row: int | None = None) -> str:
    """Return what the bound is at its worst instant, of all rows or of one: a key of STEPS, or "enough"."""
    rows = slice(None) if row is None else slice(row, row + 1)
    bound, at = out.bound["best"][:, rows], _worst(out, rows)
    if at_round_off(out)[rows][at[1]]:
        return "round-off"
    if not 0 < bound[at] < np.inf:
        return "zero" if bound[at] == 0 else "infinite"
    if np.max(bound + out.round_off[:, rows]) <= permitted(out)[0]:
        return "enough"
    return max(out.causes, key=lambda cause: out.causes[cause][:, rows][at])


def advice(out: OutputData, time: str, scope: dict[str, str], row: int | None = None) -> str:
    """Return what dominates the bound at its worst instant and what to do, or "enough"; of all rows, or of one."""
    rows, found = slice(None) if row is None else slice(row, row + 1), judged(out, row)
    if found == "round-off":
        return "nothing to improve: more modes or shorter steps do not show above rounding of the input"
    if found in ("zero", "infinite"):
        return "nothing to improve" if found == "zero" else "no finite bound: the messages or reasons say why"
    if found == "enough":
        return f"enough{under(scope)}: the bound of the {error_kind(time)} is within {permitted(out)[1]}"
    bound, cause, at = out.bound["best"][:, rows], out.causes[found][:, rows], _worst(out, rows)
    rest = np.max(bound - cause)
    left = f"; the rest alone bounds it by {rounded_up(rest)} {out.unit}" if rest > 0 else ""
    share = cause[at] / sum(x[:, rows][at] for x in out.causes.values())
    return f"{100 * share:.0f} % of it from the {CURES_OF_CAUSES[found]}{left}"


def percent(share: float) -> str:
    """Return a share in %, in two digits, never as 1.4e+02; nothing where a percentage says nothing any more."""
    return f" ({float(f'{100 * share:.2g}'):g} %)" if share <= 10 else ""


def outside(out: OutputData, row: int) -> str:
    """Return in words that the truth compared is farther away than bound and rounding allow; empty if it is not."""
    allowed = out.bound["best"][:, row] + out.round_off[:, row]
    count = np.count_nonzero(np.abs(out.error[:, row]) > allowed)
    where = f"at {count} instants the true error of {out.row_names[row]} is above the bound"
    return f"{where}: that truth is not the full model's, or the bound fails" if count else ""


def _worst(out: OutputData, rows: slice) -> tuple:
    bound = out.bound["best"][:, rows]
    return np.unravel_index(np.argmax(bound), bound.shape)


def _largest(x: np.ndarray, row: int) -> float:
    return np.max(np.abs(x[:, row]), initial=0.0)


def _where_finite(out: OutputData, row: int, scope: dict[str, str]) -> str:
    """What is known where an infinite bound is still finite."""
    bound = out.bound["best"][:, row]
    known = bound[np.isfinite(bound)]
    if not known.any():
        return ""
    most = f"at most {rounded_up(known.max())} {out.unit}"
    return f" at {len(bound) - len(known)} instants; at the others{under(scope)}{',' if under(scope) else ''} {most}"


def _wrong_by(out: OutputData, row: int) -> str:
    largest, bound = _largest(out.value, row), _largest(out.bound["best"], row)
    share = percent(bound / largest) if largest > 0 and np.isfinite(bound) else ""
    vain = ", not informative: more than the output itself" if bound > largest > 0 else ""
    return f"{rounded_up(bound)} {out.unit}{share}{vain}"


def _floor(out: OutputData, row: int) -> str:
    return f"{rounded_up(_largest(out.bound['best'], row) + _largest(out.round_off, row), 1)} {out.unit}"
