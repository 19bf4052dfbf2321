"""Estimator "energy" of a mechanism: all its bodies together, the feedback of joints included (theory.md 7)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot
from typing import TYPE_CHECKING

import numpy as np

from ..decay.decay_rates import body_rates, damping_in_steps, stiffness_damping
from ..decay.passive_steps import OF_MODES, PassiveSteps
from ..linalg.blocked_products import row_norms, rows_times
from ..residual.free_mass import AtStart, free_velocity_norms
from ..residual.interface_stiffening import interface_rows
from ..residual.slow_modes import SlowModesOf
from ..trajectory.bounds import Bounds, times
from ..trajectory.estimate import LINEARISED
from ..trajectory.segments import Added, Block, Start
from .energy import cut_size

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..residual.problem import Problem


EXACT = PassiveSteps(0.0)  # exact motion, which keeps its energy as the trapezoidal rule does


@dataclass
class JointEnergy:
    """Energies of all bodies of a mechanism together at the ends of segments, (S,) each; see passive_steps.py.

    stored, beside : |e + K^-1 R|_K <= c stored + beside, c of `steps` with the size h, of which all were if `even`.
    speed : |e'|_M <= c speed. peak : the largest |e + K^-1 R|_K in segments. onward : g and rough that go on.
    apart : whether damping leaves modes of the mechanism apart. started : what is stored of accelerations that the
    run started with, to be added; overshoot (S, 2) : in its place what these add to |e|_M and |e'|_M.
    """

    stored: np.ndarray
    beside: np.ndarray
    speed: np.ndarray
    peak: np.ndarray
    onward: tuple[float, float] = (0.0, 0.0)
    started: np.ndarray | None = None
    overshoot: np.ndarray | None = None
    steps: PassiveSteps = EXACT
    h: float = 0.0
    even: bool = True
    apart: bool = False

    @classmethod
    def of_exact_motion(cls, g: np.ndarray, rough: np.ndarray, peak: np.ndarray) -> JointEnergy:
        """Return it as it is without steps."""
        return cls(g, 0.0 * g, np.minimum(g, rough), peak, (float(g[-1]), float(rough[-1])))

    def at(self, i: int) -> JointEnergy:
        """Return what it is at one end (1,)."""
        names = "stored", "beside", "speed", "peak", "started", "overshoot"
        arrays = {name: getattr(self, name) for name in names}
        return replace(self, **{name: x[i : i + 1].copy() for name, x in arrays.items() if x is not None})

    @property
    def norms(self) -> tuple[float, float]:
        """Factors c of |e + K^-1 R|_K and |e'|_M."""
        if not self.even:
            return self.steps.norms
        return tuple(map(min, self.steps.from_rest, OF_MODES)) if self.apart else self.steps.from_rest

    @property
    def level(self) -> np.ndarray:
        """Bound (S,) of |e + K^-1 R|_K, and of |e'|_M, without what the start adds."""
        return self.norms[0] * self.stored + self.beside


