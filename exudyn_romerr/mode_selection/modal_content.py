"""ModalContent: what each further mode of a body would take from the errors of a mechanism's sensors, or fewer add.

The error of a run is the march under what forces its modes leave unanswered. A further mode v answers its share of
them, K v (v^T r) / (v^T K v); a mode of the run answers m a + d v + k q of its own coordinate. Each share is marched
by itself, with the factors that the error itself has: exact where modes are orthogonal in M and K to each other and
to all vectors, as free eigenmodes are, and those with fixed interfaces beside vectors that move none of these. For
modes that go it leaves out how all others answer that: their error is told to a factor of about two.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.linalg as la

from ..mechanism_errors.march import March
from ..mechanism_errors.modes import THIRDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    import scipy.sparse as sp

    from ..mechanism.body import Body
    from ..mechanism.mechanism import Mechanism
    from ..mechanism.rows import Rows
    from ..mechanism_errors.half_widths import CauseEstimate
    from ..mechanism_errors.modes import Marched

KEPT = 500  # instants, about: peaks of errors last longer than one of so many


class FurtherModes(NamedTuple):
    """Modes (N, m) that call number `call` makes for a body beyond its own, the last `number` of which vary."""

    call: int
    number: int
    modes: np.ndarray


class Content(NamedTuple):
    """Of some instants (T,): known (T, R), the error by modes, parts : call -> (m, T, R) of each of its modes.

    step, rest (T, R) : errors by the step, and by all else.
    """

    known: np.ndarray
    parts: dict[int, np.ndarray]
    step: np.ndarray
    rest: np.ndarray

    def by_modes(self, component: int, numbers: Sequence[int], own: Sequence[int]) -> np.ndarray:
        """Return the error (T,) of a component there would be with `numbers` of modes by call, in place of own."""
        y = self.known[:, component].copy()
        for call, x in self.parts.items():
            n, now = numbers[call], own[call]
            y += x[n:now, :, component].sum(0) - x[now:n, :, component].sum(0)
        return y


class ModalContent:
    """Takes blocks of errors as they are marched; bodies : of each, None: its modes do not vary."""

    def __init__(self, of: Mechanism, bodies: Sequence[Shares | None]):
        self._of, self._bodies = of, bodies
        self._step = max(len(of.rows) // KEPT, 1)
        self._march = March(of.unknowns, of.scheme)
        self._kept: list[tuple[np.ndarray, np.ndarray]] = []

    def take(self, marched: Marched, first: int) -> None:
        """Take errors of a block of rows of the run that begins at number `first`."""
        u, rows, f = self._of.unknowns, marched.block.rows, []
        for one, body, block, wave in zip(self._bodies, u.bodies, u.blocks, u.waves, strict=True):
            if one is not None:
                at = np.r_[block.start + 6 : block.stop, wave.start : wave.stop]
                pushed = np.zeros((*marched.of_modes.shape, one.count))
                pushed[:, at] = one.forces(body, rows, marched.of_modes[:, at])
                f.append(pushed)
        e, lam = self._march.through(marched.block, marched.factors, np.concatenate(f, axis=-1))
        keep = np.arange(-first % self._step, len(rows), self._step)
        self._kept.append((keep + first, self._of.outputs(first, e, self._of.all_multipliers(lam))[keep]))

    def content(self, by_cause: dict[str, CauseEstimate]) -> Content:
        """Return what was taken; by_cause : errors at all rows."""
        at, y = (np.concatenate(x) for x in zip(*self._kept, strict=True))
        parts: dict[int, np.ndarray] = {}
        for one in filter(None, self._bodies):
            own, y = np.moveaxis(y[..., : one.count], -1, 0), y[..., one.count :]
            parts[one.call] = parts.get(one.call, 0.0) + own
        known = {cause: one.over_time[at] for cause, one in by_cause.items()}
        modes = known.pop("modes")
        none = np.zeros_like(modes)
        return Content(modes, parts, known.pop("step", none), sum(known.values(), none))


class Shares:
    """Forces on modes of a body that may vary: its own, then further ones. count : of both."""

    def __init__(
        self, further: FurtherModes, shapes: np.ndarray, n: int, stiffness: sp.spmatrix, projectors: np.ndarray
    ):
        """Project; shapes (N, k), n modes first; projectors (GROUPS, k - n, k - n), of forces on its vectors."""
        self.call, self.count = further.call, further.number + further.modes.shape[1]
        self._own = np.arange(n - further.number, n)
        of = stiffness @ further.modes
        size = np.einsum("ij,ij->j", further.modes, of)
        K = shapes.T @ (stiffness @ shapes)
        keeping = la.orth(projectors[:THIRDS].sum(0).T)  # not what deforms interfaces
        wide = la.block_diag(np.eye(n), keeping)
        known = keeping @ la.lstsq(wide.T @ K @ wide, wide.T @ (shapes.T @ of))[0][n:]  # of each, in vectors
        self._share = np.einsum("aj,bj->jab", K[n:, n:] @ known / size, known)

    def forces(self, body: Body, rows: Rows, left: np.ndarray) -> np.ndarray:
        """Return forces (T, k, count) on shapes of the body; left (T, k) : those that its modes do not answer."""
        f, own, n = np.zeros((*left.shape, self.count)), self._own, body.n
        q, v, a = (y[:, body.place.modal[own]] for y in (rows.q, rows.v, rows.a))
        M, D, K = (np.diag(x)[own] for x in (body.M, body.D, body.K))
        f[:, own, range(len(own))] = M * a + D * v + K * q
        f[:, n:, len(own) :] = np.einsum("jab,tb->taj", self._share, left[:, n:])
        return f
