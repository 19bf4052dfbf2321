"""The march: e = y_full - y_reduced of the linearised mechanism under kicks, by the run's own generalised-alpha.

M e'' + D e' + K e + G^T lam = f, C e = 0, once for many right-hand sides. Oscillators are vectors, all else is a
small system: frames, modes, kept vectors, other bodies, constraints. In coordinates of the mbs: Newmark's formulas
hold for Euler parameters, not for rotations z in global axes: with states dp beside z, H = 4 E^T(p), J = E(p),
z = H dp, a step from predictions P, P' has, with zeta the increment of z,

    dp = P + delta ,  dp' = P' + c2 delta ,  dp'' = c1 delta ,   delta = J zeta + nu ,  nu = -p (p . P)
    z = H P + zeta ,  z' = H P' + H' (P + nu) + (c2 + H' J) zeta ,
    z'' = 2 H' (P' + c2 nu) + H'' (P + nu) + (c1 + 2 c2 H' J + H'' J) zeta .
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..compiled.loops import loops
from ..mechanism.rotations import global_rates, parameter_rates
from ..mechanism.samples import Rows, Samples
from ..mechanism.tangents import Block
from ..mechanism.unknowns import Unknowns
from ..trajectory.scheme import Scheme

SMALL = 64  # rows of matrices that are inverted in C: a fourth of the time of LAPACK's
LEAST = 1e-10  # of the largest diagonal entry: Euler parameters have no mass along themselves
REST = 1e-4  # of the largest acceleration: a run that begins with less begins in an equilibrium


@dataclass
class State:
    """x (4, n, columns): e, e', e'', the scheme's own acceleration; p (4, nodes, 4, columns): of Euler parameters."""

    x: np.ndarray
    p: np.ndarray


@dataclass
class Turns(Samples):
    """Of nodes with Euler parameters at T rows.

    p (T, nodes, 4), J (T, nodes, 4, 3), H, H1, H2 (T, nodes, 3, 4); B1 = H' J, B2 = 2 c2 H' J + H'' J, (3, 3) each.
    """

    p: np.ndarray
    J: np.ndarray
    H: np.ndarray
    H1: np.ndarray
    H2: np.ndarray
    B1: np.ndarray
    B2: np.ndarray

    @classmethod
    def of(cls, rows: Rows, unknowns: Unknowns, c2: np.ndarray) -> Turns:
        """Read them off rows."""
        none = np.zeros((len(rows), 0, 4))
        p, p1, p2 = none, none, none
        if unknowns.nodes:
            p = np.stack([node.parameters(rows.q) for node in unknowns.nodes], axis=1)
            p1, p2 = (np.stack([x[:, n.own[3:]] for n in unknowns.nodes], axis=1) for x in (rows.v, rows.a))
        J, H, H1, H2 = parameter_rates(p), *(global_rates(x) for x in (p, p1, p2))
        B1 = H1 @ J
        return cls(p, J, H, H1, H2, B1, 2 * c2[:, None, None, None] * B1 + H2 @ J)

    def packed(self) -> np.ndarray:
        """All of a node one behind the other, (T, nodes, 70), as mechanism_march.h has it."""
        parts = (x.reshape(*x.shape[:2], int(np.prod(x.shape[2:]))) for x in vars(self).values())
        return np.concatenate([*parts], axis=2)


@dataclass
class Factors(Samples):
    """Of every row of a block: what a step needs, made for all at once.

    inverse (T, n_a + c, n_a + c) : of the small system. up (T, s, m) : coupling of rows / Lambda, down (T, s, m) : of
    columns, soft (T, m) = 1 / Lambda, of each body. turns : of nodes. c1, c2, h (T,).
    """

    inverse: np.ndarray
    up: list[np.ndarray]
    down: list[np.ndarray]
    soft: list[np.ndarray]
    turns: Turns
    c1: np.ndarray
    c2: np.ndarray
    h: np.ndarray


def factors_of(block: Block, h: np.ndarray, unknowns: Unknowns, scheme: Scheme) -> Factors:
    """Return factors of steps of lengths h (T,) that end at the rows of a block."""
    c1, c2 = scheme.mass_and_damping(h)
    one, two = c1[:, None, None], c2[:, None, None]
    A, turns = one * block.M + two * block.D + block.K, Turns.of(block.rows, unknowns, c2)
    for k, node in enumerate(unknowns.nodes):
        at = node.shifts_and_turns[1]
        A[:, :, at] += block.M[:, :, at] @ turns.B2[:, k] + block.D[:, :, at] @ turns.B1[:, k]
    up, down, soft = [], [], []
    for b, (body, at, wave) in enumerate(zip(unknowns.bodies, unknowns.blocks, block.couplings, strict=True)):
        soft.append(1 / (c1[:, None] + c2[:, None] * body.dampers + body.springs))
        up.append((one * wave.M + two * wave.D + wave.K) * soft[-1][:, None])
        back = one * wave.M + two * wave.D_back + wave.K_back
        B1, B2 = (x[:, b].swapaxes(1, 2) for x in (turns.B1, turns.B2))  # frames of bodies are the first nodes
        back[:, 3:6] += B2 @ wave.M[:, 3:6] + B1 @ wave.D_back[:, 3:6]
        down.append(back)
        A[:, at, at] -= up[-1] @ back.swapaxes(1, 2)
    return Factors(bordered_inverses(A, block.G, block.C), up, down, soft, turns, c1, c2, h)


def bordered_inverses(A: np.ndarray, G: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return inverses of [[A, G^T], [C, 0]] (T, n + c, n + c), rows and columns scaled first."""
    T, c, n = C.shape
    diagonal = np.abs(np.diagonal(A, axis1=1, axis2=2))
    largest = diagonal.max(axis=1, keepdims=True, initial=np.finfo(float).tiny)
    size = np.sqrt(np.maximum(diagonal, LEAST * largest))
    whole, scale = np.zeros((T, n + c, n + c)), np.ones((T, n + c))
    scale[:, :n] = 1 / size
    if c:
        lengths = np.linalg.norm(C / size[:, None], axis=2)
        scale[:, n:] = 1 / np.where(lengths > 0, lengths, 1.0)
    whole[:, :n, :n], whole[:, :n, n:], whole[:, n:, :n] = A, G.swapaxes(1, 2), C
    both = scale[:, :, None] * scale[:, None]
    return both * inverses(both * whole)


