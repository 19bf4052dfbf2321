"""Bounds of mechanisms: random free bodies, joints, springs and dampers, assembled and solved exactly.

    M e'' + D e' + K e + G^T dl = -R ,   G e = 0 ,   R_b of every body balanced: no rigid motion feels it

Each body is reduced by Craig-Bampton modes or by fewer, in its own frame; loads are linear between samples, and so is
R for the truth of the theorem ("sampled"). Nothing here but the modes' space is taken from exudyn_romerr.
"""

from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg as la
import tolerances as tol

from exudyn_romerr import Basis, ElasticBody, Output
from exudyn_romerr import mechanism as shared
from exudyn_romerr.enrichment import Enrichment
from exudyn_romerr.estimators.base import Added
from exudyn_romerr.mechanism import join_extensions, joined_openings
from exudyn_romerr.offline import prepare
from exudyn_romerr.online import Run
from exudyn_romerr.scope import COUPLED, Scene
from exudyn_romerr.space import mass_orthogonal, mean_motion, rigid_modes

NODES, STEPS, LEFT, RIGHT = 8, 200, np.arange(3), np.arange(3, 6)
N = 3 * NODES
SEEDS = range(40)
SHAPES = ("alone", "tree", "loop", "weld", "springs", "floating")
ENERGY, CORRECTED = Scene(scope=COUPLED), Scene(scope=COUPLED, feedback=True, corrected=True)


@dataclass(frozen=True)
class Part:
    """A body with modes V (N, n), damping D (N, N), loads B (N, 2), C_0 (6, N) and its full motions X (N, 6 + free)."""

    body: ElasticBody
    V: np.ndarray
    D: np.ndarray
    B: np.ndarray
    held: np.ndarray
    C: np.ndarray

    @cached_property
    def Rg(self):
        return rigid_modes(self.body.positions)

    @cached_property
    def matrices(self):
        return self.body.mass.toarray(), self.D, self.body.stiffness.toarray()

    @cached_property
    def faces(self):
        """Mean motion of both interfaces (12, N)."""
        return np.vstack([mean_motion(face).motion_rows(self.body.positions) for face in (LEFT, RIGHT)])

    @cached_property
    def X(self):
        return np.hstack([self.Rg, self.body.space.Z.toarray()])

    def seen(self, e):
        """e (T, N) as seen from the body's frame."""
        return e - e @ self.held.T @ la.inv(self.held @ self.Rg).T @ self.Rg.T

    @cached_property
    def columns(self):
        """What a'', a', loads and wrenches of both interfaces multiply, a the motion of the frame: (N, 26)."""
        return np.hstack([-self.matrices[0] @ self.Rg, -self.D @ self.Rg, self.B, self.faces.T])

    def offline(self, V, scene, **options):
        outputs = Output("y", self.C), Output("v", self.C, of="velocity")
        name = "auxiliary" if scene.corrected else "energy"
        common = {"inputs": self.columns, "outputs": outputs, "sampled_inputs": True, "estimators": name}
        return prepare(self.body, Basis(V), scene=scene, **common, **options)


def lattice(rng, kind, damping):
    """A Part with NODES nodes, every two of them joined by a spring, so that only rigid motion is free; no modes yet."""
    x = rng.uniform(-1, 1, (NODES, 3))
    K, M = np.zeros((N, N)), np.kron(np.diag(rng.uniform(0.5, 2, NODES)), np.eye(3))
    for i in range(NODES):
        for j in range(i):
            along = np.zeros((NODES, 3))
            along[i], along[j] = x[i] - x[j], x[j] - x[i]
            K += 10 ** rng.uniform(1, 2.5) * np.outer(along, along)
    held = {"RBE2": {"fixed": range(9), "rigid": [RIGHT]}, "RBE3": {"reference": mean_motion(LEFT)}}
    held = held.get(kind, {"reference": mass_orthogonal()})
    Rg = rigid_modes(x)
    conditions = Rg.T @ M if kind == "free" else mean_motion(LEFT).motion_rows(x)
    elastic = np.eye(N) - Rg @ la.solve(conditions @ Rg, conditions)
    D, given = {
        "none": (0 * K, {}),
        "exudyn": (elastic.T @ (0.5 * M) @ elastic + 2e-3 * K, {"rayleigh": (0.5, 2e-3)}),
        "air": (0.5 * M + 2e-3 * K, {"rayleigh": (0.5, 2e-3)}),
        "matrix": (1.0 * M[:, ::4] @ M[::4], {"damping": 1.0 * M[:, ::4] @ M[::4]}),
    }[damping]
    body = ElasticBody(M, K, positions=x, **held, **given)
    return Part(body, np.zeros((N, 0)), D, rng.standard_normal((N, 2)), conditions, rng.standard_normal((2, N)))


