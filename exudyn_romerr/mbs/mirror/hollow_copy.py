"""The hollow copy of an mbs, which is asked for everything that is no floating body in closed form.

Joints, springs, user functions, rigid bodies, loads, whatever a script has: their residual at rows, their tangents by
differences of it. The mbs of the run is read once and never moved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import exudyn as exu
import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from ...basis.shape_sums import ShapeSums
from ...errors import AssumptionError
from ...mechanism.rows import Rows
from ...mechanism.splined import Reading
from ...mechanism.unknowns import Unknowns
from ..access.copied_mbs import copy_items, object_terms
from ..access.detached import READS_SENSORS, Detached, functions_of
from ..access.equations import Equations, fill, state_in_place
from ..access.mbs_items import Items, node_coordinates
from ..access.solvers import threads
from .pre_step import PreStep
from .vectors import Enriched

UNSEEN = 1e-8  # of the largest: what differences leave of an unknown that nothing knows
STEP = 1e-5  # rad, and of a body's size: to differentiate by, both ways
FINE = 1e-3  # of the largest coordinates of first order, to differentiate by
KNOWN = 1e-12  # of the largest force: a change by rates that is less is rounding
DEPENDENT = 1e-8  # of the largest: what is below is a constraint that others imply, or none
ROUNDED = 1e2 * np.finfo(float).eps  # of the sizes of coordinates that constraints know: rounding of differences
# of what its row of G could come to: less is the length of Euler parameters, which unknowns keep
NO_CONSTRAINT = 1e-8


class HollowCopy:
    """Equations of an mbs without its floating bodies, in coordinates of the run, those of vectors behind them.

    Attributes
    ----------
    independent (c,) : numbers of constraints that no others imply. felt, seen : unknowns that forces act on, and that
    forces know, sampled : that a PreStep function knows. scales (n_a,) : finite motions that are alike; inertia : of
    the lightest body moved so. frames : nodes in whose axes readings are.
    """

    def __init__(
        self,
        mbs: Any,
        enriched: Sequence[Enriched],
        unknowns: Unknowns,
        detached: Detached,
        shows: bool = False,
        pre_step: PreStep | None = None,
    ):
        """Copy, with copies of user functions; shows: whether with all vectors, and the sensors.

        pre_step : acts before each step; None: nothing does.
        """
        self._unknowns, self._shows, self._pre_step = unknowns, shows, pre_step
        self.independent: np.ndarray | None = None
        self.frames = [node for node in unknowns.nodes if node.is_frame]
        self.seen = self.felt = self.sampled = np.arange(unknowns.n_a)
        self.scales = unknowns.steps(STEP)[: unknowns.n_a]
        self.inertia = min(one.body.mass for one in enriched) * (STEP * unknowns.largest_size) ** 2
        self._acting = np.zeros(unknowns.n_a)  # largest forces on unknowns that were met
        wider = {one.body.place.number: _massless(one.shapes if shows else one.kept_shapes) for one in enriched}
        self._container = exu.SystemContainer()
        self.mbs = self._container.AddSystem()
        copy_items(mbs, self.mbs, detached, wider, shows or READS_SENSORS in detached.names)
        for load in (number for one in enriched for number in one.weights):
            self.mbs.SetLoadParameter(load, "loadVectorUserFunction", 0)
            self.mbs.SetLoadParameter(load, "loadVector", [0.0, 0.0, 0.0])
        self._detached = detached
        self.mbs.Assemble()
        # in its unknowns each equation of first order has the mass of the lightest body
        masses = min(one.body.mass for one in enriched) / unknowns.units[unknowns.n_q - unknowns.n_1 :] ** 2
        self._equations = Equations(self.mbs, threads(mbs), masses)
        # to be asked for once: that takes twice as long as to set it
        self._state = state_in_place(self.mbs.systemData)
        self._state[4][:] = mbs.systemData.GetODE1Coordinates()  # a static solve holds them
        self.size, self._is_massless = self._equations.size, not self._equations.mass(self.mbs).any()
        self.own, self.extra = self._places(mbs, enriched)

    def _places(self, mbs: Any, enriched: Sequence[Enriched]) -> tuple[np.ndarray, np.ndarray]:
        """Where coordinates of the mbs, and vectors, are among those of the copy."""
        own, extra = np.zeros(self._unknowns.n_q, int), [np.zeros(0, int)]
        for number in range(mbs.systemData.NumberOfNodes()):
            mine = node_coordinates(mbs, number)
            own[mine] = node_coordinates(self.mbs, number)[: len(mine)]
        for one in enriched:
            node = int(mbs.GetObject(one.body.place.number)["nodeNumbers"][1])
            extra.append(node_coordinates(self.mbs, node)[one.body.n :])
        plain = len(self._state[0])
        own[mbs.systemData.ODE2Size() :] = np.arange(plain, self.size)
        return own, np.concatenate(extra)

    def wide(self, x: np.ndarray, vectors: np.ndarray | float = 0.0) -> np.ndarray:
        """Return coordinates (..., n_q) of the run, and of vectors, as the copy has them."""
        found = np.zeros((*x.shape[:-1], self.size))
        found[..., self.own], found[..., self.extra] = x, vectors
        return found

    def set(self, t: float, *state: np.ndarray) -> None:
        """Set q, v, a in coordinates of the copy, and multipliers where they are given."""
        self.mbs.systemData.SetTime(t)
        fill(self._state, *state)

    def _rates(self, v: np.ndarray) -> np.ndarray:
        """Rates (n_a,) to differentiate by around v (size,)."""
        rate = np.abs(v[: len(self._state[0])]).max() + self.scales.max()
        found = self.scales * rate / self.scales.max()
        found[self._unknowns.first_order] = FINE * self._unknowns.speed
        return found

    def with_first_rates(self, rows: Rows) -> Rows:
        """Return rows with the rates of coordinates of first order, which Exudyn leaves zero where a solve begins."""
        if not self._unknowns.n_1:
            return rows
        rates = rows.a.copy()
        tail = rates[:, -self._unknowns.n_1 :]
        at = np.flatnonzero(~tail.any(axis=1))
        part = rows[at]
        left, _ = self._unbalanced(part.t, [*map(self.wide, (part.q, part.v, part.a))], part.multipliers)
        tail[at] = -left[:, len(self._state[0]) :] / self._equations.masses
        return replace(rows, a=rates)

    def jacobians(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return J, J', J'' (3, T, size, n_a) in states (T, size)."""
        u, own = self._unknowns, self.own
        J = np.zeros((3, len(q), self.size, u.n_a))
        J[:, :, own] = u.jacobians(q[:, own], v[:, own], a[:, own])
        if not self._shows:
            J[0][:, self.extra, u.kept] = 1.0
        return J

    def _on_unknowns(self, X: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return forces X (T, r, size) in states q (T, size) on unknowns, (T, r, n_a), in axes of their bodies."""
        found = self._unknowns.by_unknowns(X[..., self.own], q[:, self.own])
        if not self._shows:
            found[..., self._unknowns.kept] = X[..., self.extra]
        return found

    def _forces(self, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """M a - f (size,), without forces of constraints."""
        self.set(t, q, v, a)
        inertia = 0.0 if self._is_massless else self._equations.mass(self.mbs) @ a
        return inertia - self._equations.forces(self.mbs)

    def residuals(
        self, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return M a - f (T, n_a), G^T (T, n_a, all), g (T, all) in states (T, size), in axes of their bodies."""
        T, count = len(q), len(self._state[3])  # T is 0 where forces know no unknown
        R, G, g = (np.zeros((T, *shape)) for shape in ((self.size,), (count, self.size), (count,)))
        is_constrained = self.independent is None or len(self.independent)  # by more than lengths of Euler parameters
        for i, state in enumerate(zip(q, v, a, strict=True)):
            R[i] = self._forces(t, *state)
            if is_constrained:
                G[i] = self._equations.constraints(self.mbs)
                g[i] = self._equations.drift(self.mbs)
        whole = self._on_unknowns(np.concatenate([R[:, None], G], axis=1), q)
        return whole[:, 0], whole[:, 1:].swapaxes(1, 2), g

    def begin_step(self, t: float, moved: float = 0.0) -> None:
        """Let the PreStep function set what holds at t along the run: by the state at the begin of that step.

        moved : of that state, times its largest coordinate and rate.
        """
        if self._pre_step is None:
            return
        if (row := self._pre_step.before(t)) is None:
            self._pre_step.set_back(self.mbs)
        else:
            state = (x * (1 + moved) + moved * np.abs(x).max(initial=0.0) for x in row[1:4])
            self._act(t, [*map(self.wide, state)], row[4])

    def _act(self, t: float, state: Sequence[np.ndarray], multipliers: np.ndarray) -> None:
        """Let the PreStep function set what holds in a step to t that begins in a state."""
        if self._pre_step is not None:
            self.set(t, *state, multipliers)
            self._pre_step(self.mbs, t)

    def _balance(self, t: float, state: Sequence[np.ndarray], multipliers: np.ndarray) -> np.ndarray:
        """Return -(M a - f + G^T lam) (size,), then g (all,), in a state, with parameters as they are."""
        self.set(t, *state, -multipliers)
        found = self._equations.static_balance(self.mbs)
        if not self._is_massless:
            found[: self.size] -= self._equations.mass(self.mbs) @ state[2]
        return found

    def _unbalanced(
        self, t: np.ndarray, states: Sequence[np.ndarray], multipliers: np.ndarray, at_once: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return M a - f + G^T lam (T, size) and g (T, all) in states (T, size).

        at_once : whether the PreStep function sees these states, and not those at the begins of steps.
        """
        found = []
        for now, *state, lam in zip(t, *states, multipliers, strict=True):
            if at_once:
                self._act(now, state, lam)
            else:
                self.begin_step(now)
            found.append(self._balance(now, state, lam))
        forces, g = np.split(np.array(found), [self.size], axis=1)
        return -forces, g

    def unbalanced(self, rows: Rows) -> np.ndarray:
        """Return M a - f + G^T lam (T, n_a) at rows of the run, in axes of bodies."""
        states = [self.wide(x) for x in (rows.q, rows.v, rows.a)]
        forces, _ = self._unbalanced(rows.t, states, rows.multipliers)
        return self._on_unknowns(forces[:, None], states[0])[:, 0]

    def moved_forces(
        self, t: np.ndarray, states: Sequence[np.ndarray], kept: np.ndarray, lam: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return M a - f + G^T lam (T, n_a) in axes of bodies, g (T, all); kept (T, 3, kept) : beside q, v, a."""
        wide = [self.wide(x, y) for x, y in zip(states, np.moveaxis(kept, 1, 0), strict=True)]
        forces, g = self._unbalanced(t, wide, lam, at_once=True)
        return self._on_unknowns(forces[:, None], wide[0])[:, 0], g

    @cached_property
    def _loads(self) -> list[tuple[Callable, Any]]:
        """User functions of loads that may know more than the time, and the loads that these are given."""
        loads = [(f, load) for load in Items(self.mbs).loads for f in functions_of(load)]
        given = [(f, load.get("loadVector", load.get("load"))) for f, load in loads]
        return [one for one in given if self._detached.may_know_motion(*one)]

    @property
    def loads_know_motion(self) -> bool:
        """Whether user functions of loads may know more than the time."""
        return bool(self._loads)

    def loads(self, t: np.ndarray, states: Sequence[np.ndarray], kept: np.ndarray) -> np.ndarray:
        """Return what user functions of loads give that may know more than the time, (T, .); kept : as above."""
        found = []
        for now, *state in zip(t, *map(self.wide, states, np.moveaxis(kept, 1, 0)), strict=True):
            self.set(now, *state)
            found.append(np.concatenate([np.ravel(f(self.mbs, now, given)) for f, given in self._loads]))
        return np.array(found)

    def along(self, states: Rows) -> tuple[np.ndarray, np.ndarray]:
        """Return M a - f + G^T lam (T, n_q) and g (T, all) in states of the run, in coordinates of the mbs."""
        wide = [self.wide(x) for x in (states.q, states.v, states.a)]
        forces, g = self._unbalanced(states.t, wide, states.multipliers, at_once=True)
        return forces[:, self.own], g

    def delay(self, rows: Rows) -> np.ndarray:
        """Return forces (T, n_q) that a feedback of the same instant has beside that of the step's begin."""
        if self._pre_step is None:
            return np.zeros(rows.q.shape)
        given = rows.t, [self.wide(x) for x in (rows.q, rows.v, rows.a)], rows.multipliers
        late, at_once = (self._unbalanced(*given, at_once=now)[0][:, self.own] for now in (False, True))
        return late - at_once

    def read(self, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray, lam: np.ndarray) -> Reading:
        """Return the tangent at a row of the run by central differences along unknowns that forces know."""
        state = [self.wide(x) for x in (q, v, a)]
        self.begin_step(t)
        J, n, use = self.jacobians(*(x[None] for x in state))[:, 0], self._unknowns.n_a, self.seen
        h = np.concatenate([self.scales[use], -self.scales[use]])
        states = [x + h[:, None] * part[:, [*use, *use]].T for x, part in zip(state, J, strict=True)]
        R, G_t, g = self.residuals(t, *states)
        most = (x.max(axis=0, initial=0.0) for x in (np.abs(R), np.abs(G_t) @ np.abs(lam)))
        self._acting = np.maximum(self._acting, sum(most))
        found = [x.reshape(2, len(use), *x.shape[1:]) for x in (R, G_t, g)]
        of_R, of_G, of_g = (((x[0] - x[1]).T / (2 * self.scales[use])).T for x in found)
        K, C = np.zeros((n, n)), np.zeros((n, of_g.shape[1]))
        K[use], C[use] = of_R, of_g
        j, i, number = np.nonzero(of_G)
        H = sp.csr_matrix((of_G[j, i, number], (i * n + use[j], number)), shape=(n * n, of_G.shape[2]))
        D = self._damping(t, state, J)
        self.set(t, *state)
        M = J[0].T @ self._equations.mass(self.mbs) @ J[0]
        whole = self._equations.constraints(self.mbs)
        if self.independent is None:
            self.independent = self._independent(C.T, whole, J[0])
        late = () if self._pre_step is None else self._feedback(t, state, lam, J[0])
        of_constraints = whole[self.independent] @ J[0], C.T[self.independent]
        return Reading.of(M, D, K.T, *of_constraints, H, sampled=late)

    def _feedback(
        self, t: float, state: Sequence[np.ndarray], lam: np.ndarray, J_end: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (n_a, n_a) of forces in a state by coordinates and rates at the begin of its step.

        In axes of bodies at the end of the step, both. Zero where the PreStep function does not know them.
        """
        u, S = self._unknowns, np.zeros((2, self._unknowns.n_a, self._unknowns.n_a))
        begin = self._pre_step.before(t)
        *start, forces = [*state, lam] if begin is None else [*map(self.wide, begin[1:4]), begin[4]]
        axes = u.in_body_axes(u.in_global_axes(np.eye(u.n_a), state[0][self.own]), start[0][self.own])
        J, J1 = self.jacobians(*(x[None] for x in start))[:2, 0] @ axes.T
        by_rates, weights = self._rates(start[1]), np.random.default_rng(2).uniform(0.5, 1.0, u.n_a)

        def effect(dq: Any = 0.0, dv: Any = 0.0, da: Any = 0.0, more: float = 0.0) -> np.ndarray:
            """Forces (n_a,), and constraints (all,)."""
            self._act(t, [x + dx for x, dx in zip(start, (dq, dv, da), strict=True)], forces + more)
            found = self._balance(t, state, lam)
            return np.concatenate([-J_end.T @ found[: self.size], found[self.size :]])

        here = effect()
        if np.any(effect(da=J @ (by_rates * weights), more=1.0) != here):
            raise AssumptionError("the PreStep function reads accelerations or forces")
        along = (J * self.scales, J1 * self.scales), (0.0 * J, J * by_rates)
        for order, (moves, h) in enumerate(zip(along, (self.scales, by_rates), strict=True)):
            moved = effect(*(x @ weights for x in moves))
            if np.any(moved[u.n_a :] != here[u.n_a :]):
                raise AssumptionError("the PreStep function moves joints by what it sees of the motion")
            for j in self.sampled if np.any(moved != here) else ():
                two = (effect(*(sign * x[:, j] for x in moves))[: u.n_a] for sign in (1, -1))
                S[order][:, j] = np.subtract(*two) / (2 * h[j])
        return tuple(S)

    def note_dependence(self, readings: Sequence[Reading]) -> None:
        """Note which unknowns forces act on (felt), and which they know (seen); others are not moved any more."""
        both = self.scales * self.scales[:, None]
        rows, columns = np.zeros((2, self._unknowns.n_a))
        for one in readings:
            of_H = abs(one.H).max(axis=1).toarray() if one.H.shape[1] else np.zeros(both.size)
            for x in (one.K.toarray(), one.D.toarray(), of_H.reshape(both.shape)):
                x = np.abs(x) * both
                if largest := x.max(initial=0.0):
                    rows = np.maximum(rows, x.max(axis=1) / largest)
                    columns = np.maximum(columns, x.max(axis=0) / largest)
            x = (np.abs(one.C.toarray()) * self.scales).max(axis=0, initial=0.0)
            if largest := x.max(initial=0.0):
                columns = np.maximum(columns, x / largest)
        acting = self._acting * self.scales
        rows = np.maximum(rows, acting / acting.max() if acting.any() else 0.0)
        self.felt, self.seen = (np.flatnonzero(x > UNSEEN) for x in (rows, columns))
        sampled = [x for one in readings for x in one.sampled]
        if any(x.nnz for x in sampled):
            self.sampled = np.unique(np.concatenate([x.indices for x in sampled]))

    def _damping(self, t: float, state: list[np.ndarray], J: np.ndarray) -> np.ndarray:
        """Derivative by rates; zero where forces do not know them, which is tried along one of them all."""
        rng, (q, v, a) = np.random.default_rng(1), state
        R, h = J[0].T @ self._forces(t, q, v, a), self._rates(v)
        e = rng.uniform(0.5, 1.0, J.shape[2]) * h
        moved = J[0].T @ self._forces(t, q, v + J[0] @ e, a + 2 * J[1] @ e)
        D = np.zeros((len(R), len(R)))
        if np.abs(moved - R).max() <= KNOWN * np.abs(R).max():
            return D
        for j in self.seen:
            two = [self._forces(t, q, v + s * J[0][:, j], a + 2 * s * J[1][:, j]) for s in (h[j], -h[j])]
            D[:, j] = J[0].T @ (two[0] - two[1]) / (2 * h[j])
        return D

    def _independent(self, C: np.ndarray, whole: np.ndarray, J: np.ndarray) -> np.ndarray:
        """Numbers of constraints that act on unknowns and that no others imply.

        C (all, n_a), whole : G (all, size), J (size, n_a): what a row of G could come to with any signs is what tells
        rounding from a constraint, for there may be none but the lengths of Euler parameters, which unknowns keep.
        """
        scaled = C * self.scales
        size, able = np.linalg.norm(scaled, axis=1), np.linalg.norm(np.abs(whole) @ np.abs(J * self.scales), axis=1)
        where = exu.ConfigurationType.Current, exu.ConfigurationType.Reference
        coordinates = sum(np.abs(self.mbs.systemData.GetODE2Coordinates(one)) for one in where)
        rounded = np.abs(whole[:, : len(coordinates)]) @ coordinates
        rows = np.flatnonzero(size > np.maximum(NO_CONSTRAINT * able, ROUNDED * rounded))
        if not len(rows):
            return rows
        triangle, order = la.qr((scaled[rows] / size[rows, None]).T, mode="r", pivoting=True)
        values = np.abs(np.diag(triangle[: len(rows), : len(rows)]))
        return np.sort(rows[order[: int(np.sum(values > DEPENDENT * values[0]))]])


def _massless(shapes: np.ndarray) -> dict[str, Any]:
    """What a body's object has of shapes (N, k) that have neither mass nor stiffness."""
    k = shapes.shape[1]
    sums = np.zeros((3, 3, k, k)), np.zeros((3, 3, k)), np.zeros((3, k)), np.zeros((k, k)), np.zeros((k, k))
    return object_terms(shapes, ShapeSums(*sums))
