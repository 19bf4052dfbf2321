"""The paper's sensitivity study on its linkage: unit systems and single precision, its way and the package's."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

import exudyn_romerr as romerr
from models import exact, linkage
from models.beam3d import DOFS_PER_NODE
from models.paper_way import PaperWay

LEVELS = (6, 12, 24, 30, 36, 84, 114)  # Krylov vectors, as the paper; the last is the full model
OMEGA = 2 * np.pi * linkage.FREQUENCY  # rad/s
END = 2.0  # s
PRECISIONS = {64: np.float64, 32: np.float32}
ESTIMATORS = ("fast", "convolution", "energy", "auxiliary")
INTEGRATED = 12  # Krylov vectors of the integrated runs
TOLERANCES = ((1e-3, 1e-6), (1e-6, 1e-9))  # relative and absolute; the first are those of MATLAB's ode45 and scipy

_body, INPUTS, OUTPUT = linkage.build()
_truth = exact.full_solution(_body, INPUTS, linkage.AMPLITUDE, OMEGA)


@dataclass(frozen=True)
class Units:
    """A unit system with the second; length and mass: how many of its units make 1 m and 1 kg.

    seed: other than 0, all entries are moved at random by a unit in their last digit, as a conversion may.
    """

    name: str
    length: float
    mass: float
    seed: int = 0

    @property
    def position_norm(self) -> float:
        """How many of its units make 1 m sqrt(kg), the unit of |e|_M."""
        return self.length * np.sqrt(self.mass)

    @property
    def amplitude(self) -> float:
        """The linkage's force."""
        return linkage.AMPLITUDE * self.mass * self.length

    def vectors(self, rows: np.ndarray) -> np.ndarray:
        """Return M-orthonormal vectors (N, n) given in kg, m: translations are converted, rotations have no unit."""
        return self._moved(rows * self._scale(len(rows))[:, None] / self.position_norm)

    def matrix(self, matrix: np.ndarray) -> np.ndarray:
        """Return a mass or stiffness matrix (N, N) given in kg, m, s: x^T A x is an energy (mass: times s^2)."""
        scale = self._scale(len(matrix))
        moved = np.triu(self._moved(self.mass * self.length**2 * matrix / np.outer(scale, scale)))
        return moved + np.triu(moved, 1).T

    def _moved(self, entries: np.ndarray) -> np.ndarray:
        digits = np.random.default_rng(self.seed).integers(-1, 2, entries.shape)
        return entries * (1 + bool(self.seed) * np.finfo(float).eps * digits)

    def _scale(self, count: int) -> np.ndarray:
        return np.where(np.arange(count) % DOFS_PER_NODE < 3, self.length, 1.0)


UNITS = (
    Units("m, kg, s", 1.0, 1.0),
    Units("km, g, s", 1e-3, 1e3),
    Units("mm, t, s", 1e3, 1e-3),
    # nearly the same, but conversion rounds nothing: what still differs is the package's own
    Units("1024 m, kg/1024, s", 2.0**-10, 2.0**10),
    Units("m/1024, 1024 kg, s", 2.0**10, 2.0**-10),
    # no conversion at all: what rounding of the entries alone does
    Units("m, kg, s, last digits moved", 1.0, 1.0, seed=1),
    Units("m, kg, s, last digits moved again", 1.0, 1.0, seed=2),
)
DECIMAL, BINARY, MOVED = [0, 1, 2], [0, 3, 4], [0, 5, 6]


def linkage_in(units: Units, bits: int = 64) -> romerr.ElasticBody:
    """Return the linkage in other units, its matrices rounded to a precision."""
    mass, stiffness = (units.matrix(A.toarray()).astype(PRECISIONS[bits]) for A in (_body.mass, _body.stiffness))
    positions = units.length * _body.positions
    return romerr.ElasticBody(mass, stiffness, rayleigh=_body.rayleigh, fixed=linkage.CLAMPED, positions=positions)


def krylov(n: int) -> np.ndarray:
    """Return the basis (N, n) in m, kg; all n free coordinates: their unit vectors."""
    return _body.expand(np.eye(n)) if n == _body.free.size else romerr.krylov_basis(_body, INPUTS, n).V


def sample_times(step: float, first: float = 1e-8) -> np.ndarray:
    """Return 0..2 s in equal steps, the first one cut up geometrically: the start excites the fast modes."""
    start = np.geomspace(first, step, 400, endpoint=False)
    return np.concatenate([[0.0], start, step * np.arange(1, round(END / step) + 1)])


def exact_tip(t: np.ndarray) -> np.ndarray:
    """Return the tip's displacement of the full model in m, closed form."""
    return _truth.output(OUTPUT.resolve(_body), t)[:, 0]


