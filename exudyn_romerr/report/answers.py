"""Answers to "is it exact enough?", one table from them to words and exit statuses; tolerances as users type them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from enum import Enum
from typing import NamedTuple

from ..errors import InputError


class Answer(str, Enum):
    """What is known of an error beside its tolerance; what counts least first."""

    NO_TOLERANCE = "no tolerance"
    ENOUGH = "enough"
    NOT_KNOWN = "not known"
    NOT_COVERED = "not covered"
    TOO_LARGE = "too large"


WRONG_USAGE = 2
STATUS = {
    Answer.ENOUGH: 0,
    Answer.NO_TOLERANCE: WRONG_USAGE,  # the answer only where every tolerance names what no sensor is called
    Answer.TOO_LARGE: 3,
    Answer.NOT_KNOWN: 4,
    Answer.NOT_COVERED: 4,
}
ASSESSED = {  # in words of report.assess, where bounds prove nothing
    Answer.NO_TOLERANCE: "unknown",
    Answer.ENOUGH: "likely",
    Answer.NOT_KNOWN: "unknown",
    Answer.NOT_COVERED: "unknown",
    Answer.TOO_LARGE: "unlikely",
}
SHARE = 1e-2  # of the largest value, where no tolerance was given: what most engineers ask for
NEEDED = "a positive number in the model's unit (0.001), a share of the largest value (1%), or of one sensor: tip=1%"


def worst(answers: Iterable[Answer]) -> Answer:
    """Return the answer that counts for all: too large before not known before enough before no tolerance."""
    order = list(Answer)
    return max(answers, key=order.index, default=Answer.NOT_KNOWN)


class Limit(NamedTuple):
    """A tolerance of one component in its unit, None: none; is_asked : by the user."""

    size: float | None
    is_asked: bool


NO_LIMIT = Limit(None, False)


class Tolerances:
    """Tolerances of all sensors, and of single ones by name.

    Parameters
    ----------
    texts : sequence of str
        As typed: "0.001", "1%", "tip=0.001", "tip=1%".

    Raises
    ------
    InputError
        A text that is none of these; two for one sensor.
    """

    def __init__(self, texts: Sequence[str] = ()):
        self.texts, self.is_given = tuple(texts), bool(texts)
        self._of: dict[str | None, tuple[float, bool]] = {}
        for text in texts:
            name, number = _named(text)
            if name in self._of:
                raise InputError(f"--tolerance is given twice for {'all sensors' if name is None else repr(name)}")
            self._of[name] = number

    def limit(self, name: str, shown: float) -> Limit:
        """Return what is allowed of a sensor that shows so much; none if others have a tolerance and it has not."""
        if not self.is_given:
            return Limit(SHARE * shown, False)
        size, is_share = self._of.get(name, self._of.get(None, (None, False)))
        return Limit(size * shown if is_share else size, True)

    @property
    def names(self) -> set[str]:
        """Of sensors that have a tolerance of their own."""
        return {name for name in self._of if name is not None}

    def misspelt(self, names: Iterable[str]) -> list[str]:
        """Return a line for each name that no sensor has, with the nearest that one has; names : of all sensors."""
        known = list(dict.fromkeys(names))
        unknown = [name for name in self._of if name is not None and name not in known] if known else []
        return [f"--tolerance names {name!r}, which no sensor is called; {_nearest(name, known)}" for name in unknown]


def tolerances_of(given: Sequence[str] | str | float | None) -> Tolerances:
    """Return what a keyword stands for: nothing, a number, a text or several texts; InputError: none of these."""
    texts = [] if given is None else [given] if isinstance(given, str | float | int) else given
    return Tolerances([str(text) for text in texts])


def _nearest(name: str, known: Sequence[str]) -> str:
    near = get_close_matches(name, known, 1, 0.0)
    beside = [repr(other) for other in known if other not in near]
    return f"did you mean {near[0]!r}?{(beside and ' There are ' + ', '.join(beside) + ', too') or ''}"


def _named(text: str) -> tuple[str | None, tuple[float, bool]]:
    """Name of a sensor or None, a number, and whether that is a share of what the sensor shows."""
    name, equals, number = text.rpartition("=")
    is_share = number.rstrip().endswith("%")
    try:
        size = float(number.rstrip().rstrip("%")) / (100 if is_share else 1)
    except ValueError:
        size = math.nan
    if not 0 < size < math.inf:
        raise InputError(f"--tolerance {text!r}: needed is {NEEDED}")
    return (name if equals else None), (size, is_share)
