"""Bounds of mechanisms: random free bodies, joints, springs and dampers, assembled and solved exactly.

    M e'' + D e' + K e + G^T dl = -R ,   G e = 0 ,   R_b of every body balanced: no rigid motion feels it

Bodies are reduced in their frames. Loads are linear between samples, and so is R in the theorem ("sampled").
"""

from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg as la

from exudyn_romerr import ElasticBody
from exudyn_romerr.estimators import coupled_energy
from exudyn_romerr.estimators.coupled_energy import MechanismEnergy
from exudyn_romerr.model.admissible_space import mass_orthogonal
from exudyn_romerr.online import coupled_runs as mechanism
from exudyn_romerr.online.coupled_runs import FirstSteps, join_extensions, joined_openings
from exudyn_romerr.trajectory.segments import Added
from tests.basis.test_enrichment import DAMPINGS, KINDS, N, Part, lattice
from tests.helpers import tolerances as tol

STEPS, SEEDS = 200, range(42)
SHAPES = ("alone", "tree", "loop", "weld", "springs", "floating")


def links_of(shape, rng, parts):
    """Links of one of SHAPES: rows (6, all N) of relative motion, locked axes (6,), spring and damper (6, 6)."""
    count, locked = len(parts), {"weld": (6, 7), "springs": (0, 1)}.get(shape, (3, 6))
    ends = [((b - 1, 1), (b, 0)) for b in range(1, count)]
    ends += [((0, 0),)] * (shape not in ("alone", "floating")) + [((count - 1, 1),)] * (shape == "loop")
    for pair in ends:
        rows = np.zeros((6, N * count))
        for sign, (b, side) in zip((1, -1), pair, strict=False):
            rows[:, N * b : N * (b + 1)] = sign * parts[b].faces[6 * side : 6 * side + 6]
        springs = (size * A @ A.T for size, A in zip((30.0, 3.0), rng.standard_normal((2, 6, 2)), strict=True))
        yield rows, rng.permutation(6) < rng.integers(*locked), *springs


def admissible(part):
    """All motions of a body (N, N): rigid ones, then those that its reference conditions admit."""
    return np.hstack([part.Rg, part.body.expand(np.eye(part.body.free.size))])


@dataclass(frozen=True)
class Scenario:
    """A mechanism under loads (T, 2 per body), linear between times with steps h."""

    parts: list[Part]
    links: list[tuple]
    loads: np.ndarray
    h: float

    @cached_property
    def matrices(self):
        """M, D, K of all bodies, and what links add to D and K."""
        of_bodies = [la.block_diag(*found) for found in zip(*(part.matrices for part in self.parts), strict=True)]
        added = np.zeros((3, len(of_bodies[0]), len(of_bodies[0])))
        for rows, _, spring, damper in self.links:
            added[1:] += rows.T @ damper @ rows, rows.T @ spring @ rows
        return of_bodies, added

    @cached_property
    def locked(self):
        return np.vstack([np.zeros((0, len(self.forces[0]))), *(rows[locked] for rows, locked, _, _ in self.links)])

    @cached_property
    def forces(self):
        return self.loads @ la.block_diag(*(part.B for part in self.parts)).T

    def motion(self, spaces, forces):
        """U, u', u'' (3, T, all N) on spaces of the bodies, from rest under forces linear between samples."""
        M, D, K = map(np.add, *self.matrices)
        X = la.orth(la.block_diag(*spaces))
        X = X @ la.null_space(self.locked @ X) if len(self.locked) else X
        X = X @ la.inv(la.cholesky(X.T @ M @ X))
        f, n, A, B = forces @ X, X.shape[1], X.T @ D @ X, X.T @ K @ X
        chain = la.block_diag(np.block([[np.zeros((n, n)), np.eye(n)], [-B, -A]]), np.zeros((2 * n, 2 * n)))
        chain[n : 3 * n, 2 * n :] = np.eye(2 * n)
        move, first, both = np.split(la.expm(self.h * chain)[: 2 * n], [2 * n, 3 * n], axis=1)
        states = [np.zeros(2 * n)]
        for change in f[:-1] @ (first - both / self.h).T + f[1:] @ both.T / self.h:
            states.append(move @ states[-1] + change)
        x, v = np.split(np.array(states), 2, axis=1)
        return np.array([x, v, f - v @ A.T - x @ B.T]) @ X.T

    def error(self, R):
        return self.motion([admissible(part) for part in self.parts], -R)

    @cached_property
    def truth(self):
        return self.error(-self.forces)

    @cached_property
    def reduced(self):
        return Reduced(self, [part.V for part in self.parts])

    @cached_property
    def e(self):
        return self.error(self.reduced.R)

    def compared(self, e, bounds):
        """(name, true error, bound, size of the motion) of everything that is bounded; e: errors e, e' (T, all N)."""
        speed, largest = (norms(self.matrices[0][0], x[1]) for x in (e, self.truth))
        for b, (part, bound) in enumerate(zip(self.parts, bounds, strict=True)):
            known, size = (x[:2, :, N * b : N * (b + 1)] @ part.seen.T for x in (e, self.truth))
            yield "position", norms(part.matrices[0], known[0]), bound.position, norms(part.matrices[0], size[0])
            yield "velocity", speed, bound.velocity, largest
            for i, name in enumerate("yv"):
                x, rows = known[i] @ part.C.T, slice(2 * i, 2 * i + 2)
                yield name, np.abs(x), bound.outputs[:, rows], size[i] @ part.C.T
                left = np.abs(x - bound.correction[:, rows])
                yield f"corrected {name}", left, bound.correction_bound[:, rows], size[i] @ part.C.T