class MechanismEnergy:
    """|e + K^-1 R|_K <= g and |e'|_M <= g, sums over all bodies b of the mechanism, however they are joined.

        g = (sum_b |R_b(0)|^2)^(1/2) + total variation of (sum_b |R_b|^2)^(1/2),   |.| in the K_b^-1 norm

    K_b^-1 on the free body is K^-1 where the reference conditions hold it and the first wrench balances it. Rigid
    motion has no energy: outputs are those seen from the body's frame. No decay rate is admissible, for rigid
    motion is undamped. Where bodies have damping D >= beta K, rough residuals do less work than they vary:

        |e|_K, |e'|_M <= rough ,   rough^2 = int sum_b |R_b|^2/(2 beta_b) dt ,   g <= rough + (sum_b |R_b|^2)^(1/2)

    and g is the smaller one at every step, from whichever was smaller before.
    """

    name = "energy"
    assumes = "ideal joints, dissipative springs and dampers, the mechanism linearised about its motion"
    inside = None

    def __init__(self, problem: Problem, unknown: int = 0):
        self.start_norms = problem.dual.start_norms
        self._interfaces = interface_rows(problem, unknown) if problem.has_initial_error else None
        self.norm, self.norm_static = problem.dual.norm_K, problem.dual.norm_static
        self.static_rows, self.velocity_rows = problem.rows.static_rows, problem.rows.velocity_rows
        self.factors = problem.rows.C_K.copy()
        if self.velocity_rows.any():
            self.factors[self.velocity_rows] = free_velocity_norms(problem.body, problem.rows.C[self.velocity_rows])
        self.static_cut = np.where(self.velocity_rows, 0.0, problem.rows.C_K)
        self.per_mass = body_rates(problem.body)[0].per_mass
        self.at_start = AtStart(problem, unknown)
        self.beta = stiffness_damping(problem.body)
        self.g = self.rough = 0.0

    def energies_at(self, start: Start) -> tuple[float, float]:
        """Return what g and `rough` of this body begin with.

        g : |R(0)|, or the energy of d0 = e0 + K^-1 R(0) and e0' if there is an initial error. In static equilibrium
        -e0 is K^-1 R(0) as far as joints let it: what moves interfaces is counted whole. rough : the energy of e0 and
        e0' and of what is cut; g without damping.
        """
        size = float(self.norm(start.z))
        if start.y0 is None:
            return size + start.cut, start.cut if self.beta else size + start.cut
        w = start.y0.copy()
        w[: len(start.z)] += start.z
        held = np.linalg.norm(self._interfaces @ start.z)
        g = float(np.hypot(self.start_norms.K(w), self.start_norms.M(start.y0_t)) + held)
        return g, g + size * (self.beta > 0)

    def variations(self, block: Block) -> np.ndarray:
        """Return what R of this body varies by (S, d + 1): the pieces of its polygon, and what that does not hold."""
        return np.column_stack([block.pieces(self.norm), self.missed(block)])

    def missed(self, block: Block) -> np.ndarray:
        """Return what the polygon of R does not hold (S,) of its variation."""
        missed = block.of_inputs(self.norm, block.unresolved_variation)
        missed = missed if block.cut is None else missed + block.cut.variation
        return missed if block.turn is None else missed + block.h * block.turn.missed

    def roughness(self, block: Block) -> tuple[np.ndarray, np.ndarray]:
        """Return int |R|^2/(2 beta) over segments (S,), R linear in each, and |R| where they begin and end (S, 2)."""
        ends = block.norms(self.norm)[:, [0, -1]]
        if not self.beta:
            return np.zeros(len(ends)), 0 * ends
        middle = self.norm((block.c[:, 0] + block.c[:, -1]) / 2)
        return block.h * ((ends**2).sum(axis=1) + 4 * middle**2) / (12 * damping_in_steps(self.beta, block.h)), ends

    def start(self, start: Start) -> Bounds:
        """Begin a run; return the bounds at its first instant."""
        self.g, self.rough = start.joint or self.energies_at(start)
        # without an initial error e and e' are zero, whatever R is
        known = start.z, np.array([self.g]), np.array([self.rough]), np.array([start.cut])
        z, g, rough, cut = (0 * x for x in known) if start.y0 is None else known
        return self._bounds(z[None], JointEnergy.of_exact_motion(g, rough, g), cut)

    def advance(self, block: Block) -> Bounds:
        """Go on by one block; return the bounds at the ends of its segments."""
        joint = block.joint or JointEnergy.of_exact_motion(*joint_growth([self], [block]))
        self.g, self.rough = joint.onward
        return self._bounds(block.c[:, -1], joint, cut_size(block))

    def instant(self, i: int) -> tuple:
        """Return what bounds the outputs at entry i of the bounds returned last."""
        given, self._given = self._given, None
        z, joint, cut = given
        return z[i : i + 1].copy(), joint.at(i), cut[i : i + 1].copy()

    def bounds_at(self, instant: tuple) -> Bounds:
        """Return the bounds (1, R) at an instant of an estimator with other outputs."""
        return self._bounds(*instant)

    def _bounds(self, z: np.ndarray, joint: JointEnergy, cut: np.ndarray) -> Bounds:
        self._given, known = (z, joint, cut), -(z @ self.static_rows.T)
        slack, jumped = self._slack(joint, cut), self._started(joint)
        level, speed = joint.level + cut, joint.norms[1] * joint.speed
        position, velocity = self.norm_static(z) + level * self.per_mass, speed
        if jumped is not None:
            slack += jumped
            overshoot, started = joint.overshoot, joint.started
            position += overshoot[:, 0] if started is None else joint.steps.norms[0] * started * self.per_mass
            velocity = speed + (overshoot[:, 1] if started is None else joint.steps.norms[1] * started)
        return Bounds(position, velocity, np.abs(known) + slack, jumped, known, slack)

    def _slack(self, joint: JointEnergy, cut: np.ndarray) -> np.ndarray:
        """Bounds (S, R) of rows beside what is known, without what the start adds."""
        places, rates = (np.minimum(c, most) for c, most in zip(self._of_rows(joint), joint.norms, strict=True))
        still = times(joint.stored, places * self.factors) + times(joint.beside, self.factors)
        # the speed has what is beside in it
        moving = times(joint.speed, rates * self.factors)
        return np.where(self.velocity_rows, moving, still) + times(cut, self.static_cut)

    def _started(self, joint: JointEnergy) -> np.ndarray | None:
        """What the start adds to rows (S, R); None: nothing."""
        if joint.started is not None:
            places, rates = self._of_rows(joint)
            return times(joint.started, np.where(self.velocity_rows, rates, places) * self.factors)
        if joint.overshoot is None or not joint.overshoot.any():
            return None
        moved, moved_t = (times(x, self.at_start.factors) for x in joint.overshoot.T)
        return np.where(self.velocity_rows, moved_t, moved)

    def _of_rows(self, joint: JointEnergy) -> tuple[np.ndarray, np.ndarray]:
        """Factors c of every row, as a displacement and as a velocity, (R,) each."""
        if not joint.steps.kappa:
            return np.ones((2, len(self.factors)))
        means = self.at_start.means
        return joint.steps.displacement(joint.h, means), joint.steps.velocity(joint.h, means)


