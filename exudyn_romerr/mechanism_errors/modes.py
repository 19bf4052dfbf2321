"""Errors by modes and by rigid interfaces: the march under what vectors would feel, and one correction of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..mechanism.tangents import Block
from ..report.causes import FURTHER, FURTHER_INTERFACES, LINEAR_INTERFACES, LINEAR_MODES, STEPS_OF_MODES
from .factors import Factors, factors_of
from .half_widths import CauseEstimate, Largest, tail, unchecked
from .march import March, State
from .missed import MissedForces
from .unbalanced import unbalanced

if TYPE_CHECKING:
    from ..mechanism.mechanism import Mechanism
    from .end_state import EndState
    from .linearity import UnmovedForces

# of whose force on vectors the kicks are: thirds of the vectors, in the order in which they were found; those that
# deform interfaces which the modes make rigid, the last third of these apart
PARTS = ("first third", "second third", "last third", "deforming", "deforming, last third")
OF_MODES = 3  # of PARTS
# between h and 2 h lie 3 times the error of steps where they resolve what vectors do, and less where they do not
TWICE_THE_STEP = 1.5


@dataclass
class Marched:
    """A block that was marched: kicks f (T, n), errors e (T, 3, n), lam (T, c) of all parts, corrected.

    of_modes (T, n) : f without what deforms rigid interfaces. factors : of the march.
    missed (T, R) : what comes of forces that linear equations miss, in outputs; None: that was not asked.
    second_order : see MissedForces.
    """

    block: Block
    f: np.ndarray
    e: np.ndarray
    lam: np.ndarray
    of_modes: np.ndarray
    factors: Factors
    missed: np.ndarray | None = None
    second_order: np.ndarray | None = None


@dataclass
class OfBody:
    """What errors have of one body's shapes.

    squares (m, m) : the sum over rows of x x^T of vectors. deformed (k,) : all shapes in the row where |U x|_M is
    largest; size, row : that norm and its number.
    """

    squares: np.ndarray | float = 0.0
    deformed: np.ndarray | None = None
    size: float = 0.0
    row: int = 0


class Modes:
    """Marches block after block. now : the last block. of_bodies : see OfBody."""

    def __init__(self, of: Mechanism, before: EndState | None, for_bounds: bool = False):
        self._of, self._before, self._goes_on = of, None, before
        self.is_rigid = of.is_rigid
        self._parts = len(PARTS) if self.is_rigid else OF_MODES
        self._wanted = [OF_MODES, self._parts] if self.is_rigid else [OF_MODES]  # parts whose sums are corrected
        self._first, self._second, self._coarse = (March(of.unknowns, of.scheme) for _ in range(3))
        self._before_coarse: float | None = None
        self._last: np.ndarray | None = None  # sums of parts in the row before, (3, n, wanted)
        self._largest, self._kept = Largest(), []
        self.now: Marched | None = None
        self._for_bounds = for_bounds
        self._missed = None if of.readings.splined.is_sampled else MissedForces(of, for_bounds, before)
        self.of_bodies = [OfBody() for _ in of.unknowns.bodies]

    def take(self, block: Block, first: int, unmoved: UnmovedForces) -> None:
        """Go on through a block of rows of the run that begins at number `first`."""
        u, t = self._of.unknowns, block.rows.t
        f = self._shared(self._kicks(block))[..., : self._parts]
        h = np.diff(t, prepend=t[0] - 1.0 if self._before is None else self._before)
        self._before = t[-1]
        factors = factors_of(block, h, u, self._of.scheme)
        before = (None, None) if self._goes_on is None else (self._goes_on.parts, self._goes_on.corrections)
        e, lam = self._first.through(block, factors, f, before[0])
        sums = [np.stack([x[..., :w].sum(-1) for w in self._wanted], -1) for x in (f, e, lam)]
        felt = self._without_sampled(block, sums[0], sums[1])
        left = [unbalanced(block, u, *(x[..., k] for x in (felt, *sums[1:])))[0] for k in range(len(self._wanted))]
        d, dlam = self._second.through(block, factors, np.stack(left, -1), before[1])
        whole, forces, f, beside = sums[1] + d, sums[2] + dlam, sums[0][..., -1], {}
        if self._missed:
            given = (x[..., -1] for x in sums[1:])
            kicks, added, of_rest = self._missed.take(block, factors, first, *given, unmoved)
            whole, forces = (x + y[..., None] for x, y in zip((whole, forces), added, strict=True))
            f = f + kicks
            beside = {"missed": of_rest} if self._for_bounds else {}
        self.now = Marched(block, f, whole[..., -1], forces[..., -1], sums[0][..., 0], factors)
        self._note_deformation(first, whole[:, 0, :, -1])
        of_modes = np.abs(whole[:, 0]).max()
        changed = min(1.0, np.abs(d[:, 0]).max() / of_modes) if of_modes else 0.0
        off, off_lam = self._marched_coarsely(block, first, *(x[..., -1:] for x in sums))
        shown = self._shown(
            first,
            parts=(e, lam),
            whole=(whole, forces),
            change=(d[..., :1], dlam[..., :1]),
            steps=(off, off_lam),
            **beside,
        )
        self._keep(shown, changed)

    def _note_deformation(self, first: int, e: np.ndarray) -> None:
        """Take what errors e (T, n) of rows from `first` on have of each body's shapes."""
        u = self._of.unknowns
        for body, block, wave, found in zip(u.bodies, u.blocks, u.waves, self.of_bodies, strict=True):
            x = e[:, [*range(block.start + 6, block.stop), *range(wave.start, wave.stop)]]
            found.squares = found.squares + x[:, body.n :].T @ x[:, body.n :]
            sizes = np.sqrt(np.maximum(np.einsum("ti,ti->t", x @ body.M, x), 0.0))
            sizes = np.where(np.isfinite(sizes), sizes, np.inf)  # what grows beyond all numbers is the largest
            worst = int(np.argmax(sizes))
            if found.deformed is None or sizes[worst] > found.size:
                found.deformed, found.size, found.row = x[worst].copy(), sizes[worst], first + worst

    def _without_sampled(self, block: Block, f: np.ndarray, e: np.ndarray) -> np.ndarray:
        """Return kicks f (T, n, columns) less what is sampled of e (T, 3, n, columns) at the begins of steps."""
        if not block.sampled:
            return f
        if self._last is None:  # nothing was sampled yet, or by the run before in much the same state
            self._last = e[0] * (self._goes_on is not None)
        before, left, n_a = np.concatenate([self._last[None], e[:-1]]), f.copy(), self._of.unknowns.n_a
        for order, S in enumerate(block.sampled):
            left[:, :n_a] -= S @ before[:, order, :n_a]
        self._last = e[-1]
        return left

    def _shown(self, first: int, **errors: tuple[np.ndarray, np.ndarray]) -> dict[str, np.ndarray]:
        """What sensors show (T, R, columns) of errors by name, each (e, lam) of some columns: all at once."""
        e, lam = (np.concatenate(x, axis=-1) for x in zip(*errors.values(), strict=True))
        y = self._of.outputs(first, e, self._of.all_multipliers(lam))
        ends = np.cumsum([x.shape[-1] for x, _ in errors.values()])
        return dict(zip(errors, np.split(y, ends[:-1], axis=-1), strict=True))

    def _keep(self, shown: dict[str, np.ndarray], changed: float) -> None:
        """Keep estimates over time, and the largest of what tells how far they are off."""
        if "missed" in shown:
            self.now.missed, self.now.second_order = shown["missed"][..., 0], self._missed.second_order
        z, parts = shown["whole"], dict(zip(PARTS, np.moveaxis(shown["parts"], -1, 0), strict=False))
        self._largest.add(modes=z[..., 0], last=parts["last third"], second=parts["second third"])
        self._largest.add(change=shown["change"][..., 0] * changed, steps=shown["steps"][..., 0] / TWICE_THE_STEP)
        if self.is_rigid:
            z[..., 1] -= z[..., 0]
            self._largest.add(interfaces=z[..., 1])
            self._largest.add(deforming=parts["deforming, last third"], first_deforming=parts["deforming"])
        self._kept.append(z)

    def _marched_coarsely(
        self, block: Block, first: int, f: np.ndarray, e: np.ndarray, lam: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What e, lam of a sum f of parts are off those of a march over every second row; zero in all other rows."""
        even = slice(first % 2, None, 2)
        part, off, off_lam = block[even], np.zeros_like(e), np.zeros_like(lam)
        if len(part):
            h = np.diff(part.rows.t, prepend=part.rows.t[0] - 1.0 if first == 0 else self._before_coarse)
            self._before_coarse = part.rows.t[-1]
            factors = factors_of(part, h, self._of.unknowns, self._of.scheme)
            before = None if self._goes_on is None else self._goes_on.parts
            whole = (
                None
                if before is None
                else replace(before, x=before.x.sum(-1, keepdims=True), p=before.p.sum(-1, keepdims=True))
            )
            there, forces = self._coarse.through(part, factors, f[even], whole)
            off[even], off_lam[even] = there - e[even], forces - lam[even]
        return off, off_lam

    @property
    def end(self) -> tuple[State, State, State | None]:
        """The states of parts, corrections and what is missed after the last row."""
        return self._first.state, self._second.state, self._missed and self._missed.end

    def _kicks(self, block: Block) -> np.ndarray:
        """Forces (T, n) on vectors that the reduced run does not answer: what M a - f + G^T lam leaves there."""
        u, others = self._of.unknowns, self._of.equations
        left = np.zeros((len(block), u.n))
        left[:, u.n_a :], left[:, u.kept] = -block.forces[:, u.n_a :], -block.forces[:, u.kept]
        felt = np.intersect1d(u.kept, others.felt)
        if len(felt):
            left[:, felt] -= others.unbalanced(block.rows)[:, felt]
        return left

    def _shared(self, left: np.ndarray) -> np.ndarray:
        """Parts (T, n, PARTS) of the kicks."""
        u, found = self._of.unknowns, np.zeros((*left.shape, len(PARTS)))
        for projectors, own in zip(self._of.projectors, u.of_vectors(), strict=True):
            found[:, own] = np.moveaxis(left[:, own] @ projectors.swapaxes(1, 2), 0, -1)
        return found

    def estimates(self) -> dict[str, CauseEstimate]:
        """Return what is known of "modes", and of "interfaces" where these are rigid."""
        most, over_time = self._largest, np.concatenate(self._kept)
        checks = {
            FURTHER: tail(most["last"], most["second"]),
            LINEAR_MODES: most["change"] + unchecked(most["modes"], self._of.sensors),
            STEPS_OF_MODES: most["steps"],
        }
        found = {"modes": CauseEstimate(over_time[..., 0], checks)}
        if self.is_rigid:
            checks = {FURTHER_INTERFACES: tail(most["deforming"], most["first_deforming"], 2)}
            checks[LINEAR_INTERFACES] = most["change"] + unchecked(most["interfaces"], self._of.sensors)
            found["interfaces"] = CauseEstimate(over_time[..., 1], checks)
        return found