def inverses(A: np.ndarray) -> np.ndarray:
    """Return inverses of matrices (T, n, n), which may take their place.

    Raises
    ------
    LinAlgError
        One has none.
    """
    if loops is None or A.shape[1] > SMALL:
        return np.linalg.inv(A)
    if loops.inverses(len(A), A.shape[1], A) < len(A):
        raise np.linalg.LinAlgError("Singular matrix")
    return A


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

    def go_on(self, block: Block, f: np.ndarray, before: State) -> tuple[np.ndarray, np.ndarray]:
        """First row under f (n, columns) of a run that begins where another has ended: accelerations anew.

        Returns
        -------
        e (1, 3, n, columns), lam (1, c, columns)
        """
        u, n_a = self._unknowns, self._unknowns.n_a
        (q, v, *_), (p, p1, *_) = before.x, before.p
        left = f.copy()
        left[:n_a] -= block.K[0] @ q[:n_a] + block.D[0] @ v[:n_a]
        for body, at, own, wave in zip(u.bodies, u.blocks, u.waves, block.couplings, strict=True):
            left[at] -= wave.K[0] @ q[own] + wave.D[0] @ v[own]
            left[own] -= body.springs[:, None] * q[own] + body.dampers[:, None] * v[own]
            left[own] -= wave.K_back[0].T @ q[at] + wave.D_back[0].T @ v[at]
        e, lam = self.begin(block, left, False)
        a, turns = e[0, 2], Turns.of(block.rows[:1], u, np.zeros(1))[0]
        p_rate, p_bend = (np.stack([x[0][n.own[3:]] for n in u.nodes]) for x in (block.rows.v, block.rows.a))
        along = 2 * np.einsum("ki,kic->kc", p_rate, p1) + np.einsum("ki,kic->kc", p_bend, p)
        bend = a[u.turns].reshape(-1, 3, f.shape[1]) - 2 * turns.H1 @ p1 - turns.H2 @ p
        p2 = turns.J @ bend - turns.p[:, :, None] * along[:, None]
        self.state = State(np.array([q, v, a, a]), np.array([p, p1, p2, p2]))
        return self.state.x[None, :3].copy(), lam

    def begin(self, block: Block, f: np.ndarray, rests: bool) -> tuple[np.ndarray, np.ndarray]:
        """First row under f (n, columns): accelerations from rest; static if rests, for the full model rests, too.

        Returns
        -------
        e (1, 3, n, columns), lam (1, c, columns)
        """
        u, n_a, x = self._unknowns, self._unknowns.n_a, f.copy()
        A = (block.K if rests else block.M)[:1].copy()
        r, waves = np.zeros((n_a + block.C.shape[1], f.shape[1])), []
        r[:n_a] = f[:n_a]
        for body, at, own, wave in zip(u.bodies, u.blocks, u.waves, block.couplings, strict=True):
            soft = 1 / body.springs if rests else np.ones(body.m)
            up, down = (wave.K[0] * soft, wave.K_back[0]) if rests else (wave.M[0], wave.M[0])
            A[0, at, at] -= up @ down.T
            r[at] -= up @ f[own]
            waves.append((at, own, down, soft[:, None]))
        z = bordered_inverses(A, block.G[:1], block.C[:1])[0] @ r
        x[:n_a] = z[:n_a]
        for at, own, down, soft in waves:
            x[own] = soft * (f[own] - down.T @ z[at])
        zero, J = np.zeros_like(f), Turns.of(block.rows[:1], u, np.zeros(1)).J[0]
        states = np.array([x, zero, zero, zero] if rests else [zero, zero, x, x])
        p = np.array([J @ y[u.turns].reshape(-1, 3, f.shape[1]) for y in states])
        self.state = State(states, p)
        return states[None, :3], z[None, n_a:]

    def __call__(self, block: Block, factors: Factors, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """March the rows of a block under f (T, n, columns).

        Returns
        -------
        e (T, 3, n, columns), lam (T, c, columns)
        """
        T, n, columns = f.shape
        e, lam = np.empty((T, 3, n, columns)), np.empty((T, block.C.shape[1], columns))
        if loops is not None:
            self._march_compiled(block, factors, f, e, lam)
            return e, lam
        for i in range(T):
            e[i], lam[i] = self._step(block, factors, i, f[i])
        return e, lam

    def _step(self, block: Block, factors: Factors, i: int, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Go on to row i under f (n, columns); return e (3, n, columns), lam (c, columns)."""
        u, s, n_a, turns = self._unknowns, self._scheme, self._unknowns.n_a, factors.turns[i]
        h, c1, c2, flat = factors.h[i], factors.c1[i], factors.c2[i], (-1, f.shape[1])
        (q, v, carried), (P, P1, carried_p) = (_predicted(x, h, s) for x in (self.state.x, self.state.p))
        nu = -turns.p[:, :, None] * np.einsum("ki,kic->kc", turns.p, P)[:, None]
        q[u.turns], v[u.turns] = (turns.H @ P).reshape(flat), (turns.H @ P1 + turns.H1 @ (P + nu)).reshape(flat)
        a0 = (2 * turns.H1 @ (P1 + c2 * nu) + turns.H2 @ (P + nu)).reshape(flat)
        r = np.concatenate([f[:n_a] - block.K[i] @ q[:n_a] - block.D[i] @ v[:n_a], -block.C[i] @ q[:n_a]])
        r[:n_a] -= block.M[i][:, u.turns] @ a0
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
        delta, share = turns.J @ zeta + nu, (1 - s.alpha_f) / (1 - s.alpha_m)
        x = np.array([q, v, a, carried + share * a])
        p = np.array([P + delta, P1 + c2 * delta, c1 * delta, carried_p + share * c1 * delta])
        self.state = State(x, p)
        return x[:3], small[n_a:]

    def _march_compiled(self, block: Block, factors: Factors, f: np.ndarray, e: np.ndarray, lam: np.ndarray) -> None:
        """The same in C, into e and lam."""
        u, s, bodies = self._unknowns, self._scheme, []
        x, p = self.state.x.copy(), self.state.p.copy()
        for b, (body, at, own, wave) in enumerate(zip(u.bodies, u.blocks, u.waves, block.couplings, strict=True)):
            parts = *vars(wave).values(), factors.up[b], factors.down[b], factors.soft[b], body.springs, body.dampers
            bodies.append((at.start, at.stop - at.start, own.start, body.m, *map(np.ascontiguousarray, parts)))
        arrays = (
            *(factors.h, factors.c1, factors.c2, block.M, block.D, block.K, block.C),
            *(factors.inverse, factors.turns.packed(), f),
        )
        starts = np.array([node.at + 3 for node in u.nodes], np.int64)
        T, n, columns = f.shape
        loops.march_mechanism(
            (T, n, u.n_a, block.C.shape[1], columns),
            np.array([s.alpha_m, s.alpha_f, s.beta, s.gamma]),
            starts,
            bodies,
            tuple(map(np.ascontiguousarray, arrays)),
            (x, p, e, lam),
        )
        self.state = State(x, p)


def _predicted(x: np.ndarray, h: float, s: Scheme) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What a state (4, ...) is after h without new accelerations, its rate, what the scheme carries on."""
    q, v, a, own = x
    carried = (s.alpha_f * a - s.alpha_m * own) / (1 - s.alpha_m)
    moved = q + h * v + h**2 * ((0.5 - s.beta) * own + s.beta * carried)
    return moved, v + h * ((1 - s.gamma) * own + s.gamma * carried), carried
