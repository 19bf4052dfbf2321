"""Overshoot: what generalised-alpha makes of accelerations that a run starts with, in modes that are left out.

A mode of unit mass under -1 from the start, x'' + (alpha + beta omega^2) x' + omega^2 x = -1, obeys

    |x + 1/omega^2| <= 1/omega^2 + E_n ,   |x'| <= 1/omega + F_n        after n steps, E_n = F_n = 0 in exact motion.

With numerical damping the integrator overshoots where steps do not resolve the mode: it starts from its acceleration,
-1, which goes on with it for some steps (E_n: h^2 times a number as omega grows, where damping grows, too). For a
residual R(0) that a body starts with, E and F the largest over all omega,

    |C (e + K^-1 R(0))| <= |C|_{K^-1} |R(0)|_{K^-1} + |C|_{M^-1} E |R(0)|_{M^-1} ,   |e'|_M <= ... + F |R(0)|_{M^-1} .

A load that changes later finds accelerations that are none of its making: its discrete response stays below 1/omega^2
and 1/omega, in steps of one size. Dampings are looked at up to Rayleigh's. What joins modes, as dampers in joints do,
is bounded by decay/passive_steps.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..decay.passive_steps import PassiveSteps
from ..trajectory.scheme import Scheme

LOWEST, HIGHEST, A_DECADE = 0.1, 1e6, 16  # omega h, and numbers that are looked at
SHARES = 1.0, 0.5, 0.25, 0.06, 0.0  # of Rayleigh's beta: rigid bodies, and springs that are not damped, leave less
ROUNDING = 1e-6  # of the exact one: less of what is larger may be rounding
QUIET = 64  # steps without any, after which there is none


def overshoots(scheme: Scheme) -> bool:
    """Whether it does: not where the scheme conserves energy, as with spectral radius 1."""
    return scheme.alpha_m != scheme.alpha_f or (scheme.gamma, scheme.beta) != (0.5, 0.25)


class Overshoot:
    """E and F along a run from time t of a scheme that overshoots; dampings : (alpha, beta) of its bodies."""

    def __init__(self, scheme: Scheme, t: float, dampings: Sequence[tuple[float, float]]):
        self._scheme, self._dampings, self._t, self._quiet = scheme, dampings, t, 0
        self._x: np.ndarray | None = None  # x omega^2 + 1, its rates, algorithmic acceleration, (4, modes)

    def advance(self, t: np.ndarray) -> np.ndarray:
        """Return E in s^2 and F in s (S, 2) at the next samples t (S,)."""
        h, found = np.diff(t, prepend=self._t), np.zeros((len(t), 2))
        self._t = float(t[-1])
        if self._x is None and len(t):
            self._begin(h[0])
        ahead, onward, omega = self._scheme.ahead(h), self._scheme.next(h), np.sqrt(self._K)
        for i, (mass, damping) in enumerate(zip(*self._scheme.mass_and_damping(h), strict=True)):
            if self._quiet > QUIET:
                break
            known = ahead[i] @ self._x
            left = mass * known[0] + self._D * (damping * known[0] - known[1])
            d = left / (mass + damping * self._D + self._K)  # so that little cancels
            self._x = onward[i] @ np.vstack([known, d - known[0]])
            self._x[0] = d
            sizes = np.abs([d, self._x[1] / omega])
            more = np.where(sizes > 1.0 + ROUNDING, sizes - 1.0, 0.0)
            found[i] = (more / [self._K, omega]).max(axis=1)
            self._quiet = 0 if found[i].any() else self._quiet + 1
        return found

    def _begin(self, h: float) -> None:
        count = int(A_DECADE * np.log10(HIGHEST / LOWEST)) + 1
        omega = np.geomspace(LOWEST, HIGHEST, count) / h
        pairs = {(a * x, b * y) for a, b in self._dampings for x in (0.0, 1.0) for y in SHARES}
        alpha, beta = np.array(sorted(pairs)).T[..., None]
        self._K = np.broadcast_to(omega**2, (len(alpha), count)).ravel()
        self._D = (alpha + beta * omega**2).ravel()
        one = np.ones_like(self._K)
        self._x = np.array([one, 0 * one, -self._K, -self._K])


SLOW = 1.7  # more than what steps store of accelerations of slow modes, over (kappa h)^2, at any time
LONG = 256  # steps; in so many stiff modes have forgotten, and others do not


class Excess(NamedTuple):
    """Damping beside what leaves modes apart: 0 <= D - beta (K + K_s) <= mass M + stiffness (K + K_s).

    beta, stiffness in s, mass in 1/s.
    """

    beta: float
    mass: float = 0.0
    stiffness: float = 0.0


class StartStorage:
    """What steps have stored of accelerations that a run starts with, |a|_M = mass and |a|_{K + K_s} = stiffness.

    It never grows, whatever damping there is: PassiveSteps.start. Where modes would be apart but for a damping E, the
    excess, steps without E store in n steps

        2 S_n <= (kappa h)^2 (SLOW mass^2 + B_n (kappa h stiffness)^2) ,

    B_n the largest over omega of what single modes have above SLOW, and E adds (h/2) sum |v|_E^2 to 2 S at most, for
    the velocities v that steps without E see (theory.md 8). The least of all n so far counts.

    excess : None: it is not known.
    """

    def __init__(self, steps: PassiveSteps, h: float, sizes: tuple[float, float], excess: Excess | None = None):
        mass, stiffness = sizes
        self._known, self._n = np.full(1, steps.start(h, mass, stiffness)), 0
        if excess is not None and np.isfinite(excess.mass) and steps.kappa:
            above, seen = _stored(steps.kappa, excess.beta / h)
            size = steps.kappa * h
            own = np.sqrt(SLOW * mass**2 + above * (size * stiffness) ** 2)
            joined = np.sqrt(h / 2 * seen * (excess.mass * mass**2 + excess.stiffness * stiffness**2))
            self._known = np.minimum.accumulate(np.append(self._known, size * (own + joined)))

    def advance(self, count: int) -> np.ndarray:
        """Return its root (S,) after the next steps."""
        n, self._n = self._n + 1 + np.arange(count), self._n + count
        return self._known[np.minimum(n, len(self._known) - 1)]


@lru_cache(maxsize=8)
def _stored(kappa: float, beta: float) -> tuple[np.ndarray, np.ndarray]:
    """B_n, and sums of the largest v_af^2 over kappa^2, (LONG,), of single modes in steps of 1."""
    alpha_m, alpha_f, gamma, newmark = (1 - 3 * kappa) / 2, (1 - kappa) / 2, 0.5 + kappa, (1 + kappa) ** 2 / 4
    K = np.geomspace(LOWEST / 100, HIGHEST, A_DECADE * 9) ** 2
    D, (x, v, a) = beta * K, np.outer([0.0, 0.0, 1.0], np.ones_like(K))
    above, seen = np.empty((2, LONG))
    for n in range(LONG):
        ahead, speed = x + v + (0.5 - newmark) * a, v + (1 - gamma) * a
        known = alpha_m * a + D * (alpha_f * v + (1 - alpha_f) * speed) + K * (alpha_f * x + (1 - alpha_f) * ahead)
        a = -known / (1 - alpha_m + (1 - alpha_f) * (gamma * D + newmark * K))
        x, before, v = ahead + newmark * a, v, speed + gamma * a
        m, p, q = v + kappa * a / 2, x + kappa * v / 2 - kappa**2 * a / 4, kappa / 2 * (v - kappa * a / 2)
        stored = (m**2 + kappa**2 * a**2 / 2 + K * (p**2 + q**2)) / kappa**2
        above[n] = np.max((stored - SLOW) / (kappa**2 * K), initial=0.0)
        seen[n] = np.max((alpha_f * before + (1 - alpha_f) * v) ** 2) / kappa**2
    return above, np.cumsum(seen)


# omega h of modes whose accelerations change their sign from step to step, and steps in which they die out, or do not
STIFF, CARRIED_ON = (10.0, 100.0, 1e6), 512


class CarriedTurn:
    """What accelerations that a run starts with do to the energy of its error later on, where the mechanism turns.

    Generalised-alpha goes on with the accelerations a of the step before, in coordinates of which some turn with the
    bodies and some do not: a step feels f_n = (M_n - M_n-1) (a_n - a_n-1) / 4 beside all forces. Where steps do not
    resolve what moves, a changes its sign from step to step, and dies out with the spectral radius. Under f of
    alternating sign modes of any frequency have, |f| in the M^-1 norm,

        |e + K^-1 R|_K , |e'|_M <= h/2 (|f_n| + sum | |f_k| - |f_k-1| |)       (spectral radius 1) ,

    and below radius 1 less than twice as much, which was tried. Steps are counted from the first that turns: what
    sets in while all is at rest is taken for as young as that. What was moved stays when nothing turns any more.

    push : |R(0)|_{M^-1} times |dM a|_{M^-1} of accelerations |a|_M = 1, a radian.
    """

    def __init__(self, scheme: Scheme, push: float):
        self._sizes, self._push, self._n = _carried(scheme), push, 0
        self._share = 1.0 if overshoots(scheme) else 0.5
        self._force = self._changes = 0.0

    def advance(self, h: np.ndarray, turned: np.ndarray) -> np.ndarray:
        """Return it (S,) in steps h (S,) in which the mechanism turns by `turned` / 2 (S,)."""
        turned = np.broadcast_to(turned, h.shape)
        began = np.logical_or.accumulate(turned > 0) | (self._n > 0)
        n = self._n + np.cumsum(began)
        forces = self._push * turned / 4 * self._sizes[np.minimum(n - began, len(self._sizes) - 1)]
        changes = self._changes + np.cumsum(np.abs(np.diff(forces, prepend=self._force)))
        self._n, self._force, self._changes = int(n[-1]), float(forces[-1]), float(changes[-1])
        return self._share * h * (forces + changes)


@cache
def _carried(scheme: Scheme) -> np.ndarray:
    """Share (CARRIED_ON,) of accelerations at the start that changes sign in a step, or in a later one, largest."""
    one = np.ones(len(STIFF))
    (mass, _), ahead, onward, K = scheme.mass_and_damping(one), scheme.ahead(one), scheme.next(one), np.square(STIFF)
    step = onward @ np.concatenate([ahead, -(K / (mass + K))[:, None, None] * ahead[:, :1]], axis=1)
    x = np.empty((CARRIED_ON + 1, len(STIFF), 4, 1))
    x[0] = np.stack([one, 0 * one, -K, -K], axis=1)[..., None]
    for before, after in pairwise(x):
        np.matmul(step, before, out=after)
    found = np.abs(np.diff(x[:, :, 2, 0], axis=0)) / (2 * K)
    return np.maximum.accumulate(found.max(axis=1)[::-1])[::-1]