class Reduced:
    """The mechanism on modes of its bodies: u, u', u'', R (T, all N) with joints in balance, samples of the runs."""

    def __init__(self, case, modes):
        self.case, self.modes = case, modes
        spaces = [np.hstack([part.Rg, V]) for part, V in zip(case.parts, modes, strict=True)]
        self.u, T = case.motion(spaces, case.forces), la.block_diag(*spaces)
        inner, links = (sum(x @ A.T for x, A in zip(self.u[::-1], of, strict=True)) for of in case.matrices)
        links += (case.forces - inner - links) @ T @ np.linalg.pinv(case.locked @ T, 1e-10) @ case.locked
        self.R = inner + links - case.forces
        self.samples = []
        for b, (part, space) in enumerate(zip(case.parts, spaces, strict=True)):
            own = slice(N * b, N * (b + 1))
            x = self.u[:, :, own] @ la.pinv(space).T
            inputs = x[2, :, :6], x[1, :, :6], case.loads[:, 2 * b : 2 * b + 2], -links[:, own] @ la.pinv(part.faces)
            self.samples.append((case.h * np.arange(len(self.R)), *x[:, :, 6:], np.hstack(inputs)))

    def runs(self, joined=True, added=None, blocks=(0, 40, 41, STEPS)):
        """Run all bodies; samples after the first come in blocks. added: what vectors beside the modes add."""
        runs = [part.run(V, added is not None) for part, V in zip(self.case.parts, self.modes, strict=True)]
        openings = [run.opening(*(x[0] for x in rows)) for run, rows in zip(runs, self.samples, strict=True)]
        for run, opening in zip(runs, joined_openings(runs, openings) if joined else openings, strict=True):
            run.open(opening)
        for a, b in pairwise(blocks):
            new = slice(a + 1, b + 1)
            extensions = [
                run.extension(*(x[new] for x in rows)) for run, rows in zip(runs, self.samples, strict=True)
            ]
            for extension, vectors in zip(extensions, added or (), strict=False):
                extension.segments["reduction"][0].added = Added(*(x[new] for x in vectors))
            if joined:
                join_extensions(runs, extensions, FirstSteps(None), np.zeros(b - a))
            for run, extension in zip(runs, extensions, strict=True):
                run.advance(extension)
        return runs

    def bounds(self, **options):
        return [next(iter(run.streams()["total"].values())) for run in self.runs(**options)]


def norms(A, x):
    return np.sqrt(np.einsum("ti,ij,tj->t", x, A, x))


def violations(rows):
    excess = [(name, np.max(error - bound), np.max(np.abs(size))) for name, error, bound, size in rows]
    return [name for name, more, size in excess if not (np.isfinite(more) and more <= tol.COUPLED * size)]


