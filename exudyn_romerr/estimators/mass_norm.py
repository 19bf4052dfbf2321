"""What every estimator takes and gives: the start of a run, blocks of steps in, bounds out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..model.floating_frame import Turn
    from ..residual.packed_residual import Cut
    from ..residual.problem import Problem
    from ..residual.residual import StartNorms


class Added(NamedTuple):
    """What auxiliary vectors add to a reduced trajectory, which was bounded with it.

    q, q_t : (S, n) of modes and vectors. speed : (S,) the root of twice the kinetic energy of all that is added.
    """

    q: np.ndarray
    q_t: np.ndarray
    speed: np.ndarray


@dataclass(frozen=True)
class Start:
    """First instant of a run.

    z : (k,) residual coordinates; y0, y0_t : columns' combinations with K e0 = L y0, M e0' = L y0' (theory.md 3),
    None if the initial error is zero. cut : bound of what z leaves out of R, in the K^-1 norm. joint : energy of all
    bodies of a mechanism together; None: this body is alone. added : what auxiliary vectors add; None: nothing.
    """

    t: float
    z: np.ndarray
    y0: np.ndarray | None = None
    y0_t: np.ndarray | None = None
    cut: float = 0.0
    joint: float | None = None
    added: Added | None = None


@dataclass
class Block:
    """S consecutive segments of a trajectory, polynomial in time.

    t : (S,) ends of the segments; h : (S,) lengths; c : (S, d + 1, k) Bezier control points of z.
    unresolved : (S, p) bounds of |u - u_I| in each segment, u_I the polynomial that c contains.
    unresolved_variation : (S, p) bounds of the total variation of u - u_I.
    skipped : (S, 2, n), samples of qr and qr' less the trajectory at the ends of the segments; None: no difference.
    turn : how the frame turns in each segment; None: not at all. cut : what c leaves out of R; None: nothing.
    bent, moved : (S, 2), see Turn.of_curve. joint : (S,) variation of R of all bodies of a mechanism together; None:
    this body is alone. added : what auxiliary vectors add at the ends of the segments; None: nothing.
    """

    t: np.ndarray
    h: np.ndarray
    c: np.ndarray
    unresolved: np.ndarray
    unresolved_variation: np.ndarray
    skipped: np.ndarray | None = None
    turn: Turn | None = None
    cut: Cut | None = None
    bent: np.ndarray | None = None
    moved: np.ndarray | None = None
    joint: np.ndarray | None = None
    added: Added | None = None
    _norms: dict = field(default_factory=dict, init=False)

    @classmethod
    def joined(cls, blocks: Sequence[Block]) -> Block:
        """Return blocks one after another."""
        fields = ("t", "h", "c", "unresolved", "unresolved_variation")
        joined = cls(*(np.concatenate([getattr(block, name) for block in blocks]) for name in fields))
        shapes = {block.skipped.shape[1:] for block in blocks if block.skipped is not None}
        if shapes:
            none = np.zeros((1, *shapes.pop()))
            parts = [np.repeat(none, len(b.h), axis=0) if b.skipped is None else b.skipped for b in blocks]
            joined.skipped = np.concatenate(parts)
        return joined

    def norms(self, norm: Callable) -> np.ndarray:
        """Norms of the control points (S, d + 1), computed once for all estimators that share `norm`."""
        if norm not in self._norms:
            self._norms[norm] = norm(self.c)
        return self._norms[norm]

    def integral(self, norm: Callable) -> np.ndarray:
        """Upper bounds (S,) of int |R| over each segment: |R| <= sum_j B_j |c_j| and int B_j = h/(d + 1)."""
        return self.h * (self.norms(norm).mean(axis=1) + self.unresolved @ self.input_norms(norm))

    def variation(self, norm: Callable, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Upper bounds (S,) of the total variation of R inside each segment, and of the jump at its beginning.

        Inside: the length of the control polygon. before (k,): z at the end of the segment before this block.
        """
        inside = self.pieces(norm).sum(axis=1)
        steps = self.c[:, 0] - np.vstack([before, self.c[:-1, -1]])
        jumps = norm(steps) if steps.any() else np.zeros(len(self.h))
        return inside + self.unresolved_variation @ self.input_norms(norm), jumps

    def pieces(self, norm: Callable) -> np.ndarray:
        """Lengths (S, d) of the pieces of the control polygon."""
        return norm(self._polygon)

    @cached_property
    def _polygon(self) -> np.ndarray:
        return np.diff(self.c, axis=1)

    def input_norms(self, norm: Callable) -> np.ndarray:
        """Norms (p,) of the columns of B."""
        p = self.unresolved.shape[1]
        return norm(np.eye(self.c.shape[2])[self.c.shape[2] - p :])


