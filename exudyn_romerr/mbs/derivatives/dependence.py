"""Which rows of M and of constraints follow which coordinates, so that several are moved at a time to differentiate.

Coordinates whose changes touch different rows are differenced together (Curtis, Powell and Reid, J. Inst. Maths
Applics 13, 1974).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ...trajectory.unit_sphere import bend

SHAKEN = 0.05  # of coordinates: out of positions that hide what depends on what
STEP = 1e-3  # of coordinates: differences of fourth order, which leave 1e-13 of a quantity
NEGLIGIBLE = 1e-9  # of a row, by a coordinate: less than rounding leaves of one-sided differences
NEW = 1e-6  # of a row: entries that were negligible, and are not any more
SEED = 20
Quantity = Callable[[np.ndarray], np.ndarray]  # of coordinates (n,)


class Quaternion(NamedTuple):
    """Euler parameters of a node: their coordinates (4,), and reference values."""

    own: list[int]
    reference: np.ndarray

    def unit(self, q: np.ndarray) -> np.ndarray:
        """Return them, of length 1."""
        p = q[self.own] + self.reference
        return p / math.sqrt(p @ p)


class Dependence(NamedTuple):
    """Entries (p,): row i follows coordinate j. groups: coordinates (n,) moved at a time, and their entries."""

    i: np.ndarray
    j: np.ndarray
    groups: list[tuple[np.ndarray, slice]]

    @classmethod
    def of(cls, wanted: np.ndarray, touched: np.ndarray, tied: Sequence[Sequence[int]] = ()) -> Dependence:
        """Make it of the entries (n, rows) that are wanted, and of all that a coordinate changes.

        tied : coordinates that are moved as one.
        """
        single = set(range(len(wanted))).difference(*tied)
        sets = [own for own in (*map(list, tied), *([j] for j in sorted(single))) if wanted[own].any()]
        together, taken = (np.zeros((len(sets), of.shape[1]), bool) for of in (wanted.T, touched))
        count = 0
        for own in sets:
            rows = touched[own].any(axis=0)
            g = int((taken[: count + 1] & rows).any(axis=1).argmin())  # the last one is empty
            together[g, own], count = True, max(count, g + 1)
            taken[g] |= rows
        together = together[:count]
        entries = [np.nonzero(wanted & moved[:, None]) for moved in together]
        ends = np.cumsum([0, *(len(j) for j, _ in entries)])
        groups = [(moved.astype(float), slice(*ends[g : g + 2])) for g, moved in enumerate(together)]
        j, i = np.hstack([np.zeros((2, 0), int), *entries])
        return cls(i, j, groups)

    def forward(self, value: Quantity, q: np.ndarray, step: float) -> np.ndarray:
        """Return how rows change (p, ...) with their coordinates, by one-sided differences."""
        before = value(q)
        found = [value(q + step * moved)[self.i[entries]] - before[self.i[entries]] for moved, entries in self.groups]
        return np.concatenate([np.zeros((0, *before.shape[1:])), *found]) / step


class Unlike(NamedTuple):
    """Where G is not the derivative C of what constraints keep zero: by some coordinates, and along Euler parameters.

    Exudyn's G is made of angular velocities, which do not know the length of Euler parameters.
    """

    depends: Dependence
    quaternions: list[Quaternion]

    @classmethod
    def of(cls, q, off: np.ndarray, touched: np.ndarray, small: np.ndarray, quaternions: list[Quaternion]) -> Unlike:
        """Make it of C - G (n, c) at q, what coordinates change, and what of each row is small."""
        unlike, along = np.abs(off) > small, []
        for one in quaternions:
            p = one.unit(q)
            rest = np.abs(off[one.own] - np.outer(p, p @ off[one.own])) > small
            if unlike[one.own].any() and not rest.any():
                unlike[one.own] = unlike[one.own].any(axis=0)
                along.append(one)
        return cls(Dependence.of(unlike, touched | unlike, [one.own for one in along]), along)

    def corrected(self, G: np.ndarray, kept: Quantity, q: np.ndarray, step: float) -> np.ndarray:
        """Return C (c, n) of G, by differences of what constraints keep zero, (c,), to both sides."""
        i, j, groups = self.depends
        C, weights = G.copy(), np.ones(len(q))
        for one in self.quaternions:
            weights[one.own] = one.unit(q)
        for moved, entries in groups:
            moved = moved * weights
            off = (kept(q + step * moved) - kept(q - step * moved)) / (2 * step) - G @ moved
            C[i[entries], j[entries]] += off[i[entries]] * moved[j[entries]]
        return C


class Dependences(NamedTuple):
    """How M and G^T depend on the coordinates, where G is not C, and where M and G (n + c, n) may have entries."""

    mass: Dependence
    forces: Dependence
    unlike: Unlike
    reach: np.ndarray

    @classmethod
    def at(
        cls,
        q: np.ndarray,
        columns: np.ndarray,
        rows: np.ndarray,
        quaternions: list[Quaternion],
        quantities: Sequence[Quantity],
    ) -> Dependences:
        """Find them near q, where nothing coincides.

        By some coordinates; rows: numbers of independent constraints. quantities : M, G, what constraints keep zero.
        """
        q = normalised(q + SHAKEN * np.random.default_rng(SEED).uniform(0.5, 1.0, len(q)), quaternions)
        mass, constraints, kept = quantities
        M, G = mass(q), constraints(q)
        small_M, small_G = (NEGLIGIBLE * np.abs(x).max(axis=1) for x in (M, G))
        by_M, forces = np.zeros((2, len(q), len(q)), bool)
        has_masses = M.any()  # none where closed forms have all of them
        least_M, least_G, least = STEP * small_M[:, None], STEP * small_G[:, None], small_G[rows]
        C, steps = G.T.copy(), STEP * np.eye(len(q))
        for j in columns:
            step = steps[j]
            after, before = q + step, q - step
            if has_masses:
                by_M[j] = (np.abs(mass(after) - M) > least_M).any(axis=1)
            forces[j] = (np.abs(constraints(after) - G) > least_G).any(axis=0)
            near = (kept(after) - kept(before)) / (2 * STEP)
            if (np.abs(near - G[:, j])[rows] > least).any():  # by second order already it is G elsewhere
                far = (kept(q + 2 * step) - kept(q - 2 * step)) / (4 * STEP)
                C[j, rows] = ((4 * near - far) / 3)[rows]
        reach = np.abs(np.vstack([M, G[rows]])) > np.concatenate([small_M, small_G[rows]])[:, None]
        unlike = Unlike.of(q, C - G.T, np.abs(C) > small_G, small_G, quaternions)
        return cls(Dependence.of(by_M, by_M), Dependence.of(forces, forces), unlike, reach)

    def hold_for(self, M: np.ndarray, G: np.ndarray) -> bool:
        """Whether M and G have entries where they had, and nowhere else."""
        entries = np.abs(np.vstack([M, G]))
        return not np.any((entries > NEW * entries.max(axis=1, keepdims=True)) & ~self.reach)


def normalised(q: np.ndarray, quaternions: list[Quaternion]) -> np.ndarray:
    """Return q (n,) with Euler parameters of length 1, which rates of a solver let them leave."""
    q = q.copy()
    for one in quaternions:
        q[one.own] = one.unit(q) - one.reference
    return q


def moved_by(
    e: Sequence[np.ndarray], states: Sequence[np.ndarray], quaternions: list[Quaternion]
) -> list[np.ndarray]:
    """Return q, q_t, q_tt (S, k) plus e (3, S, k), Euler parameters along the unit sphere."""
    found = [x + dx for x, dx in zip(states, e, strict=True)]
    if quaternions:
        own, reference = (np.array(x) for x in zip(*quaternions, strict=True))
        (p, *rates), turned = ([x[:, own] for x in of] for of in (states, e))
        moves = [[x.reshape(-1, 4) for x in of] for of in ((reference + p, *rates), turned)]
        for x, bent in zip(found, bend(*moves), strict=True):
            x[:, own] += bent.reshape(p.shape)
    return found
