"""StoredResiduals: what Exudyn's equations leave in states that are set, at and between samples of a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...errors import RunError
from ...estimates.local_errors import in_the_middle
from ..access.linearisation import Tangents
from ..access.load_functions import load_functions, loads_with_functions
from ..access.state_guard import set_state, state_kept
from ..memory.user_memory import memory_kept

BALANCED = 1e-3  # of the largest force: what may be left at a sample, where Newton's iterations have ended
# of the largest local error of a velocity: a residual that moves it by more is looked at closer. Each velocity by
# itself: where modes ring unresolved, their local errors hide those of a load that switches and moves the body
MATTERS = 0.1
SEEN = 1e-2  # of the local errors of all: those of single velocities below count as such
QUARTERS, MIDDLE = (0.25, 0.75), 0.5
# Boole's rule less Simpson's, of residuals at quarter, middle, three quarters; both have 0 at the ends
CLOSER = np.array([32 / 90, 12 / 90 - 2 / 3, 32 / 90]) / (2 / 3)  # 2/3: what at_samples multiplies by


class StoredResiduals:
    """Residuals M q'' + G^T l - f of an mbs between the samples of a run.

    The run goes on as it was, bit for bit: states are set back, and what user functions keep.

    Attributes
    ----------
    failure : why there are no residuals between samples; empty if there are.
    """

    def __init__(self, tangents: Tangents, mbs: Any):
        self._tangents, self._functions = tangents, user_functions(mbs)
        self.failure = ""

    def between(
        self, mbs: Any, rows: Sequence[np.ndarray], first: int, dv: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | tuple[None, None]:
        """Return r (S, n) in the middle of the steps from `first` on, and what is uncertain of it.

        rows : t (W,), q, q_t, q_tt, multipliers (W, ...) of samples. dv (W - 1, n) : local errors of velocities,
        beside which residuals matter or not. None, None: see failure.
        """
        if self.failure or mbs is None:
            self.failure = self.failure or GONE
            return None, None
        try:
            with memory_kept(mbs, self._functions) as memory, state_kept(mbs.systemData):
                if memory.lost:
                    raise RunError(HOLDS.format(memory.lost))
                self._check(mbs, rows, dv)
                found = self._between(mbs, rows, first, dv)
                self.failure = MEMORY if memory.changed else ""
        except Exception as error:  # of a user function, or of a state that cannot be
            self.failure = FAILED.format(error)
        return (None, None) if self.failure else found

    def _between(self, mbs: Any, rows: Sequence, first: int, dv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The middle of all steps; where that matters, their quarters too."""
        r = self._at(mbs, rows, MIDDLE, np.arange(first, len(rows[0]) - 1))
        uncertain = np.zeros_like(r)
        light = np.sqrt(self._tangents.readings[-1].masses)
        moved, known = np.diff(rows[0])[first:, None] * np.abs(r) / light, np.abs(dv * light).max(axis=0)
        closer = np.flatnonzero((moved > MATTERS * np.maximum(known, SEEN * self._largest(dv))).any(axis=1))
        if closer.size:
            quarter, last = (self._at(mbs, rows, share, first + closer) for share in QUARTERS)
            uncertain[closer] = np.tensordot(CLOSER, [quarter, r[closer], last], axes=1)
        return r, uncertain

    def _speed(self, force: np.ndarray) -> np.ndarray:
        """What forces (S, n) change in unit time, of the size of velocities in the mass norm."""
        return np.linalg.norm(force / np.sqrt(self._tangents.readings[-1].masses), axis=1)

    def _largest(self, dv: np.ndarray) -> float:
        return float(np.linalg.norm(dv * np.sqrt(self._tangents.readings[-1].masses), axis=1).max())

    def _at(self, mbs: Any, rows: Sequence[np.ndarray], share: float, steps: np.ndarray) -> np.ndarray:
        """Residuals (S, n) within steps, at a share of each."""
        t, *states = rows
        times = t[:-1] + share * np.diff(t)
        inside = [in_the_middle(t, x, share)[steps] for x in states]
        return np.array([self._residual(mbs, now, state) for now, *state in zip(times[steps], *inside, strict=True)])

    def _residual(self, mbs: Any, t: float, state: Sequence[np.ndarray]) -> np.ndarray:
        set_state(mbs.systemData, t, state)
        return self._tangents.equations.residual(mbs)

    def _check(self, mbs: Any, rows: Sequence[np.ndarray], dv: np.ndarray) -> None:
        """RunError if the equations of the run are not these: something acts on it that its state does not tell."""
        t, q, q_t, q_tt, multipliers = (x[-1] for x in rows)
        left = self._residual(mbs, t, (q, q_t, q_tt, multipliers))
        forces = self._residual(mbs, t, (q, q_t, 0 * q_tt, 0 * multipliers))
        moved = (t - rows[0][-2]) * self._speed(left[None])[0]
        if np.abs(left).max() > BALANCED * np.abs(forces).max() and moved > MATTERS * self._largest(dv):
            raise RunError(f"at t = {t:g} s Exudyn's equations do not hold in the state of the sample")


def user_functions(mbs: Any) -> list[Callable]:
    """Return the user functions of loads and objects."""
    found = [f for i in loads_with_functions(mbs) for f in load_functions(mbs.GetLoad(i))]
    for i in range(mbs.systemData.NumberOfObjects()):
        values = [value for key, value in mbs.GetObject(i).items() if key.endswith("UserFunction") and value]
        found += [f for f in (v.get("function") if isinstance(v, dict) else v for v in values) if callable(f)]
    return found


GONE = "the mbs is gone"
MEMORY = "a user function keeps something from call to call"
HOLDS = "a user function can reach what no call away from the run could put back: {}"
FAILED = "{}"
