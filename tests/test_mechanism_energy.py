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
    """into (6, all faces): relative motion of two interfaces; locked (6,), spring and damper (6, 6)."""

    into: np.ndarray
    locked: np.ndarray
    spring: np.ndarray
    damper: np.ndarray


def link(count, rng, locked, *ends):
    """Join interfaces (body, side) among `count` bodies, or one to the ground; not all axes locked: with springs."""
    into = np.zeros((6, 12 * count))
    for sign, (b, side) in zip((1, -1), ends, strict=False):
        into[:, 12 * b + 6 * side :][:, :6] = sign * np.eye(6)
    springs = (size * A @ A.T for size, A in zip((30.0, 3.0), rng.standard_normal((2, 6, 2)), strict=True))
    return Link(into, rng.permutation(6) < locked, *springs)


class System:
    """The mechanism on motions T (all N, k) of its bodies, constraints eliminated."""

    def __init__(self, parts, links, T):
        self.of_bodies = [la.block_diag(*(part.matrices[i] for part in parts)) for i in range(3)]
        M, D, K = self.of_bodies
        self.T, self.links, self.faces = T, links, la.block_diag(*(part.faces for part in parts))
        for each in links:
            rows = each.into @ self.faces
            K, D = K + rows.T @ each.spring @ rows, D + rows.T @ each.damper @ rows
        self.locked = np.vstack([np.zeros((0, len(self.faces))), *(each.into[each.locked] for each in links)])
        moved = la.orth(T)
        free = moved @ la.null_space(self.locked @ self.faces @ moved) if len(self.locked) else moved
        self.M, self.D, self.K = M, D, K
        self.X = free @ la.inv(la.cholesky(free.T @ M @ free))

    def motion(self, h, forces):
        """u, u', u'' (T, all N) from rest under forces (T, all N), linear between samples."""
        f, n = forces @ self.X, self.X.shape[1]
        D, K = (self.X.T @ A @ self.X for A in (self.D, self.K))
        chain = la.block_diag(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -D]]), np.zeros((2 * n, 2 * n)))
        chain[n : 3 * n, 2 * n :] = np.eye(2 * n)
        whole = la.expm(h * chain)[: 2 * n]
        move, first, both = whole[:, : 2 * n], whole[:, 2 * n : 3 * n], whole[:, 3 * n :] / h
        states = [np.zeros(2 * n)]
        for change in f[:-1] @ (first - both).T + f[1:] @ both.T:
            states.append(move @ states[-1] + change)
        x, v = np.split(np.array(states), 2, axis=1)
        return tuple(part @ self.X.T for part in (x, v, f - v @ D.T - x @ K.T))

    def residual(self, u, forces):
        """R (T, all N) of a motion, and the wrenches (T, all faces) of links that hold it in balance on T."""
        M, D, K = self.of_bodies
        wrenches = np.zeros((len(forces), len(self.faces)))
        for each in self.links:
            into = self.faces.T @ each.into.T
            wrenches -= (u[0] @ into @ each.spring + u[1] @ into @ each.damper) @ each.into
        left = u[2] @ M + u[1] @ D.T + u[0] @ K - forces
        wrenches += (left - wrenches @ self.faces) @ self.T @ np.linalg.pinv(self.locked @ self.faces @ self.T, 1e-10) @ self.locked
        return left - wrenches @ self.faces, wrenches


@dataclass(frozen=True)
class Scenario:
    """A mechanism under loads u (T, 2 per body), linear between times with steps h."""

    parts: list[Part]
    links: list[Link]
    loads: np.ndarray
    h: float

    @cached_property
    def forces(self):
        return self.loads @ la.block_diag(*(part.B for part in self.parts)).T

    @cached_property
    def full(self):
        return System(self.parts, self.links, la.block_diag(*(part.X for part in self.parts)))

    @cached_property
    def truth(self):
        """u, u', u'' of the full mechanism."""
        return self.full.motion(self.h, self.forces)

    @cached_property
    def reduced(self):
        return Reduced(self, [part.V for part in self.parts])


