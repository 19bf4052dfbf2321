"""The march: e = y_full - y_reduced of the linearised mechanism under kicks, by the run's own generalised-alpha.

M e'' + D e' + K e + G^T lam = f, C e = 0, once for many right-hand sides; with S e + S' e' of the row before on the
left where forces are sampled at the begins of steps. Oscillators are vectors, all else is a
small system: frames, modes, kept vectors, other bodies, constraints. In coordinates of the mbs: Newmark's formulas
hold for Euler parameters, not for rotations z in global axes: with states dp beside z, H = 4 E^T(p), J = E(p),
z = H dp, a step from predictions P, P' has, with zeta the increment of z,

    dp = P + delta ,  dp' = P' + c2 delta ,  dp'' = c1 delta ,   delta = J zeta + nu ,  nu = -p (p . P)
    z = H P + zeta ,  z' = H P' + H' (P + nu) + (c2 + H' J) zeta ,
    z'' = 2 H' (P' + c2 nu) + H'' (P + nu) + (c1 + 2 c2 H' J + H'' J) zeta .

Coordinates of first order are rates, and go by the trapezoidal rule whatever the scheme is, as Exudyn's do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..compiled.loops import loops
from ..mechanism.rows import Rows
from ..mechanism.scheme import Scheme
from ..mechanism.tangents import Block
from ..mechanism.unknowns import Unknowns
from .factors import Factors, Turns, bodies_given, bordered_inverses, bordered_pseudoinverses, starts_of_turns

REST = 1e-4  # of the largest acceleration: a run that begins with less begins in an equilibrium


@dataclass
class State:
    """x (4, n, columns): e, e', e'', the scheme's own acceleration; p (4, nodes, 4, columns): of Euler parameters.

    balancing : unknowns whose rates, of first order, are what holds all others at rest where the next run begins.
    """

    x: np.ndarray
    p: np.ndarray
    balancing: Sequence[int] = ()

    @classmethod
    def at_rest(cls, unknowns: Unknowns) -> State:
        """Return one column that is zero."""
        return cls(np.zeros((4, unknowns.n, 1)), np.zeros((4, len(unknowns.nodes), 4, 1)))


def is_at_rest(rows: Rows) -> bool:
    """Whether the first row is an equilibrium, as a static solve leaves it; loads that begin suddenly are none."""
    return not rows.v[0].any() and np.abs(rows.a[0]).max(initial=0.0) <= REST * np.abs(rows.a).max(initial=0.0)


class March:
    """Goes on from block to block; columns are right-hand sides.

    state : after the last row; None before the first.
    """

    def __init__(self, unknowns: Unknowns, scheme: Scheme):
        self._unknowns, self._scheme = unknowns, scheme
        self.state: State | None = None

    def through(
        self,
        block: Block,
        factors: Factors,
        f: np.ndarray,
        before: State | None = None,
        of_constraints: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """March a block; its very first row begins the march, or goes on from a state before.

        of_constraints (T, c, columns) : what C e is to be; None: zero.

        Returns
        -------
        e (T, 3, n, columns), lam (T, c, columns)
        """
        g = np.zeros((len(f), block.C.shape[1], f.shape[2])) if of_constraints is None else of_constraints
        if self.state is not None:
            return self(block, factors, f, g)
        if before is None:
            rests = is_at_rest(block.rows) and not self._unknowns.n_1
            begun = self.begin(block, f[0], rests and bool(f[0].any()), g[0])
        else:
            begun = self.go_on(block, f[0], before)
        return tuple(map(np.concatenate, zip(begun, self(block[1:], factors[1:], f[1:], g[1:]), strict=True)))

    def go_on(self, block: Block, f: np.ndarray, before: State) -> tuple[np.ndarray, np.ndarray]:
        """First row under f (n, columns) of a run that begins where another has ended: accelerations anew.

        Returns
        -------
        e (1, 3, n, columns), lam (1, c, columns)
        """
        u, n_a = self._unknowns, self._unknowns.n_a
        (q, v, *_), (p, p1, *_), free = before.x.copy(), before.p, before.balancing
        left = f.copy()
        left[:n_a] -= block.K[0] @ q[:n_a] + block.D[0] @ v[:n_a]
        for S, x in zip(block.sampled, (q, v), strict=False):
            left[:n_a] -= S[0] @ x[:n_a]
        for body, at, own, wave in zip(u.bodies, u.blocks, u.waves, block.couplings, strict=True):
            left[at] -= wave.K[0] @ q[own] + wave.D[0] @ v[own]
            left[own] -= body.springs[:, None] * q[own] + body.dampers[:, None] * v[own]
            left[own] -= wave.K_back[0].T @ q[at] + wave.D_back[0].T @ v[at]
        if len(free):
            others = slice(u.first_order.start)  # but oscillators, which a static solve has balanced
            of_free = block.D[0][:, free] + sum(S[0][:, free] for S in block.sampled[1:])
            able = np.hstack([block.G[0].T, of_free])[others]
            size = np.sqrt(np.maximum(np.diag(block.M[0])[others], np.finfo(float).tiny))[:, None]
            v[free] = np.linalg.lstsq(able / size, left[others] / size, rcond=None)[0][block.G.shape[1] :]
            left[:n_a] -= of_free @ v[free]
        e, lam = self.begin(block, left, False)
        e[0, 2, u.first_order] = 0.0  # as Exudyn has rates of first order where a solve begins
        a, turns = e[0, 2], Turns.of(block.rows[:1], u, np.zeros(1))[0]
        p_rate, p_bend = (np.stack([x[0][n.own[3:]] for n in u.nodes]) for x in (block.rows.v, block.rows.a))
        along = 2 * np.einsum("ki,kic->kc", p_rate, p1) + np.einsum("ki,kic->kc", p_bend, p)
        bend = a[u.turns].reshape(-1, 3, f.shape[1]) - 2 * turns.H1 @ p1 - turns.H2 @ p
        p2 = turns.J @ bend - turns.p[:, :, None] * along[:, None]
        self.state = State(np.array([q, v, a, a]), np.array([p, p1, p2, p2]))
        return self.state.x[None, :3].copy(), lam

    def begin(
        self, block: Block, f: np.ndarray, rests: bool, g: np.ndarray | float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """First row under f (n, columns): accelerations from rest; if rests static with C e = g, as all modes are.

        Returns
        -------
        e (1, 3, n, columns), lam (1, c, columns)
        """
        u, n_a, x = self._unknowns, self._unknowns.n_a, f.copy()
        A = (block.K if rests else block.M)[:1].copy()
        r, waves = np.zeros((n_a + block.C.shape[1], f.shape[1])), []
        r[:n_a], r[n_a:] = f[:n_a], g if rests else 0.0
        for body, at, own, wave in zip(u.bodies, u.blocks, u.waves, block.couplings, strict=True):
            soft = 1 / body.springs if rests else np.ones(body.m)
            up, down = (wave.K[0] * soft, wave.K_back[0]) if rests else (wave.M[0], wave.M[0])
            A[0, at, at] -= up @ down.T
            r[at] -= up @ f[own]
            waves.append((at, own, down, soft[:, None]))
        inverses = bordered_pseudoinverses if rests else bordered_inverses  # a mechanism may be free to move
        z = inverses(A, block.G[:1], block.C[:1])[0] @ r
        x[:n_a] = z[:n_a]
        for at, own, down, soft in waves:
            x[own] = soft * (f[own] - down.T @ z[at])
        zero, J = np.zeros_like(f), Turns.of(block.rows[:1], u, np.zeros(1)).J[0]
        states = np.array([x, zero, zero, zero] if rests else [zero, zero, x, x])
        p = np.array([J @ y[u.turns].reshape(-1, 3, f.shape[1]) for y in states])
        self.state = State(states, p)
        return states[None, :3], z[None, n_a:]

    def __call__(self, block: Block, factors: Factors, f: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """March the rows of a block under f (T, n, columns), with C e = g (T, c, columns).

        Returns
        -------
        e (T, 3, n, columns), lam (T, c, columns)
        """
        T, n, columns = f.shape
        e, lam = np.empty((T, 3, n, columns)), np.empty((T, block.C.shape[1], columns))
        if loops is not None:
            self._march_compiled(block, factors, f, g, e, lam)
            return e, lam
        for i in range(T):
            e[i], lam[i] = self._step(block, factors, i, f[i], g[i])
        return e, lam

    def _step(
        self, block: Block, factors: Factors, i: int, f: np.ndarray, g: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Go on to row i under f (n, columns), C e = g; return e (3, n, columns), lam (c, columns)."""
        u, s, n_a, turns = self._unknowns, self._scheme, self._unknowns.n_a, factors.turns[i]
        h, c1, c2, flat = factors.h[i], factors.c1[i], factors.c2[i], (-1, f.shape[1])
        of_first = u.first_order
        (q, v, carried), (P, P1, carried_p) = predicted(self.state.x, h, s, of_first), predicted(self.state.p, h, s)
        nu = -turns.p[:, :, None] * np.einsum("ki,kic->kc", turns.p, P)[:, None]
        q[u.turns], v[u.turns] = (turns.H @ P).reshape(flat), (turns.H @ P1 + turns.H1 @ (P + nu)).reshape(flat)
        a0 = (2 * turns.H1 @ (P1 + c2 * nu) + turns.H2 @ (P + nu)).reshape(flat)
        r = np.concatenate([f[:n_a] - block.K[i] @ q[:n_a] - block.D[i] @ v[:n_a], g - block.C[i] @ q[:n_a]])
        r[:n_a] -= block.M[i][:, u.turns] @ a0
        for S, x in zip(block.sampled, self.state.x, strict=False):
            r[:n_a] -= S[i] @ x[:n_a]
        pushed = []
        for b, (body, at, own, wave) in enumerate(zip(u.bodies, u.blocks, u.waves, block.couplings, strict=True)):
            W = f[own] - body.springs[:, None] * q[own] - body.dampers[:, None] * v[own]
            W -= wave.K_back[i].T @ q[at] + wave.D_back[i].T @ v[at] + wave.M[i, 3:6].T @ a0[3 * b : 3 * b + 3]
            r[at] -= wave.K[i] @ q[own] + wave.D[i] @ v[own] + factors.up[b][i] @ W
            pushed.append(W)
        small, z = factors.inverse[i] @ r, np.empty_like(f)
        z[:n_a] = small[:n_a]
        for b, (at, own) in enumerate(zip(u.blocks, u.waves, strict=True)):
            z[own] = factors.soft[b][i][:, None] * (pushed[b] - factors.down[b][i].T @ z[at])
        a, zeta = c1 * z, z[u.turns].reshape(-1, 3, f.shape[1])
        q, v = q + z, v + c2 * z
        v[u.turns] += (turns.B1 @ zeta).reshape(flat)
        a[u.turns] += a0 + (turns.B2 @ zeta).reshape(flat)
        a[of_first] = 2 * c2 / h * z[of_first]
        delta, share = turns.J @ zeta + nu, (1 - s.alpha_f) / (1 - s.alpha_m)
        x = np.array([q, v, a, carried + share * a])
        p = np.array([P + delta, P1 + c2 * delta, c1 * delta, carried_p + share * c1 * delta])
        self.state = State(x, p)
        return x[:3], small[n_a:]

    def _march_compiled(
        self, block: Block, factors: Factors, f: np.ndarray, g: np.ndarray, e: np.ndarray, lam: np.ndarray
    ) -> None:
        """The same in C, into e and lam."""
        u, s = self._unknowns, self._scheme
        x, p = self.state.x.copy(), self.state.p.copy()
        arrays = (
            *(factors.h, factors.c1, factors.c2, block.M, block.D, block.K, block.C),
            *(factors.inverse, np.array(block.sampled), f, g, factors.turns.packed()),
        )
        T, n, columns = f.shape
        loops.march_mechanism(
            (T, n, u.n_a, block.C.shape[1], columns, len(block.sampled), u.n_1),
            np.array([s.alpha_m, s.alpha_f, s.beta, s.gamma]),
            starts_of_turns(u),
            bodies_given(block, u, factors.up, factors.down, factors.soft),
            tuple(map(np.ascontiguousarray, arrays)),
            (x, p, e, lam),
        )
        self.state = State(x, p)


def predicted(
    x: np.ndarray, h: float, s: Scheme, of_first: slice = slice(0)
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what a state (4, ...) is after h without new accelerations, its rate, what the scheme carries on.

    of_first : whose rates are of first order, and go by the trapezoidal rule
    """
    q, v, a, own = x
    carried = (s.alpha_f * a - s.alpha_m * own) / (1 - s.alpha_m)
    moved = q + h * v + h**2 * ((0.5 - s.beta) * own + s.beta * carried)
    rate = v + h * ((1 - s.gamma) * own + s.gamma * carried)
    rate[of_first] = v[of_first] + h / 2 * a[of_first]
    return moved, rate, carried
