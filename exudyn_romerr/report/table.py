"""Verdicts as text: what is enough and what is not, then a line for each output, a column for each cause."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from .answers import SHARE, Answer, worst
from .verdicts import CAUSES, MEASURED, NONE, Row
from .wording import digits, listed, percent, rounded_up

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .verdicts import Verdict

TITLES = {"modes": "modes", "interfaces": "rigid interfaces", "step": "step", "start": "start", "sum": "whole error"}
NOT_RIGID = "if the part is not as rigid there as its modes make it: RBE3 modes cure that, no number of modes does"
BESIDE = ("order", "noise", "estimated about")
SHOWN = 0.005  # of a size: a half width below it is not seen in two digits


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return lines of text whose columns begin below each other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def by_sensor(rows: Sequence[Row]) -> list[Row]:
    """Return one row for each sensor and solve: the largest component, and of each cause the worst of all."""
    found: dict[tuple, list[Row]] = {}
    for row in rows:
        found.setdefault((row.solve, row.name), []).append(row)
    return [_merged(of) for of in found.values()]


def _merged(rows: Sequence[Row]) -> Row:
    bounds, noises = [row.bound for row in rows], [row.noise for row in rows if row.noise is not None]
    estimates = [row.estimated for row in rows if row.estimated is not None]
    largest = [row.largest for row in rows if row.largest is not None]
    causes = [cause for cause in (*CAUSES, "sum") if any(cause in row.of for row in rows)]
    return replace(
        rows[0],
        largest=max(largest, default=None),
        of={cause: _worst_of([row.of[cause] for row in rows if cause in row.of]) for cause in causes},
        bound=None if None in bounds else max(bounds),
        order=max(rows, key=lambda row: row.of["step"].most if "step" in row.of else 0.0).order,
        noise=max(noises, default=None),
        estimated=max(estimates, key=lambda verdict: verdict.most, default=None),
        label="",
    )


def _worst_of(verdicts: Sequence[Verdict]) -> Verdict:
    answer = worst(verdict.answer for verdict in verdicts)
    return max((verdict for verdict in verdicts if verdict.answer is answer), key=lambda verdict: verdict.most)


def summary(sensors: Sequence[Row], what: str = "sensor") -> str:
    """Return the sentence that stands first: enough or not, for which cause; what : they are rows of."""
    answer, asked = worst(row.answer for row in sensors), sensors[0].is_asked
    within = "its tolerance" if asked else f"{100 * SHARE:g} % of what the {what} shows"
    if answer is Answer.ENOUGH:
        return f"Enough: the error of every {what} is within {within}."
    causes = [cause for cause in CAUSES if any(cause in row.of and row.of[cause].answer is answer for row in sensors)]
    of = f", by {listed([TITLES[cause] for cause in causes])}" if causes else ""
    names = listed(list(dict.fromkeys(row.name for row in sensors if row.answer is answer)))
    if answer is Answer.TOO_LARGE:
        return f"{'Too large' if asked else f'More than {100 * SHARE:g} %'}{of}: {names}."
    if answer is Answer.NOT_COVERED:
        return f"Not covered by any estimate: {names}."
    return f"Not known whether it is enough{of}: {names}."


def first_sentences(sensors: Sequence[Row]) -> list[str]:
    """Return a sentence for each cause: enough or not, how large, at which sensor, what to do."""
    return [_of_cause(sensors, cause) for cause in CAUSES if any(cause in row.of for row in sensors)]


def _of_cause(sensors: Sequence[Row], cause: str) -> str:
    """The sentence about one cause, told by the worst of all sensors that have a number."""
    title = TITLES[cause].capitalize()
    known = [row for row in sensors if cause in row.of and row.of[cause].size is not None]
    if not known:
        return f"{title}: not known."
    answer = worst(row.of[cause].answer for row in known)
    same = [row for row in known if row.of[cause].answer is answer]
    row = max(same, key=lambda row: row.of[cause].most / (row.largest or 1.0))
    verdict = row.of[cause]
    size = f"{said(verdict, row.unit)}{share_in_brackets(verdict, row.largest)} at {row.name}"
    if cause == "interfaces" and answer is not Answer.ENOUGH:
        return f"{title}: {size}, {NOT_RIGID}."
    todo = f"; {verdict.cure}" if verdict.cure else ""
    return f"{title}: {_word(row, verdict)}, {size}{todo}."


def _word(row: Row, verdict: Verdict) -> str:
    """The answer in a word or two; without a tolerance of the user's nothing is called too large."""
    if verdict.answer is Answer.ENOUGH:
        return "enough"
    if not verdict.is_resolved:
        return "not resolved"
    if verdict.answer is Answer.TOO_LARGE:
        return "too large" if row.is_asked else f"more than {100 * SHARE:g} %"
    return "too close to the tolerance to tell"


