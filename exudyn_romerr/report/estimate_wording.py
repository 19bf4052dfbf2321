"""Estimates in words: how wrong an output is about, what that comes from, and how far it can be trusted."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..estimates.estimate import RESOLVED
from ..estimates.kept_estimate import LINEAR, LINEAR_STEPS
from .scope import FROZEN
from .wording import (
    CURES_OF_CHECKS,
    FROZEN_FIRST,
    MUCH_SHORTER,
    NOT_LINEAR,
    RINGS,
    SHORT,
    digits,
    error_kind,
    for_run_alone,
    percent,
    permitted,
    rounded_up,
    widest_scope,
)

if TYPE_CHECKING:
    from .data import OutputData, ReportData

THREE_DIGITS = 0.05  # half width over the largest estimate: below it the third digit says something
SMALL = 0.1  # of what other causes make: that is not what makes an error too large to be linear
TWENTIETH = 20.0  # times shorter steps: who is told to halve them would not get there
SHOWN = 0.005  # of the largest estimate: a part or half width below it is not seen in three digits


class Known(NamedTuple):
    """What the estimate says of rows of an output over the whole run.

    size : the largest |estimate|. off : how far the largest error may be from it, by the half widths of all instants.
    half : the largest half width, or, where that is proved, off: a proof needs no margin. most : the largest sum of
    estimate, half width and rounding. floor : what rounding of the input may move. check : makes most of the half
    width. parts : the largest |part| by cause, each at its own instant: two that cancel at one are both seen. value :
    the largest |value|. beside_steps : see OutputReport.
    """

    size: float
    half: float
    off: float
    most: float
    floor: float
    check: str
    parts: dict[str, float]
    value: float
    beside_steps: tuple[str, ...]

    @property
    def is_resolved(self) -> bool:
        """Whether the estimate is a number to rely on."""
        return self.half <= RESOLVED * self.size

    @property
    def tells_nothing(self) -> bool:
        """Whether the error may be larger than the output itself, for all that is known: the estimate is no size."""
        return not self.is_resolved and (self.half > self.value > 0 or self.half == np.inf)

    @property
    def of_modes(self) -> tuple[float, str]:
        """The largest part that time steps, loads and starts do not make, and what makes it."""
        return max((self.parts.get(cause, 0.0), cause) for cause in ("basis", "interfaces"))

    @property
    def rings(self) -> bool:
        """Whether something starts at once: what rings then no other cure lowers by far as much as a smooth start."""
        return bool(self.beside_steps)

    @property
    def cure(self) -> str:
        """What would make the half width smaller, in words."""
        return f"{self.first_cure}{RINGS}" if self.rings else self.first_cure

    @property
    def first_cure(self) -> str:
        """The same in a few words: the one that helps most, alone, or first."""
        if self.rings:
            return self.beside_steps[0]
        steps, modes = self.parts.get("time step", 0.0), self.of_modes[0]
        if self.check == LINEAR:
            cures = ("more modes", "shorter steps") if steps < modes else ("shorter steps", "more modes")
            count = 1 if min(steps, modes) < SMALL * max(steps, modes) else 2
            return f"{', then '.join(cures[:count])}, {NOT_LINEAR}"
        return self._shorter_steps if self.check == "steps" else CURES_OF_CHECKS[self.check]

    @property
    def _shorter_steps(self) -> str:
        """How much shorter at least: half widths fall with the square of the step at best, and have to by far."""
        is_far = self.value > 0 and TWENTIETH**2 * RESOLVED * self.value < self.half < np.inf
        return MUCH_SHORTER if is_far else CURES_OF_CHECKS["steps"]

    @property
    def is_at_round_off(self) -> bool:
        """Whether rounding of the input moves the output as much."""
        return self.size + self.half < 2 * self.floor


def known(out: OutputData, row: int | None = None) -> Known | None:
    """Return what the estimate says of one row, or of all; None where there is no estimate at every instant."""
    rows = slice(None) if row is None else slice(row, row + 1)
    if out.estimate is None or not np.isfinite(out.estimate[:, rows]).all():
        return None
    size, half, floor = np.abs(out.estimate[:, rows]), out.uncertainty[:, rows], out.round_off[:, rows]
    parts = {cause: _largest(part[:, rows]) for cause, part in parts_of(out).items()}
    most, least = _largest(size + half), max(float(np.max(size - half, initial=0.0)), 0.0)
    off = max(most - _largest(size), _largest(size) - least)
    doubt = off if set(out.uncertainty_parts) == {"proved"} else _largest(half)
    largest = (_largest(size), doubt, off, _largest(size + half + floor), _largest(floor))
    return Known(*largest, _check(out, rows), parts, _largest(out.value[:, rows]), out.beside_steps)


def parts_of(out: OutputData) -> dict[str, np.ndarray]:
    """Return the estimate by cause; rigid interfaces that it does not tell from missing modes as the bound does."""
    parts, zero = dict(out.estimate_parts), np.zeros_like(out.estimate)
    stiff, modes = (out.causes.get(cause, zero) for cause in ("interfaces", "basis"))
    if np.any(parts.get("interfaces", zero)) or not np.any(stiff):
        return parts
    share = np.divide(stiff, stiff + modes, out=zero, where=(stiff > 0) & np.isfinite(modes))
    return {**parts, "basis": (1 - share) * parts["basis"], "interfaces": share * parts["basis"]}


def _check(out: OutputData, rows: slice) -> str:
    """What makes most of the half width; a bound of the rest has the same causes as the bound itself."""
    sizes: Counter[str] = Counter()
    for name, half in out.uncertainty_parts.items():
        sizes[LINEAR if name == LINEAR_STEPS else name] += _largest(half[:, rows])
    found = max(sizes, key=sizes.get)
    if found != "proved":
        return found
    cause = max(out.causes, key=lambda cause: _largest(out.causes[cause][:, rows]))
    return {"jumps": "loads", "time step": "steps"}.get(cause, found)


def is_enough(out: OutputData, found: Known) -> bool:
    """Return whether the error, as far as the estimate can tell, is within what is permitted."""
    return found.most <= permitted(out)[0]


def covers_time(out: OutputData, time: str) -> bool:
    """Return whether the estimate has the error of the time steps in it, which sampled bounds have not."""
    return time != "sampled" or bool(np.any(out.estimate_parts.get("time step", 0.0)))


def estimated_kind(out: OutputData, time: str) -> str:
    """Return what the estimate is an estimate of."""
    return "error" if covers_time(out, time) else error_kind(time)


def estimate_scope(out: OutputData, scope: dict[str, str]) -> str:
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


def estimated_under(out: OutputData, scope: dict[str, str]) -> str:
    """Return what must be said with an estimate, in two words; "about" says that it is of first order."""
    return SHORT[FROZEN] if estimate_scope(out, scope) == FROZEN else ""


def covers_more(out: OutputData, time: str, scope: dict[str, str]) -> bool:
    """Return whether the estimate covers what the best bound leaves out: then the bound says little beside it."""
    wider = widest_scope(scope) == FROZEN != estimate_scope(out, scope)
    return wider or estimated_kind(out, time) != error_kind(time)


def about(out: OutputData, found: Known) -> str:
    """Return in words how wrong a row of an output is, as far as its estimate can tell."""
    if found.is_at_round_off:
        return f"about {rounded_up(found.most, 1)} {out.unit} or less, at round-off"
    if found.is_resolved:
        notes = "; ".join(filter(None, [_share(found.size, found.value), ", ".join(_parts(found))]))
        return f"about {number(found)} {out.unit}{notes and f' ({notes})'}"
    # others help where it is not certified; and with frozen inputs no half width is that of the whole error
    cure = "" if out.uncertified or out.estimate_scope == FROZEN else f": {found.first_cure}"
    not_resolved = "" if is_enough(out, found) else f"not resolved{cure}"
    if not_resolved and found.tells_nothing:
        return f"not known ({not_resolved})"
    notes = "; ".join(filter(None, [_share(found.most, found.value), not_resolved]))
    return f"about {digits(found.most, 2)} {out.unit} or less{notes and f' ({notes})'}"


def about_all(out: OutputData, scope: dict[str, str]) -> str:
    """Return in a few words, for a table, how wrong an output is about, all rows together."""
    found, unit = known(out), out.unit
    if found is None:
        return "not known"
    largest = _largest(out.value)
    share = _share(found.size if found.is_resolved else found.most, largest)
    if found.is_at_round_off:
        said = f"{rounded_up(found.most, 1)} {unit} or less, at round-off"
    elif found.is_resolved:
        said = f"{number(found)} {unit}{share and f' ({share})'}"
    elif is_enough(out, found):
        said = f"{digits(found.most, 2)} {unit} or less"
    elif found.tells_nothing:
        said = "not known"
    else:
        said = f"{digits(found.most, 2)} {unit} or less{share and f' ({share})'}, not resolved"
    return f"{said}{estimated_under(out, scope)}"


def number(found: Known) -> str:
    """Return the largest estimate, how far off it may be where that shows, and no more digits than that leaves."""
    size = digits(found.size, 3 if found.off <= THREE_DIGITS * found.size else 2)
    off = float(f"{found.off:.3g}")  # a difference, whose last digits are rounding
    return f"{size} +- {rounded_up(off, 1)}" if found.off > SHOWN * found.size else size


def off_by(out: OutputData, row: int | None = None) -> str:
    """Return in words how far the estimate of one row, or of all, is from the true error that was compared.

    A truth with the same time steps has nothing of their error: then of the estimate without it, too.
    """
    rows = slice(None) if row is None else slice(row, row + 1)
    true, of_steps = out.error[:, rows], out.estimate_parts.get("time step", np.zeros_like(out.estimate))[:, rows]
    off, without = (_largest(true - out.estimate[:, rows] + part) for part in (0.0, of_steps))
    said, other = (_share_of_it(x, _largest(true), out.unit) for x in (off, without))
    beside = f", without its time steps by {other}" if without < off else ""
    return f"the estimate is off by up to {said}{beside}"


def _share_of_it(x: float, of: float, unit: str) -> str:
    share = (percent(x / of) or "more than 1000 %") if of > 0 else ""
    return f"{digits(x, 2)} {unit}{share and f' ({share} of it)'}"


def rest(out: OutputData, cause: str, row: int | None) -> str:
    """Return in words how wrong the output would be without one part of the estimate; empty: not at all."""
    rows = slice(None) if row is None else slice(row, row + 1)
    left, half = np.abs(out.estimate - parts_of(out)[cause])[:, rows], out.uncertainty[:, rows]
    size, most = _largest(left), _largest(left + half)
    if not 0 < most < np.inf:
        return ""
    is_resolved = _largest(half) <= RESOLVED * size
    left = digits(size if is_resolved else most, 2)
    return f"; the rest is about {left} {out.unit}{'' if is_resolved else ' or less'}"


def _share(x: float, of: float) -> str:
    return percent(x / of) if of > 0 else ""


def _parts(found: Known) -> list[str]:
    """Causes that show in the estimate; a single one needs no number, it is all of it."""
    seen = {cause: x for cause, x in found.parts.items() if x > SHOWN * found.size}
    return list(seen) if len(seen) == 1 else [f"{cause} {digits(x, 2)}" for cause, x in seen.items()]


def _largest(x: np.ndarray) -> float:
    return float(np.max(np.abs(x), initial=0.0))
