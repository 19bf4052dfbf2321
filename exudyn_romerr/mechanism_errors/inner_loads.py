"""Loads between samples by true accelerations at points inside steps, which the equations of motion tell."""

from __future__ import annotations

import numpy as np

from ..mechanism.mechanism import OtherEquations
from ..mechanism.rotations import times
from ..mechanism.rows import Rows
from ..mechanism.unknowns import Unknowns
from .reduced_system import FrozenSteps, cubics

GAUSS = np.array([0.5 + 0.5 * x for x in (-(0.6**0.5), 0.0, 0.6**0.5)])
SECTIONS = 4  # of a step, a point in each where user functions may do what samples do not tell
FINE = 64  # points in a step where loads jump
STANDS_OUT, FEW = 10.0, 8  # times the median of a block; steps of which none is usual
SMOOTH = 1e-3  # of the largest load, in the norm of the mass: what is off by less is no jump
GOLDEN = (5**0.5 - 1) / 2  # of a part, by which these points go on from step to step: no period is a fraction of it


class TrueLoads:
    """Coefficients of loads over steps, from accelerations at points inside each.

    is_shifting : whether points are others in every step, so that what repeats itself with a part of the step shows.
    """

    def __init__(self, unknowns: Unknowns, equations: OtherEquations, is_shifting: bool):
        self._unknowns, self._equations, self.is_shifting, self._done = unknowns, equations, is_shifting, 0

    def _shares(self, count: int) -> np.ndarray:
        """Shares of steps (T, points) where loads are asked for."""
        if not self.is_shifting:
            return np.tile(GAUSS, (count, 1))
        numbers = self._done + np.arange(count)
        self._done += count
        return (np.arange(SECTIONS) + (GOLDEN * (1 + numbers[:, None])) % 1.0) / SECTIONS

    def __call__(
        self, rows: Rows, frozen: FrozenSteps, inverses: np.ndarray, at: np.ndarray, cubic: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return coefficients (T, m, n_q) of loads over steps `at`, and how far their means may be off (T, n_q).

        inverses : of [[M, G^T], [C, 0]] at rows, whose rates obey the constraints. cubic (T, 4, n_q) : those that
        samples tell.
        """
        shares = self._shares(len(at))
        states, forces, g = self._states(rows, at, shares)
        of_g = self._constraints(rows, at, shares, g)
        true = self._loads(rows, frozen, inverses, at, shares, states, forces, of_g)
        found, margin = np.linalg.inv(_powers(shares, shares.shape[1])) @ true, np.zeros(true[:, 0].shape)
        if self.is_shifting:
            fine = np.tile((np.arange(FINE) + 0.5) / FINE, (1, 1))
            fit = np.linalg.pinv(_powers(fine, found.shape[1]))
            for i in _standing_out(true - _powers(shares, cubic.shape[1]) @ cubic, true, frozen.masses):
                one = slice(i, i + 1)
                more = self._states(rows, at[one], fine)
                closer = self._loads(rows, frozen[one], inverses, at[one], fine, *more[:2], of_g[one])
                found[one] = fit @ closer
                margin[i] = _largest_jump(np.diff(closer[0], axis=0), frozen.masses[i]) / FINE
        return found, margin

    def _states(self, rows: Rows, at: np.ndarray, shares: np.ndarray) -> tuple[Rows, np.ndarray, np.ndarray]:
        """States at shares (T, P) of steps, forces (P, T, n_q) and constraints (P, T, c) there, point by point."""
        points, steps = shares.T.reshape(-1, 1), np.tile(at, shares.shape[1])
        h = (rows.t[steps + 1] - rows.t[steps])[:, None]
        q, v, a = (x / h**k for k, x in enumerate(_paths(rows, at, shares)))
        lam = (1 - points) * rows.multipliers[steps] + points * rows.multipliers[steps + 1]
        states = Rows(rows.t[steps] + (points * h)[:, 0], q, v, a, lam)
        forces, constraints = self._equations.along(states)
        R, g = forces + self._of_bodies(states), constraints[:, self._equations.independent]
        return states, *(x.reshape(*shares.T.shape, x.shape[1]) for x in (R, g))

    def _loads(
        self,
        rows: Rows,
        frozen: FrozenSteps,
        inverses: np.ndarray,
        at: np.ndarray,
        shares: np.ndarray,
        states: Rows,
        forces: np.ndarray,
        of_g: np.ndarray,
    ) -> np.ndarray:
        """Loads (T, P, n_q) that true accelerations tell; of_g : coefficients of constraints over steps."""
        h, p = rows.t[at + 1] - rows.t[at], np.arange(2, of_g.shape[1])
        bends = (p * (p - 1) * _powers(shares, len(p))) @ of_g[:, 2:] / (h**2)[:, None, None]
        q, v, a, of_parameters = (
            x.reshape(*shares.T.shape, x.shape[1])
            for x in (states.q, states.v, states.a, self._bend_of_parameters(states))
        )
        bend = np.concatenate([bends.swapaxes(0, 1), of_parameters], axis=2)
        given, s = np.concatenate([forces, bend], axis=2), shares.T[:, :, None]
        begin, end = (times(inverses[i, : a.shape[2]], given) for i in (at, at + 1))
        true = a - (1 - s) * begin - s * end
        return (true - times(frozen.A, np.concatenate([q - rows.q[at], v], axis=2))).swapaxes(0, 1)

    def _of_bodies(self, states: Rows) -> np.ndarray:
        """Forces (T, n_q) of the bodies' own, in coordinates of the mbs."""
        u = self._unknowns
        forces = np.zeros((len(states), u.n_a))
        for body, at in zip(u.bodies, u.blocks, strict=True):
            forces[:, at.start : at.start + 6 + body.n] = body.residual(body.motion(states))[:, : 6 + body.n]
        return u.by_coordinates(u.in_global_axes(forces, states.q)[:, None], states.q)[:, 0]

    def _constraints(self, rows: Rows, at: np.ndarray, shares: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Coefficients (T, points + 2, c) over steps of what constraints keep zero: ends, and the points inside."""
        if not g.size:
            return np.zeros((len(at), len(g) + 2, 0))
        _, there = self._equations.along(rows[at[0] : at[-1] + 2])
        ends = there[:, self._equations.independent]
        values = np.stack([ends[at - at[0]], *g, ends[at + 1 - at[0]]], axis=1)
        s = np.pad(shares, ((0, 0), (1, 1)), constant_values=((0, 0), (0.0, 1.0)))
        return np.linalg.inv(_powers(s, s.shape[1])) @ values

    def _bend_of_parameters(self, states: Rows) -> np.ndarray:
        """The same of the length of Euler parameters, (T, nodes)."""
        pairs = ((node.parameters(states.q), node.own[3:]) for node in self._unknowns.nodes)
        found = [((p * states.a[:, own]) + states.v[:, own] ** 2).sum(axis=1) for p, own in pairs]
        return np.array(found).reshape(-1, len(states)).T


def _standing_out(off: np.ndarray, loads: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """Numbers of steps in which loads (T, points, n) are off what samples tell as in few others: a jump.

    masses (T, n) : by which what matters is told from what is nothing but rounding.
    """
    size = np.abs(off).max(axis=1)
    least = SMOOTH * np.sqrt((loads**2).max(axis=1) * masses).max()
    usual = np.median(size, axis=0) if len(size) >= FEW else 0.0
    return np.flatnonzero(np.any((size > STANDS_OUT * usual) & (size * np.sqrt(masses) > least), axis=1))


def _largest_jump(changes: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """The largest (n,) of changes of loads from point to point (P, n), as much longer as the next is beside it.

    With its signs, for those of modes are anybody's choice; a pulse begins and ends in one step.
    """
    sizes = np.sqrt((changes**2 * masses).sum(axis=1))
    i, after = int(np.argmax(sizes)), np.sort(sizes)[-2]
    return changes[i] * (1 + after / sizes[i]) if sizes[i] else changes[i]


def _powers(s: np.ndarray, count: int) -> np.ndarray:
    """Powers 0 .. count - 1 of s (T, points), (T, points, count)."""
    return s[:, :, None] ** np.arange(count)


def _paths(rows: Rows, at: np.ndarray, shares: np.ndarray) -> list[np.ndarray]:
    """q, h q', h^2 q'' (P T, n) at shares (T, P) of steps, by cubics through samples of q alone.

    Stored rates of what steps do not resolve ring, and a path that followed them would leave the run's by far.
    """
    first, weights = cubics(rows.t, at)
    c = weights @ rows.q[first[:, None] + np.arange(weights.shape[2])]
    found = []
    for _ in range(3):
        found.append((_powers(shares, c.shape[1]) @ c).swapaxes(0, 1).reshape(-1, c.shape[2]))
        c = c[:, 1:] * np.arange(1, c.shape[1])[:, None]
    return found
