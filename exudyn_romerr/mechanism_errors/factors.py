"""Factors of steps: what the march needs in every row of a block, made for all rows at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..compiled.loops import loops
from ..mechanism.rotations import global_rates, parameter_rates
from ..mechanism.rows import Rows, Samples
from ..mechanism.scheme import Scheme
from ..mechanism.tangents import Block
from ..mechanism.unknowns import Unknowns

SMALL = 150  # rows of matrices that are inverted in C: half to two thirds of the time of LAPACK's
LEAST = 1e-10  # of the largest diagonal entry: Euler parameters have no mass along themselves
FREE = 1e-12  # of the largest singular value: below, the stiffness of a mechanism that may move is rounding


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
    turns = Turns.of(block.rows, unknowns, c2)
    if unknowns.n_1:  # whose accelerations are other multiples of increments
        M, own = block.M.copy(), unknowns.first_order
        M[:, own, own] *= (2 * c2 / (h * c1))[:, None, None]
        block = replace(block, M=M)
    make = _matrices if loops is None else _matrices_compiled
    A, *coupled = make(block, unknowns, turns, c1, c2)
    return Factors(bordered_inverses(A, block.G, block.C), *coupled, turns, c1, c2, h)


def _matrices_compiled(block: Block, unknowns: Unknowns, turns: Turns, c1: np.ndarray, c2: np.ndarray) -> tuple:
    """Return A (T, n_a, n_a), and up, down, soft of bodies, see Factors."""
    up, down = ([np.empty(wave.M.shape) for wave in block.couplings] for _ in range(2))
    soft = [np.empty((len(block), body.m)) for body in unknowns.bodies]
    A, arrays = np.empty(block.M.shape), (c1, c2, block.M, block.D, block.K, turns.packed())
    loops.step_matrices(
        (len(block), unknowns.n, unknowns.n_a),
        starts_of_turns(unknowns),
        bodies_given(block, unknowns, up, down, soft),
        tuple(map(np.ascontiguousarray, arrays)),
        A,
    )
    return A, up, down, soft


def _matrices(block: Block, unknowns: Unknowns, turns: Turns, c1: np.ndarray, c2: np.ndarray) -> tuple:
    """Return the same where no loops are compiled."""
    one, two = c1[:, None, None], c2[:, None, None]
    A = one * block.M + two * block.D + block.K
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
    return A, up, down, soft


def starts_of_turns(unknowns: Unknowns) -> np.ndarray:
    """Return where rotations of nodes are, as compiled loops take them."""
    return np.array([node.at + 3 for node in unknowns.nodes], np.int64)


def bodies_given(block: Block, unknowns: Unknowns, *factors: Sequence[np.ndarray]) -> list[tuple]:
    """Return bodies as compiled loops take them; factors : up, down, soft of each, read or written."""
    u, found = unknowns, []
    for body, at, own, wave, *parts in zip(u.bodies, u.blocks, u.waves, block.couplings, *factors, strict=True):
        arrays = *vars(wave).values(), *parts, body.springs, body.dampers
        found.append((at.start, at.stop - at.start, own.start, body.m, *map(np.ascontiguousarray, arrays)))
    return found


def bordered_inverses(A: np.ndarray, G: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return inverses of [[A, G^T], [C, 0]] (T, n + c, n + c), rows and columns scaled first.

    Raises
    ------
    LinAlgError
        One has none.
    """
    T, c, n = C.shape
    if loops is None or n + c > SMALL:
        return _bordered_inverses(A, G, C)
    found = np.empty((T, n + c, n + c))
    if loops.bordered_inverses(T, n, c, LEAST, *map(np.ascontiguousarray, (A, G, C)), found) < T:
        raise np.linalg.LinAlgError("Singular matrix")
    return found


def bordered_pseudoinverses(A: np.ndarray, G: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return the same of matrices that may be singular: what nothing holds stays where it is."""
    both, scaled = _scaled(A, G, C)
    return both * np.linalg.pinv(scaled, rcond=FREE)


def _bordered_inverses(A: np.ndarray, G: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return bordered_inverses by LAPACK."""
    both, scaled = _scaled(A, G, C)
    return both * np.linalg.inv(scaled)


def _scaled(A: np.ndarray, G: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Factors of the rows times those of the columns, and the matrices times these, (T, n + c, n + c)."""
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
    return both, both * whole