def with_modes(part, rng, static, n):
    """The part with static modes of its interfaces, or without, and n eigenmodes or random columns."""
    space, body = part.body.space, part.body
    columns = [body.modes(n).shapes if rng.random() < 0.7 else rng.standard_normal((body.free.size, n))] if n else []
    if static:
        wrenches = space.loads(part.faces.T)
        columns.append(body.stiffness_factor.solve(la.orth(wrenches, 1e-10)))
    return replace(part, V=space.expand(np.hstack(columns)))


@dataclass(frozen=True)
class Link:
    """rows (6, all N) of the relative motion of two interfaces; locked (6,), spring and damper (6, 6)."""

    rows: np.ndarray
    locked: np.ndarray
    spring: np.ndarray
    damper: np.ndarray


def link(parts, rng, ends, locked):
    """Join interfaces (body, side) of ends; a single end is joined to the ground; what is not locked has a spring."""
    rows = np.zeros((6, N * len(parts)))
    for sign, (b, side) in zip((1, -1), ends, strict=False):
        rows[:, N * b : N * (b + 1)] += sign * parts[b].faces[6 * side : 6 * side + 6]
    springs = (size * A @ A.T for size, A in zip((30.0, 3.0), rng.standard_normal((2, 6, 2)), strict=True))
    return Link(rows, rng.permutation(6) < locked, *springs)


class System:
    """The mechanism on motions T (all N, k) of its bodies, constraints eliminated."""

    def __init__(self, parts, links, T):
        self.M, self.D, self.K = (la.block_diag(*(part.matrices[i] for part in parts)) for i in range(3))
        for each in links:
            self.K = self.K + each.rows.T @ each.spring @ each.rows
            self.D = self.D + each.rows.T @ each.damper @ each.rows
        self.G = np.vstack([np.zeros((0, len(T))), *(each.rows[each.locked] for each in links)])
        moved = la.orth(T)
        free = moved @ la.null_space(self.G @ moved) if len(self.G) else moved
        self.X = free @ la.inv(la.cholesky(free.T @ self.M @ free))

    def motion(self, h, forces):
        """Return u, u', u'' (T, all N) from rest under forces (T, all N), linear between samples."""
        f, n = forces @ self.X, self.X.shape[1]
        D, K = (self.X.T @ A @ self.X for A in (self.D, self.K))
        chain = la.block_diag(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -D]]), np.zeros((2 * n, 2 * n)))
        chain[n : 3 * n, 2 * n :] = np.eye(2 * n)
        whole = la.expm(h * chain)[: 2 * n]
        move, first, both = whole[:, : 2 * n], whole[:, 2 * n : 3 * n], whole[:, 3 * n :] / h
        added = f[:-1] @ (first - both).T + f[1:] @ both.T
        states = [np.zeros(2 * n)]
        for change in added:
            states.append(move @ states[-1] + change)
        x, v = np.split(np.array(states), 2, axis=1)
        return tuple(part @ self.X.T for part in (x, v, f - v @ D.T - x @ K.T))


@dataclass(frozen=True)
class Scenario:
    """A mechanism under loads u (T, 2 per body) at times with steps h; modes: static ones or not."""

    parts: list[Part]
    links: list[Link]
    loads: np.ndarray
    h: float

    def system(self, spaces):
        return System(self.parts, self.links, la.block_diag(*spaces))

    @cached_property
    def full(self):
        return self.system([part.X for part in self.parts])

    @cached_property
    def forces(self):
        return self.loads @ la.block_diag(*(part.B for part in self.parts)).T

    def spaces(self, modes):
        return [np.hstack([part.Rg, V]) for part, V in zip(self.parts, modes, strict=True)]

    def reduced(self, modes):
        return Reduced(self, self.spaces(modes), modes)

    @cached_property
    def run(self):
        return self.reduced([part.V for part in self.parts])


class Reduced:
    """The mechanism with its bodies on some modes: u, u', u'', R of all bodies, and what runs are fed with."""

    def __init__(self, case, spaces, modes):
        self.case, self.modes = case, modes
        system = case.system(spaces)
        self.u = system.motion(case.h, case.forces)
        left = sum(x @ A.T for x, A in zip(self.u[::-1], (system.M, system.D, system.K), strict=True)) - case.forces
        T = la.block_diag(*spaces)
        multipliers = -left @ T @ la.pinv(T.T @ system.G.T).T
        self.R, self.wrenches = left + multipliers @ system.G, self._wrenches(multipliers)

    def _wrenches(self, multipliers):
        """Of links on the interfaces of all bodies, (T, bodies, 12)."""
        case = self.case
        forces = -multipliers @ system_rows(case)
        return forces