@cache
def scenario(seed, static=None):
    rng = np.random.default_rng([seed, 23])
    shape = SHAPES[seed % len(SHAPES)]
    parts = []
    for _ in range(1 if shape == "alone" else rng.integers(2, 4)):
        with_static = rng.random() < 0.6 if static is None else static
        part = lattice(rng, rng.choice(KINDS), rng.choice(DAMPINGS))
        parts.append(part.reduced(rng, with_static, rng.integers(not with_static, 5)))
    omega, p = parts[0].body.modes(1).omega[0], 2 * len(parts)
    rates, phases = rng.uniform(0.1, 1.5, p) * omega, rng.uniform(0, 3, p) * rng.integers(0, 2)
    loads = np.sin(np.outer(0.08 * np.arange(STEPS + 1), rates / omega) + phases) * rng.standard_normal(p)
    return Scenario(parts, list(links_of(shape, rng, parts)), loads, 0.08 / omega)


@cache
def bounds(seed):
    return scenario(seed).reduced.bounds()


@pytest.mark.parametrize("seed", SEEDS)
def test_coupled_errors_stay_below_their_bounds(seed):
    """R linear between samples; and full less reduced mechanism, where what lies between is less than the slack."""
    case = scenario(seed)
    assert not violations(case.compared(case.e, bounds(seed)))
    assert not violations(case.compared(case.truth - case.reduced.u, bounds(seed)))


def test_both_true_errors_agree():
    pairs = [(case.e[1], (case.truth - case.reduced.u)[1]) for case in map(scenario, SEEDS)]
    assert np.median([np.max(np.abs(x - y)) / np.max(np.abs(x)) for x, y in pairs]) < tol.BETWEEN_SAMPLES


@pytest.mark.parametrize("seed", SEEDS)
def test_joint_energy_lies_between_the_largest_and_the_sum_of_single_ones(seed):
    single = np.array([bound.velocity for bound in scenario(seed).reduced.bounds(joined=False)])
    for bound in bounds(seed):
        assert np.all(bound.velocity >= single.max(axis=0) * (1 - tol.SUMS))
        assert np.all(bound.velocity <= single.sum(axis=0) * (1 + tol.SUMS))


def test_half_of_the_bounds_with_static_modes_are_sharp():
    cases = [scenario(seed, static=True) for seed in SEEDS]
    rows = [row for case in cases for row in case.compared(case.e, case.reduced.bounds())]
    for name, limit in tol.MEDIAN_COUPLED.items():
        assert 1 <= np.median([np.max(bound) / np.max(e) for what, e, bound, _ in rows if what == name]) < limit


@pytest.mark.parametrize(("seed", "factor"), [(1, -3e5), (2, 1e-12), (5, 1e9)])
def test_bounds_are_linear_in_the_load(seed, factor):
    case = scenario(seed)
    for once, scaled in zip(bounds(seed), replace(case, loads=factor * case.loads).reduced.bounds(), strict=True):
        for kind in ("position", "velocity", "outputs"):
            assert getattr(scaled, kind) == pytest.approx(abs(factor) * getattr(once, kind), rel=tol.REPEATED)


def attained(kind, count, first=1.0):
    """Equal bodies, a load on one missed free mode of each, constant or suddenly so: all energy moves, then none."""
    part = lattice(np.random.default_rng(7), kind)
    (M, _, K), X = part.matrices, admissible(part)
    squares, modes = la.eigh(X.T @ K @ X, X.T @ M @ X)
    B, loads = M @ X @ modes[:, 6:8], np.append(first, np.ones(STEPS))[:, None] * ([1.0, 0.0] * count)
    parts = [replace(part, B=B, C=B.T, V=part.body.expand(modes[6:, 8:]))] * count
    return Scenario(parts, [], loads, 0.08 / squares[6] ** 0.5)


@pytest.mark.parametrize("first", [0.0, 1.0])
@pytest.mark.parametrize(("kind", "count"), [*((kind, 2) for kind in KINDS), ("free", 1)])
def test_bounds_are_attained(kind, count, first):
    """Of velocities of two bodies together; of all that a free body's first mode moves."""
    case = attained(kind, count, first)
    for name, error, bound, _ in case.compared(case.e, case.reduced.bounds()):
        if name == "velocity" or (count == 1 and not name.startswith("corrected")):
            assert 1 <= np.max(bound) / np.max(error) < tol.NEARLY_ATTAINED


