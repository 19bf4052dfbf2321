"""Verdicts as text: what is enough and what is not, then a line for each sensor, a column for each cause."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import isfinite

from .answers import SHARE, Answer, worst
from .verdicts import CAUSES, MEASURED, NONE, Row, Verdict
from .wording import digits, listed, percent, rounded_up, with_unit

TITLES = {name: cause.title for name, cause in CAUSES.items()} | {"sum": "whole error"}
NOT_RIGID = (
    "if the part is not as rigid there as its modes make it: RBE3 modes cure that, no number of modes does; "
    "if it is: interfaces='rigid' (romerr run --interfaces rigid)"
)
CANCEL = "Enough as it is, for causes cancel each other: change none of them alone: {}."
AFTER_THE_STEP = "All else is judged once steps are shorter: {}."
BESIDE = ("order", "noise", "estimated about")
CONTRADICTION = "Measured {}, estimated about {} at {}: one of both is wrong."
SHOWN = 0.005  # of a size: a half width below it is not seen in two digits
UNSURE = (Answer.NOT_KNOWN, Answer.NOT_COVERED)
WORSE = (Answer.TOO_LARGE, *UNSURE)
FINE = (Answer.ENOUGH, Answer.NO_TOLERANCE)  # of which there is nothing to do
OPTION, ASSESS = "--tolerance", "report.assess"  # what another tolerance is given by
YOURS = "your_script.py"  # in cures: the script that the user has


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return lines of text whose columns begin below each other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def has_numbers(rows: Sequence[Row]) -> bool:
    """Return whether anything is known of an error."""
    return any(row.bound is not None or verdict.how != NONE for row in rows for verdict in row.of.values())


def by_sensor(rows: Sequence[Row]) -> list[Row]:
    """Return of each sensor and solve the component whose error is the largest share of its tolerance.

    Where another component is the worst of a cause, it follows in a row of its own.
    """
    found: dict[tuple, list[Row]] = {}
    for row in rows:
        found.setdefault((row.solve, row.name), []).append(row)
    told: list[Row] = []
    for of in found.values():
        first = max(of, key=lambda row: (row.share("sum"), _known_share(row)))
        its = [first]
        for cause in CAUSES:
            row = max(of, key=lambda row, cause=cause, first=first: (row.share(cause), row is first))
            its += [row] if row not in its else []
        told += its
    return told


def _known_share(row: Row) -> float:
    return max(filter(isfinite, map(row.share, CAUSES)), default=0.0)


def worst_by_cause(rows: Sequence[Row]) -> dict[str, Verdict]:
    """Return of each cause, and of the sum, the verdict on the component where it is worst."""
    found = {cause: _with(rows, cause) for cause in (*CAUSES, "sum")}
    return {cause: max(of, key=lambda row, x=cause: row.share(x)).of[cause] for cause, of in found.items() if of}


def _with(rows: Sequence[Row], cause: str) -> list[Row]:
    return [row for row in rows if cause in row.of]


def _largest_first(rows: Sequence[Row]) -> list[str]:
    """Causes that there are, that with the largest share of its tolerance first: what to see to first."""
    largest = {cause: max(row.share(cause) for row in of) for cause in CAUSES if (of := _with(rows, cause))}
    return sorted(largest, key=largest.get, reverse=True)


def summary(rows: Sequence[Row], what: str = "sensor", how_to_ask: str = OPTION) -> str:
    """Return the first line: every sensor and cause that is too large, then every one that is not known.

    rows : of all components. what : they are of. how_to_ask : what another tolerance is given by.
    """
    # rates in a static solve are enough without any estimate
    unsure = [row for row in rows if row.answer is not Answer.ENOUGH]
    uncovered = [row for row in unsure if all(verdict.how == NONE for verdict in row.of.values())]
    still = [row for row in rows if row.shows_nothing and row.answer not in FINE]
    others = [row for row in rows if row not in uncovered]
    said = [
        *_ends(rows),
        *_by_causes("Too large", others, (Answer.TOO_LARGE,)),
        *_by_causes("Not known", [row for row in others if not row.shows_nothing], UNSURE, (Answer.TOO_LARGE,)),
        *_list("Shows 0 throughout", still),
        *_list("Not measured" if how(rows) == MEASURED else "Not covered by any estimate", uncovered),
        *_contradictions(rows),
        *_enough(rows, what),
        *_list("No tolerance", [row for row in rows if row.answer is Answer.NO_TOLERANCE]),
    ]
    is_assumed = any(not row.limit.is_asked for row in rows)
    assumed = f" ({100 * SHARE:g} % assumed; {how_to_ask})." if is_assumed else "."
    return " ".join(said).removesuffix(".") + assumed


def _list(word: str, rows: Sequence[Row]) -> list[str]:
    return [f"{word}: {_names(rows)}."] if rows else []


def _ends(rows: Sequence[Row]) -> list[str]:
    """Until when runs went that were to go farther."""
    several = len({row.solve for row in rows}) > 1
    ends = dict.fromkeys((row.solve, row.until) for row in rows if row.until)
    return [f"{f'Solve {solve} u' if several else 'U'}{until[1:]}." for solve, until in ends]


def _by_causes(
    word: str, rows: Sequence[Row], answers: tuple[Answer, ...], besides: tuple[Answer, ...] = ()
) -> list[str]:
    """A sentence that names sensors by cause, those with the same sensors together.

    besides : answers of which a sensor and cause is named already.
    """
    of = [row for row in rows if row.answer not in FINE]
    by_names: dict[str, list[str]] = {}
    for cause in _largest_first(of):
        own = [row for row in _with(of, cause) if cause == "step" or not row.is_coarse]
        named = {row.name for row in own if row.of[cause].answer in besides}
        if names := _names(row for row in own if row.of[cause].answer in answers and row.name not in named):
            by_names.setdefault(names, []).append(TITLES[cause])
    listed_causes = {names: [", ".join(x[:-1])] * (len(x) > 1) + x[-1:] for names, x in by_names.items()}
    parts = [f"by {' and '.join(causes)}: {names}" for names, causes in listed_causes.items()]
    told = {row.name for row in of if _has_cause(row, (*besides, *answers))}  # by a cause, of another component too
    alone = _names(row for row in of if row.answer in answers and row.name not in told)
    said = [f"{word}, {'; '.join(parts)}."] if parts else []
    return said + ([f"{word}: {alone}."] if alone else [])


def _has_cause(row: Row, answers: tuple[Answer, ...]) -> bool:
    return any(row.of[cause].answer in answers for cause in CAUSES if cause in row.of)


def _names(rows: Iterable[Row]) -> str:
    return listed(list(dict.fromkeys(row.name for row in rows)))


def _contradictions(rows: Sequence[Row]) -> list[str]:
    """Both numbers of the sensors of which runs and estimate tell different things."""
    wrong = [row for row in rows if row.is_contradicted and row.answer not in FINE]
    of = {row.name: [one for one in wrong if one.name == row.name] for row in wrong}
    told = [max(its, key=lambda row: row.estimated.size) for its in of.values()]
    both = ((row, *(size_in_words(x, row.unit) for x in (row.of["sum"], row.estimated))) for row in told)
    return [CONTRADICTION.format(one, other, row.label or row.name) for row, one, other in both]


def _enough(rows: Sequence[Row], what: str) -> list[str]:
    """That all is enough of which something was asked; nothing where something is not."""
    enough = [row for row in rows if row.answer is Answer.ENOUGH]
    if not enough or any(row.answer not in (*FINE, Answer.NOT_COVERED) for row in rows):
        return []
    which = f"every {what}" if len(enough) == len(rows) else _names(enough)
    cancel = _names(row for row in enough if _has_cause(row, (Answer.TOO_LARGE,)))
    return [f"Enough: the error of {which} is within its tolerance."] + [CANCEL.format(cancel)] * bool(cancel)


def first_sentences(rows: Sequence[Row]) -> list[str]:
    """Return a sentence for each cause: enough or not, how large, at which component, what to do.

    The cause with the largest share of its tolerance stands first; nothing where nothing is known. rows : of all
    components.
    """
    if not has_numbers(rows):
        return []
    wrong = [row for row in rows if row.answer not in FINE]
    by_cause = [row for row in wrong if row.shows_nothing or len(row.of) == 1 or _has_cause(row, WORSE)]
    named = {row.name for row in by_cause}
    together = [row for row in wrong if row.name not in named]  # no cause is too large, all of them together are
    told = [("sum", together), *((cause, _worth_a_sentence(rows, cause)) for cause in _largest_first(rows))]
    in_solves = len({row.solve for row in rows}) > 1
    return [*(_of_cause(of, cause, in_solves) for cause, of in told if of), *after_the_step(rows)]


def after_the_step(rows: Sequence[Row]) -> list[str]:
    """Return the sentence that names what cannot be judged yet; nothing where all can."""
    coarse = _names(row for row in rows if row.is_coarse)
    return [AFTER_THE_STEP.format(coarse)] * bool(coarse)


def worst_first(rows: Sequence[Row]) -> list[Row]:
    """Return rows by the answer on their whole error, of one answer that with the largest share first."""
    order = list(Answer)
    return sorted(rows, key=lambda row: (order.index(row.answer), row.share("sum")), reverse=True)


def worst_of_cause(rows: Sequence[Row], cause: str) -> tuple[Row, str]:
    """Return the row in which a cause is worst, of those that its sentence is about, and what to do about it."""
    told = (cause != "sum" and _worth_a_sentence(rows, cause)) or _with(rows, cause)
    answer = worst(row.of[cause].answer for row in told)
    return _worst_of_one_answer([row for row in told if row.of[cause].answer is answer], cause)


def _worst_of_one_answer(rows: Sequence[Row], cause: str) -> tuple[Row, str]:
    """The worst row, and what to do, so that it helps all of them."""
    row = max(rows, key=lambda row: row.share(cause))
    verdict = row.of[cause]
    if cause == "interfaces" and verdict.answer not in FINE and not verdict.reason:
        return row, NOT_RIGID
    return row, max(rows, key=lambda row: row.shortening).of[cause].cure if cause == "step" else verdict.cure


def _worth_a_sentence(rows: Sequence[Row], cause: str) -> list[Row]:
    """The rows that a cause's sentence is about; none where those that would have to be judged are not."""
    of = _with(rows, cause)
    told = [row for row in of if cause == "step" or not row.is_coarse]  # where steps resolve nothing, they come alone
    told = [row for row in told if not row.shows_nothing or row.of[cause].answer is Answer.TOO_LARGE]
    is_open = any(row.is_coarse for row in of) and cause != "step"
    is_said = any(row.of[cause].answer not in FINE for row in told)
    return told if is_said or not is_open else []


