"""Small bodies at the edge of what double precision can hold: M, K (N, N) dense, nothing fixed."""

from __future__ import annotations

import numpy as np

from models.beam3d import DOFS_PER_NODE, STEEL, RoundSection, assemble

Matrices = tuple[np.ndarray, np.ndarray]


def chain(n: int, stiffness: float = 1.0) -> Matrices:
    """Masses of 1 kg in a row between two walls."""
    return np.eye(n), stiffness * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))


def light_mass(ratio: float) -> Matrices:
    """Three masses between two walls, the last one so light that it alone swings `ratio` times faster."""
    return np.diag([1.0, 1.5, ratio**-2]), chain(3)[1]


def stiff_link(ratio: float) -> Matrices:
    """Three masses, the last two linked by a spring so stiff that they swing `ratio` times faster against each other.

    What holds them is a difference of entries that are ratio^2 as large: K has ratio^2 for its condition.
    """
    K = chain(3)[1]
    K[1:, 1:] = np.array([[1.0, 0.0], [0.0, 0.0]]) + ratio**2 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return np.eye(3), K


def graded(ratio: float, n: int = 6) -> Matrices:
    """Frequencies spread evenly over 1..ratio on a logarithmic scale, all coordinates coupled."""
    mixed = np.eye(n) + 0.1 * np.random.default_rng(0).standard_normal((n, n))
    scale = ratio ** np.linspace(0, 1, n)
    return np.eye(n), scale[:, None] * (mixed @ mixed.T) * scale


def clustered(distance: float) -> Matrices:
    """Squared frequencies 1, 2 three times, 9 twice, within relative `distance`; coordinates turned at random."""
    squares = np.array([1, 2, 2 * (1 + distance), 2 * (1 + 2 * distance), 9, 9 * (1 + distance)])
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((6, 6)))[0]
    K = turn @ (squares[:, None] * turn.T)
    return np.eye(6), (K + K.T) / 2


def multiple() -> Matrices:
    """Squared frequencies 1, 2, 2, 2, 9, 9, equal to the last bit."""
    return np.eye(6), np.diag([1.0, 2.0, 2.0, 2.0, 9.0, 9.0])


def almost_free(hold: float) -> Matrices:
    """Four masses in a row, the first one held by a spring of `hold` times the others' stiffness."""
    K = np.diag([1.0, 2.0, 2.0, 1.0]) - np.eye(4, k=1) - np.eye(4, k=-1)
    K[0, 0] += hold
    return np.eye(4), K


def slender_beam(slenderness: float, turned: bool, count: int = 3) -> Matrices:
    """A clamped steel beam of 1 m, `slenderness` its length over its diameter, along x or in a random direction."""
    direction = np.random.default_rng(3).standard_normal(3) if turned else np.array([1.0, 0.0, 0.0])
    nodes = np.linspace(0, 1, count + 1)[:, None] * direction / np.linalg.norm(direction)
    elements = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    matrices = assemble(nodes, elements, RoundSection(diameter=1 / slenderness), STEEL)
    M, K = (matrix.toarray()[DOFS_PER_NODE:, DOFS_PER_NODE:] for matrix in matrices)
    return (M + M.T) / 2, (K + K.T) / 2


def massless(hidden: bool) -> Matrices:
    """Five masses of which coordinate 2 has none, or coordinates 1 and 2 none when they move against each other."""
    M, K = chain(5)
    M[2, 2] = 0.0
    if hidden:
        M[1:3, 1:3] = 0.5
    return M, K
