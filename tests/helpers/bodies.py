"""Seeded full models of the tests: dense matrices, from which both the truth and an ElasticBody are built."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la

from exudyn_romerr import ElasticBody
from models import linkage
from models.beam3d import DOFS_PER_NODE, STEEL, RoundSection, assemble

BODIES = ("chain", "pencil", "wide", "beam", "linkage")
DAMPINGS = ("none", "under", "critical", "overdamped", "stiff", "matrix", "gyroscopic")


@dataclass(frozen=True)
class Model:
    """M, D, K (N, N) dense, all coordinates free; rayleigh is None where D is a general matrix."""

    name: str
    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    rayleigh: tuple[float, float] | None

    @property
    def N(self):
        return len(self.M)

    @cached_property
    def modes(self):
        """Angular frequencies (N,) ascending and M-orthonormal shapes (N, N)."""
        squares, shapes = la.eigh(self.K, self.M)
        return np.sqrt(squares), shapes

    @cached_property
    def body(self):
        damping = {"damping": self.D} if self.rayleigh is None else {"rayleigh": self.rayleigh}
        return ElasticBody(self.M, self.K, **damping)


def model(kind, damping, seed):
    """Return the Model of one of BODIES with one of DAMPINGS."""
    rng = np.random.default_rng([seed, BODIES.index(kind), DAMPINGS.index(damping)])
    M, K = MATRICES[kind](rng)
    omega = np.sqrt(la.eigvalsh(K, M))
    if damping in ("matrix", "gyroscopic"):
        return Model(f"{kind}/{damping}", M, _general_damping(rng, M, omega, damping), K, None)
    alpha, beta = map(float, RAYLEIGH[damping](omega[0], omega[-1], rng))
    return Model(f"{kind}/{damping}", M, alpha * M + beta * K, K, (alpha, beta))


def chain(rng, size=10):
    """Masses and springs in a row, with a small random positive definite coupling of all of them."""
    M = np.diag(rng.uniform(0.5, 2, size)) + _definite(rng, size, 0.02)
    K = np.diag(rng.uniform(20, 100, size)) + _definite(rng, size, 5.0)
    for i, k in enumerate(rng.uniform(300, 900, size - 1)):
        K[i : i + 2, i : i + 2] += k * np.array([[1, -1], [-1, 1]])
    return M, K


def pencil(rng, size=12, lowest=3.0, ratio=20.0):
    """A dense pencil with frequencies spread over lowest .. lowest * ratio rad/s."""
    omega = lowest * ratio ** np.sort(np.concatenate([[0, 1], rng.uniform(0, 1, size - 2)]))
    X = np.eye(size) + 0.5 * rng.standard_normal((size, size)) / np.sqrt(size)
    return _symmetric(X.T @ X), _symmetric(X.T @ (omega[:, None] ** 2 * X))


def wide(rng):
    """Frequencies over four decades: stiff."""
    return pencil(rng, size=8, lowest=0.5, ratio=1e4)


def beam(rng, count=3):
    """A clamped straight steel beam in a random direction."""
    direction = rng.standard_normal(3)
    nodes = np.linspace(0, 1, count + 1)[:, None] * direction / la.norm(direction)
    elements = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    matrices = assemble(nodes, elements, RoundSection(diameter=0.02), STEEL)
    return tuple(_symmetric(m.toarray()[DOFS_PER_NODE:, DOFS_PER_NODE:]) for m in matrices)


def _linkage(rng):
    return tuple(_symmetric(m.toarray()[DOFS_PER_NODE:, DOFS_PER_NODE:]) for m in linkage.matrices())


MATRICES = {"chain": chain, "pencil": pencil, "wide": wide, "beam": beam, "linkage": _linkage}

# (alpha, beta) from the lowest and the highest frequency
RAYLEIGH = {
    "none": lambda low, high, rng: (0.0, 0.0),
    "under": lambda low, high, rng: (0.02 * low, 0.02 / high),
    "critical": lambda low, high, rng: (2 * low, 0.0),  # zeta_1 = 1, the others below
    "overdamped": lambda low, high, rng: (rng.uniform(1, 4) * low, 2 * rng.uniform(0.2, 1) / low),
    "stiff": lambda low, high, rng: (0.0, 10 * rng.uniform(0.1, 1) / np.sqrt(low * high)),  # high modes overdamped
}


def _general_damping(rng, M, omega, kind):
    """Random dissipative D (singular, so that some motions are undamped), with a skew part if gyroscopic."""
    L = la.cholesky(M, lower=True)
    A = rng.standard_normal((len(M), max(1, len(M) // 2))) / np.sqrt(len(M))
    D = L @ A @ A.T @ L.T * omega[0] * rng.uniform(0.1, 2)
    if kind == "matrix":
        return _symmetric(D)
    skew = np.triu(rng.standard_normal(M.shape), 1) / np.sqrt(len(M))
    return D + 0.5 * omega[0] * L @ (skew - skew.T) @ L.T


def _definite(rng, size, scale):
    A = rng.standard_normal((size, size)) / np.sqrt(size)
    return scale * _symmetric(A @ A.T)


def _symmetric(A):
    return (A + A.T) / 2