def test_forgetting_a_body_at_the_start_is_noticed(monkeypatch):
    case, original, shares = attained("RBE3", 2), MechanismEnergy.energies_at, iter([1.0, 0.0])
    monkeypatch.setattr(
        MechanismEnergy, "energies_at", lambda self, start: next(shares) * np.array(original(self, start))
    )
    assert "velocity" in violations(case.compared(case.e, case.reduced.bounds()))


def test_forgetting_a_body_over_time_is_noticed(monkeypatch):
    """All modes of all bodies but the last: the others err, but their own R says nothing of it."""
    case = scenario(SHAPES.index("weld"), static=True)
    complete = [part.body.expand(np.eye(part.body.free.size)) for part in case.parts[:-1]]
    run = Reduced(case, [*complete, case.parts[-1].V])
    assert not violations(case.compared(case.error(run.R), run.bounds()))
    original = mechanism.joint_growth
    monkeypatch.setattr(mechanism, "joint_growth", lambda energies, blocks, *_: original(energies[:-1], blocks[:-1]))
    assert set(violations(case.compared(case.error(run.R), run.bounds()))) >= {"position", "velocity", "y", "v"}


def rough(seed):
    """A mechanism of damped bodies under loads that change their sign at random from sample to sample."""
    case, rng = scenario(seed), np.random.default_rng([seed, 29])
    parts = [lattice(rng, rng.choice(KINDS), "exudyn").reduced(rng, bool(rng.random() < 0.6), 3) for _ in case.parts]
    loads = rng.choice([-1.0, 1.0], case.loads.shape) * rng.standard_normal(case.loads.shape[1])
    return Scenario(parts, list(links_of(SHAPES[seed % len(SHAPES)], rng, parts)), loads, case.h)


@pytest.mark.parametrize("seed", SEEDS[::3])
def test_damping_makes_bounds_of_rough_residuals_smaller(seed, monkeypatch):
    """What R does to bodies with D >= beta K in place of its variation; measured: at most 0.50 times, of 42 seeds."""
    case = rough(seed)
    found = case.reduced.bounds()
    assert not violations(case.compared(case.e, found))
    monkeypatch.setattr(coupled_energy, "stiffness_damping", lambda body: 0.0)
    for bound, varied in zip(found, case.reduced.bounds(), strict=True):
        for kind in ("velocity", "outputs"):
            assert np.all(getattr(bound, kind) <= getattr(varied, kind) * (1 + tol.SUMS))
            assert np.all(getattr(bound, kind)[-1] < 0.6 * getattr(varied, kind)[-1])


def swung_up():
    """A damped free body, whose highest mode is missed, under the load that feeds most energy into it.

    R = -2 beta K e' is where -e'^T R - e'^T D e' is |R|^2/(4 beta): e swings up as if its damping were negative.
    """
    part, beta = lattice(np.random.default_rng(7), "free"), 0.03
    (M, _, K), X = part.matrices, admissible(part)
    squares, modes = la.eigh(X.T @ K @ X, X.T @ M @ X)
    omega, B = squares[-1] ** 0.5, M @ X @ modes[:, [-1, -1]]
    body = ElasticBody(M, K, positions=part.body.positions, reference=mass_orthogonal(), rayleigh=(0.0, beta / omega))
    t, rate = 0.16 / omega * np.arange(4 * STEPS + 1), beta * omega / 2
    swing = np.sqrt(omega**2 - rate**2)
    speed = np.exp(rate * t) * (np.cos(swing * t) + rate / swing * np.sin(swing * t))
    loads = np.column_stack([2 * beta * omega * speed, 0 * t])
    part = replace(part, body=body, matrices=(M, beta / omega * K, K), B=B, C=B.T, V=(X @ modes)[:, 6:-1])
    return Scenario([part], [], loads, t[1])


def test_bounds_of_damped_bodies_are_nearly_attained(monkeypatch):
    """By the load that feeds most energy into a mode, 20 periods; a fifth more damping would be too much."""
    case = swung_up()
    blocks = (0, len(case.loads) - 1)
    for name, error, bound, _ in case.compared(case.e, case.reduced.bounds(blocks=blocks)):
        if name != "position":
            assert 1 <= np.max(bound) / np.max(error) < 1.1, name
    known = coupled_energy.stiffness_damping
    monkeypatch.setattr(coupled_energy, "stiffness_damping", lambda body: 1.2 * known(body))
    assert set(violations(case.compared(case.e, case.reduced.bounds(blocks=blocks)))) >= {"velocity", "y", "v"}
