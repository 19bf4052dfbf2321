"""Estimate: the error itself as far as it is known, by cause, and how far that can be trusted (estimates.md)."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .bounds import Bounds

RESOLVED = 0.3  # half width over the largest estimate: above it no digit of the estimate is right
CAUSES = ("basis", "interfaces", "time step", "initial", "jumps")
RINGING = "ringing"  # a check of estimates by steps
LINEAR, LINEAR_STEPS = "linearisation", "linearisation of steps"  # what linear equations miss of each
# checks of the march of a whole mechanism, which tells interfaces and modes apart: vectors that it has not, and what
# linear equations miss
FURTHER, LINEAR_MODES = "further vectors", "linearisation of modes"
FURTHER_INTERFACES, LINEAR_INTERFACES = "further vectors of interfaces", "linearisation of interfaces"
# what steps make wrong of what modes leave out: of the whole error, of neither cause alone
STEPS_OF_MODES = "steps of what modes leave out"
BY_STEPS = ("time step", "steps", LINEAR_STEPS, "loads", RINGING)
# of what is estimated, where what linear equations leave out is not measured; it was up to 0.007 right after a static
# solve, up to 0.002 else, and more where springs are short beside the motion
LINEARISED = 0.01
# samples whose values are provisional: the error by time steps at one depends on two samples after it, the error of
# that error on two more
PROVISIONAL = 4


class Estimate(NamedTuple):
    """Signed error of an output by cause, its half width by check; each (T, r)."""

    parts: dict[str, np.ndarray]
    half_widths: dict[str, np.ndarray]

    def of_rows(self, part: slice) -> Estimate:
        """Return the estimate of some of the rows."""
        return Estimate(*({name: x[:, part] for name, x in kept.items()} for kept in self))

    @property
    def total(self) -> np.ndarray:
        """The estimate (T, r)."""
        return sum(self.parts.values())

    @property
    def uncertainty(self) -> np.ndarray:
        """Its half width (T, r)."""
        return reduce(np.add, self.half_widths.values())  # of one: that array, no copy of it

    def interface_share(self, otherwise: np.ndarray | float) -> np.ndarray | float:
        """Return the share (r,) of rigid interfaces in what the basis makes, largest values over time.

        otherwise : what is returned where the parts do not tell the two apart, or are not known.
        """
        stiff, modes = (np.max(np.abs(self.parts[cause]), axis=0, initial=0.0) for cause in ("interfaces", "basis"))
        told = (stiff > 0) & np.isfinite(stiff + modes)
        return np.where(told, np.divide(stiff, stiff + modes, out=np.zeros_like(stiff), where=told), otherwise)


class TimeStep(NamedTuple):
    """Error by time steps at some samples, computed minus exact.

    x, x2 : (3, S, size), of coordinates, velocities and accelerations, and the error of x. loads : likewise, what
    loads between the samples make uncertain; None where they were not looked at. replaced : so many of the first
    samples are the last ones that were returned before, better known. left : what x may lack still, the sum of the
    sizes of these.
    """

    x: np.ndarray
    x2: np.ndarray
    loads: np.ndarray | None
    replaced: int
    left: Sequence[np.ndarray] = ()

    def of(self, columns: np.ndarray | slice) -> TimeStep:
        """The same of some coordinates."""
        loads = None if self.loads is None else self.loads[..., columns]
        left = [x[..., columns] for x in self.left]
        return TimeStep(self.x[..., columns], self.x2[..., columns], loads, self.replaced, left)


def estimated(streams: dict[str, dict[str, Bounds]], name: str, interfaces: np.ndarray | float = 0.0) -> Estimate:
    """Return what estimator `name` knows of an output's error; what it leaves is bounded, which is the half width.

    Where the scope is complete that is proved; elsewhere it holds under what the scope says.

    interfaces : their share (r,) in what the basis makes, that of static errors. The part follows the whole in time:
    static errors lack the frequencies that free interfaces lower, 60 to 80 % off where a bar rings.
    """
    total, reduction = streams["total"][name], streams["reduction"][name].correction
    none = np.broadcast_to(0.0, total.correction.shape)  # takes no memory
    initial = streams["initial"][name].correction if "initial" in streams else None
    initial = none if initial is None else initial
    basis = reduction - initial
    of_basis = ((1 - interfaces) * basis, interfaces * basis) if np.any(interfaces) else (basis, none)
    known = (*of_basis, total.correction - reduction, initial, none)
    return Estimate(dict(zip(CAUSES, known, strict=True)), {"proved": total.correction_bound})
