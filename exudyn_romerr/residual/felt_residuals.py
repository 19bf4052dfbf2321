"""FeltResiduals: the energy of a mechanism's error by what generalised-alpha feels of residuals (theory.md 8).

Its equation of a step holds R only as (1 - alpha_f) R_n + alpha_f R_n-1. What changes its sign from step to step is
felt by (1 - rho)/(1 + rho) of it, nothing with spectral radius 1: its changes and its work count so much less.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

# of h |R(0)|^2/(2 beta): with what Overshoot has of a start this covers that a solver starts with accelerations
STARTED = 0.5
EVEN = 1e-6  # of a step: what another one may differ by
# rad a step, twice what anything turns by: corrected outputs of two bars on a driven joint, without damping, were off
# by 3.6, 2.3 and 0.1 times their bound where that was up to 0.15, 0.08 and 0.04
TURNS = 0.04
# the same in all steps so far, as far as residuals ring from step to step: a scene of the same bars in steps of 8 ms,
# below TURNS, was off by 1.01 times its bound, corrected 1.3 times, from 0.1 on; without averages it is covered
RINGS = 0.05


class FeltResiduals:
    """Energies of all bodies together at samples of a run; inf from where steps are not of one size, or turn far.

        f_n = (1 - share) R_n + share R_n-1 ,   |e + K^-1 f|_K <= c g ,   |e|_K <= c rough ,   |e'|_M <= c g , c rough

    with c of PassiveSteps. g grows by |f_n - f_n-1|, rough^2 by h |f|^2/(2 beta) of damped bodies; of others rough
    takes what f varies.

    Parameters
    ----------
    share : alpha_f of the scheme.
    norms : of each body, z -> |R|_{K^-1}.
    betas : of each body, D >= beta K.
    begin : g and rough at the start.
    started : of h |R(0)|^2/(2 beta), more work of a start.

    Attributes
    ----------
    latest : bound of |e + K^-1 R|_K over c, of the last sample, as who goes on with it has found.
    """

    def __init__(
        self,
        share: float,
        norms: Sequence[Callable],
        betas: Sequence[float],
        begin: tuple[float, float],
        started: float = 0.0,
    ):
        self._share, self._norms, self._betas, self._more = share, norms, betas, started
        (self._g, self._rest), self._work, self._turned = begin, 0.0, 0.0
        self._rung = 0.0
        self._h: float | None = None
        self._changes: list[np.ndarray] = []  # of R in the last step, of every body
        self.latest = self._g

    def advance(
        self, h: np.ndarray, chains: Sequence[np.ndarray | None], missed: np.ndarray, turned: np.ndarray
    ) -> np.ndarray:
        """Return g, rough, and what e + K^-1 R is beside c times each (4, S), at the ends of the next steps h (S,).

        chains : z (S + 1, k) of every body, straight between samples; None: R is another curve. missed (S,) : what
        these do not hold of the variation of R, and impulses of other forces. turned (S,) : angles by which frames
        and joints turn in the steps: by so much averages are of other directions.
        """
        begins = self._h is None
        self._h = float(h[0]) if begins else self._h
        if np.any(np.abs(h - self._h) > EVEN * self._h) or any(z is None for z in chains):
            self._g = np.inf
        if not np.isfinite(self._g):
            return np.full((4, len(h)), np.inf)
        changes = [np.diff(z, axis=0) for z in chains]
        before = [0 * x[:1] for x in changes] if begins else self._changes
        bends = np.abs(np.diff(turned, prepend=self._turned))
        self._changes, self._turned = [x[-1:] for x in changes], float(turned[-1])
        a, varied, beside, sizes, works = self._share, [], [], [], np.zeros(len(h))
        rings = []  # of every body: how R changes, its changes over two steps, its sizes
        for norm, beta, z, change, last in zip(self._norms, self._betas, chains, changes, before, strict=True):
            earlier, size, changed = np.vstack([last, change[:-1]]), norm(z), norm(change)
            beside.append(a * (changed + turned * size[1:]))
            turns = a * (turned * (changed + np.append(norm(last), changed[:-1])) + bends * size[1:])
            varied.append(norm((1 - a) * change + a * earlier) + turns)
            sizes.append(size[1:])
            rings.append(
                [changed + np.append(norm(last), changed[:-1]), norm(change + earlier), size[1:] + size[:-1]]
            )
            if beta:
                felt = norm((1 - a) * z[1:] + a * z[:-1]) + a * turned * size[:-1]
                works += h * felt**2 / (2 * beta)
                works[0] += begins * self._more * h[0] * size[0] ** 2 / (2 * beta)
        found = self._summed(missed, works, *(np.array(x) for x in (varied, beside, sizes)))
        angles = np.broadcast_to(turned, h.shape)
        rung = self._rung + np.cumsum(angles * _ringing(np.array(rings)))
        self._rung = float(rung[-1])
        if (far := np.logical_or.accumulate((angles > TURNS) | (rung > RINGS))).any():
            found[:, far] = self._g = np.inf
        return found

    def _summed(
        self, missed: np.ndarray, works: np.ndarray, varied: np.ndarray, beside: np.ndarray, sizes: np.ndarray
    ) -> np.ndarray:
        """From what single bodies (b, S) add: variation, what R is beside its average, |R|; works (S,) of all."""
        damped = np.array([beta > 0 for beta in self._betas])
        g = self._g + np.cumsum(np.linalg.norm(varied, axis=0) + missed)
        rest = self._rest + np.cumsum(np.linalg.norm(varied[~damped], axis=0) + missed)
        work = self._work + np.cumsum(works)
        self._g, self._rest, self._work = (float(x[-1]) for x in (g, rest, work))
        other = np.linalg.norm(sizes[damped], axis=0) + np.linalg.norm(beside[~damped], axis=0)
        return np.array([g, np.sqrt(work) + rest, np.linalg.norm(beside, axis=0), other])


def _ringing(rings: np.ndarray) -> np.ndarray:
    """Share (S,) of R that changes its sign from step to step, of all bodies (b, 3, S) together."""
    changed, twice, sizes = np.linalg.norm(rings, axis=0)
    return np.clip((changed - twice) / 2 / np.maximum(sizes, np.finfo(float).tiny), 0.0, 1.0)
