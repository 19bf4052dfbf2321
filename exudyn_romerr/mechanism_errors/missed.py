"""What linear equations miss of joints, springs and other bodies, as forces to be marched beside the error itself.

Exudyn's own forces and constraints under q + e tell by how much, and a march what comes of it. A few rows show
whether that counts: where errors are largest and, for bounds, half way between rows in which tangents were read,
where splines are farthest off. Where it counts all rows are asked, and what comes of it is added to the error; what
is missed then is less by as much as errors are small.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ..mechanism.mechanism import Mechanism
from ..mechanism.rotations import times
from ..mechanism.tangents import Block
from .factors import Factors, factors_of
from .half_widths import Largest
from .linearity import UnmovedForces, largest_shares, missed_sizes, nonlinear_forces, rows_by_users
from .march import March, State

if TYPE_CHECKING:
    from .end_state import EndState

MOST = 32  # rows of a block that are looked at
# of forces or motions of errors, if more is missed it is added: half widths know of the second, of the first bounds
# would take a margin that is wide; with more than MUCH errors are not small, and what is added may grow
FOR_BOUNDS, COUNTS, MUCH = 1 / 2048, 1 / 50, 1 / 4
COMES = 128  # rows over which what is added comes or goes: constraints off by it at once would make velocities


class MissedForces:
    """Marches what linear equations miss, block after block.

    second_order (2,) : what is missed of constraints in the end, as a share of the error's motion, and how far errors
    turn a node, rad; the largest of both.
    """

    def __init__(self, of: Mechanism, for_bounds: bool, before: EndState | None):
        self._of, self._for_bounds, self.second_order, self._most = of, for_bounds, np.zeros(2), 0.0
        self._added, self._rest = (March(of.unknowns, of.scheme) for _ in range(2))
        self._before = None if before is None else before.added
        # how much of it is added, 0 to 1, and what was in the last row
        self._level, self._last = float(before is None or before.added is not None), None

    @property
    def end(self) -> State | None:
        """The state after the last row of what is added to errors; None: nothing was."""
        return self._added.state

    def take(
        self,
        block: Block,
        factors: Factors,
        first: int,
        e: np.ndarray,
        lam: np.ndarray,
        unmoved: UnmovedForces,
    ) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray] | None]:
        """Go on through a block that begins with row `first`, under errors e (T, 3, n), lam (T, c).

        Returns
        -------
        kicks (T, n) to be added; what comes of them (T, 3, n), (T, c); for bounds the same of what is still missed
        """
        kicks, g = np.zeros((len(block), self._of.unknowns.n)), np.zeros(lam.shape)
        rows, added = self._rows(block, first, e), (np.zeros(e.shape), np.zeros(lam.shape))
        missed = self._missed(block, rows, e, lam, unmoved)
        share, counts = self._shares(block, rows, e, missed).max(), FOR_BOUNDS if self._for_bounds else COUNTS
        goes_on = self.end is not None or (first == 0 and self._before is not None)
        if is_added := goes_on or counts < share < MUCH:
            if first and self.end is None:
                self._added.state, self._level = State.at_rest(self._of.unknowns), 0.0
            kicks, g = self._to_be_added(block, first, e, lam, unmoved, share < MUCH)
            added = self._added.through(block, factors, kicks[..., None], self._before, g[..., None])
            added = [x[..., 0] for x in added]
        by_users = rows_by_users(self._of, block, e[..., : self._of.unknowns.n_a], unmoved)
        rows = np.union1d(rows, by_users)
        if self._for_bounds and (is_added or len(by_users)):
            e, lam = (x + y for x, y in zip((e, lam), added, strict=True))
            now = self._missed(block, rows, e, lam, unmoved)
            missed = [x - y[rows] for x, y in zip(now, (kicks, g), strict=True)]
        return kicks, added, self._beside(block, factors, first, rows, e, missed) if self._for_bounds else None

    def _to_be_added(
        self, block: Block, first: int, e: np.ndarray, lam: np.ndarray, unmoved: UnmovedForces, is_small: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """What is missed, kicks (T, n) and of constraints (T, c): it comes in, or goes if it is no longer small."""
        T, begins = len(block), int(first == 0 and not e[0, :2].any())
        change = np.arange(1, T + 1) / COMES
        if is_small:
            kicks, g = np.zeros((T, self._of.unknowns.n)), np.zeros(lam.shape)
            kicks[begins:], g[begins:] = self._missed(block, np.arange(begins, T), e, lam, unmoved)
            self._last, level = (kicks[-1:], g[-1:]), np.minimum(self._level + change, 1.0)
        else:
            kicks, g = self._last = self._last or self._missed(block, np.arange(1), e, lam, unmoved)
            level = np.maximum(self._level - change, 0.0)
        self._level, weight = level[-1], (level**2 * (3 - 2 * level))[:, None]
        return weight * kicks, weight * g

    def _beside(
        self,
        block: Block,
        factors: Factors,
        first: int,
        rows: np.ndarray,
        e: np.ndarray,
        missed: tuple[np.ndarray, np.ndarray],
    ) -> tuple[np.ndarray, np.ndarray]:
        """What comes of forces that are missed in a few rows, and of second order."""
        turns = e[:, 0, self._of.unknowns.turns].reshape(len(e), -1, 3)
        now = self._shares(block, rows, e, missed)[1], np.linalg.norm(turns, axis=2).max(initial=0.0)
        self.second_order = np.maximum(self.second_order, now)
        between = np.zeros((len(block), self._of.unknowns.n, 1))
        if len(rows):
            every = np.arange(len(block))
            between[..., 0] = np.transpose([np.interp(every, rows, y) for y in missed[0].T])
        if first == 0:
            between[0] = 0.0
        return self._rest.through(block, factors, between)

    def _missed(
        self, block: Block, rows: np.ndarray, e: np.ndarray, lam: np.ndarray, unmoved: UnmovedForces
    ) -> tuple[np.ndarray, np.ndarray]:
        """Kicks (rows, n) and what constraints (rows, c) shall see, for what linear equations miss."""
        u, kicks, g = self._of.unknowns, np.zeros((len(rows), e.shape[2])), np.zeros((len(rows), lam.shape[1]))
        if len(rows):
            left, bent = nonlinear_forces(self._of, block[rows], e[rows, :, : u.n_a], lam[rows], unmoved(rows))
            kicks[:, : u.n_a], g = -left, -bent
        return kicks, g

    def _shares(
        self, block: Block, rows: np.ndarray, e: np.ndarray, missed: tuple[np.ndarray, np.ndarray]
    ) -> np.ndarray:
        """Largest shares (2,) of forces and of motions that errors make."""
        if not len(rows):
            return np.zeros(2)
        own = slice(self._of.unknowns.n_a)
        sizes = missed_sizes(self._of, block[rows], e[rows, :, own], missed[0][:, own], missed[1])
        self._most = np.maximum(self._most, sizes[:, 1].max(axis=0))
        return largest_shares(sizes, self._most)

    def _rows(self, block: Block, first: int, e: np.ndarray) -> np.ndarray:
        """Rows of a block that are looked at: where there are errors."""
        T, x = len(block), e[:, 0, : self._of.unknowns.n_a]
        squares = np.einsum("ti,ti->t", times(block.M, x), x)
        readings = self._of.readings.at if self._for_bounds else ()
        between = [(a + b) // 2 - first for a, b in pairwise(readings) if b > a + 1]
        between = [i for i in between if 0 <= i < T]
        rows = sorted({*between[:: 1 + len(between) // MOST], int(np.argmax(squares))})
        return np.array([i for i in rows if e[i, 0].any()], int)


class MissedFeedback:
    """What comes of forces of a sampled feedback that are not linear in the error, where it saturates: marched.

    Their errors are of first order in the step, and no few rows tell where a controller that saturates begins to.
    largest : over time, "feedback" of what sensors show.
    """

    def __init__(self, of: Mechanism):
        self._of, self._march, self._before, self.largest = of, March(of.unknowns, of.scheme), 0.0, Largest()

    def take(self, block: Block, first: int, e: np.ndarray, lam: np.ndarray, unmoved: UnmovedForces) -> None:
        """Go on through a block that begins with row `first`, under errors e (T, 3, n_a), lam (T, c)."""
        of, block, kicks = self._of, block.as_if_at_once(), np.zeros((len(block), self._of.unknowns.n, 1))
        every = np.arange(int(first == 0), len(block))
        left, _ = nonlinear_forces(of, block[every], e[every], lam[every], unmoved(every))
        kicks[every, : of.unknowns.n_a, 0] = -left
        h = np.diff(block.rows.t, prepend=self._before if first else block.rows.t[0] - 1.0)
        self._before = block.rows.t[-1]
        d, forces = self._march.through(block, factors_of(block, h, of.unknowns, of.scheme), kicks)
        self.largest.add(feedback=of.outputs(first, d, of.all_multipliers(forces))[..., 0])
