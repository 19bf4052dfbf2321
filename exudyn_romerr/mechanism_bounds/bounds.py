"""The bound: what an estimated error of modes misses, in the frames of bodies, at most.

The reduced run and the estimate e together are a motion of the full mechanism, whose residual R is known. To first
order what is still missing, z, obeys

    |C z + C K^-1 f_n| <= c |C|_{K^-1} (g_n + rest_n) ,

all bodies together, whatever joints, springs and dampers there are (docs/theory.md): g of `Sums`, f_n the mean of R_n
and R_n-1 that steps feel. Nothing here has the number of nodes but what is made once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..linalg.blocked_products import row_norms
from ..mechanism.mechanism import Mechanism
from ..mechanism_errors.march import is_at_rest
from ..mechanism_errors.modes import Marched
from .free_mass import FreeMass, free_velocity_norms
from .passive_steps import Means, PassiveSteps
from .residual_norm import ResidualNorm
from .residuals import Residual, Residuals
from .sums import Sums

MANY_TURNS = 0.04  # rad in a step: above, means of two steps are no forces in one frame
SAME = 1e-6  # of a step: of the same size
IDLE = 1e-6  # of a load or wrench: more of it where no motion answers it is not counted
OTHER_STEPS = "steps of another scheme than generalised-alpha"
UNEQUAL_STEPS = "steps of different sizes"
IDLE_FORCES = "a load or joint force that modes and vectors do not answer"


@dataclass(frozen=True)
class MeshRows:
    """Output rows from `first` on: C (r, N) of displacements in the frame of body number `body`, or of rates."""

    first: int
    body: int
    C: np.ndarray
    is_rate: bool


@dataclass(frozen=True)
class Proved:
    """Of output rows (n,): what is to be added to estimates, and what these then miss at most, as (T, n).

    missed (T, n) : what comes of forces that linear equations miss. second_order (2,) : see MissedForces.
    sizes (n,) : by which rows of any unit are alike: of what a unit of the error's energy shows in each.
    """

    rows: np.ndarray
    sizes: np.ndarray
    static: np.ndarray
    miss: np.ndarray
    missed: np.ndarray
    second_order: np.ndarray


@dataclass(frozen=True)
class _Seen:
    """Of MeshRows: |C| in K^-1, or M^-1 of rates; C K^-1 (Y, r); means of what they see; both None of rates."""

    size: np.ndarray
    static: np.ndarray | None
    means: Means | None


class Bounds:
    """Goes on from block to block. why_not : why there is no bound; empty: there is one, so far."""

    def __init__(self, of: Mechanism, norms: Iterable[ResidualNorm], outputs: Sequence[MeshRows]):
        scheme, unknowns = of.scheme, of.unknowns
        self._alpha, self._outputs = scheme.alpha_f, outputs
        self._steps = PassiveSteps.of(scheme.alpha_m, scheme.alpha_f, scheme.beta, scheme.gamma)
        self.why_not = "" if self._steps else OTHER_STEPS
        norms = [*norms] if self._steps else []  # made only where they are asked
        if max((norm.idle for norm in norms), default=0.0) > IDLE:
            self.why_not, norms = self.why_not or IDLE_FORCES, []
        self._nodes, self._residuals, self._sums = unknowns.nodes, Residuals(unknowns, norms), Sums()
        self._beta = np.maximum([norm.rayleigh[1] for norm in norms], np.finfo(float).tiny)
        self._seen = [] if self.why_not else [_seen(norms[out.body], out) for out in outputs]
        self._y = self._turn = self._last_time = self._h = None
        self._start, self._static, self._miss, self._missed = 0.0, [], [], []
        self._second_order = np.zeros(2)

    def take(self, now: Marched) -> None:
        """Go on through what has been marched."""
        if self.why_not:
            return
        t = now.block.rows.t
        begins = self._last_time is None
        h = np.diff(t, prepend=t[0] - (t[1] - t[0]) if begins else self._last_time)
        self._last_time, self._h = t[-1], h[-1] if begins else self._h
        if np.abs(h / self._h - 1).max() > SAME:
            self.why_not = UNEQUAL_STEPS
            return
        rests = begins and is_at_rest(now.block.rows) and bool(now.f[0].any())
        R = self._residuals.take(now.block, now.f, now.e, now.lam)
        turn = h * 2 * self._speeds(now)
        if begins:
            self._y, self._turn = R.y[[0, 0, 0]], turn[:1]
            if self._steps.kappa and not rests:
                self._start = self._steps.start(self._h, *self._residuals.start)
                self._sums.begin(self._start)
        f, g = self._grown(R, turn, h, begins, rests)
        static, miss = self._shown(f, g + R.fast)
        if begins and not rests:
            static[0] = miss[0] = 0.0
        self._missed.append(now.missed)
        self._second_order = now.second_order
        self._static.append(static)
        self._miss.append(miss)

    def proved(self) -> Proved | None:
        """Return what is proved of all rows; None: nothing, and why_not says why."""
        if self.why_not:
            return None
        rows = np.concatenate([np.arange(out.first, out.first + len(out.C)) for out in self._outputs])
        missed = np.concatenate(self._missed)[:, rows]
        sizes = np.concatenate([seen.size for seen in self._seen])
        static, miss = -np.concatenate(self._static), np.concatenate(self._miss)
        return Proved(rows, sizes, static, miss, missed, self._second_order)

    def _speeds(self, now: Marched) -> np.ndarray:
        """Angular velocity (T,) of the node that turns fastest, rad/s."""
        return np.max([2 * row_norms(now.block.rows.v[:, node.own[3:]]) for node in self._nodes], axis=0)

    def _grown(
        self, R: Residual, turn: np.ndarray, h: np.ndarray, begins: bool, rests: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Forces f (T, Y) that steps feel, and g (T,)."""
        a, y = self._alpha, np.concatenate([self._y, R.y])
        use = np.where(turn > MANY_TURNS, 0.0, a)
        f = y[3:] - use[:, None] * (y[3:] - y[2:-1])
        before = np.concatenate([y[2:3] - use[0] * (y[2:3] - y[1:2]), f[:-1]])
        if begins:
            turn[0] = turn[min(1, len(turn) - 1)]
            before[:2] = 0.0
            if rests:  # in an equilibrium C K^-1 f is there at once, but for what shapes would answer
                before[0, ~self._residuals.on_shapes] = f[0, ~self._residuals.on_shapes]
                before[1:2] = f[:1]
        d, turned = row_norms(np.diff(y, axis=0)), np.abs(np.diff(turn, prepend=self._turn)) * row_norms(y[3:])
        turning = use * (turn * (d[2:] + d[1:-1]) + turned)
        extra = R.fast_change + turning + self._steps.impulse * h * R.push
        parts = np.split(f, self._residuals.cuts[1:-1], axis=1)
        work = h / 2 * sum(row_norms(x) ** 2 / beta for x, beta in zip(parts, self._beta, strict=True))
        steps = np.stack([row_norms(f - before), extra, work, row_norms(f)], axis=1)
        if begins:
            steps[0, 1:3] = 0.0
            steps[0] *= rests
        self._y, self._turn = y[-3:], turn[-1:]
        return f, self._sums.take(*steps.T)

    def _shown(self, f: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """C K^-1 f (T, R), and what is missed beside it, at most."""
        cuts, static, miss = self._residuals.cuts, [], []
        at_once, later = np.minimum(g, self._start), np.maximum(g - self._start, 0.0)
        for out, seen in zip(self._outputs, self._seen, strict=True):
            if out.is_rate:
                c = np.full(len(seen.size), self._steps.norms[1])
                static.append(np.zeros((len(g), len(seen.size))))
            else:
                c = self._steps.displacement(self._h, seen.means)
                static.append(f[:, cuts[out.body] : cuts[out.body + 1]] @ seen.static)
            from_rest = np.minimum(c, self._steps.from_rest[int(out.is_rate)])
            miss.append(np.outer(later, from_rest * seen.size) + np.outer(at_once, c * seen.size))
        return np.concatenate(static, axis=1), np.concatenate(miss, axis=1)


def _seen(norm: ResidualNorm, out: MeshRows) -> _Seen:
    C = norm.held.space.rows(out.C)
    if out.is_rate:
        return _Seen(free_velocity_norms(norm.held, C), None, None)
    mass = FreeMass.of(norm.held)
    return _Seen(*norm.rows(C), mass.means(C.T, mass.norms(C.T)))
