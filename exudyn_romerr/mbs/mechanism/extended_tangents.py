"""ExtendedTangents: the linearised equations of a mechanism with auxiliary vectors of its bodies, over time."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...estimates.march import Tangent
from ...online.coupled_runs import shared_energy
from ..access.mbs_items import has_joints_only
from ..derivatives.tangent_reading import is_lighter

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...model.floating_frame import FrameMotion
    from ...online.run import Opening, Run
    from ..derivatives.linearisation import Reading, Tangents
    from .enriched_body import EnrichedBody

    Seen = Callable[[float, Sequence[np.ndarray]], Sequence[np.ndarray]]  # parts of D and K by vectors, of t, state

TINY = np.finfo(float).tiny
MASSLESS = 1e-12  # of the largest mass: a parameter of a rotation may have none
KEPT = 8  # tangents: whoever asks after the march asks for the same ones again, of a block there are few
LEFT = 1e-8  # of constraints: what Newton's tolerance leaves of none


class ExtendedTangents:
    """Tangents with the vectors behind the coordinates of the mechanism, and rates of a spline in time through them.

    Made when asked for, the last KEPT of them kept. t : their times, those of the readings.
    """

    def __init__(
        self,
        readings: Sequence[Reading],
        size: int,
        parts: Sequence[tuple[EnrichedBody, slice]],
        before: ExtendedTangents | None = None,
        seen: Seen | None = None,
    ):
        """Size counts the coordinates of mechanism and vectors; parts: bodies, and where their vectors are.

        before : of the same parts; what it has of readings is not made again. seen : see mbs/shadow/seen_vectors.py.
        """
        self._size = size
        self.t = np.array([reading.t for reading in readings])
        self._whole = np.zeros((len(readings), 3 * size + len(readings[0].G), size))
        self._own = [reading.K for reading in readings]  # a reading is made anew where another one comes before it
        made = {} if before is None else {id(K): row for K, row in zip(before._own, before._whole, strict=True)}
        new = []
        for j, K in enumerate(self._own):
            if id(K) in made:
                self._whole[j] = made[id(K)]
            else:
                new.append(j)
        if new:
            self._extend(new, [readings[j] for j in new], parts)
        for j in new if seen is not None else ():  # by controllers
            of_vectors = self._whole[j, size : 3 * size].reshape(2, size, size)[:, :, len(readings[j].M) :]
            of_vectors += seen(readings[j].t, readings[j].state)
        # rates of the motion itself: where pieces of splines meet, C would have a kink
        is_moving = len(readings) > 1
        self._turning = [(reading.C, reading.C_t if is_moving else 0 * reading.C) for reading in readings]
        self._made: dict[int, Tangent] = {}

    @cached_property
    def _rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Which entries vary, for of two bodies much is zero and stays so; their rates (T, p)."""
        varies = (self._whole != self._whole[0]).any(axis=0)
        if not varies.any():
            return varies, np.zeros((len(self.t), 0))
        from scipy.interpolate import CubicSpline  # here, for it takes long to import: see CoupledSubject

        slopes = CubicSpline(self.t, np.eye(len(self.t)))(self.t, 1)  # of values at these times
        return varies, slopes @ (self._whole[:, varies] - self._whole[0, varies])

    def is_of(self, readings: Sequence[Reading]) -> bool:
        """Whether these are the readings that it is made of."""
        return len(readings) == len(self._own) and all(r.K is K for r, K in zip(readings, self._own, strict=True))

    def __getitem__(self, j: int) -> Tangent:
        if j not in self._made:
            if len(self._made) == KEPT:
                del self._made[next(iter(self._made))]
            self._made[j] = replace(self._tangent(j, 0), rate=self._tangent(j, 1))
        return self._made[j]

    def turning(self, t: np.ndarray) -> np.ndarray:
        """Return how fast constraints turn (S,), rad/s, in the steps to t; a reading is good for those around it."""
        rates = [
            (np.linalg.norm(C_t, axis=1) / np.maximum(np.linalg.norm(C, axis=1), TINY)).max(initial=0.0)
            for C, C_t in self._turning
        ]
        after = np.clip(np.searchsorted(self.t, t), 0, len(rates) - 1)
        return np.maximum(np.array(rates)[after], np.array(rates)[np.maximum(after - 1, 0)])

    def is_lighter(self, j: int, share: float) -> bool:
        """Whether the smallest mass that constraints admit is below a share of both ends' on the way to the next."""
        ends = self[j], self[j + 1]
        eighth, masses = (ends[1].t - ends[0].t) / 8, np.max([np.diag(tangent.M) for tangent in ends], axis=0)
        of_M, of_C = ([getattr(x, name) for x in ends] + [getattr(x.rate, name) for x in ends] for name in "MC")
        M, C = (np.array([x, y, (x + y) / 2 + eighth * (x_t - y_t)]) for x, y, x_t, y_t in (of_M, of_C))
        return is_lighter(M, C, 1 / np.sqrt(np.maximum(masses, MASSLESS * masses.max())), share)

    def _tangent(self, j: int, order: int) -> Tangent:
        """The tangent, or its rate."""
        n, turning, whole = self._size, self._turning[j][order], self._whole[j]
        if order:
            varies, rates = self._rates
            whole = np.zeros_like(whole)
            whole[varies] = rates[j]
        C = np.hstack([turning, np.zeros((len(turning), n - turning.shape[1]))])
        return Tangent(self.t[j], *whole[: 3 * n].reshape(3, n, n), whole[3 * n :], C)

    def _extend(self, new: Sequence[int], readings: Sequence[Reading], parts: Sequence[tuple]) -> None:
        """Write M, D, K and G of new readings with the vectors, one upon another."""
        n, size = len(readings[0].M), self._size
        t, states = self.t[new], [np.array([reading.state[k] for reading in readings]) for k in range(3)]
        coupled = [(body.couplings(t, [x[:, body.columns] for x in states]), body, own) for body, own in parts]
        for i, (j, reading) in enumerate(zip(new, readings, strict=True)):
            M, D, K = whole = self._whole[j, : 3 * size].reshape(3, size, size)
            whole[:, :n, :n] = reading.M, reading.D, reading.K
            for of, body, own in coupled:
                rows = np.concatenate([body.columns, np.arange(own.start, own.stop)])
                M[rows, own], D[rows, own], K[rows, own] = of.M[i], of.D[i], of.K[i]
                M[own, body.columns] = of.M[i][: len(body.columns)].T
                D[own, body.columns], K[own, body.columns] = of.D_rows[i], of.K_rows[i]
            self._whole[j, 3 * size :, :n] = reading.G


