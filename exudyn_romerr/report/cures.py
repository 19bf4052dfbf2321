"""What to do about an error, or about an estimate whose half width is too large: by its cause."""

from __future__ import annotations

from math import ceil, sqrt
from typing import TYPE_CHECKING

import numpy as np

from ..estimates.estimate import RESOLVED
from ..estimates.kept_estimate import LINEAR, LINEAR_STEPS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .data import OutputData

OF_CAUSES = {
    "modes": "more modes",
    "interfaces": "RBE3 modes; nothing, if the part is as rigid there in reality",
    "step": "shorter steps",
    "start": "let loads begin smoothly, or start from equilibrium",
}
OF_BOUNDS = {  # by cause of a bound
    "basis": OF_CAUSES["modes"],
    "interfaces": OF_CAUSES["interfaces"],
    "time step": OF_CAUSES["step"],
    "initial": OF_CAUSES["start"],
    "jumps": OF_CAUSES["start"],
}
MORE_VECTORS = "more vectors (auxiliary_modes=...)"
NOT_LINEAR = "for the error is too large to be linear"
MUCH_SHORTER = "take a twentieth of the step or less"
TWENTIETH = 20.0  # times shorter steps: who is told to halve them would not get there
# makes half widths 50 to 7000 times smaller; shorter steps, damping, vectors 0.5 to 3 times (test_cures.py)
FAR = 3.0  # times the estimate of what it bounds: from there on a bound says that it is far off, not the error
SHARPER = "the bound is {} times the estimate: auxiliary_modes=60, or 130, make it sharper"
OF_CHECKS = {"steps": "halve the step", "vectors": MORE_VECTORS, "loads": "smoother loads"}


def cure_of(
    out: OutputData,
    cause: str | None,
    size: float,
    half: float,
    halves: Mapping[str, float],
    limit: float | None,
) -> str:
    """Return what to do about one cause of an error.

    cause : None: of a bound beside which there is no estimate. size, half : of the error, and its half width.
    halves : parts of that by check. limit : what is allowed.
    """
    if cause is None:
        return OF_BOUNDS[max(out.causes, key=lambda name: np.max(np.abs(out.causes[name]), initial=0.0))]
    if half <= RESOLVED * size or cause == "interfaces":
        return _shorter_steps(size, limit) if cause == "step" and limit is not None else OF_CAUSES[cause]
    if out.beside_steps:  # what starts at once rings in modes that neither steps nor vectors resolve
        return out.beside_steps[0]
    check = max(halves, key=halves.get)
    if check in (LINEAR, LINEAR_STEPS):
        return f"{OF_CAUSES[cause]}, {NOT_LINEAR}"
    if check == "steps" and _is_far(halves[check], float(np.max(np.abs(out.value), initial=0.0))):
        return MUCH_SHORTER
    return OF_CHECKS.get(check, OF_CAUSES[cause])


def _shorter_steps(size: float, limit: float) -> str:
    """How much shorter: errors fall with the square of the step at best."""
    times = ceil(sqrt(size / limit)) if limit > 0 else 2
    return OF_CAUSES["step"] if times <= 2 else f"take steps {times} times as short"


def _is_far(half: float, value: float) -> bool:
    """Whether halving would not get there: half widths fall with the square of the step at best."""
    return value > 0 and TWENTIETH**2 * RESOLVED * value < half < np.inf