@dataclass(frozen=True)
class Level:
    """One reduced model, all in m, kg, s.

    bound : estimator -> bounds of the tip (T,). error : (T,), true one of the tip. residual : way -> |R|_{M^-1} (T,).
    negative : how many squares of the expanded residual are. from_data : how far rounding the matrices moves the
    tip at most; round_off : what the report says of that.
    """

    bound: dict[str, np.ndarray]
    error: np.ndarray
    residual: dict[str, np.ndarray] = field(default_factory=dict)
    negative: int = 0
    from_data: float = 0.0
    round_off: float = 0.0

    def largest(self, estimator: str) -> float:
        """Return the largest bound."""
        return float(np.max(self.bound[estimator]))

    @property
    def largest_error(self) -> float:
        """The largest true error."""
        return float(np.max(np.abs(self.error)))


def paper_level(parameters: dict) -> Level:
    """Evaluate a level as the paper does, all of it in one precision and one unit system.

    Parameters
    ----------
    parameters : dict
        n (of LEVELS), units (index in UNITS), bits (of PRECISIONS), and functionData: {"step": of the samples, in s}.
    """
    units, bits = UNITS[parameters["units"]], parameters["bits"]
    paper = PaperWay(linkage_in(units, bits), INPUTS, OUTPUT, PRECISIONS[bits], parameters["n"])
    t = sample_times(parameters["functionData"]["step"])
    return _by_paper(paper, paper.exact_motion(t, units.amplitude, OMEGA), units)


def _by_paper(paper: PaperWay, motion: romerr.Trajectory, units: Units) -> Level:
    squares = paper.squared_residuals(motion)
    residual = {way: np.sqrt(np.abs(x)) for way, x in squares.items()}
    return Level(
        bound={e: x / units.length for e, x in paper.bounds(motion.t, residual["direct"]).items()},
        error=exact_tip(motion.t) - paper.tip(motion.q) / units.length,
        residual={way: x / units.position_norm for way, x in residual.items()},
        negative=int(np.sum(squares["expanded"] < 0)),
    )


def our_level(parameters: dict) -> Level:
    """Evaluate a level by the package: parameters as of paper_level, matrices and basis rounded to a precision.

    Krylov vectors are those of m, kg, s, converted: a user converts a model, and the bounds must not notice. Exudyn
    computes in double, so does the reduced motion here. error is that of the reduction: truth is the full model with
    the same rounded matrices.
    """
    units, bits = UNITS[parameters["units"]], parameters["bits"]
    body = linkage_in(units, bits)
    basis = romerr.Basis(units.vectors(krylov(parameters["n"])).astype(PRECISIONS[bits]))
    t = sample_times(parameters["functionData"]["step"])
    solution = exact.reduced_solution(body, basis, INPUTS, units.amplitude, OMEGA)
    row = OUTPUT.resolve(body)
    full = exact.full_solution(body, INPUTS, units.amplitude, OMEGA).output(row, t)[:, 0]
    bound, round_off = _by_package(body, basis, exact.reduced_trajectory(solution, t, units.amplitude), units)
    return Level(
        bound=bound,
        error=(full - solution.output(row @ basis.V, t)[:, 0]) / units.length,
        from_data=np.max(np.abs(full / units.length - exact_tip(t))),
        round_off=round_off,
    )


def _by_package(body, basis, motion, units) -> tuple[dict[str, np.ndarray], float]:
    report = romerr.evaluate(
        body, basis, motion, inputs=INPUTS, outputs=[OUTPUT], estimators=ESTIMATORS, time="sampled"
    )
    out = report.output(OUTPUT.name)
    bound = {e: out.bound[e][:, 0] / units.length for e in ESTIMATORS}
    return bound, float(np.max(out.round_off)) / units.length


def integrated_level(parameters: dict) -> tuple[Level, Level]:
    """Integrate 12 Krylov vectors by Runge-Kutta 4(5); evaluate the run as the paper does and by the package.

    Parameters
    ----------
    parameters : dict
        units (index in UNITS), tolerances (index in TOLERANCES).
    """
    units, tolerances = UNITS[parameters["units"]], TOLERANCES[parameters["tolerances"]]
    body, V = linkage_in(units), units.vectors(krylov(INTEGRATED))
    paper = PaperWay(body, INPUTS, OUTPUT, np.float64, INTEGRATED, V[body.free])
    motion = paper.integrated_motion(END, units.amplitude, OMEGA, *tolerances)
    by_paper = _by_paper(paper, motion, units)
    bound, round_off = _by_package(body, romerr.Basis(V), motion, units)
    return by_paper, Level(bound, by_paper.error, round_off=round_off)
