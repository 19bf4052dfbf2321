"""The answer as text: what is enough and what is not, then a line for each sensor, a column for each cause."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..report.overview import aligned
from ..report.wording import digits, listed, percent, rounded_up
from .answers import SHARE, Answer, worst
from .verdicts import CAUSES, CURES, MEASURED, NONE, Judgement, Row

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from .verdicts import Verdict

FEW_SOLVES = 3  # of these each has its own table; of more a line each
TITLES = {"modes": "modes", "interfaces": "rigid interfaces", "step": "step", "start": "start", "sum": "whole error"}
MEASURE = "romerr verify {} measures it"
NOT_RIGID = "if the part is not as rigid there as its modes make it; no number of modes cures that"
BESIDE = ("order", "noise", "estimated about")
SHOWN = 0.005  # of a size: a half width below it is not seen in two digits


def text(judgement: Judgement, script: str) -> str:
    """Return all that `romerr run` prints; script : as the user typed it, for what to type next."""
    sensors = by_sensor(judgement.rows)
    lines = [*judgement.notes]
    if sensors:
        lines.append(summary(sensors))
    if any(verdict.how != NONE for row in sensors for verdict in row.of.values()):
        lines += [*first_sentences(sensors), "", *_tables(sensors, judgement)]
    return "\n".join([*lines, *reasons(sensors, script)])


def _tables(sensors: Sequence[Row], judgement: Judgement) -> list[str]:
    numbers = sorted({row.solve for row in sensors})
    if len(numbers) > FEW_SOLVES:
        return aligned(table_of_solves(sensors, numbers))
    lines: list[str] = []
    for number in numbers:
        lines += [f"solve {number} ({judgement.solves[number].kind}):"] if len(numbers) > 1 else []
        lines += aligned(table([row for row in sensors if row.solve == number]))
    return lines


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


def summary(sensors: Sequence[Row]) -> str:
    """Return the sentence that stands first: enough or not, for which cause."""
    answer, asked = worst(row.answer for row in sensors), sensors[0].is_asked
    within = "its tolerance" if asked else f"{100 * SHARE:g} % of what the sensor shows"
    if answer is Answer.ENOUGH:
        return f"Enough: the error of every sensor is within {within}."
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
    size = f"{_said(verdict, row.unit)}{_in_brackets(verdict, row.largest)} at {row.name}"
    if cause == "interfaces" and answer is not Answer.ENOUGH:
        return f"{title}: {size}, {NOT_RIGID}."
    todo = "" if answer is Answer.ENOUGH else f"; {CURES[cause]}"
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


def table(sensors: Sequence[Row]) -> list[tuple[str, ...]]:
    """Return head and a line for each sensor, a column for each cause."""
    causes = [cause for cause in (*CAUSES, "sum") if any(cause in row.of for row in sensors)]
    with_bound = any(row.bound is not None for row in sensors)
    how = _how(sensors)
    head = ("sensor", "up to", *(f"{TITLES[cause]} {how}" for cause in causes), *(["at most"] if with_bound else []))
    lines = [head, *(_line(row, causes, with_bound) for row in sensors)]
    if how != MEASURED:
        return lines
    return [line + beside for line, beside in zip(lines, [BESIDE, *map(_beside, sensors)], strict=True)]


def _how(sensors: Sequence[Row]) -> str:
    """The word for sizes."""
    return MEASURED if any(x.how == MEASURED for row in sensors for x in row.of.values()) else "about"


def _line(row: Row, causes: Sequence[str], with_bound: bool) -> tuple[str, ...]:
    size = "" if row.largest is None else f"{digits(row.largest, 4)} {row.unit}".rstrip()
    bound = "" if row.bound is None else f"{rounded_up(row.bound, 2)}{row.scope and f' ({row.scope})'}"
    return (row.name, size, *(_cell(row, cause) for cause in causes), *([bound] if with_bound else []))


def _beside(row: Row) -> tuple[str, ...]:
    """What stands beside a measured error: order of the step's, noise, the run's own estimate."""
    order = "" if row.order is None else digits(row.order, 2)
    estimated = "not covered" if row.estimated is None or row.estimated.size is None else _said(row.estimated)
    return order, "" if row.noise is None else digits(row.noise, 1), estimated


def _cell(row: Row, cause: str) -> str:
    """Size, half width and share of one cause."""
    verdict = row.of.get(cause)
    if verdict is None:
        return ""
    if verdict.size is None:
        return verdict.answer.value
    return f"{_said(verdict)}{_in_brackets(verdict, row.largest)}"


def table_of_solves(sensors: Sequence[Row], numbers: Iterable[int]) -> list[tuple[str, ...]]:
    """Return head and a line for each solve: the sensor with the largest share of each cause."""
    causes = [cause for cause in (*CAUSES, "sum") if any(cause in row.of for row in sensors)]
    lines = [("solve", "answer", *(f"{TITLES[cause]} {_how(sensors)}" for cause in causes))]
    for number in numbers:
        own = [row for row in sensors if row.solve == number]
        lines.append((str(number), worst(row.answer for row in own).value, *(_worst_cell(own, x) for x in causes)))
    return lines


def _worst_cell(sensors: Sequence[Row], cause: str) -> str:
    known = [row for row in sensors if cause in row.of and row.of[cause].size is not None and row.largest]
    if not known:
        return Answer.NOT_COVERED.value
    row = max(known, key=lambda row: row.of[cause].most / row.largest)
    return f"{_said(row.of[cause], row.unit)}{_in_brackets(row.of[cause], row.largest)}, {row.name}"


def reasons(sensors: Sequence[Row], script: str) -> list[str]:
    """Return a line for sensors of which something is not covered: why, and what to type."""
    why: dict[str, list[str]] = {}
    for row in sensors:
        found = [row.of[x] for x in ("sum", *CAUSES) if x in row.of]
        missing = next((x for x in found if x.how == NONE or x.reason), None)
        if missing is not None and row.name not in why.setdefault(missing.reason, []):
            why[missing.reason].append(row.name)
    lines = [f"not known, {listed(names)}: {reason}" for reason, names in why.items()]
    if _how(sensors) != MEASURED and (lines or any(row.answer is Answer.NOT_KNOWN for row in sensors)):
        lines.append(MEASURE.format(script))
    return lines


def _said(verdict: Verdict, unit: str = "") -> str:
    """Size and half width in as many digits as these leave."""
    unit = unit and f" {unit}"
    if not verdict.is_resolved:
        return f"{rounded_up(verdict.most, 2)}{unit} or less"
    half = f" +- {rounded_up(verdict.half_width, 1)}" if verdict.half_width > SHOWN * verdict.size else ""
    return f"{digits(verdict.size, 2)}{half}{unit}"


def _in_brackets(verdict: Verdict, of: float | None) -> str:
    """The share of what the sensor shows."""
    size = verdict.size if verdict.is_resolved else verdict.most
    return f" ({percent(size / of) or 'more than 10 times'})" if of else ""