def _of_cause(rows: Sequence[Row], cause: str, in_solves: bool) -> str:
    """The sentence about one cause: what is too large, then what is not known, each by the worst component.

    in_solves : whether there are several, so that the component's is named.
    """
    title = TITLES[cause].capitalize()
    known = [row for row in rows if row.of[cause].size is not None]
    found = [[row for row in known if row.of[cause].answer is answer] for answer in reversed(Answer)]
    clauses = [_clause(of, cause, in_solves) for of in found if of]
    todo = [of for of in found if of and of[0].of[cause].answer not in FINE]
    return f"{title}: {'; '.join(clauses[: max(len(todo), 1)]) or 'not known'}."


def _clause(rows: Sequence[Row], cause: str, in_solves: bool) -> str:
    """What is said of rows of one answer: the worst, and what to do."""
    row, cure = _worst_of_one_answer(rows, cause)
    verdict = row.of[cause]
    is_close = verdict.answer is Answer.NOT_KNOWN and verdict.is_resolved and not verdict.reason
    where = f"{row.label or row.name}{f' in solve {row.solve}' if in_solves else ''}"
    size = f"{verdict.how if verdict.how == MEASURED else 'about'} {size_in_words(verdict, row.unit, row.extent)}"
    said = f"{verdict.answer.value}{' (too close to the tolerance)' * is_close}, {size} at {where}"
    between = ", " if cure is NOT_RIGID else "; "
    return f"{said}{cure and f'{between}{cure}'}"


