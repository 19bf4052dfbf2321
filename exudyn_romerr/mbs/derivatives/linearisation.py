"""Linearisation of a running mechanism: M, D, K and constraints G, read inside the hook without touching the run.

A static solver of our own, initialised once, computes them from the current state and writes into itself only:
the simulation stays equal bit for bit (measured with Exudyn 1.13.6; ComputeLinearizedSystem starts a solver each
time, and states, accelerations and time have to be restored after it). So it does where a stored state is set
(late_readings.py), and what is read there equals, bit for bit, what would have been read in passing.
"""

from __future__ import annotations

from bisect import bisect, bisect_left
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import AssumptionError
from ..access.equations import Equations
from ..access.load_functions import controllers, loads_with_functions
from ..access.state_guard import current_state, of_coordinates, set_state, state_kept, state_set
from ..control.control_functions import find_controls
from ..memory.kept_values import Copies
from .dependence import moved_by
from .reader import DIFFERENCE, FAILED, TangentReader
from .tangent_reading import Carried, Reading, carried_of, compared, hashed, turned_share
from .twin import Place, Twin

CHANGE = 0.6  # of G and K from one tangent to the next: more, and they are taken more often
# steps between tangents, also where nothing changes; they double from 1 on (from 8 on, what rings after a sudden
# start was predicted 5 to 20 times worse)
LONGEST = 1024
SMALL = 0.4  # of CHANGE: less, and less often
CALM = 0.01  # of CHANGE: less, and much less often
TURNED = 0.2  # share of G: more, and how it changes with the coordinates is another one
KEPT = 3  # readings of the block before: a spline through them goes on smoothly