def table(sensors: Sequence[Row], what: str = "sensor") -> list[tuple[str, ...]]:
    """Return head and a line for each sensor, or of what they are rows, a column for each cause."""
    causes = [cause for cause in (*CAUSES, "sum") if any(_has_size(row, cause) for row in sensors)]
    with_bound = any(row.bound is not None for row in sensors)
    word = how(sensors)
    scopes = {row.scope for row in sensors if row.bound is not None}
    shared = scopes.pop() if len(scopes) == 1 else ""
    most = [f"at most{shared and f' ({shared})'}"] if with_bound else []
    head = (what, "up to", *(f"{TITLES[cause]} {word}" for cause in causes), *most)
    lines = [head, *(_line(replace(row, scope="" if shared else row.scope), causes, with_bound) for row in sensors)]
    if word != MEASURED:
        return lines
    return [line + beside for line, beside in zip(lines, [BESIDE, *map(_beside, sensors)], strict=True)]


def _has_size(row: Row, cause: str) -> bool:
    return cause in row.of and row.of[cause].size is not None


def how(sensors: Sequence[Row]) -> str:
    """Return the word for sizes: "about", or "measured"."""
    return MEASURED if any(x.how == MEASURED for row in sensors for x in row.of.values()) else "about"


def _line(row: Row, causes: Sequence[str], with_bound: bool) -> tuple[str, ...]:
    size = "" if row.largest is None else f"{digits(row.largest, 4)} {row.unit}".rstrip()
    bound = "" if row.bound is None else f"{rounded_up(row.bound, 2)}{row.scope and f' ({row.scope})'}"
    return (row.label or row.name, size, *(_cell(row, cause) for cause in causes), *([bound] if with_bound else []))


def _beside(row: Row) -> tuple[str, ...]:
    """What stands beside a measured error: order of the step's, noise, the run's own estimate."""
    order = "" if row.order is None else digits(row.order, 2)
    estimated = "not covered" if row.estimated is None or row.estimated.size is None else said(row.estimated)
    return order, "" if row.noise is None else digits(row.noise, 1), estimated


def _cell(row: Row, cause: str) -> str:
    """Size, half width and share of one cause."""
    verdict = row.of.get(cause)
    if verdict is None:
        return ""
    if verdict.size is None:
        return verdict.answer.value
    return f"{said(verdict)}{share_in_brackets(verdict, row.largest)}"


def said(verdict: Verdict, unit: str = "") -> str:
    """Return size and half width in as many digits as these leave."""
    unit = unit and f" {unit}"
    if verdict.is_at_round_off:
        return f"{rounded_up(verdict.most, 1)}{unit} or less, at round-off"
    if not verdict.is_resolved:
        return f"{rounded_up(verdict.most, 2)}{unit} or less"
    off = float(f"{verdict.half_width:.3g}")  # a difference, whose last digits are rounding
    half = f" +- {rounded_up(off, 1)}" if off > SHOWN * verdict.size else ""
    return f"{digits(verdict.size, 2)}{half}{unit}"


def share_in_brackets(verdict: Verdict, of: float | None) -> str:
    """Return the share of what the output shows."""
    size = verdict.size if verdict.is_resolved else verdict.most
    return f" ({percent(size / of) or 'more than 10 times'})" if of else ""


def reasons(sensors: Sequence[Row]) -> list[str]:
    """Return a line for what is not covered, or does not tell: which, and why."""
    why: dict[str, list[str]] = {}
    for row in sensors:
        found = [row.of[x] for x in ("sum", *CAUSES) if x in row.of]
        missing = next((x for x in found if x.how == NONE or x.reason), None)
        if missing is not None and row.name not in why.setdefault(missing.reason, []):
            why[missing.reason].append(row.name)
    return [f"not known, {listed(names)}: {reason}" for reason, names in why.items()]
