"""Loads between samples by true accelerations at points inside steps, which the equations of motion tell."""

from __future__ import annotations

import numpy as np

from ..mechanism.mechanism import OtherEquations
from ..mechanism.rotations import times, times_transposed
from ..mechanism.samples import Rows
from ..mechanism.unknowns import Unknowns
from .reduced_system import FrozenSteps

GAUSS = np.array([0.5 + 0.5 * x for x in (-(0.6**0.5), 0.0, 0.6**0.5)])
PARTS = 4  # of a step, a point in each where user functions may do what samples do not tell
GOLDEN = (5**0.5 - 1) / 2  # of a part, by which these points go on from step to step: no period is a fraction of it
SHORT = 0.05  # of a step: to differentiate constraints by, twice


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
        return (np.arange(PARTS) + (GOLDEN * (1 + numbers[:, None])) % 1.0) / PARTS

    def __call__(self, rows: Rows, frozen: FrozenSteps, at: np.ndarray) -> np.ndarray:
        """Return coefficients (T, points, n_q) over steps `at`; rates in rows obey the constraints."""
        h, found, shares = rows.t[at + 1] - rows.t[at], [], self._shares(len(at))
        ends = [(x[at], x[at + 1]) for x in (rows.q, rows.v, rows.a)]
        for s in shares.T:
            q, v, a = quintic(s[:, None], h[:, None], *ends)
            lam = (1 - s[:, None]) * rows.multipliers[at] + s[:, None] * rows.multipliers[at + 1]
            true = a - self._off(Rows(rows.t[at] + s * h, q, v, a, lam), h, frozen)
            found.append(true - times(frozen.a21, q - rows.q[at]) - times(frozen.a22, v))
        weights = np.linalg.inv(shares[:, :, None] ** np.arange(shares.shape[1]))
        return weights @ np.array(found).swapaxes(0, 1)

    def _off(self, states: Rows, h: np.ndarray, frozen: FrozenSteps) -> np.ndarray:
        """What accelerations of states are off those of the equations, (T, n_q)."""
        u, others = self._unknowns, self._equations
        forces = np.zeros((len(states), u.n_a))
        for body, at in zip(u.bodies, u.blocks, strict=True):
            forces[:, at.start : at.start + 6 + body.n] = body.residual(body.motion(states))[:, : 6 + body.n]
        R = times_transposed(u.inverses(states.q, states.v, states.a)[0], u.in_global_axes(forces, states.q))
        R += [others.forces_at(*states.row(i)) for i in range(len(states))]
        bend = np.concatenate([self._bend(states, h), self._bend_of_parameters(states)], axis=1)
        return times(frozen.A1, R) + times(frozen.A2, bend)

    def _bend(self, states: Rows, h: np.ndarray) -> np.ndarray:
        """Second derivatives (T, c) of what constraints keep zero, along the motion."""
        found = np.zeros((len(states), len(self._equations.independent)))
        for i in range(len(states)) if found.size else ():
            t, q, v, a, _ = states.row(i)
            tau = SHORT * h[i]
            g = [
                self._equations.constraints_at(t + s, q + s * v + s**2 / 2 * a, v, a)[self._equations.independent]
                for s in (-tau, 0.0, tau)
            ]
            found[i] = (g[0] + g[2] - 2 * g[1]) / tau**2
        return found

    def _bend_of_parameters(self, states: Rows) -> np.ndarray:
        """The same of the length of Euler parameters, (T, nodes)."""
        pairs = ((node.parameters(states.q), node.own[3:]) for node in self._unknowns.nodes)
        found = [((p * states.a[:, own]) + states.v[:, own] ** 2).sum(axis=1) for p, own in pairs]
        return np.array(found).reshape(-1, len(states)).T


def quintic(
    s: np.ndarray, h: np.ndarray, *ends: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return q, q', q'' at a share s of steps of length h, by the quintic through (q, v, a) at both ends."""
    (q0, q1), (v0, v1), (a0, a1) = ends
    c = [q0, h * v0, h**2 * a0 / 2]
    d, d1, d2 = q1 - sum(c), h * v1 - c[1] - 2 * c[2], h**2 * a1 - 2 * c[2]
    c += [10 * d - 4 * d1 + d2 / 2, -15 * d + 7 * d1 - d2, 6 * d - 3 * d1 + d2 / 2]
    q = sum(x * s**k for k, x in enumerate(c))
    v = sum(k * x * s ** (k - 1) for k, x in enumerate(c) if k)
    a = sum(k * (k - 1) * x * s ** (k - 2) for k, x in enumerate(c) if k > 1)
    return q, v / h, a / h**2