def table(rows: Sequence[Row], what: str = "sensor") -> list[tuple[str, ...]]:
    """Return head and a line for each row, a column for each cause; what : rows are of."""
    sizes = {cause: [row.of[cause].size for row in _with(rows, cause)] for cause in (*CAUSES, "sum")}
    causes = [cause for cause, of in sizes.items() if any(size is not None for size in of)]
    word, scopes = how(rows), {row.scope for row in rows if row.bound is not None}
    shared = "".join(scopes) if len(scopes) == 1 else ""
    most = [f"at most{shared and f' ({shared})'}"] if scopes else []
    head = (what, "up to", *(f"{TITLES[cause]} {word}" for cause in causes), *most)
    lines = [head, *(_line(replace(row, scope="" if shared else row.scope), causes, bool(scopes)) for row in rows)]
    if word != MEASURED:
        return lines
    return [line + beside for line, beside in zip(lines, [BESIDE, *map(_beside, rows)], strict=True)]


def how(rows: Sequence[Row]) -> str:
    """Return the word for sizes: "about", or "measured"."""
    return MEASURED if any(row.noise is not None for row in rows) else "about"


def _line(row: Row, causes: Sequence[str], with_bound: bool) -> tuple[str, ...]:
    size = "" if row.extent is None else f"{digits(row.extent, 4)} {row.unit}".rstrip()
    bound = "" if row.bound is None else f"{rounded_up(row.bound, 2)}{row.scope and f' ({row.scope})'}"
    return (row.label or row.name, size, *(_cell(row, cause) for cause in causes), *([bound] if with_bound else []))