@dataclass(frozen=True)
class Bounds:
    """Bounds at S instants: position (S,) and velocity (S,) in the M-norm, outputs (S, R).

    jumped : (S, R), the share of load jumps in outputs; None: no jumps so far. correction : (S, R), the part of the
    outputs' error that is known with its sign; correction_bound : (S, R), what is left of the error then. None where
    an estimator has none, or nobody asks (of_outputs).
    """

    position: np.ndarray | None
    velocity: np.ndarray | None
    outputs: np.ndarray
    jumped: np.ndarray | None = None
    correction: np.ndarray | None = None
    correction_bound: np.ndarray | None = None

    def at(self, index: np.ndarray | slice) -> Bounds:
        """Return the bounds at some of the instants."""
        return Bounds(*(None if x is None else x[index] for x in self.arrays()))

    def widened(self, position: np.ndarray, velocity: np.ndarray, outputs: np.ndarray) -> Bounds:
        """Return the bounds with something added at every instant."""
        left = None if self.correction_bound is None else self.correction_bound + outputs
        return replace(
            self,
            position=self.position + position,
            velocity=self.velocity + velocity,
            outputs=self.outputs + outputs,
            correction_bound=left,
        )

    def of_rows(self, part: slice) -> Bounds:
        """Return the bounds of some of the output rows."""
        rows = (None if x is None else x[:, part] for x in self.arrays()[2:])
        return Bounds(self.position, self.velocity, *rows)

    def arrays(self) -> tuple:
        """Return the fields in their order."""
        return (self.position, self.velocity, self.outputs, self.jumped, self.correction, self.correction_bound)

    def of_outputs(self) -> Bounds:
        """Return the bounds of the outputs alone."""
        return Bounds(None, None, self.outputs)


def times(bound: np.ndarray, constants: np.ndarray) -> np.ndarray:
    """Return bound (S,) times constants (R,) as (S, R); an output that sees nothing has bound 0, also of inf."""
    seen = constants > 0
    product = np.zeros((len(bound), len(constants)))
    product[:, seen] = np.outer(bound, constants[seen])
    return product


@dataclass(frozen=True)
class InitialError:
    """Norms of the initial error: |e0|_M, |e0|_K, |e0'|_M."""

    e_M: float = 0.0
    e_K: float = 0.0
    v_M: float = 0.0

    @property
    def energy(self) -> float:
        """sqrt(|e0'|_M^2 + |e0|_K^2): bounds |e'|_M of the free motion under any dissipative damping."""
        return float(np.hypot(self.e_K, self.v_M))

    @classmethod
    def of(cls, start: Start, norms: StartNorms | None) -> InitialError:
        """Evaluate the norms at the start; zero if the run starts in the span of V."""
        if start.y0 is None:
            return cls()
        return cls(float(norms.static(start.y0)), float(norms.K(start.y0)), float(norms.M(start.y0_t)))


class MassNormEstimator:
    """Shared part of the estimators that bound |e|_M by the integral of |R|_{M^-1} (paper, section 4)."""

    name: str

    def __init__(self, problem: Problem):
        self.norm = problem.norm_M
        self.C2 = problem.C2
        self.velocity_rows = problem.velocity_rows
        self._start_norms = problem.start_norms
        self.integral = 0.0
        self.t0 = 0.0
        self.initial = InitialError()

    def start(self, start: Start) -> Bounds:
        """Begin a run; return the bounds at its first instant."""
        self.t0, self.integral = start.t, 0.0
        self.initial = InitialError.of(start, self._start_norms)
        return self._bounds(np.array([start.t]), np.zeros(1), None)

    def advance(self, block: Block) -> Bounds:
        """Go on by one block; return the bounds at the ends of its segments."""
        total = self.integral + np.cumsum(block.integral(self.norm))
        self.integral = float(total[-1])
        return self._bounds(block.t, total, block)

    def _bounds(self, t: np.ndarray, integral: np.ndarray, block: Block | None) -> Bounds:
        position, velocity = self._state_bounds(t - self.t0, integral, block)
        self._position = position
        outputs = np.where(self.velocity_rows, times(velocity, self.C2), times(position, self.C2))
        return Bounds(position, velocity, outputs)

    def instant(self, i: int) -> tuple:
        """Return what bounds displacements at entry i of the bounds returned last."""
        return (self._position[i],)

    def outputs_at(self, instant: tuple) -> np.ndarray:
        """Return the bounds (R,) of displacement outputs at an instant of an estimator with other outputs."""
        return times(np.array(instant), self.C2)[0]

    def _state_bounds(self, t, integral, block) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of |e|_M and |e'|_M after times t (S,) from the start, with int |R| up to there."""
        raise NotImplementedError