class Tangents:
    """Reads the tangent every few steps of a solve; more often where the mechanism turns fast, or its forces change.

    Attributes
    ----------
    equations : in any state. size : number of coordinates. readings : list of Reading, in the order of time.
    carried : list of Carried, where G has turned since. functions_look : whether user functions look at
    the mbs, beyond what Exudyn gives them.
    """

    def __init__(self, mbs: Any, threads: int = 1):
        self.equations = Equations(mbs, threads)
        self.size = self.equations.size
        controls = find_controls(mbs)
        self.functions_look = controls.functions_look
        self._reader, self._twin = TangentReader(mbs, self.size, controls.functions_look), None
        self._loads = [i for i in loads_with_functions(mbs) if i not in controls.loads]
        self._bare: Place | None = None
        self._copies = Copies()
        self.readings: list[Reading] = []
        self.carried: list[Carried] = []
        self._stride = 1

    def shared(self, mbs: Any) -> np.ndarray:
        """Numbers of redundant constraints, and of those that imply them."""
        return self._reader.shared(Place(self.equations, mbs))

    def read(self, mbs: Any, t: float) -> int:
        """Read the tangent now; return after how many steps it is to be read again."""
        change = self.readings[self.add(self._read(mbs, t))].change
        if len(self.readings) > 1:
            self._stride = max(self._stride // 2, 1) if change > 1 else self._stride
            faster = 4 if change < CALM else 2
            self._stride = min(faster * self._stride, LONGEST) if change < SMALL else self._stride
        return self._stride

    def read_stored(self, mbs: Any, t: float, state: Sequence[np.ndarray]) -> None:
        """Read the tangent of a stored state: q, q_t, q_tt and multipliers at time t."""
        with state_set(mbs.systemData, t, state):
            self.add(self._read(mbs, t))

    def add(self, reading: Reading) -> int:
        """Put a reading where its time belongs; return its number."""
        j = bisect(self.readings, reading.t, key=lambda other: other.t)
        self.readings.insert(j, reading)
        for i in (j, j + 1):
            if 0 < i < len(self.readings):
                self.readings[i] = compared(self.readings[i - 1], self.readings[i], CHANGE)
        return j

    def reads_the_same(self, mbs: Any, reading: Reading) -> bool:
        """Whether Exudyn shows now, near the state of a reading, what it showed then: nothing else has changed."""
        return hashed(*Place(self.equations, mbs).look(reading.t, reading.state)) == reading.seen

    def end_before(self, t: float) -> None:
        """Drop readings from a time on."""
        del self.readings[bisect_left(self.readings, t, key=lambda reading: reading.t) :]

    def forget(self) -> None:
        """Keep the last readings, which what follows is interpolated with."""
        del self.readings[:-KEPT]
        self.carried = [self.carried_near(self.readings[-1].t)]

    def moved(self, states: Sequence[np.ndarray], e: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return q, q_t, q_tt (S, k) that e (3, S, k) moves; coordinates behind those of the mbs may follow."""
        return moved_by(e, states, self._reader.quaternions)

    def differences(self, mbs: Any, t: np.ndarray, states: Sequence[np.ndarray], dq: np.ndarray) -> np.ndarray:
        """K dq (S, n) in states at t (S,), of an mbs that reads the same: all forces at both sides of each.

        Over twice the distance.
        """
        at, step, found = self.light(mbs), DIFFERENCE / np.abs(dq).max(), []
        residual = of_coordinates(at.mbs, lambda _: at.residual())
        with state_kept(at.mbs.systemData):
            for time, q, *others in zip(t, *states, strict=True):
                set_state(at.mbs.systemData, time, (q, *others))
                found.append(residual(q + step * dq) - residual(q - step * dq))
        return np.array(found) / (2 * step)

    def light(self, mbs: Any) -> Place:
        """Where the equations of an mbs that reads the same cost least."""
        return Place(self.equations, mbs) if self._twin is None else self._twin.light

    def cheapest(self, mbs: Any, t: float, state: Sequence[np.ndarray]) -> Place:
        """The light copy if it shows near a state q, q_t, q_tt, multipliers what the mbs shows; or the mbs."""
        own, light = Place(self.equations, mbs), self.light(mbs)
        return light if light.mbs is not mbs and light.shows(t, state, own.look(t, state)) else own

    def without_inertia(self, mbs: Any, t: float, state: Sequence[np.ndarray], count: int) -> Place:
        """The cheapest for residuals in many states, of about so many steps: inertia in closed forms."""
        own = Place(self.equations, mbs)
        if self._twin is None:
            return own
        self._bare = self._bare or self._twin.bare(count)
        seen = own.look(t, state)
        return next((at for at in (self._bare, self._twin.light) if at.shows(t, state, seen)), own)

    def drifts(self, mbs: Any, rows: Sequence[np.ndarray]) -> np.ndarray:
        """What independent constraints keep zero (S, c), in rows of t, q, q_t, q_tt, multipliers."""
        return self.equations.drifts(mbs, rows)[:, self.independent]

    @property
    def differentiable(self) -> np.ndarray:
        """Whether K holds all forces by a coordinate (size,)."""
        return self._reader.differentiable

    @property
    def independent(self) -> np.ndarray:
        """Numbers (c,) of the constraints that are kept, among all."""
        return self._reader.rows

    @property
    def redundant(self) -> int:
        """Number of constraints that follow from others."""
        return self._reader.redundant

    def _read(self, mbs: Any, t: float) -> Reading:
        """Read the tangent in the current state."""
        self._check_loads(mbs)
        state = current_state(mbs.systemData)
        try:
            seen = Place(self.equations, mbs).look(t, state)
        except Exception as error:
            raise AssumptionError(f"{FAILED}: {error}") from error
        at = self._beside(mbs, t, state, seen)
        reading, parts = self._reader.read(at, t)
        if self._is_due(t, reading.G):
            self.carried.append(carried_of(reading, parts, at.inertias))
        return replace(reading, seen=hashed(*seen))

    def _beside(self, mbs: Any, t: float, state: Sequence[np.ndarray], seen: list[np.ndarray]) -> Place:
        """The twin in this state, if it shows what the mbs has shown; else the mbs from now on."""
        if not self.readings:
            self._twin = Twin.of(mbs, self.equations.threads, self.functions_look, t, state, seen)
            self._bare = None
        elif self._twin is not None and not self._twin.light.shows(t, state, seen):
            self._twin = None
        return Place(self.equations, mbs) if self._twin is None else self._twin.hollow.at(t, state)

    def _check_loads(self, mbs: Any) -> None:
        try:
            found = controllers(mbs, self._loads, self._copies)
        except Exception as error:
            raise AssumptionError(f"{FAILED}: {error}") from error
        if found:
            raise AssumptionError(
                f"{', '.join(found.values())} depend on the motion or on earlier calls: pass scope='inputs frozen'"
            )

    def _is_due(self, t: float, G: np.ndarray) -> bool:
        """Whether changes of M and G are kept: where steps are read one by one, nothing is interpolated."""
        if not self.carried:
            return True
        return self._stride > 1 and turned_share(self.carried_near(t).G, G) > TURNED

    def carried_near(self, t: float) -> Carried:
        """Return that of the nearest time."""
        return min(self.carried, key=lambda one: abs(one.t - t))
