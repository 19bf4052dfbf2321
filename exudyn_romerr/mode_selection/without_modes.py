"""What a run would be without one of its modes, to first order, for every mode: one march, one column a mode.

Without mode j the reduced mechanism has the same equations but that of coordinate j, which rests. Linearised, the
run less that without it, d, has d_j = q_j, of the run, and M d'' + D d' + K d + G^T lam = s e_j, C d = 0 with the s
that makes it so. With the inverse X of a step's matrix that is one division: d = d_0 + X e_j (q_j - d_0j) / X_jj.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..mechanism.tangents import block_of, rows_at_once
from ..mechanism_errors.factors import bordered_inverses, bordered_pseudoinverses
from ..mechanism_errors.march import is_at_rest, predicted
from ..mechanism_errors.reduced_system import ReducedSystem

if TYPE_CHECKING:
    from ..mechanism.mechanism import Mechanism

# of what a sensor shows: a mode that carries all of it takes all away, and others may then ring as much
LOST = 2.0
FIXED = 1e-14  # of the largest answer to a unit force: a coordinate that answers less cannot be left out


class Shown(NamedTuple):
    """A sensor: name, unit, its rows among all outputs, what each shows at most."""

    name: str
    unit: str
    rows: np.ndarray
    extents: np.ndarray


@dataclass(frozen=True)
class InRun:
    """What coordinates do in a run: energy (n,), shares of the strain energy; sensors {name: (unit, (n,))}.

    vectors (N, m) beside the modes, and the sum over the run of x x^T (m, m), x what the error has of them.
    """

    energy: np.ndarray
    sensors: dict[str, tuple[str, np.ndarray]]
    vectors: np.ndarray
    squares: np.ndarray


class WithoutModes:
    """Tells when it is asked for the first time. Holds arrays of the run, nothing of an mbs."""

    def __init__(self, of: Mechanism, sensors: Sequence[Shown], vectors: Sequence[tuple[np.ndarray, np.ndarray]]):
        self._unknowns, self._rows, self._scheme, self._outputs = of.unknowns, of.rows, of.scheme, of.outputs
        self._splined, self._sensors, self._vectors = of.readings.splined, sensors, vectors
        self._independent, self._sign = of.equations.independent, of.sign
        self._own = np.concatenate([body.place.modal for body in of.unknowns.bodies])

    @cached_property
    def in_run(self) -> dict[int, InRun]:
        """What modes do, by number of the body."""
        largest = np.max([np.abs(y).max(axis=0) for y in self._changes()], axis=0)
        grows = {one.name: (one.unit, _known(largest[one.rows], one.extents)) for one in self._sensors}
        found, first = {}, 0
        for body, vectors in zip(self._unknowns.bodies, self._vectors, strict=True):
            q, own = self._rows.q[:, body.place.modal], slice(first, first + body.n)
            energy = np.einsum("ti,ti->i", q, q @ body.K[: body.n, : body.n])
            share = energy / (energy.sum() or 1.0)
            of_sensors = {name: (unit, x[own]) for name, (unit, x) in grows.items()}
            found[body.place.number] = InRun(share, of_sensors, *vectors)
            first = own.stop
        return found

    def _changes(self) -> Iterator[np.ndarray]:
        """Yield what outputs change by without each mode, (T, R, modes), block by block."""
        u, x, before = self._unknowns, None, 0.0
        rates = slice(u.n_q - u.n_1, u.n_q)  # coordinates of first order go by the trapezoidal rule, as in the march
        for a in range(0, len(self._rows), count := rows_at_once(u)):
            rows = self._rows[a : a + count]
            system = ReducedSystem.of(block_of(rows, u, self._splined), u)
            h = np.diff(rows.t, prepend=before if a else rows.t[0] - 1.0)
            before, (c1, c2) = rows.t[-1], self._scheme.mass_and_damping(h)
            A = c1[:, None, None] * system.M + c2[:, None, None] * system.D + system.K
            A[:, rates, rates] += (2 * c2 / h - c1)[:, None, None] * system.M[:, rates, rates]
            X = bordered_inverses(A, system.G, system.C)
            d, lam = np.zeros((len(rows), 3, u.n_q, len(self._own))), []
            for i in range(len(rows)):
                x, forces = self._begin(system) if x is None else self._step(x, system, X[i], i, rows, (h, c1, c2))
                d[i] = x[:3]
                lam.append(forces)
            yield self._shown(a, rows, d, np.array(lam))

    def _begin(self, system: ReducedSystem) -> tuple[np.ndarray, np.ndarray]:
        """First row: at rest in its own equilibrium, or from where the run begins."""
        own, columns, n = self._own, np.arange(len(self._own)), self._unknowns.n_q
        x = np.zeros((4, n, len(own)))
        rests = is_at_rest(self._rows) and not self._unknowns.n_1
        first = [part[0, own] for part in (self._rows.q, self._rows.v, self._rows.a)]
        if not rests:
            x[0, own, columns], x[1, own, columns] = first[:2]
        inverses = bordered_pseudoinverses if rests else bordered_inverses
        X = inverses((system.K if rests else system.M)[:1], system.G[:1], system.C[:1])[0]
        z = X[:, :n] @ -(system.K[0] @ x[0] + system.D[0] @ x[1])
        z = self._prescribed(z, X, first[0 if rests else 2])
        x[[0] if rests else [2, 3]] = z[:n]
        return x, z[n:]

    def _step(
        self, x: np.ndarray, system: ReducedSystem, X: np.ndarray, i: int, rows: object, steps: tuple
    ) -> tuple[np.ndarray, np.ndarray]:
        """Go on to row i of a block."""
        (h, c1, c2), s, n = (of[i] for of in steps), self._scheme, self._unknowns.n_q
        rates = slice(n - self._unknowns.n_1, n)
        q, v, carried = predicted(x, h, s, rates)
        z = X @ np.concatenate([-(system.K[i] @ q + system.D[i] @ v), -system.C[i] @ q])
        z = self._prescribed(z, X, rows.q[i, self._own] - q[self._own, np.arange(len(self._own))])
        a = c1 * z[:n]
        a[rates] = 2 * c2 / h * z[rates]
        own = carried + (1 - s.alpha_f) / (1 - s.alpha_m) * a
        return np.array([q + z[:n], v + c2 * z[:n], a, own]), z[n:]

    def _prescribed(self, z: np.ndarray, X: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Answers z (n + c, modes) with forces that make coordinate j of column j what is wanted (modes,)."""
        own = self._own
        able = X[own, own]
        able = np.where(np.abs(able) > FIXED * np.abs(able).max(), able, np.nan)
        return z + X[:, own] * ((wanted - z[own, np.arange(len(own))]) / able)

    def _shown(self, first: int, rows: object, d: np.ndarray, lam: np.ndarray) -> np.ndarray:
        """What outputs show of changes of coordinates d (T, 3, n_q, modes)."""
        wide = np.zeros((len(rows), self._rows.multipliers.shape[1], d.shape[-1]))
        wide[:, self._independent] = self._sign * lam[:, : len(self._independent)]
        return self._outputs(first, self._unknowns.of_coordinates(rows.q, rows.v, rows.a, d), wide)


def _known(largest: np.ndarray, extents: np.ndarray) -> np.ndarray:
    """The largest of a sensor's components (r, modes), inf where no linear equation tells it."""
    found = np.max(largest, axis=0)
    return np.where(found <= LOST * extents.max(initial=0.0), found, np.inf)
