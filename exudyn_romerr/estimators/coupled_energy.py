"""Estimator "energy" of a mechanism: all its bodies together, the feedback of joints included (theory.md 7)."""

from __future__ import annotations

from dataclasses import replace
from math import hypot
from typing import TYPE_CHECKING

import numpy as np

from ..decay.decay_rates import body_rates, damping_in_steps, stiffness_damping
from ..linalg.blocked_products import row_norms, rows_times
from ..residual.free_mass import AtStart, free_velocity_norms
from ..residual.interface_stiffening import interface_rows
from ..residual.slow_modes import SlowModesOf
from ..trajectory.bounds import Bounds, times
from ..trajectory.segments import Added, Block, Start
from .energy import cut_size

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..residual.problem import Problem

# of what auxiliary vectors add, where what linear equations leave out is not measured; it was up to 0.007 right after
# a static solve, up to 0.002 else, and more where springs are short beside the motion
LINEARISED = 0.01


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
        self.at_start = AtStart(problem)
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
        known = (start.z, self.g, self.rough, start.cut)  # without an initial error e and e' are zero, whatever R is
        z, g, rough, cut = (0 * x for x in known) if start.y0 is None else known
        return self._bounds(z[None], *np.array([[g], [rough], [cut]]), np.zeros((1, 2)))

    def advance(self, block: Block) -> Bounds:
        """Go on by one block; return the bounds at the ends of its segments."""
        g, rough, self._peak, *own = joint_growth([self], [block]) if block.joint is None else block.joint
        self.g, self.rough = (float(x[-1]) for x in own or (g, rough))
        more = np.zeros((len(g), 2)) if block.overshoot is None else block.overshoot
        return self._bounds(block.c[:, -1], g, rough, cut_size(block), more)

    def instant(self, i: int) -> tuple:
        """Return what bounds the outputs at entry i of the bounds returned last."""
        given, self._given = self._given, None
        return tuple(x[i : i + 1].copy() for x in given)

    def bounds_at(self, instant: tuple) -> Bounds:
        """Return the bounds (1, R) at an instant of an estimator with other outputs."""
        return self._bounds(*instant)

    def _bounds(self, z: np.ndarray, g: np.ndarray, rough: np.ndarray, cut: np.ndarray, more: np.ndarray) -> Bounds:
        self._given = z, g, rough, cut, more
        known, speed, jumped = -(z @ self.static_rows.T), np.minimum(g, rough), None
        slack = np.where(self.velocity_rows, times(speed, self.factors), times(g, self.factors))
        slack = slack + times(cut, self.static_cut)
        if more.any():
            moved, moved_t = (times(x, self.at_start.factors) for x in more.T)
            jumped = np.where(self.velocity_rows, moved_t, moved)
            slack += jumped
        position = self.norm_static(z) + (cut + g) * self.per_mass + more[:, 0]
        return Bounds(position, speed + more[:, 1], np.abs(known) + slack, jumped, known, slack)


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
        z, g, _, cut, _ = self._given
        w = self._added.veer.w if self._added.veer else 0 * g
        missed, less = cut + super().missed(block), times(g, self.factors) + times(cut, self.static_cut)
        less -= np.minimum(self.slow.advance((block.h, z, w), self.impulses(block), missed, (self._peak, g)), less)
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

    def _bounds(self, z: np.ndarray, g: np.ndarray, rough: np.ndarray, cut: np.ndarray, more: np.ndarray) -> Bounds:
        rest, added = super()._bounds(z, g, rough, cut, more), self._added
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


def joint_growth(energies: Sequence[MechanismEnergy], blocks: Sequence[Block]) -> tuple[np.ndarray, ...]:
    """Return g and rough at the ends of the next segments, and the largest g in these, (S,) of all bodies together.

    R is linear in a segment; of bodies without damping it varies in both.
    """
    varied = [energy.variations(block) for energy, block in zip(energies, blocks, strict=True)]
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