def _beside(row: Row) -> tuple[str, ...]:
    """What stands beside a measured error: order of the step's, noise, the run's own estimate."""
    order = "" if row.order is None else digits(row.order, 2)
    estimated = "not covered" if row.estimated is None or row.estimated.size is None else size_in_words(row.estimated)
    return order, "" if row.noise is None else digits(row.noise, 1), estimated


def _cell(row: Row, cause: str) -> str:
    """Size, half width and share of one cause; that it was measured, where the table's others are estimates."""
    if cause not in row.of:
        return ""
    verdict = row.of[cause]
    if verdict.size is None:
        return verdict.answer.value
    is_another = verdict.how == MEASURED and row.noise is None
    return f"{'measured ' if is_another else ''}{size_in_words(verdict, '', row.extent)}"


def size_in_words(verdict: Verdict, unit: str = "", of: float | None = None) -> str:
    """Return size and half width in as many digits as these leave; of : what it is a share of, in brackets."""
    is_size = verdict.half_width is None or (verdict.is_resolved and not verdict.is_at_round_off)
    size, unit = verdict.size if is_size else verdict.most, unit and f" {unit}"
    if verdict.half_width is None:
        said = f"{digits(size, 2)}{unit} or more"
    elif verdict.is_at_round_off:
        said = f"{rounded_up(size, 1)}{unit} or less, at round-off"
    elif not verdict.is_resolved:
        said = f"{rounded_up(size, 2)}{unit} or less"
    else:
        off = float(f"{verdict.half_width:.3g}")  # a difference, whose last digits are rounding
        half = f" +- {rounded_up(off, 2)}" if off > SHOWN * size else ""
        said = f"{digits(size, 2)}{half}{unit}"
    return f"{said} ({percent(size / of) or 'more than 10 times'})" if of else said


def size_and_half(verdict: Verdict, unit: str, of: float | None) -> tuple[str, str]:
    """Return size and half width apart; of what is not resolved, or at round-off, the size has both in it."""
    if verdict.size is None:
        return "", ""
    if verdict.half_width is None or not verdict.is_resolved or verdict.is_at_round_off:
        return size_in_words(verdict, unit, of), "" if verdict.half_width is None else "included"
    half = rounded_up(float(f"{verdict.half_width:.3g}"), 2)
    return size_in_words(replace(verdict, half_width=0.0), unit, of), with_unit(half, unit)


def reasons(rows: Sequence[Row], script: str = YOURS) -> list[str]:
    """Return a line for what is not covered, or does not tell: which, why, and what to do.

    rows : of all components. script : as the user typed it, for what to type next.
    """
    why: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        told = [x for x in ("sum", *CAUSES) if x in row.of and (x == "step" or not row.is_coarse)]
        for verdict in (row.of[x] for x in told if row.answer not in FINE):
            if verdict.reason and verdict.answer in UNSURE:
                names = why.setdefault((verdict.reason, verdict.cure.replace(YOURS, script)), [])
                names += [row.name] if row.name not in names else []
    return [f"not known, {listed(names)}: {said}{cure and f'; {cure}'}" for (said, cure), names in why.items()]