class Reduced:
    """The mechanism with its bodies on modes V: u, u', u'', R, and rows of all bodies' runs."""

    def __init__(self, case, modes):
        self.case, self.modes = case, modes
        spaces = [np.hstack([part.Rg, V]) for part, V in zip(case.parts, modes, strict=True)]
        system = System(case.parts, case.links, la.block_diag(*spaces))
        self.u = system.motion(case.h, case.forces)
        self.R, wrenches = system.residual(self.u, case.forces)
        self.rows = []
        for b, space in enumerate(spaces):
            x, x_t, x_tt = (u[:, N * b : N * (b + 1)] @ la.pinv(space).T for u in self.u)
            inputs = x_tt[:, :6], x_t[:, :6], case.loads[:, 2 * b : 2 * b + 2], wrenches[:, 12 * b : 12 * b + 12]
            self.rows.append((x[:, 6:], x_t[:, 6:], x_tt[:, 6:], np.hstack(inputs)))

    @cached_property
    def error(self):
        """e, e', e'' (T, all N) under R, linear between samples."""
        return self.case.full.motion(self.case.h, -self.R)

    def bounds(self, scene=ENERGY, added=None, blocks=(1, 40, 41), **options):
        """Bounds of every body, samples given in several parts."""
        t = self.case.h * np.arange(len(self.R))
        pairs = list(zip(self.case.parts, self.modes, strict=True))
        runs = [Run(part.offline(V, scene, **options)) for part, V in pairs]
        openings = [run.opening(t[0], *(x[0] for x in rows)) for run, rows in zip(runs, self.rows, strict=True)]
        for run, opening in zip(runs, joined_openings(runs, openings), strict=True):
            run.open(opening)
        for a, b in pairwise((*blocks, len(t))):
            extensions = [run.extension(t[a:b], *(x[a:b] for x in rows)) for run, rows in zip(runs, self.rows, strict=True)]
            for i, extension in enumerate(extensions if added else ()):
                extension.segments["reduction"][0].added = Added(*(x[a:b] for x in added[i]))
            join_extensions(runs, extensions)
            for run, extension in zip(runs, extensions, strict=True):
                run.advance(extension)
        return [next(iter(run.streams()["total"].values())) for run in runs]

    def compared(self, bounds, e=None):
        """(name, error, bound, size) of all that is bounded; e: e, e', by default that of the theorem."""
        e, e_t = self.error[:2] if e is None else e
        u, u_t = self.case.truth[:2]
        speed, largest = (np.sqrt(np.einsum("ti,ij,tj->t", x, self.case.full.M, x)) for x in (e_t, u_t))
        for b, (part, bound) in enumerate(zip(self.case.parts, bounds, strict=True)):
            own = slice(N * b, N * (b + 1))
            M, y, size = part.matrices[0], part.seen(e[:, own]), part.seen(u[:, own])
            C, v, size_t = part.C.T, part.seen(e_t[:, own]), part.seen(u_t[:, own])
            yield "position", norms(M, y), bound.position, norms(M, size)
            yield "velocity", speed, bound.velocity, largest
            for i, known in enumerate((y @ C, v @ C)):
                rows, of = slice(2 * i, 2 * i + 2), (size, size_t)[i] @ C
                yield "yv"[i], np.abs(known), bound.outputs[:, rows], of
                yield f"corrected {'yv'[i]}", np.abs(known - bound.correction[:, rows]), bound.correction_bound[:, rows], of


def norms(A, x):
    return np.sqrt(np.einsum("ti,ij,tj->t", x, A, x))


def assert_covered(rows):
    for name, error, bound, size in rows:
        assert np.isfinite(bound).all()
        excess = error - bound - tol.COUPLED * np.max(np.abs(size))
        assert np.all(excess <= 0), f"{name}: {np.max(error)} exceeds its bound by {np.max(excess)}"


def shape_of(name, rng, count):
    """Links of a topology: hinges of 3 to 5 locked axes and springs along the others."""

    def hinge():
        return int(rng.integers(3, 6))

    chain = [link(count, rng, hinge(), (b - 1, 1), (b, 0)) for b in range(1, count)]
    ground = link(count, rng, hinge(), (0, 0))
    return {
        "alone": [],
        "tree": [ground, *chain],
        "loop": [ground, *chain, link(count, rng, 3, (count - 1, 1))],
        "weld": [link(count, rng, 6, (0, 0)), *(replace(each, locked=np.full(6, True)) for each in chain)],
        "springs": [replace(each, locked=np.full(6, False)) for each in (ground, *chain)],
        "floating": chain,
    }[name]


@cache
def scenario(seed, static=None, shape=None):
    rng = np.random.default_rng([seed, 23])
    shape = shape or SHAPES[seed % len(SHAPES)]
    count = 1 if shape == "alone" else int(rng.integers(2, 4))
    parts = []
    for _ in range(count):
        part = lattice(rng, rng.choice(["RBE2", "RBE3", "free"]), rng.choice(["none", "exudyn", "air", "matrix"]))
        has_static = rng.random() < 0.6 if static is None else static
        parts.append(with_modes(part, rng, has_static, int(rng.integers(0 if has_static else 1, 5))))
    omega = parts[0].body.modes(1).omega[0]
    h = 0.08 / omega
    t = h * np.arange(STEPS + 1)
    rates, phases = rng.uniform(0.1, 1.5, 2 * count) * omega, rng.uniform(0, 3, 2 * count) * rng.integers(0, 2)
    loads = np.sin(np.outer(t, rates) + phases) * rng.standard_normal(2 * count)
    return Scenario(parts, shape_of(shape, rng, count), loads, h)


@cache
def bounds(seed):
    return scenario(seed).reduced.bounds()


@pytest.mark.parametrize("seed", SEEDS)
def test_coupled_errors_stay_below_their_bounds(seed):
    """Positions and outputs as seen from the frames, velocities of all bodies together, corrected outputs."""
    assert_covered(scenario(seed).reduced.compared(bounds(seed)))


@pytest.mark.parametrize("seed", SEEDS)
def test_full_less_reduced_mechanism_stays_below_the_bounds(seed):
    """The difference of two exact motions: that R is no straight line between samples is less than the bounds' slack."""
    case = scenario(seed)
    e = [full - reduced for full, reduced in zip(case.truth, case.reduced.u, strict=True)][:2]
    off = norms(case.full.M, e[1] - case.reduced.error[1])
    assert np.max(off) < tol.BETWEEN_SAMPLES * np.max(norms(case.full.M, e[1]))
    assert_covered(case.reduced.compared(bounds(seed), e))


@pytest.mark.parametrize("seed", SEEDS)
def test_joint_energy_lies_between_the_largest_and_the_sum_of_single_ones(seed):
    case = scenario(seed)
    single = [Single(case.reduced, b).bounds() for b in range(len(case.parts))]