class CorrectedEnergy(MechanismEnergy):
    """Bounds by way of the trajectory u + du that auxiliary vectors add up to: du is known, the rest is bounded.

        |C e| <= |C du - C K^-1 R| + |C|_{K^-1} g ,   R and g of u + du

    du solves linearised equations, whose matrices are interpolated between tangents. What that misses of du is in no
    residual of a body. Inertia forces of second order in du, of which a body's own R holds only what its wrenches
    balance, go into g as the force that they are: |F|_{M^-1} of every step. For the rest the largest so far is added
    of what was measured (estimates/remainder.py); of LINEARISED du, where nothing was.
    """

    name = "auxiliary"

    def __init__(self, problem: Problem, unknown: int = 0):
        super().__init__(problem, unknown)
        self.value_rows, body, x = problem.rows.C @ problem.V, problem.body, problem.body.positions.ravel()
        self.root = np.linalg.qr(body.mass_factor.half_multiply(problem.V), mode="r")
        self.arm, self.mass = float(np.sqrt(x @ (body.mass @ x))), body.total_mass
        self._force, self.slow = 0.0, None  # of second order, at the end of the last block; SlowModes, where known
        self.slow_modes = SlowModesOf(problem)
        # so far of du, and of what it may lack: every output, and its mass norm
        self._largest = np.zeros((2, len(self.value_rows) + 1))

    def start(self, start: Start) -> Bounds:
        """Begin a run; return the bounds at its first instant."""
        self._added, self._force = start.added or self._nothing(1), 0.0
        return super().start(start)

    def advance(self, block: Block) -> Bounds:
        """Go on by one block; return the bounds at the ends of its segments."""
        self._added = block.added or self._nothing(len(block.h))
        found = super().advance(block)
        found = found if self.slow is None else self._with_slow_modes(found, block)
        self._force = float(self._unbalanced(block)[-1])
        return found

    def _with_slow_modes(self, found: Bounds, block: Block) -> Bounds:
        z, joint, cut = self._given
        w = self._added.veer.w if self._added.veer else 0 * cut
        missed, less, energy = cut + super().missed(block), self._slack(joint, cut), (joint.peak, joint.level)
        less -= np.minimum(self.slow.advance((block.h, z, w), self.impulses(block), missed, energy), less)
        return replace(found, outputs=found.outputs - less, correction_bound=found.correction_bound - less)

    def missed(self, block: Block) -> np.ndarray:
        """Return the same (S,), with the impulses that the linearised equations lack."""
        return super().missed(block) + self.impulses(block)

    def impulses(self, block: Block) -> np.ndarray:
        """Integrals (S,) of forces of second order over the segments of the next block, |.|_{M^-1}."""
        force = self._unbalanced(block)
        return block.h * np.maximum(force, np.append(self._force, force[:-1]))

    def _unbalanced(self, block: Block) -> np.ndarray:
        """Inertia forces (S,) of second order in du at the ends of the segments, |.|_{M^-1}."""
        if block.added is None or block.added.veer is None:
            return np.zeros(len(block.h))
        du, du_t = (row_norms(rows_times(x, self.root.T)) for x in (block.added.q, block.added.q_t))
        bound, known = block.added.veer.unbalanced(du, du_t, self.arm, self.mass), block.added.beside
        return bound if known is None else np.where(np.isnan(known), bound, known)

    def _nothing(self, count: int) -> Added:
        return Added(*np.zeros((2, count, self.value_rows.shape[1])), np.zeros(count))

    def instant(self, i: int) -> tuple:
        """Return what bounds the outputs at entry i of the bounds returned last."""
        added, self._added = self._added, None
        left = added.left and [tuple(x[i : i + 1].copy() for x in states) for states in added.left]
        return super().instant(i), Added(*(x[i : i + 1].copy() for x in added[:3]), left=left)

    def bounds_at(self, instant: tuple) -> Bounds:
        """Return the bounds (1, R) at an instant of an estimator with other outputs."""
        rest, self._added = instant
        return super().bounds_at(rest)

    def _bounds(self, z: np.ndarray, joint: JointEnergy, cut: np.ndarray) -> Bounds:
        rest, added = super()._bounds(z, joint, cut), self._added
        rows, size = self._seen(added.q, added.q_t)
        known = rest.correction + rows
        du = np.abs(np.column_stack([known, size]))
        lacks = sum((np.abs(np.column_stack(self._seen(*states))) for states in added.left or ()), 0.0 * du)
        largest = np.maximum.accumulate(np.vstack([self._largest[None], np.stack([du, lacks], axis=1)]))[1:]
        self._largest, (du, left) = largest[-1], largest.swapaxes(0, 1)
        left = left if added.left is not None else np.maximum(left, LINEARISED * du)
        slack = rest.correction_bound + left[:, :-1]
        position = rest.position + size + left[:, -1]
        return Bounds(position, rest.velocity + added.speed, np.abs(known) + slack, rest.jumped, known, slack)

    def _seen(self, q: np.ndarray, q_t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Outputs (S, R) of modes and vectors, and their mass norm (S,)."""
        rows, sizes = self.value_rows.T, row_norms(rows_times(q, self.root.T))
        return np.where(self.velocity_rows, rows_times(q_t, rows), rows_times(q, rows)), sizes


def joint_growth(
    energies: Sequence[MechanismEnergy], blocks: Sequence[Block], impulse: float = 1.0
) -> tuple[np.ndarray, ...]:
    """Return g and rough at the ends of the next segments, and the largest g in these, (S,) of all bodies together.

    R is linear in a segment; of bodies without damping it varies in both. impulse : of PassiveSteps.
    """
    varied = [energy.variations(block) for energy, block in zip(energies, blocks, strict=True)]
    for x in varied:
        x[:, -1] *= impulse
    known = [energy.roughness(block) for energy, block in zip(energies, blocks, strict=True)]
    others = [x[:, -1:] if energy.beta else x for x, energy in zip(varied, energies, strict=True)]
    work, R = sum(x for x, _ in known), np.sqrt(sum(ends**2 for _, ends in known))
    g, rough, peaks = [energies[0].g], [energies[0].rough], []  # not a list a step: many set off garbage collection
    steps = (x.tolist() for x in (_joint(varied), work, _joint(others), R[:, 1], R.max(axis=1)))
    for more, W, rest, last, largest in zip(*steps, strict=True):
        one, other = g[-1] + more, hypot(rough[-1], W**0.5) + rest
        g.append(min(one, other + last))  # either may go on from the other
        rough.append(min(other, one + last))
        peaks.append(min(one, other + largest))
    return tuple(map(np.array, (g[1:], rough[1:], peaks)))


def _joint(columns: list[np.ndarray]) -> np.ndarray:
    """Variation (S,) of the bodies together from their variations (S, d): |.| of all is the root of the squares."""
    square = np.zeros((len(columns[0]), max(x.shape[1] for x in columns)))
    for x in columns:
        square[:, square.shape[1] - x.shape[1] :] += x**2
    return np.sqrt(square).sum(axis=1)