class ExtendedReadings:
    """Makes ExtendedTangents of readings; what it has made of one it does not make again."""

    seen: Seen | None = None  # set where there is one, before anything is made

    def __init__(self, tangents: Tangents, size: int, parts: Sequence[tuple[EnrichedBody, slice]]):
        """Tangents hold readings; for the others see ExtendedTangents."""
        self._tangents, self._of = tangents, (size, parts)
        self._made: ExtendedTangents | None = None

    def of(self, readings: Sequence[Reading]) -> ExtendedTangents:
        """Make them of some readings."""
        return ExtendedTangents(readings, *self._of, self._made, self.seen)

    def now(self) -> ExtendedTangents:
        """Make them of all readings that are kept now, and keep them until the next call."""
        readings = self._tangents.readings
        if self._made is None or not self._made.is_of(readings):
            self._made = self.of(readings)
        return self._made

    def forget(self) -> None:
        """Keep the last readings only."""
        self._tangents.forget()
        self.now()


class FixedFreedoms:
    """Rigid motions that joints leave to a body which is the whole mechanism, if they are the same ones all the time.

    In the body's axes. Joints that see its deformations leave none, and springs are not asked.
    """

    def __init__(self, bodies: Sequence[EnrichedBody], size: int):
        """Size counts the coordinates of the mechanism."""
        self._body = bodies[0] if len(bodies) == 1 and size == len(bodies[0].columns) else None
        self._t = -np.inf

    def prepare(self, mbs: Any) -> None:
        """Do before the solve what `open` needs of the full body, whatever the joints are."""
        if self._body is not None and has_joints_only(mbs):
            _ = self._body.offline.estimators["auxiliary"].slow_modes.shapes

    def open(self, mbs: Any, readings: Sequence[Reading], runs: Sequence[Run], openings: Sequence[Opening]) -> None:
        """Find them where a run begins; its bounds know them from there on."""
        if self._body is None or openings[0].start is None or openings[0].start.y0 is not None:
            return
        self._scale = np.repeat([1.0, 1.0 / np.abs(self._body.flex.positions).max()], 3)  # of rotations: a length
        self._shapes = np.abs(self._body.shapes[:, : len(self._body.modal)]).max(axis=0)
        self._found = self._among(readings[0]) if has_joints_only(mbs) else None
        if self._found is not None:
            energy = shared_energy(runs[0], "reduction")
            energy.slow = energy.slow_modes(self._scale[:, None] * self._found)
            if energy.slow is not None:
                energy.slow.start(openings[0].start.z, float(np.linalg.norm(self._motion(readings).w[0])))

    def check(self, readings: Sequence[Reading], runs: Sequence[Run]) -> None:
        """Let bounds forget them if readings have others."""
        energy = None if self._body is None else shared_energy(runs[0], "reduction")
        new = [] if energy is None or energy.slow is None else [x for x in readings if x.t > self._t]
        if new:
            self._t, moves = new[-1].t, self._moves(new) @ self._found
            leaves = all(self._leaves(*pair) for pair in zip(new, moves, strict=True))
            if not leaves or not energy.slow.cover(self._motion(new).w):
                energy.slow = None

    def _leaves(self, reading: Reading, moves: np.ndarray) -> bool:
        """Whether constraints, independent of one another, leave just these motions (frame, f)."""
        rows = np.vstack([reading.G, reading.C])
        of_frame = rows[:, self._body.frame]
        limit = LEFT * np.abs(of_frame).max(initial=0.0)
        stays = np.all(np.abs(of_frame @ moves) <= limit * np.abs(moves).max(initial=0.0))
        return bool(len(reading.G) == self._count and stays and not self._sees_shapes(rows))

    def _sees_shapes(self, rows: np.ndarray) -> bool:
        limit = LEFT * np.abs(rows[:, self._body.frame]).max(initial=0.0)
        return bool(np.any(np.abs(rows[:, self._body.modal]) > limit * self._shapes))

    def _among(self, reading: Reading) -> np.ndarray | None:
        """Orthonormal combinations (6, f) of scaled rigid motions; None: constraints see deformations."""
        rows, self._count = np.vstack([reading.G, reading.C]), len(reading.G)
        rigid = rows[:, self._body.frame] @ self._moves([reading])[0]
        _, size, turn = np.linalg.svd(np.vstack([rigid, np.zeros((6, 6))]))
        return None if self._sees_shapes(rows) else turn[size <= LEFT * np.abs(rigid).max(initial=0.0)].T

    def _moves(self, readings: Sequence[Reading]) -> np.ndarray:
        """Rates (T, frame, 6) of the frame's coordinates that scaled rigid motions in the body's axes are."""
        motion, size = self._motion(readings), self._body.frame_size
        moves = np.zeros((len(readings), size, 6))
        frames = np.array([reading.state[0][self._body.columns[:size]] for reading in readings])
        moves[:, :3, :3], moves[:, 3:, 3:] = motion.A, np.linalg.pinv(self._body.sampler.frame.rates(frames))
        return moves * self._scale

    def _motion(self, readings: Sequence[Reading]) -> FrameMotion:
        columns = self._body.columns[: self._body.frame_size]
        states = (np.array([reading.state[k][columns] for reading in readings]) for k in range(3))
        return self._body.sampler.frame.motion(*states)
