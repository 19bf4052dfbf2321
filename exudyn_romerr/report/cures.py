"""Causes of errors, and what to do about each, or about an estimate whose half width is too large."""

from __future__ import annotations

from math import ceil
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..linear.estimators.causes import FEEDBACK, FURTHER, LINEAR, LINEAR_MODES, LINEAR_STEPS, RESOLVED

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


class Cause(NamedTuple):
    """What makes an error: in words; parts of estimates and of bounds that are of it, checks of these; its cure."""

    title: str
    parts: tuple[str, ...]
    checks: tuple[str, ...]
    cure: str


OF_MODES = ("vectors", LINEAR, FURTHER, LINEAR_MODES, "proved")
OF_STEPS = ("steps", LINEAR_STEPS, "loads", FEEDBACK, "proved")
CAUSES = {
    "modes": Cause("modes", ("basis",), OF_MODES, "more modes"),
    "interfaces": Cause(
        "rigid interfaces",
        ("interfaces",),
        OF_MODES,
        "RBE3 modes; nothing, if the part is as rigid there in reality",
    ),
    "step": Cause("step", ("time step",), OF_STEPS, "shorter steps"),
    "start": Cause("start", ("initial", "jumps"), OF_MODES, "let loads begin smoothly, or start from equilibrium"),
}
ALWAYS = ("modes", "step")  # the two that every user asks; the others only where there is something of them
MORE_VECTORS = "more vectors (auxiliary_modes=...)"
NOT_LINEAR = "for the error is too large to be linear"
AGAIN = "then ask again"  # where an error, or its half width, is too large to tell how far to go
MOST_TIMES = 20  # times shorter steps: what is told at once; farther away nothing says that it gets there
SECOND_ORDER = 2.0  # of Exudyn's implicit solvers, where none was measured
LOWEST_ORDER = 1.0  # in which errors of steps are taken to fall where a lower order was measured; of PreStep
FAR = 3.0  # times the estimate of what it bounds: from there on a bound says that it is far off, not the error
SHARPER = "the bound is {} times the estimate: auxiliary_modes=60, or 130, make it sharper"
OF_CHECKS = {"vectors": MORE_VECTORS, "loads": "smoother loads"}


class Steps(NamedTuple):
    """How many steps a run has taken, None: not known, or not of one size; in which order their error falls."""

    count: int | None
    order: float = SECOND_ORDER


def cure_of(
    cause: str,
    size: float,
    half: float,
    halves: Mapping[str, float],
    limit: float | None,
    steps: Steps,
    beside_steps: Sequence[str] = (),
) -> str:
    """Return what to do about one cause of an error, with a number where there is one.

    size, half : of the error, and its half width. halves : parts of that by check. limit : what is allowed.
    beside_steps : what helps beside shorter steps where these resolve nothing.
    """
    if half <= RESOLVED * size or cause == "interfaces":
        return shorter_steps(size + half, limit, steps) if cause == "step" else CAUSES[cause].cure
    # What starts at once rings in modes that neither steps nor vectors resolve: a smooth start makes half widths 50
    # to 7000 times smaller; shorter steps, damping, vectors 0.5 to 3 times (tests: test_output_estimates.py)
    if beside_steps:
        return beside_steps[0]
    check = max(halves, key=halves.get)
    if check in (LINEAR, LINEAR_MODES, LINEAR_STEPS, FEEDBACK):
        return f"{shorter_steps(size + half, limit, steps) if cause == 'step' else CAUSES[cause].cure}, {NOT_LINEAR}"
    if check == "steps":
        return shorter_steps(size + half, limit, steps, is_resolved=False)
    return OF_CHECKS.get(check, CAUSES[cause].cure)


def cure_of_bound(causes: Mapping[str, np.ndarray]) -> str:
    """Return what lowers the largest cause of a bound beside which there is no estimate."""
    largest = max(causes, key=lambda name: np.max(np.abs(causes[name]), initial=0.0))
    return next(cause.cure for cause in CAUSES.values() if largest in cause.parts)


def shorter_steps(most: float, limit: float | None, steps: Steps, is_resolved: bool = True) -> str:
    """Return how many steps to take: an error falls with a power of the step, its order.

    most : size and half width. limit : what is allowed; None: nothing was asked. is_resolved : whether most is a
    number to go by; else, or where it is far away, the answer is asked for again.
    """
    if limit is None or not 0 < limit < most:
        return CAUSES["step"].cure
    needed = (most / limit) ** (1 / max(steps.order, LOWEST_ORDER))
    is_far = not needed <= MOST_TIMES  # inf, too
    times = MOST_TIMES if is_far else max(ceil(needed), 2)
    said = times_as_short(times, steps)
    return said if is_resolved and not is_far else f"{said}, {AGAIN}"


def times_as_short(times: int, steps: Steps) -> str:
    """Return how many steps are so many times as short, where it is known how many there were."""
    told = f"{times} times as short"
    return f"take steps {told}" if steps.count is None else f"take {steps.count * times:,} steps, {told}"
